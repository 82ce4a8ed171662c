"""Section loads and rolling moment against closed forms: a cantilever under a tip force, buoyancy, canted fins."""

import numpy as np
import pytest

from builder.aero.load_groups import (
    forces_and_moments,
    other_load_operator,
    part_below,
    section_operator,
    six_loads,
    whole_surface,
)
from builder.aero.load_operator import load_operator
from builder.aero.surface.mesh import SurfaceMesh, mesh_load_operator, mesh_of_grid
from builder.vehicle.map_options import MapEntry
from builder.vehicle.shape.geometry import SurfaceGrid, chain_segments, surface_grid
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast

STATIONS = (0.45, 0.8, 1.13, 1.5, 1.9)


@pytest.fixture(scope="module")
def grid() -> SurfaceGrid:
    return surface_grid(chain_segments([(1.0, 0.1, 0.1), (2.0, 0.02, 0.02)]), 60, 48)


@pytest.fixture(scope="module")
def mesh(grid: SurfaceGrid) -> SurfaceMesh:
    return mesh_of_grid(grid)


def plate(angle: float, z: float) -> SurfaceMesh:
    """A square plate of 1 m2 at height z, turned round the x axis by ``angle`` from y; its normal is up at 0."""
    corner = np.array([[0.0, -0.5], [1.0, -0.5], [1.0, 0.5], [0.0, 0.5]])
    point = np.column_stack([corner[:, 0], corner[:, 1] * np.cos(angle), z - corner[:, 1] * np.sin(angle)])
    return SurfaceMesh(point, np.array([[0, 1, 2], [0, 2, 3]]))


def test_without_a_cut_five_of_the_six_are_the_loads_of_the_mesh(mesh: SurfaceMesh) -> None:
    found = six_loads(mesh, 0.7)
    np.testing.assert_allclose(found[:5], mesh_load_operator(mesh, 0.7), atol=1e-15)
    np.testing.assert_allclose(six_loads(mesh, 0.7, 5.0), found, atol=0.0)


@pytest.mark.parametrize("as_triangles", [False, True])
def test_cantilever_under_a_tip_force(grid: SurfaceGrid, mesh: SurfaceMesh, as_triangles: bool) -> None:
    """Pressure ahead of 0.4 m alone, resultants F and M about the tip: shear F, bending M + F x_s everywhere."""
    surface = mesh if as_triangles else grid
    x = np.repeat(grid.x, grid.n_roll)
    pressure = np.where(x < 0.35, 1e4, 0.0) * (1.0 + np.tile(np.cos(grid.roll_angle - 2.2), len(grid.x)))
    found = (section_operator(surface, STATIONS) @ pressure).reshape(6, 5).T
    whole = six_loads(mesh, 0.0) if as_triangles else np.vstack([load_operator(grid, 0.0), np.zeros(len(x))])
    axial, normal, side, pitch, yaw, roll = whole @ pressure
    assert min(abs(normal), abs(side)) > 10.0
    at = np.array(STATIONS)
    expected = np.column_stack([np.full((5, 3), (axial, normal, side)), pitch + normal * at, yaw + side * at])
    np.testing.assert_allclose(found[:, :5], expected, rtol=1e-12)
    np.testing.assert_allclose(found[:, 5], roll, atol=1e-12)


def test_sections_cut_triangles_exactly() -> None:
    """Uniform and linear pressure on a plate that the plane x = 0.3 cuts: force and centre of pressure."""
    flat = plate(0.0, 0.0)
    operator = six_loads(flat, 0.3, 0.3)
    uniform, linear = operator @ np.full(4, 5.0), operator @ flat.point[:, 0]
    assert uniform[1] == pytest.approx(-5.0 * 0.3, rel=1e-14)
    assert uniform[3] == pytest.approx(-5.0 * 0.3 * 0.15, rel=1e-13)
    assert linear[1] == pytest.approx(-(0.3**2) / 2.0, rel=1e-13)
    assert linear[3] == pytest.approx(-(0.3**3) / 6.0, rel=1e-13)
    assert six_loads(flat, 0.0, -0.1) == pytest.approx(0.0)


