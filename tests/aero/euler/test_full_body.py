"""The march all round a body: against the half-body march, mirror images, and shapes without an axis."""

from collections.abc import Callable
from dataclasses import dataclass
from math import acos, atan2, cos, pi, radians, sin

import numpy as np
import pytest

from builder.aero.euler.bodies.solver import FullFlowSolution, solve_flow, solve_full_flow
from builder.aero.euler.planes import MarchingGrid
from builder.vehicle.shape.geometry import BodyOfRevolution
from strainfmu.arrays import FloatArray
from strainfmu.errors import FlowReachError, InputError

BodyMaker = Callable[..., BodyOfRevolution]
GRID = MarchingGrid(n_radial=12, n_circumferential=18)


@dataclass(frozen=True, kw_only=True)
class EllipticCone:
    """Cone of 1 m with semi-axes ``y_slope`` x and ``z_slope`` x."""

    y_slope: float
    z_slope: float
    length: float = 1.0
    slope_breaks: tuple[float, ...] = ()

    @property
    def base_area(self) -> float:
        return pi * self.y_slope * self.z_slope

    def radius(self, x: FloatArray, roll_angle: FloatArray) -> FloatArray:
        return x / np.hypot(np.sin(roll_angle) / self.y_slope, np.cos(roll_angle) / self.z_slope)


@dataclass(frozen=True, kw_only=True)
class CamberedCone:
    """Circular sections of radius ``slope`` x about a curved axis z = ``camber`` x^2, 1 m long."""

    slope: float
    camber: float
    length: float = 1.0
    slope_breaks: tuple[float, ...] = ()

    def radius(self, x: FloatArray, roll_angle: FloatArray) -> FloatArray:
        offset = self.camber * x**2
        return offset * np.cos(roll_angle) + np.sqrt((self.slope * x) ** 2 - (offset * np.sin(roll_angle)) ** 2)


@dataclass(frozen=True)
class Revolved:
    """A body of revolution as a surface function."""

    body: BodyOfRevolution

    @property
    def length(self) -> float:
        return self.body.length

    @property
    def slope_breaks(self) -> FloatArray:
        return self.body.slope_breaks

    def radius(self, x: FloatArray, roll_angle: FloatArray) -> FloatArray:
        return self.body.radius(x) * np.ones_like(roll_angle)


def assert_balanced(flow: FullFlowSolution, tolerance: float) -> None:
    """Assert that the force from the walls is that from the momentum within a fraction of its size."""
    size = np.linalg.norm(flow.force_from_momentum)
    np.testing.assert_allclose(flow.force, flow.force_from_momentum, rtol=0.0, atol=tolerance * size)
    assert abs(flow.mass_defect) < 1e-4
    assert flow.n_repairs == 0


def test_full_body_of_revolution_is_two_half_bodies(vehicle_body: BodyOfRevolution) -> None:
    """The same cells without the plane of symmetry, settled to 1e-6: forces to 1e-5, pressures to 1e-4."""
    grid = MarchingGrid(n_radial=12, n_circumferential=18, conical_tolerance=1e-6)
    half = solve_flow(vehicle_body, 6.0, radians(6.0), grid)
    full = solve_full_flow(vehicle_body, 6.0, radians(6.0), 0.0, grid)
    np.testing.assert_allclose(full.force[[0, 2]], half.force, rtol=1e-5)
    assert abs(full.force[1]) < 1e-6 * half.force[1]
    assert full.n_steps == half.n_steps
    for (x, whole), (x_half, one_half) in zip(full.pieces, half.pieces, strict=True):
        np.testing.assert_allclose(x, x_half, rtol=1e-6)
        np.testing.assert_allclose(whole[:, :18], one_half, rtol=1e-4)
        np.testing.assert_allclose(whole[:, :17:-1], one_half, rtol=1e-4)


@pytest.mark.parametrize("attack", [0.0, 4.0])
def test_attack_and_sideslip_roll_the_flow(attack: float, vehicle_body: BodyOfRevolution) -> None:
    """Total incidence 6 deg made of (a, b): forces within 1e-4, the lateral one along the cross-flow."""
    half = solve_flow(vehicle_body, 6.0, radians(6.0), GRID)
    a = radians(attack)
    b = acos(cos(radians(6.0)) / cos(a))
    force = solve_full_flow(vehicle_body, 6.0, a, b, GRID).force
    np.testing.assert_allclose([force[0], np.hypot(*force[1:])], half.force, rtol=1e-4)
    assert atan2(force[1], force[2]) == pytest.approx(atan2(-sin(b), sin(a) * cos(b)), abs=1e-4)


def test_surface_function_of_a_body_of_revolution_is_that_body(make_body: BodyMaker) -> None:
    """Cone, tangent arc and frustum by way of its tables: forces within 1e-3."""
    body = make_body((0.5, 10.0, 10.0), (1.0, 10.0, 0.0), (1.4, 3.0, 3.0))
    as_function = solve_full_flow(Revolved(body), 5.0, radians(3.0), 0.0, GRID)
    as_body = solve_full_flow(body, 5.0, radians(3.0), 0.0, GRID)
    np.testing.assert_allclose(as_function.force, as_body.force, rtol=1e-3, atol=1e-6 * as_body.force[0])
    assert len(as_function.pieces) == len(as_body.pieces) == 2


