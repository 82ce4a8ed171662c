"""Where flights between the snapshots are drawn."""

from __future__ import annotations

import numpy as np
import pytest

from builder.trial.conditions import Where, flown_conditions, held_out_conditions, stress_knots
from builder.truth.revolution.flow_table import FlowTable
from builder.vehicle.file import IC3X, VEHICLES, load_vehicle

pytestmark = pytest.mark.fast

TABLE = FlowTable(
    vehicle="any",
    mach_knots=np.array([5.0, 7.0]),
    incidence_knots=np.radians([5.0, 10.0]),
    harmonic=np.zeros((2, 2, 1, 1)),
    provenance={},
)


@pytest.mark.parametrize(
    ("valid", "drawn"), [((0.0, 40.0), (12.0, 30.0)), ((0.0, 10.0), (0.0, 10.0)), ((35.0, 50.0), (35.0, 50.0))]
)
def test_altitudes_are_those_of_the_map(valid: tuple[float, float], drawn: tuple[float, float]) -> None:
    """A map that holds at none of 12 to 30 km is flown where it holds."""
    shipped = load_vehicle(IC3X)
    vehicle = shipped.model_copy(update={"map": shipped.map.model_copy(update={"valid_altitude_km": valid})})
    conditions = held_out_conditions(vehicle, TABLE, 200, np.random.default_rng(1))
    altitude = 1e-3 * np.array([one.altitude for one in conditions])
    low, high = drawn
    reach = 0.1 * (high - low)
    assert low <= altitude.min() < low + reach
    assert high - reach < altitude.max() <= high


def test_conditions_of_a_square_are_inside_it_and_its_flows() -> None:
    """|a|, |b| up to 8 deg on the shipped vehicle; without a range of sideslip the disc of total incidence."""
    shipped, random = load_vehicle(IC3X), np.random.default_rng(1)
    where = Where(square=0.8, altitudes_km=[15.0, 28.0])
    conditions = flown_conditions(where, shipped, TABLE, 300, random)
    angles = np.degrees([(one.angle_of_attack, one.sideslip_angle) for one in conditions])
    assert 7.8 < np.abs(angles).max() <= 8.0
    altitude = [one.altitude for one in conditions]
    assert 15e3 <= min(altitude) < 16e3 < 27e3 < max(altitude) <= 28e3
    mach, incidence = stress_knots(shipped, 0.8)
    assert (mach[0], mach[-1]) == (5.0, 7.0)
    assert incidence[-1] > max(one.total_incidence for one in conditions)
    entry = shipped.conditions.model_copy(update={"sideslip_angle_deg": [0.0]})
    turned = flown_conditions(where, shipped.model_copy(update={"conditions": entry}), TABLE, 200, random)
    assert 9.0 < np.degrees(max(one.total_incidence for one in turned)) <= 10.0 + 1e-9
    assert max(abs(one.sideslip_angle) for one in turned) > np.radians(8.0)


@pytest.mark.parametrize(
    ("name", "angles", "parameters"), [("ic3x.toml", (6.0, 6.0), ()), ("finned_body.toml", (4.5, 3.0), (3.0,))]
)
def test_the_corner_is_three_quarters_of_the_way(
    name: str, angles: tuple[float, float], parameters: tuple[float, ...]
) -> None:
    """On the shipped vehicle it is the example of the source."""
    where = Where(square=0.8, altitudes_km=[20.0, 20.0], corner=0.75)
    vehicle = load_vehicle(VEHICLES / name)
    table = TABLE if vehicle.is_of_revolution else None
    first, *others = flown_conditions(where, vehicle, table, 3, np.random.default_rng(1))
    assert others == [first, first]
    assert (first.mach_number, first.altitude, first.parameters) == (5.0, 20e3, parameters)
    assert np.degrees([first.angle_of_attack, first.sideslip_angle]) == pytest.approx(angles)
