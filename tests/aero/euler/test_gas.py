"""Gas relations against closed forms and integrals found by other means."""

from math import asin, atan, cos, degrees, pi, radians, sin, sqrt, tan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq, minimize_scalar

from builder.aero.euler.scheme.bow_shock import shock_slope
from builder.aero.euler.scheme.flux import characteristic_slopes, hll
from builder.aero.euler.scheme.gas import (
    GAMMA,
    MIN_PRESSURE_RATIO,
    axial_velocity,
    compressed_pressure_ratio,
    expanded_pressure_ratio,
    prandtl_meyer_angle,
    primitive,
    total_enthalpy,
    wall_pressure,
)

pytestmark = pytest.mark.fast

MACH_NUMBERS = [1.2, 2.0, 3.0, 5.0, 7.0]


def deflection(mach_number: float, shock: float) -> float:
    """Turn of the flow [rad] by an oblique shock: NACA Report 1135, eq. 138."""
    normal2 = (mach_number * sin(shock)) ** 2
    return atan(2.0 / tan(shock) * (normal2 - 1.0) / (mach_number**2 * (GAMMA + cos(2.0 * shock)) + 2.0))


def largest_deflection(mach_number: float) -> tuple[float, float]:
    """Return the shock angle and the turn at which the shock detaches [rad]."""
    best = minimize_scalar(
        lambda shock: -deflection(mach_number, shock),
        bounds=(asin(1.0 / mach_number), 0.5 * pi),
        method="bounded",
        options={"xatol": 1e-12},
    )
    return best.x, -best.fun


def shock_pressure_ratio(mach_number: float, shock: float) -> float:
    """Static pressure ratio: NACA Report 1135, eq. 128."""
    return (2.0 * GAMMA * (mach_number * sin(shock)) ** 2 - (GAMMA - 1.0)) / (GAMMA + 1.0)


@pytest.mark.parametrize("mach_number", MACH_NUMBERS)
@pytest.mark.parametrize("share", [0.05, 0.4, 0.8, 0.99])
def test_weak_shock_by_root_finding(mach_number: float, share: float) -> None:
    detached_shock, largest = largest_deflection(mach_number)
    turn = share * largest
    shock = brentq(
        lambda angle: deflection(mach_number, angle) - turn, asin(1.0 / mach_number), detached_shock, xtol=1e-14
    )
    found = compressed_pressure_ratio(mach_number, turn)
    assert found == pytest.approx(shock_pressure_ratio(mach_number, shock), rel=1e-8)


@pytest.mark.parametrize("mach_number", MACH_NUMBERS)
def test_shock_detaches_at_the_largest_deflection(mach_number: float) -> None:
    largest = largest_deflection(mach_number)[1]
    assert compressed_pressure_ratio(mach_number, largest * (1.0 - 1e-6)) > 1.0
    assert compressed_pressure_ratio(mach_number, largest * (1.0 + 1e-6)) == -1.0
    assert compressed_pressure_ratio(mach_number, 1.5) == -1.0


@pytest.mark.parametrize(("mach_number", "angle_deg"), [(1.0, 0.0), (2.0, 26.38), (3.0, 49.76), (5.0, 76.92)])
def test_prandtl_meyer_angle_of_the_tables(mach_number: float, angle_deg: float) -> None:
    """NACA Report 1135, table II, to its digits."""
    assert degrees(prandtl_meyer_angle(mach_number)) == pytest.approx(angle_deg, abs=0.005)


@pytest.mark.parametrize("mach_number", MACH_NUMBERS)
def test_prandtl_meyer_angle_by_quadrature(mach_number: float) -> None:
    def integrand(m: float) -> float:
        return sqrt(m * m - 1.0) / (1.0 + 0.5 * (GAMMA - 1.0) * m * m) / m

    expected = quad(integrand, 1.0, mach_number, epsabs=1e-13)[0]
    assert prandtl_meyer_angle(mach_number) == pytest.approx(expected, abs=1e-10)


