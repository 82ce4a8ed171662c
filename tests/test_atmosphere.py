"""The atmosphere against the published tables, and flight conditions against their definitions."""

from math import acos, atan2, cos, degrees, pi, radians, sin

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from builder.vehicle.flight_conditions import condition_grid, flow_key
from strainfmu.atmosphere import (
    LAYERS,
    dynamic_pressure,
    pressure_and_temperature,
    speed_of_sound,
    static_pressure_at,
)
from strainfmu.errors import InputError
from strainfmu.flight_condition import FlightCondition

pytestmark = pytest.mark.fast

# Geopotential altitude [m], pressure [Pa], temperature [K]: U.S. Standard Atmosphere, 1976, table I. That uses
# R* = 8314.32 / 28.9644 = 287.0529 J/(kg K), so its last digit is met.
TABLE = [
    (0.0, 101325.0, 288.15),
    (5e3, 54019.9, 255.65),
    (11e3, 22632.1, 216.65),
    (15e3, 12044.6, 216.65),
    (20e3, 5474.89, 216.65),
    (25e3, 2511.02, 221.65),
    (32e3, 868.019, 228.65),
    (47e3, 110.906, 270.65),
    (51e3, 66.9389, 270.65),
    (71e3, 3.95642, 214.65),
]


@pytest.mark.parametrize(("altitude", "pressure", "temperature"), TABLE)
def test_published_values(altitude: float, pressure: float, temperature: float) -> None:
    """Pressure to 2e-5, temperature to 0.005 K."""
    found = pressure_and_temperature(altitude)
    assert found[0] == pytest.approx(pressure, rel=2e-5)
    assert found[1] == pytest.approx(temperature, abs=5e-3)


def test_speed_of_sound_and_dynamic_pressure() -> None:
    """20 km: a = 295.07 m/s; q = 95.81, 137.97, 187.79 kPa at M 5, 6, 7."""
    assert speed_of_sound(20e3) == pytest.approx(295.07, abs=0.005)
    assert speed_of_sound(0.0) == pytest.approx(340.294, abs=0.005)
    for mach, q in ((5.0, 95.81e3), (6.0, 137.97e3), (7.0, 187.79e3)):
        assert dynamic_pressure(mach, 20e3) == pytest.approx(q, abs=5.0)


@pytest.mark.parametrize("altitude", [11e3, 20e3, 32e3, 47e3, 51e3])
def test_layers_join(altitude: float) -> None:
    """No jump: 1 mm changes pressure by its hydrostatic 2e-7 at most."""
    below, above = pressure_and_temperature(altitude - 1e-3), pressure_and_temperature(altitude + 1e-3)
    np.testing.assert_allclose(below, above, rtol=1e-6)


@given(st.floats(1.0, 70.9e3))
def test_pressure_is_hydrostatic(altitude: float) -> None:
    """dp/dH = -p g/(R T) by a centred difference over 2 m."""
    pressure, temperature = pressure_and_temperature(altitude)
    slope = (pressure_and_temperature(altitude + 1.0)[0] - pressure_and_temperature(altitude - 1.0)[0]) / 2.0
    assert slope == pytest.approx(-pressure * 9.80665 / (287.053 * temperature), rel=1e-5)


def test_pressures_of_many_altitudes() -> None:
    """The closed form, also at the boundaries of layers and beside them; NaN outside."""
    random = np.random.default_rng(1)
    edges = np.array([base for base, _ in LAYERS])
    altitude = np.concatenate([edges, edges[1:] - 1e-6, edges[:-1] + 1e-6, random.uniform(0.0, 71e3, 500)])
    expected = [pressure_and_temperature(one)[0] for one in altitude.tolist()]
    np.testing.assert_allclose(static_pressure_at(altitude), expected, rtol=1e-14)
    assert np.isnan(static_pressure_at(np.array([-1e-9, 71000.1, np.nan, np.inf, -np.inf]))).all()


def test_the_pressure_has_no_kinks() -> None:
    """Slopes over 1 m below and above every 250 m differ by what the curvature makes of them, 1.5e-4."""
    altitude = np.arange(250.0, 70e3, 250.0)
    below, at, above = (static_pressure_at(altitude + side) for side in (-1.0, 0.0, 1.0))
    np.testing.assert_allclose(above - at, at - below, rtol=2e-4)


@pytest.mark.parametrize("altitude", [-1.0, 71000.1, float("nan"), float("inf")])
def test_outside_the_tables_is_refused(altitude: float) -> None:
    with pytest.raises(InputError, match="0 to 71000 m allowed"):
        pressure_and_temperature(altitude)


@given(st.floats(-60.0, 60.0), st.floats(-60.0, 60.0))
def test_total_incidence_and_roll(alpha_deg: float, beta_deg: float) -> None:
    """cos a_T = cos a cos b, and the wind V (cos a cos b, -sin b, sin a cos b) in body axes."""
    assume(abs(alpha_deg) + abs(beta_deg) > 0.1)
    alpha, beta = radians(alpha_deg), radians(beta_deg)
    condition = FlightCondition(6.0, alpha, beta, 20e3)
    assert condition.total_incidence == pytest.approx(acos(cos(alpha) * cos(beta)), abs=1e-9)
    roll = atan2(-sin(beta), sin(alpha) * cos(beta))
    assert cos(condition.leeward_roll_angle - roll) == pytest.approx(1.0, abs=1e-12)


def test_equal_angles_point_the_cross_flow_between_the_axes() -> None:
    """a = b = 6 deg: a_T = 8.478 deg, leeward between +z and -y, 44.84 deg from -y."""
    condition = FlightCondition(5.0, radians(6.0), radians(6.0), 20e3)
    assert degrees(condition.total_incidence) == pytest.approx(8.478, abs=5e-4)
    assert degrees(condition.leeward_roll_angle) + 90.0 == pytest.approx(44.84, abs=5e-3)
    assert str(condition) == "M 5, angle of attack 6 deg, sideslip 6 deg, 20 km"


def test_condition_takes_its_atmosphere() -> None:
    condition = FlightCondition(6.0, 0.0, 0.0, 20e3)
    assert condition.ambient_pressure == pytest.approx(5474.9, abs=0.05)
    assert condition.dynamic_pressure == pytest.approx(137.97e3, abs=5.0)
    assert condition.as_tuple() == (6.0, 0.0, 0.0, 20e3)


def test_second_set_of_conditions() -> None:
    """P2: 243 conditions, 15 total incidences per Mach number, the largest 11.295 deg; (5, 6, 6) is in it."""
    angles = range(-8, 10, 2)
    conditions = condition_grid([5.0, 6.0, 7.0], angles, angles, 20e3)
    assert len(conditions) == 243
    assert len({flow_key(c) for c in conditions}) == 45
    assert degrees(max(c.total_incidence for c in conditions)) == pytest.approx(11.295, abs=5e-4)
    assert FlightCondition(5.0, radians(6), radians(6), 20e3) in conditions


def test_wind_from_above_turns_the_body_by_half() -> None:
    up, down = FlightCondition(6.0, 0.1, 0.0, 20e3), FlightCondition(6.0, -0.1, 0.0, 20e3)
    assert flow_key(up) == flow_key(down)
    assert abs(down.leeward_roll_angle - up.leeward_roll_angle) == pytest.approx(pi, rel=1e-14)