def test_elliptic_cone_without_incidence_is_symmetric() -> None:
    """Equal pressure in the four quadrants to 1e-6, no lateral force; edges have more pressure than flats."""
    flow = solve_full_flow(EllipticCone(y_slope=0.15, z_slope=0.075), 6.0, 0.0, 0.0, GRID)
    assert_balanced(flow, 1e-3)
    pressure = flow.pieces[-1][1][-1]
    np.testing.assert_allclose(pressure, pressure[::-1], rtol=1e-6)
    np.testing.assert_allclose(pressure[:18], pressure[17::-1], rtol=1e-6)
    assert np.all(np.abs(flow.force[1:]) < 1e-6 * flow.force[0])
    assert pressure[9] > 1.3 * pressure[0]


def test_elliptic_cone_lifts_as_slender_bodies_do_not_quite() -> None:
    """Flow across the wide axis: slender theory has 2 a/b, across the narrow one 2 b/a (Jones, NACA Report 835).

    At M 6 shock layers are thin and each C_Na lies between slender theory and Newton's 2 cos^2: for the ellipse of
    2 to 1, in 4 .. 2 and 1 .. 2 with 2 % on the inner side.
    """
    flat, a = EllipticCone(y_slope=0.15, z_slope=0.075), radians(1.0)
    dynamic = 0.7 * 36.0 * flat.base_area * a
    across_wide = solve_full_flow(flat, 6.0, a, 0.0, GRID)
    across_narrow = solve_full_flow(flat, 6.0, 0.0, a, GRID)
    for flow in (across_wide, across_narrow):
        assert_balanced(flow, 1e-3)
    assert 2.04 < across_wide.force[2] / dynamic < 4.0
    assert 1.0 < -across_narrow.force[1] / dynamic < 1.96


def test_turning_an_elliptic_cone_a_quarter_swaps_the_axes() -> None:
    """Forces to 1e-5: angle of attack on one is sideslip on the other."""
    a = radians(3.0)
    flat = solve_full_flow(EllipticCone(y_slope=0.15, z_slope=0.075), 6.0, a, 0.0, GRID).force
    upright = solve_full_flow(EllipticCone(y_slope=0.075, z_slope=0.15), 6.0, 0.0, a, GRID).force
    np.testing.assert_allclose(upright[[0, 1]], [flat[0], -flat[2]], rtol=1e-5)
    assert abs(upright[2]) < 1e-6 * flat[2]


def test_sideslip_from_the_other_side_mirrors_the_flow() -> None:
    """A cambered cone at (a, b) and (a, -b): C_Y changes sign, all else stays, to 1e-5."""
    body = CamberedCone(slope=0.12, camber=0.03)
    starboard, port = (solve_full_flow(body, 6.0, radians(2.0), radians(b), GRID) for b in (4.0, -4.0))
    np.testing.assert_allclose(port.force, starboard.force * [1.0, -1.0, 1.0], rtol=1e-5)
    np.testing.assert_allclose(port.pieces[0][1][-1], starboard.pieces[0][1][-1][::-1], rtol=1e-5)
    assert starboard.force[1] < 0.0


def test_camber_lifts_without_incidence() -> None:
    """An axis bent up shows its back to the stream: C_N < 0, odd in the camber, momentum within 0.5 %."""
    up, down = (solve_full_flow(CamberedCone(slope=0.12, camber=k), 6.0, 0.0, 0.0, GRID) for k in (0.03, -0.03))
    assert_balanced(up, 5e-3)
    assert up.force[2] < -0.5 * up.force[0]
    np.testing.assert_allclose(down.force[[0, 2]], up.force[[0, 2]] * [1.0, -1.0], rtol=1e-5)


def test_camber_against_incidence() -> None:
    """Newton's angle: the bent axis is inclined by 2 k x, on the area-weighted mean as much as a = 2 k L (2/3).

    A nose-up incidence of 4 k L/3 against the camber leaves less than a quarter of either lift.
    """
    bent = CamberedCone(slope=0.12, camber=0.03)
    level = solve_full_flow(bent, 6.0, 0.0, 0.0, GRID).force[2]
    against = solve_full_flow(bent, 6.0, 4.0 * 0.03 / 3.0, 0.0, GRID).force[2]
    assert abs(against) < 0.25 * abs(level)


def test_surface_without_radius_is_refused() -> None:
    with pytest.raises(InputError, match="radius must be positive and finite"):
        solve_full_flow(CamberedCone(slope=0.12, camber=0.5), 6.0, 0.0, 0.0, GRID)


def test_full_flow_out_of_reach_is_named() -> None:
    cone, grid = EllipticCone(y_slope=0.15, z_slope=0.15), MarchingGrid(n_radial=8, n_circumferential=12)
    with pytest.raises(FlowReachError, match=r"\(tip\) for M 3, angle of attack 50 deg, sideslip 5 deg"):
        solve_full_flow(cone, 3.0, radians(50.0), radians(5.0), grid)
