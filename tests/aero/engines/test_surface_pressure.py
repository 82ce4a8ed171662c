"""From wall pressure to the surface nodes: rotation, mirror symmetry, signs of the conventions."""

from collections.abc import Callable
from math import pi, radians

import numpy as np
import pytest

from builder.aero.engines.euler import EulerEngine, pressure_at_stations, pressure_ratio_on_surface
from builder.aero.euler.bodies.solver import FlowSolution, MarchingGrid
from builder.aero.load_operator import load_operator
from builder.vehicle.shape.geometry import BodyOfRevolution, SurfaceGrid, surface_grid
from strainfmu.flight_condition import FlightCondition

pytestmark = pytest.mark.fast

BodyMaker = Callable[..., BodyOfRevolution]
VehicleFlow = Callable[[float, float], FlowSolution]
COARSE = MarchingGrid(n_radial=12, n_circumferential=16)


@pytest.fixture(scope="module")
def surface(vehicle_body: BodyOfRevolution) -> SurfaceGrid:
    return surface_grid(vehicle_body, 40, 24)


@pytest.fixture(scope="module")
def ratio(vehicle_flow: VehicleFlow, surface: SurfaceGrid) -> tuple[np.ndarray, np.ndarray]:
    """p/p_inf at the stations and its roll angles, M 5, 8.478 deg."""
    flow = vehicle_flow(5.0, 8.478)
    return pressure_at_stations(flow.pieces, surface), flow.roll_angle


def pressure(body: BodyOfRevolution, surface: SurfaceGrid, alpha: float, beta: float) -> np.ndarray:
    """Absolute pressure (n_x, n_roll) [Pa] at M 6, 20 km."""
    condition = FlightCondition(6.0, radians(alpha), radians(beta), 20e3)
    engine = EulerEngine(body, COARSE, surface)
    ratio = engine.pressure_ratio(engine.solve(engine.flow_key(condition)), condition)
    return surface.as_map(condition.ambient_pressure * ratio)


def test_rolling_by_a_quarter_turn_permutes_the_nodes(
    ratio: tuple[np.ndarray, np.ndarray], surface: SurfaceGrid
) -> None:
    reference = surface.as_map(pressure_ratio_on_surface(*ratio, surface, 0.0))
    for quarter in (1, 2, 3, -1):
        rolled = surface.as_map(pressure_ratio_on_surface(*ratio, surface, 0.5 * pi * quarter))
        np.testing.assert_allclose(rolled, np.roll(reference, 6 * quarter, axis=1), rtol=1e-12)


@pytest.mark.parametrize("leeward", [0.0, 0.7, -2.0])
def test_pressure_is_the_mirror_image_about_the_incidence_plane(
    leeward: float, ratio: tuple[np.ndarray, np.ndarray], surface: SurfaceGrid
) -> None:
    """At phi_T + a and phi_T - a: a grid rolled so that its nodes mirror each other about phi_T."""
    port = surface.as_map(pressure_ratio_on_surface(*ratio, surface, leeward))
    starboard = surface.as_map(pressure_ratio_on_surface(*ratio, surface, -leeward))
    np.testing.assert_allclose(port, starboard[:, -np.arange(24) % 24], rtol=1e-12)


def test_interpolation_round_the_body_keeps_smooth_fields(surface: SurfaceGrid) -> None:
    """A constant exactly; 1 + 0.2 cos phi from 36 cells within 1e-4."""
    angle = (np.arange(36) + 0.5) * pi / 36
    ones = np.ones((len(surface.x), 36))
    np.testing.assert_allclose(pressure_ratio_on_surface(ones, angle, surface, 0.4), 1.0, rtol=1e-14)
    found = pressure_ratio_on_surface(ones + 0.2 * np.cos(angle), angle, surface, 0.4)
    expected = 1.0 + 0.2 * np.cos(surface.roll_angle - 0.4)
    np.testing.assert_allclose(surface.as_map(found), np.tile(expected, (len(surface.x), 1)), atol=2e-4)


