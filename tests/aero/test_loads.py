"""The load operator against closed forms, and against the nodal forces of the structure."""

from collections.abc import Callable
from math import cos, pi, radians, tan

import numpy as np
import pytest

from builder.aero.load_operator import coefficient_scale, load_operator
from builder.structure.fourier.shell_mesh import shell_mesh
from builder.structure.fourier.strain_operator import pressure_load
from builder.structure.wall import Material, Wall
from builder.vehicle.shape.geometry import BodyOfRevolution, SurfaceGrid, surface_grid
from builder.vehicle.shape.shape_entries import ReferenceQuantities

pytestmark = pytest.mark.fast

BodyMaker = Callable[..., BodyOfRevolution]
MOMENT_STATION = 2.0


@pytest.fixture(scope="module")
def two_cones(make_body: BodyMaker) -> BodyOfRevolution:
    return make_body((1.75, 5.0, 5.0), (3.6, 1.0, 1.0))


@pytest.fixture(scope="module")
def cone_grid(make_body: BodyMaker) -> SurfaceGrid:
    """10 deg cone of 1.5 m."""
    return surface_grid(make_body((1.5, 10.0, 10.0)), 20, 24)


def round_the_body(grid: SurfaceGrid, by_roll: np.ndarray, by_station: np.ndarray | None = None) -> np.ndarray:
    """(n_nodes,) product of a distribution over the stations (1 by default) and over roll angle."""
    return np.outer(np.ones(len(grid.x)) if by_station is None else by_station, by_roll).ravel()


def test_uniform_pressure_pushes_on_the_base_area(two_cones: BodyOfRevolution) -> None:
    """F_x = p pi R^2 exactly, nothing else."""
    grid = surface_grid(two_cones, 40, 24)
    loads = load_operator(grid, MOMENT_STATION) @ np.full(grid.n_nodes, 3e4)
    area = pi * two_cones.base_radius**2
    assert loads[0] == pytest.approx(3e4 * area, rel=1e-13)
    np.testing.assert_allclose(loads[1:], 0.0, atol=1e-12 * loads[0])


def test_pressure_linear_in_x_on_a_cone(cone_grid: SurfaceGrid) -> None:
    """p = c x: F_x = 2 pi c tan^2 L^3/3."""
    loads = load_operator(cone_grid, 1.0) @ round_the_body(cone_grid, np.ones(24), 2e4 * cone_grid.x)
    assert loads[0] == pytest.approx(2.0 * pi * 2e4 * tan(radians(10.0)) ** 2 * 1.5**3 / 3.0, rel=1e-12)


def test_pressure_as_the_cosine_on_a_cone(cone_grid: SurfaceGrid) -> None:
    """p = p1 cos phi: F_z = -p1 pi tan L^2/2; M_P = p1 pi tan (L^3/(3 cos^2) - x0 L^2/2)."""
    p1, length, x0, t = 1e4, 1.5, 0.4, tan(radians(10.0))
    loads = load_operator(cone_grid, x0) @ round_the_body(cone_grid, p1 * np.cos(cone_grid.roll_angle))
    normal = -p1 * pi * t * length**2 / 2.0
    moment = p1 * pi * t * (length**3 / (3.0 * cos(radians(10.0)) ** 2) - x0 * length**2 / 2.0)
    np.testing.assert_allclose(loads, [0.0, normal, 0.0, moment, 0.0], rtol=1e-12, atol=1e-9)
    sideways = load_operator(cone_grid, x0) @ round_the_body(cone_grid, p1 * np.sin(cone_grid.roll_angle))
    np.testing.assert_allclose(sideways, [0.0, 0.0, normal, 0.0, moment], rtol=1e-12, atol=1e-9)


def test_centre_of_pressure_of_a_cone(cone_grid: SurfaceGrid) -> None:
    """Of any conical pressure at (2/3) L / cos^2 from the tip: no moment about that point."""
    station = 2.0 / 3.0 * 1.5 / cos(radians(10.0)) ** 2
    pressure = round_the_body(cone_grid, np.exp(-np.cos(cone_grid.roll_angle - 0.3)))
    loads = load_operator(cone_grid, station) @ pressure
    assert abs(loads[1]) > 0.1
    np.testing.assert_allclose(loads[3:], 0.0, atol=1e-12)


@pytest.mark.parametrize("m", [2, 3, 5])
def test_higher_harmonics_carry_no_load(m: int, cone_grid: SurfaceGrid) -> None:
    for by_roll in (np.cos(m * cone_grid.roll_angle), np.sin(m * cone_grid.roll_angle)):
        loads = load_operator(cone_grid, 1.0) @ round_the_body(cone_grid, by_roll)
        np.testing.assert_allclose(loads, 0.0, atol=1e-14)


@pytest.mark.parametrize(("ahead", "sign"), [(True, 1.0), (False, -1.0)])
def test_signs_of_a_load_from_below_and_from_port(ahead: bool, sign: float, two_cones: BodyOfRevolution) -> None:
    """Pressed from below: up; ahead of the moment point nose-up. Pressed from port: to starboard, nose too."""
    grid = surface_grid(two_cones, 60, 24)
    where = (grid.x < 1.5) if ahead else (grid.x > 2.5)
    operator = load_operator(grid, MOMENT_STATION)
    below = operator @ round_the_body(grid, np.maximum(-np.cos(grid.roll_angle), 0.0), where.astype(float))
    port = operator @ round_the_body(grid, np.maximum(-np.sin(grid.roll_angle), 0.0), where.astype(float))
    assert below[1] > 0.0
    assert sign * below[3] > 0.0
    assert port[2] == pytest.approx(below[1], rel=1e-9)
    assert port[4] == pytest.approx(below[3], rel=1e-9)


def test_loads_are_the_sums_of_the_structures_nodal_forces(two_cones: BodyOfRevolution) -> None:
    """Both integrate the same pressure over the same cones: equal to 1e-10 for every station and load."""
    grid = surface_grid(two_cones, 40, 24)
    mesh = shell_mesh(two_cones, Wall(0.004, 0.10, Material(110e9, 0.31)), 0.05)
    force = pressure_load(mesh, grid.x).toarray().reshape(len(mesh.node), 3, len(grid.x))
    x, r = mesh.node.T
    axial, radial = force[:, 0], force[:, 1]
    arm = pi * (r @ axial - (x - MOMENT_STATION) @ radial)
    expected = [2.0 * pi * axial.sum(axis=0), pi * radial.sum(axis=0), arm]
    operator = load_operator(grid, MOMENT_STATION).reshape(5, len(grid.x), grid.n_roll)
    by_station = [
        operator[0].sum(axis=1),
        operator[1] @ np.cos(grid.roll_angle),
        operator[3] @ np.cos(grid.roll_angle),
    ]
    for found, wanted in zip(by_station, expected, strict=True):
        np.testing.assert_allclose(found, wanted, rtol=0.0, atol=1e-10 * np.abs(wanted).max())


def test_coefficients_are_over_dynamic_pressure_area_and_length() -> None:
    scale = coefficient_scale(1e5, ReferenceQuantities(0.2, 0.5, 2.0))
    np.testing.assert_allclose(scale, [5e-5, 5e-5, 5e-5, 1e-4, 1e-4], rtol=1e-14)
