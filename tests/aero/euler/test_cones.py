"""Cones: the exact conical flows that a space-marching solver must reproduce."""

from collections.abc import Callable
from math import cos, pi, radians, sin, tan

import numpy as np
import pytest
from cone_theory import GAMMA, taylor_maccoll_pressure, taylor_maccoll_surface
from scipy.interpolate import CubicSpline
from sweeps import sweep

from builder.aero.euler.bodies.solver import FlowSolution, solve_flow
from builder.aero.euler.planes import GRID_LEVELS
from builder.vehicle.shape.geometry import chain_segments
from strainfmu.errors import FlowReachError

ConeFlow = Callable[[float, float, float], FlowSolution]

# Half-angle [deg], M, p/p_inf on the cone: Taylor-Maccoll, checked against Sims, NASA SP-3004 (1964).
TAYLOR_MACCOLL = [
    (5.0, 5.0, 1.403371),
    (5.0, 6.0, 1.544972),
    (5.0, 7.0, 1.706137),
    (10.0, 5.0, 2.308307),
    (10.0, 5.5, 2.548777),
    (10.0, 6.0, 2.810147),
    (10.0, 6.5, 3.092585),
    (10.0, 7.0, 3.396236),
    (15.0, 5.0, 3.699124),
    (15.0, 7.0, 6.070971),
]

# Half-angle [deg], M, C_N per rad on the base area at a = 0: checked against Sims, NASA SP-3007 (1964).
NORMAL_FORCE_SLOPE = [
    (5.0, 5.0, 1.87165),
    (5.0, 6.0, 1.87422),
    (5.0, 7.0, 1.88090),
    (10.0, 5.0, 1.85751),
    (10.0, 6.0, 1.87528),
    (10.0, 7.0, 1.89034),
    (15.0, 5.0, 1.81818),
    (15.0, 7.0, 1.84802),
]

# M, a [deg], p/p_inf at 0, 30 .. 180 deg from leeward, C_N, C_A of the 10 deg cone: conical Euler solution on
# the unit sphere, 120 x 72 and 160 x 96 cells.
FINITE_INCIDENCE = [
    (5.0, 1.0, (2.117, 2.140, 2.207, 2.304, 2.407, 2.487, 2.516), 0.0324, 0.0749),
    (5.0, 4.0, (1.649, 1.701, 1.890, 2.248, 2.705, 3.097, 3.256), 0.1307, 0.0771),
    (7.0, 4.0, (2.097, 2.207, 2.596, 3.307, 4.204, 4.979, 5.305), 0.1321, 0.0728),
]


def surface_pressure(flow: FlowSolution) -> np.ndarray:
    """(n_phi,) p/p_inf at the end of the first piece."""
    return flow.pieces[0][1][-1]


def coefficients(flow: FlowSolution, base_area: float) -> np.ndarray:
    """C_A, C_N on the base area."""
    return flow.force / (0.5 * GAMMA * flow.mach_number**2 * base_area)


@pytest.mark.parametrize(("half_angle", "mach_number", "expected"), sweep(TAYLOR_MACCOLL, TAYLOR_MACCOLL[::3]))
def test_pressure_of_a_cone_without_incidence(
    half_angle: float, mach_number: float, expected: float, cone_flow: ConeFlow
) -> None:
    """Within 0.3 % of Taylor-Maccoll on every ray, and C_A is the cone's C_p."""
    flow = cone_flow(half_angle, mach_number, 0.0)
    np.testing.assert_allclose(surface_pressure(flow), expected, rtol=3e-3)
    axial, normal = coefficients(flow, pi * tan(radians(half_angle)) ** 2)
    pressure_coefficient = (expected - 1.0) / (0.5 * GAMMA * mach_number**2)
    assert axial == pytest.approx(pressure_coefficient, rel=5e-3)
    assert abs(normal) < 1e-3 * axial


@pytest.mark.parametrize(("level", "largest"), sweep([("coarse", 7e-4), ("medium", 4e-4)], [("coarse", 7e-4)]))
def test_error_of_a_cone_s_pressure_is_as_stated_for_the_grid(level: str, largest: float) -> None:
    """The page of verification states it: 16 x 24 cells, the default of a vehicle file, and 24 x 36; every ray."""
    errors = []
    for half_angle, mach_number, expected in TAYLOR_MACCOLL:
        angle = radians(half_angle)
        flow = solve_flow(chain_segments([(1.0, angle, angle)]), mach_number, 0.0, GRID_LEVELS[level])
        errors.append(np.abs(surface_pressure(flow) / expected - 1.0).max())
    assert 0.7 * largest < max(errors) < largest


