"""Where flights between the snapshots are drawn."""

from __future__ import annotations

import numpy as np
import pytest

from builder.trial.conditions import held_out_conditions
from builder.truth.revolution.flow_table import FlowTable
from builder.vehicle.file import IC3X, load_vehicle

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