def test_sections_of_triangles_are_those_of_the_body_of_revolution(grid: SurfaceGrid, mesh: SurfaceMesh) -> None:
    pressure = np.outer(1.0 + grid.x, 1.0 + 0.5 * np.cos(grid.roll_angle - 0.4)).ravel()
    by_grid, by_mesh = (section_operator(one, STATIONS) for one in (grid, mesh))
    chords = 1.4 * (2.0 * np.pi / 48) ** 2 / 6.0
    expected = (by_grid @ pressure).reshape(6, 5)
    np.testing.assert_allclose((by_mesh @ pressure).reshape(6, 5)[:5], expected[:5], rtol=chords)
    np.testing.assert_array_equal(expected[5], 0.0)


def test_rolling_moment_of_plates_off_the_axis() -> None:
    """Pressure from above on a plate to starboard of the axis pushes it down: positive, arm times force."""
    side = plate(0.0, 0.2)
    shifted = SurfaceMesh(side.point + np.array([0.0, 0.9, 0.0]), side.triangle)
    loads = six_loads(shifted, 0.0) @ np.full(4, 3.0)
    assert loads[1] == pytest.approx(-3.0)
    assert loads[5] == pytest.approx(3.0 * 0.9, rel=1e-14)
    # Two plates in one plane through the axis, canted against each other: the forces cancel, the moments add.
    tilt = 0.1
    right, left = plate(tilt, 0.0), plate(-tilt, 0.0)
    moments = []
    for one, y in ((right, 1.0), (left, -1.0)):
        moved = SurfaceMesh(one.point + np.array([0.0, y, 0.0]), one.triangle)
        moments.append((six_loads(moved, 0.0) @ np.full(4, 3.0 * y))[5])
    np.testing.assert_allclose(moments, 3.0 * np.cos(tilt), rtol=1e-13)


def test_body_of_revolution_without_sections_has_no_other_loads(grid: SurfaceGrid, mesh: SurfaceMesh) -> None:
    assert other_load_operator(grid, MapEntry(), 0.7).shape == (0, grid.n_nodes)
    assert other_load_operator(grid, MapEntry(section_stations_m=STATIONS), 0.7).shape == (31, grid.n_nodes)
    assert other_load_operator(mesh, MapEntry(), 0.7).shape == (1, mesh.n_nodes)


@pytest.mark.parametrize("station", [-0.1, 0.0, 2.1])
def test_station_off_the_body_is_refused(grid: SurfaceGrid, station: float) -> None:
    with pytest.raises(InputError, match=r"map.section_stations_m: expected 0 to 2 m, got"):
        section_operator(grid, (station,))


def test_a_part_of_a_part_is_cut_exactly() -> None:
    """Pressure linear over a plate, of the strip 0.2 < x < 0.7 with y < 0.1: force and moments by integration."""
    flat = plate(0.0, 0.0)
    pieces = part_below(whole_surface(flat), flat.point[:, 0], 0.7)
    pieces = part_below(pieces, -flat.point[:, 0], -0.2)
    pieces = part_below(pieces, flat.point[:, 1], 0.1)
    operator = forces_and_moments(flat, pieces, np.array([0.2, 0.0, 0.0]))
    force_and_moment = (1.0 + 2.0 * flat.point[:, 0]) @ operator
    force = -0.6 * (0.5 + (0.7**2 - 0.2**2))
    about_y = 0.6 * (0.5**2 / 2.0 * 1.4 + 2.0 * 0.5**3 / 3.0)
    about_x = (force / 0.6) * (0.1**2 - 0.5**2) / 2.0
    np.testing.assert_allclose(force_and_moment, [0.0, 0.0, force, about_x, about_y, 0.0], rtol=1e-13, atol=1e-16)
