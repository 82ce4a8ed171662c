"""Pressure by local inclination against published tables and limits."""

from math import pi, radians, sqrt

import numpy as np
import pytest

from builder.aero.engines.newtonian import (
    expanded_to_total,
    inclination_pressure_ratio,
    largest_pressure_coefficient,
    matching_point,
    pitot_pressure_ratio,
    prandtl_meyer_angle,
)
from builder.aero.euler.scheme.gas import expanded_pressure_ratio
from strainfmu.errors import FlowReachError

pytestmark = pytest.mark.fast


@pytest.mark.parametrize(("mach_number", "ratio"), [(2.0, 5.640), (3.0, 12.06), (5.0, 32.65), (6.0, 46.82)])
def test_pitot_pressure(mach_number: float, ratio: float) -> None:
    """NACA Report 1135, table II, p_t2/p_1: four digits."""
    assert pitot_pressure_ratio(mach_number) == pytest.approx(ratio, rel=2e-4)


@pytest.mark.parametrize(("mach_number", "largest"), [(5.0, 1.80877), (6.0, 1.81806), (7.0, 1.82369)])
def test_largest_pressure_coefficient(mach_number: float, largest: float) -> None:
    """(p_t2/p_1 - 1)/(gamma M^2/2), six digits; without bound on M it tends to 1.8394 (Anderson, ch. 3)."""
    assert largest_pressure_coefficient(mach_number, "rayleigh_pitot") == pytest.approx(largest, abs=5e-6)
    assert largest_pressure_coefficient(mach_number, "classical") == 2.0
    assert largest_pressure_coefficient(1e4, "rayleigh_pitot") == pytest.approx(1.8394, abs=1e-4)


@pytest.mark.parametrize(
    ("mach_number", "angle_deg"), [(2.0, 26.380), (3.0, 49.757), (5.0, 76.920), (6.0, 84.955)]
)
def test_prandtl_meyer_angle(mach_number: float, angle_deg: float) -> None:
    """NACA Report 1135, table II, nu: its digits."""
    assert prandtl_meyer_angle(np.array(1.0 / mach_number)) == pytest.approx(radians(angle_deg), abs=radians(6e-4))


def test_leeward_of_a_plate() -> None:
    """NACA Report 1135: from M 5 to 6 is a turn of 8.035 deg, p/p_t falls from 0.001890 to 0.0006334."""
    sine = np.array([np.sin(-radians(84.955 - 76.920))])
    ratio = inclination_pressure_ratio(5.0, sine, leeward="prandtl_meyer")
    # Four digits in the table, of which the third decimal of the angle moves the last.
    assert ratio[0] == pytest.approx(6.334e-4 / 1.890e-3, rel=5e-4)


def test_expansion_agrees_with_the_flow_solver() -> None:
    """M 6, 10 deg, and others: the scalar routine of the Euler solver, Newton's method on nu(M), 1e-9."""
    turning = np.radians([0.0, 1.0, 5.0, 10.0, 20.0])
    at_rest = expanded_to_total(6.0, np.zeros(1))[0]
    wanted = [expanded_pressure_ratio(6.0, angle) for angle in turning]
    np.testing.assert_allclose(expanded_to_total(6.0, turning) / at_rest, wanted, rtol=1e-9)


def test_expansion_ends_in_vacuum() -> None:
    """The largest turn from sonic flow is 130.45 deg; beyond it nothing is left, C_p = -2/(gamma M^2)."""
    largest = 0.5 * pi * (sqrt(6.0) - 1.0)
    left = expanded_to_total(1.0, np.array([largest - 0.05, largest, 3.0]))
    assert left[0] > 0.0
    np.testing.assert_allclose(left[1:], 0.0, atol=1e-100)
    ratio = inclination_pressure_ratio(6.0, np.sin(np.radians([-60.0, -90.0])), leeward="prandtl_meyer")
    np.testing.assert_array_equal(ratio, 0.0)


def test_matching_point() -> None:
    """At large M the match lies at local Mach number 1.35 (Kaufman), where pressure and its slope agree."""
    assert matching_point(1e3).mach_number == pytest.approx(1.35, abs=5e-3)
    for mach_number in (3.0, 6.0, 10.0):
        match = matching_point(mach_number)
        step = 1e-4
        at = np.sin(match.inclination + step * np.array([-2.0, -1.0, 0.0, 1.0, 2.0]))
        p = inclination_pressure_ratio(mach_number, at, leeward="matched")
        assert p[2] == pytest.approx(1.0 + (pitot_pressure_ratio(mach_number) - 1.0) * at[2] ** 2, rel=1e-9)
        # One-sided slopes differ by what curvature makes of the step: 1e-3.
        assert (p[2] - p[1]) / (p[3] - p[2]) == pytest.approx(1.0, abs=1e-3)


def test_matched_flow_falls_all_the_way() -> None:
    """From stagnation over the shoulder into the lee the pressure falls, and ends above vacuum."""
    ratio = inclination_pressure_ratio(6.0, np.sin(np.radians(np.linspace(90.0, -60.0, 301))), leeward="matched")
    assert ratio[0] == pytest.approx(pitot_pressure_ratio(6.0), rel=1e-14)
    assert (np.diff(ratio) < 0.0).all()
    assert ratio[-1] > 0.0


def test_shadow_is_ambient() -> None:
    np.testing.assert_array_equal(inclination_pressure_ratio(6.0, np.array([0.0, -0.3, -1.0])), 1.0)


def test_reach() -> None:
    with pytest.raises(FlowReachError, match=r"Mach number 0\.8 found"):
        inclination_pressure_ratio(0.8, np.array([0.5]))
    with pytest.raises(FlowReachError, match="no matching point at Mach number 2"):
        inclination_pressure_ratio(2.0, np.array([0.5]), leeward="matched")