@pytest.mark.fast
def test_integration_of_the_cone_flow_gives_the_published_values() -> None:
    for half_angle, mach_number, expected in TAYLOR_MACCOLL:
        assert taylor_maccoll_pressure(radians(half_angle), mach_number) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize(("half_angle", "mach_number"), sweep([(7.5, 5.8), (12.0, 6.3)], [(7.5, 5.8)]))
def test_pressure_of_a_cone_between_the_tables(half_angle: float, mach_number: float, cone_flow: ConeFlow) -> None:
    """Within 0.3 % of the Taylor-Maccoll equation integrated here."""
    expected = taylor_maccoll_pressure(radians(half_angle), mach_number)
    np.testing.assert_allclose(surface_pressure(cone_flow(half_angle, mach_number, 0.0)), expected, rtol=3e-3)


# Half-angle [deg], M from which the flow on the cone is supersonic along the axis: Taylor-Maccoll.
AXIALLY_SUPERSONIC = [(5.0, 1.042), (10.0, 1.130), (15.0, 1.252), (20.0, 1.407), (25.0, 1.603)]


@pytest.mark.parametrize(("half_angle", "limit"), sweep(AXIALLY_SUPERSONIC, AXIALLY_SUPERSONIC[1:2]))
def test_cone_is_solved_where_its_flow_is_axially_supersonic(half_angle: float, limit: float) -> None:
    """From 0.05 above the limit in Mach number, pressure within 0.7 %, and 0.4 % from 0.1 above; not below it."""
    angle = radians(half_angle)
    axial = [taylor_maccoll_surface(angle, limit + side)[1] * cos(angle) for side in (-1e-3, 1e-3)]
    assert not axial[0] >= 1.0  # NaN where there is no attached shock at all
    assert axial[1] > 1.0
    cone = chain_segments([(1.0, angle, angle)])
    for above, tolerance in ((0.05, 7e-3), (0.1, 4e-3)):
        expected = taylor_maccoll_pressure(angle, limit + above)
        np.testing.assert_allclose(
            surface_pressure(solve_flow(cone, limit + above, 0.0)), expected, rtol=tolerance
        )
    with pytest.raises(FlowReachError, match=r"the axial Mach number falls to 1.* at x = 0 m \(tip\)"):
        solve_flow(cone, limit - 0.01, 0.0)


@pytest.mark.parametrize(("half_angle", "limit", "incidence"), [(10.0, 1.130, 2.0), (20.0, 1.407, 4.0)])
def test_cone_at_low_mach_number_and_incidence(half_angle: float, limit: float, incidence: float) -> None:
    """0.2 above the limit: solved, settled, and the wall carries the momentum."""
    angle = radians(half_angle)
    flow = solve_flow(chain_segments([(1.0, angle, angle)]), limit + 0.2, radians(incidence))
    assert flow.conical_change < 1e-3
    np.testing.assert_allclose(flow.force, flow.force_from_momentum, rtol=2e-3)


@pytest.mark.parametrize(
    ("half_angle", "mach_number", "expected"), sweep(NORMAL_FORCE_SLOPE, NORMAL_FORCE_SLOPE[::3])
)
def test_initial_normal_force_slope(
    half_angle: float, mach_number: float, expected: float, cone_flow: ConeFlow
) -> None:
    """C_N/sin a at a = 0.5 deg within 1 % of the linearised conical flow."""
    normal = coefficients(cone_flow(half_angle, mach_number, 0.5), pi * tan(radians(half_angle)) ** 2)[1]
    assert normal / sin(radians(0.5)) == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize(("mach_number", "incidence", "pressure", "normal", "axial"), FINITE_INCIDENCE)
def test_pressure_of_a_cone_at_incidence(
    mach_number: float,
    incidence: float,
    pressure: tuple[float, ...],
    normal: float,
    axial: float,
    cone_flow: ConeFlow,
) -> None:
    """Every ray within 1 % of the conical Euler solution, forces within 1 %."""
    flow = cone_flow(10.0, mach_number, incidence)
    angle, found = flow.roll_angle, surface_pressure(flow)
    all_round = CubicSpline(
        np.concatenate([-angle[::-1], angle, 2.0 * pi - angle[::-1]]),
        np.concatenate([found[::-1], found, found[::-1]]),
    )
    np.testing.assert_allclose(all_round(np.radians(np.arange(0.0, 181.0, 30.0))), pressure, rtol=0.01)
    np.testing.assert_allclose(coefficients(flow, pi * tan(radians(10.0)) ** 2), [axial, normal], rtol=0.01)


@pytest.mark.fast
def test_conical_start_says_how_settled_it_is(cone_flow: ConeFlow) -> None:
    """The pressure changes by less than the grid's tolerance while x grows by half, and no state was repaired."""
    flow = cone_flow(10.0, 5.0, 4.0)
    assert 0.0 < flow.conical_change < 5e-4
    assert flow.n_repairs == 0