def test_interpolation_hardly_overshoots(
    ratio: tuple[np.ndarray, np.ndarray], vehicle_body: BodyOfRevolution
) -> None:
    """On 720 roll angles, at the leeward shock too: at most 1 % of the pressure's range round the body."""
    fine = surface_grid(vehicle_body, 40, 720)
    found = fine.as_map(pressure_ratio_on_surface(*ratio, fine, 0.3))
    low, high = ratio[0].min(axis=1), ratio[0].max(axis=1)
    assert np.all(found.max(axis=1) < high + 0.01 * (high - low))
    assert np.all(found.min(axis=1) > low - 0.01 * (high - low))


def test_pressure_jumps_at_the_slope_break(vehicle_flow: VehicleFlow, surface: SurfaceGrid) -> None:
    """The two nodes at 1.75 m hold the last pressure ahead of the corner and the first behind it."""
    flow = vehicle_flow(5.0, 8.478)
    found = pressure_at_stations(flow.pieces, surface)
    before, behind = np.flatnonzero(surface.x == 1.75)
    np.testing.assert_allclose(found[before], flow.pieces[0][1][-1], rtol=1e-12)
    np.testing.assert_allclose(found[behind], flow.pieces[1][1][0], rtol=1e-12)
    assert np.all(found[behind] < 0.75 * found[before])


def test_surface_of_another_body_is_refused(vehicle_flow: VehicleFlow, make_body: BodyMaker) -> None:
    grid = surface_grid(make_body((1.0, 10.0, 10.0)), 20, 24)
    with pytest.raises(ValueError, match="2 smooth pieces solved, surface grid has 1"):
        pressure_at_stations(vehicle_flow(5.0, 8.478).pieces, grid)


@pytest.mark.parametrize(
    ("alpha", "beta", "signs"),
    [(4.0, 0.0, (1, 1, 0)), (-4.0, 0.0, (1, -1, 0)), (0.0, 4.0, (1, 0, -1)), (0.0, -4.0, (1, 0, 1))],
)
def test_forces_point_where_the_wind_goes(
    alpha: float, beta: float, signs: tuple[int, int, int], vehicle_body: BodyOfRevolution, surface: SurfaceGrid
) -> None:
    """a > 0 lifts (C_N > 0), b > 0 is wind from starboard (C_Y < 0); what must vanish is below 1e-10."""
    net = pressure(vehicle_body, surface, alpha, beta).ravel() - 5474.9
    forces = (load_operator(surface, 2.0) @ net)[:3]
    for force, sign in zip(forces, signs, strict=True):
        if sign:
            assert sign * force > 1e-2 * np.linalg.norm(forces)
        else:
            assert abs(force) < 1e-10 * np.linalg.norm(forces)


def test_windward_side_of_attack_and_sideslip(vehicle_body: BodyOfRevolution, surface: SurfaceGrid) -> None:
    """a > 0 raises the pressure below (180 deg), b > 0 on starboard (90 deg)."""
    attack, sideslip = (pressure(vehicle_body, surface, *angles)[10] for angles in ((4.0, 0.0), (0.0, 4.0)))
    assert attack.argmax() == 12
    assert sideslip.argmax() == 6
    np.testing.assert_allclose(np.roll(attack, -6), sideslip, rtol=1e-10)


def test_conditions_of_one_flow_share_its_solution(vehicle_body: BodyOfRevolution, surface: SurfaceGrid) -> None:
    """(a, b) = (4, 0), (0, 4), (-4, 0): one flow, turned by quarters; momentum error below 5 %."""
    engine = EulerEngine(vehicle_body, COARSE, surface)
    conditions = [FlightCondition(6.0, radians(a), radians(b), 20e3) for a, b in ((4, 0), (0, 4), (-4, 0))]
    keys = {engine.flow_key(condition) for condition in conditions}
    assert len(keys) == 1
    flow = engine.solve(keys.pop())
    assert flow.momentum_error < 0.05
    up, right, down = (surface.as_map(engine.pressure_ratio(flow, condition)) for condition in conditions)
    np.testing.assert_allclose(right, np.roll(up, -6, axis=1), rtol=1e-12)
    np.testing.assert_allclose(down, np.roll(up, 12, axis=1), rtol=1e-12)