@pytest.mark.parametrize("mach_number", MACH_NUMBERS)
@pytest.mark.parametrize("turn_deg", [0.1, 4.0, 20.0])
def test_expansion_by_integration(mach_number: float, turn_deg: float) -> None:
    """dp/p = -gamma M^2/sqrt(M^2 - 1) dtheta with dM from the isentropic relations."""

    def along(angle: float, state: np.ndarray) -> list[float]:
        m = state[1]
        root = sqrt(m * m - 1.0)
        return [-GAMMA * m * m / root, m * (1.0 + 0.5 * (GAMMA - 1.0) * m * m) / root]

    path = solve_ivp(along, (0.0, radians(turn_deg)), [0.0, mach_number], rtol=1e-11, atol=1e-13)
    expected = float(np.exp(path.y[0, -1]))
    found = expanded_pressure_ratio(mach_number, radians(turn_deg))
    assert found == pytest.approx(max(expected, MIN_PRESSURE_RATIO), rel=1e-7)


def test_expansion_ends_short_of_vacuum() -> None:
    assert expanded_pressure_ratio(7.0, 1.0) == MIN_PRESSURE_RATIO
    assert expanded_pressure_ratio(7.0, radians(45.0)) == MIN_PRESSURE_RATIO


@pytest.mark.parametrize("mach_number", [1.5, 5.0])
def test_wall_pressure_is_continuous_through_no_turn(mach_number: float) -> None:
    """To first order p changes by -gamma p M^2/sqrt(M^2 - 1) per radian of outflow, on either side of 0."""
    density = 1.3
    pressure = 0.8
    speed = mach_number * sqrt(GAMMA * pressure / density)
    slope = -GAMMA * pressure * mach_number**2 / sqrt(mach_number**2 - 1.0)
    assert wall_pressure(pressure, density, speed, 0.0) == pytest.approx(pressure, rel=1e-12)
    for turn in (1e-4, -1e-4, 5e-7, -5e-7):
        change = wall_pressure(pressure, density, speed, turn) - pressure
        assert change == pytest.approx(slope * turn, rel=5e-3)


@pytest.mark.parametrize("mach_number", [2.0, 5.0, 7.0])
def test_slight_turns_into_the_wall_keep_their_digits(mach_number: float) -> None:
    """Weak shock and isentropic compression differ in third order: to 1e-6 of p up to 1e-3 rad."""
    for size in (1e-7, 1e-6, 3e-6, 1e-5, 1e-4, 1e-3):
        for turn in size * np.linspace(1.0, 3.0, 41) / 3.0:
            found = wall_pressure(1.0, 1.0, mach_number * sqrt(GAMMA), -turn)
            assert found == pytest.approx(expanded_pressure_ratio(mach_number, -turn), rel=1e-6)


def test_wall_pressure_of_a_detached_shock_is_negative() -> None:
    speed = 3.0 * sqrt(GAMMA)
    assert wall_pressure(1.0, 1.0, speed, -radians(40.0)) < 0.0


@given(
    pressure=st.floats(0.01, 100.0),
    density=st.floats(0.05, 20.0),
    axial_mach=st.floats(1.05, 20.0),
    v_share=st.floats(-2.0, 2.0),
    w_share=st.floats(-2.0, 2.0),
)
def test_primitive_inverts_the_conserved_state(
    pressure: float, density: float, axial_mach: float, v_share: float, w_share: float
) -> None:
    """(p, rho, u, v, w) -> E -> (p, rho, u, v, w) to 1e-9 of the momentum flux, the loss of its difference."""
    sound = sqrt(GAMMA * pressure / density)
    u, v, w = axial_mach * sound, v_share * sound, w_share * sound
    enthalpy = GAMMA / (GAMMA - 1.0) * pressure / density + 0.5 * (u * u + v * v + w * w)
    mass = density * u
    found = primitive(mass, mass * u + pressure, mass * v, mass * w, enthalpy)
    momentum = mass * u + pressure
    assert found[0] == pytest.approx(pressure, abs=1e-11 * momentum)
    np.testing.assert_allclose(found[1:], [density, u, v, w], rtol=1e-11, atol=1e-13 * u)
    assert axial_velocity(pressure, density, v, w, enthalpy) == pytest.approx(u, rel=1e-12)


