"""Triangulated surfaces: areas, normals, loads, against closed forms and the spectral load operator."""

from math import pi

import numpy as np
import pytest

from builder.aero.load_operator import load_operator
from builder.aero.surface.mesh import SurfaceMesh, mesh_load_operator, mesh_of_grid
from builder.vehicle.shape.geometry import chain_segments, surface_grid
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast

CORNERS = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])


def tetrahedron() -> SurfaceMesh:
    return SurfaceMesh(CORNERS, FACES)


def test_closed_surface_has_no_net_area_and_its_volume() -> None:
    """Gauss: the vector areas of a closed surface cancel; a third of the flux of x is the volume, here 1/6."""
    mesh = tetrahedron()
    np.testing.assert_allclose(mesh.vector_area.sum(axis=0), 0.0, atol=1e-15)
    centre = mesh.point[mesh.triangle].mean(axis=1)
    assert np.sum(mesh.vector_area * centre) / 3.0 == pytest.approx(1.0 / 6.0, rel=1e-14)
    assert mesh.node_area.sum() == pytest.approx(mesh.area.sum(), rel=1e-14)


def test_buoyancy_of_a_linear_pressure() -> None:
    """p = p_0 + g z pushes a closed body with -g V along z, through its centre of volume: exact by Gauss."""
    mesh = tetrahedron()
    g, x_ref = 3.0, 0.4
    axial, normal, side, pitch, yaw = mesh_load_operator(mesh, x_ref) @ (7.0 + g * mesh.point[:, 2])
    volume, centre_x = 1.0 / 6.0, 0.25
    assert normal == pytest.approx(-g * volume, rel=1e-13)
    np.testing.assert_allclose([axial, side, yaw], 0.0, atol=1e-14)
    # A force F_z at x turns the nose (ahead of x_ref) up by -F_z (x - x_ref).
    assert pitch == pytest.approx(g * volume * (centre_x - x_ref), rel=1e-13)


def test_lateral_linear_pressure_turns_the_nose_sideways() -> None:
    """The same along y: the force -g V at the centre turns the nose to starboard by -F_y (x - x_ref)."""
    mesh = tetrahedron()
    _, _, side, _, yaw = mesh_load_operator(mesh, 0.4) @ (2.0 * mesh.point[:, 1])
    assert side == pytest.approx(-2.0 / 6.0, rel=1e-13)
    assert yaw == pytest.approx(-side * (0.25 - 0.4), rel=1e-13)


@pytest.mark.parametrize("n_roll", [36, 72])
def test_grid_as_triangles_has_the_same_loads(n_roll: int) -> None:
    """Loads of the chords against the spectral operator: their difference is (2 pi/n)^2/6."""
    body = chain_segments([(1.0, 0.1, 0.1), (2.0, 0.02, 0.02)])
    grid = surface_grid(body, 60, n_roll)
    mesh = mesh_of_grid(grid)
    assert mesh.n_nodes == grid.n_nodes
    assert mesh.area.min() > 0.0
    outward = np.sum(mesh.vector_area[:, 1:] * mesh.point[mesh.triangle].mean(axis=1)[:, 1:], axis=1)
    assert outward.min() > 0.0
    pressure = np.outer(1.0 + grid.x, 1.0 + 0.5 * np.cos(grid.roll_angle - 0.4)).ravel()
    expected = load_operator(grid, 0.7) @ pressure
    found = mesh_load_operator(mesh, 0.7) @ pressure
    np.testing.assert_allclose(found, expected, rtol=1.2 * (2.0 * pi / n_roll) ** 2 / 6.0)


def test_node_normals_of_a_cylinder_point_outward() -> None:
    body = chain_segments([(1.0, 0.2, 0.2), (2.0, 0.0, 0.0)])
    grid = surface_grid(body, 40, 48)
    normal = grid.as_map(mesh_of_grid(grid).node_normal.T)
    aft = grid.x > 1.5
    assert aft[-1]
    np.testing.assert_allclose(normal[0, aft], 0.0, atol=1e-12)
    np.testing.assert_allclose(normal[2, aft], np.tile(np.cos(grid.roll_angle), (aft.sum(), 1)), atol=1e-12)


@pytest.mark.parametrize(
    ("point", "triangle", "words"),
    [
        (CORNERS[:, :2], FACES, "must be n x 3"),
        (CORNERS, FACES[:, :2], "at least one triangle of 3 nodes"),
        (CORNERS, FACES[:0], "at least one triangle"),
        (np.where(CORNERS == 1.0, np.nan, CORNERS), FACES, "node 1 has a coordinate that is not finite"),
        (CORNERS, FACES + 1, "names node 4 of 4"),
        (CORNERS, FACES - 1, "names node -1 of 4"),
    ],
)
def test_a_surface_that_is_none_is_refused(point: np.ndarray, triangle: np.ndarray, words: str) -> None:
    with pytest.raises(InputError, match=words):
        SurfaceMesh(point, triangle)