def test_state_that_cannot_be_has_no_axial_velocity() -> None:
    """Below the axial Mach number 1 the quadratic has no root; too little enthalpy leaves no axial velocity."""
    assert primitive(1.0, 1.0, 0.0, 0.0, 10.0)[2] == 0.0
    assert axial_velocity(1.0, 1.0, 0.0, 0.0, 1.0) == 0.0


@pytest.mark.parametrize("mach_number", [5.0, 7.0])
def test_total_enthalpy_of_the_stream(mach_number: float) -> None:
    """h0 = c_p T + V^2/2 with c_inf = 1: p/rho = 1/gamma."""
    assert total_enthalpy(mach_number) == pytest.approx(2.5 + 0.5 * mach_number**2, rel=1e-15)


@pytest.mark.parametrize("shock_deg", [12.0, 15.0, 30.0])
def test_bow_shock_has_the_slope_of_its_pressure(shock_deg: float) -> None:
    """A plane shock of a given angle: its pressure ratio by NACA Report 1135, its slope is the tangent."""
    ratio = shock_pressure_ratio(6.0, radians(shock_deg))
    assert shock_slope(ratio / GAMMA, 6.0, 0.0) == pytest.approx(tan(radians(shock_deg)), rel=1e-12)


def test_bow_shock_is_a_mach_wave_at_least() -> None:
    assert shock_slope(0.5 / GAMMA, 6.0, 0.0) == pytest.approx(tan(asin(1.0 / 6.0)), rel=1e-12)


def test_bow_shock_leans_with_the_cross_flow() -> None:
    """The slope against a stream turned by 4 deg in the plane of the normal is that turned by 4 deg."""
    ratio = shock_pressure_ratio(6.0, radians(15.0))
    u, v = 6.0 * cos(radians(4.0)), 6.0 * sin(radians(4.0))
    assert shock_slope(ratio / GAMMA, u, v) == pytest.approx(tan(radians(19.0)), rel=1e-12)


def test_characteristics_are_mach_lines() -> None:
    """At flow angle 3 deg and M 5 they run at 3 deg -+ asin(1/5)."""
    angle, mach_angle = radians(3.0), asin(0.2)
    low, high = characteristic_slopes(1.0 / GAMMA, 1.0, 5.0 * cos(angle), 5.0 * sin(angle))
    assert low == pytest.approx(tan(angle - mach_angle), rel=1e-12)
    assert high == pytest.approx(tan(angle + mach_angle), rel=1e-12)


@pytest.mark.parametrize("slope", [-1.0, 0.0, 0.1, 1.0])
def test_flux_between_equal_states_is_theirs(slope: float) -> None:
    p, rho, u, v, t = 0.9, 1.2, 6.0, 0.3, -0.2
    through = rho * (v - slope * u)
    expected = [through, through * u - slope * p, through * v + p, through * t]
    np.testing.assert_allclose(hll((p, rho, u, v, t), (p, rho, u, v, t), slope), expected, rtol=1e-12)


def test_flux_is_the_upwind_one_outside_the_fan() -> None:
    """With the face slower or faster than every wave only one side counts."""
    left, right = (0.9, 1.2, 6.0, 0.3, -0.2), (0.5, 0.7, 6.5, -0.4, 0.1)
    np.testing.assert_array_equal(hll(left, right, -2.0), hll(left, left, -2.0))
    np.testing.assert_array_equal(hll(left, right, 2.0), hll(right, right, 2.0))
