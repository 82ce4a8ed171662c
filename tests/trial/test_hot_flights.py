"""Flights while the wall warms: sigma holds with sensors and without, and loads are as good as in cold flights."""

from __future__ import annotations

import numpy as np
import pytest

from builder.campaign.snapshots import Snapshots
from builder.stress.hot_flights import Heating, hot_flights, lines_of, maps_of, standard_temperature
from builder.truth.revolution.flow_table import FlowTable
from builder.truth.revolution.strain import TrueStructure
from builder.vehicle.file import Vehicle


@pytest.mark.slow
def test_a_wall_that_warms_costs_little(
    vehicle: Vehicle, snapshots: Snapshots, table: FlowTable, true_model: TrueStructure
) -> None:
    vehicle = vehicle.model_copy(update={"temperature": standard_temperature(vehicle.body().length)})
    cold, warm = maps_of(vehicle, snapshots)
    flights = hot_flights(vehicle, true_model, table, 100, Heating(), cold.noise_std)
    assert flights.temperature.shape == (100, 8)
    assert np.abs(flights.hot - flights.cold).max() > 1e-6
    lines = lines_of(flights, cold, warm)
    print("\n".join(lines))
    rows = {line[:52].strip(): [float(value) for value in line[52:].split()] for line in lines[1:]}
    for kind in ("linear", "nonlinear"):
        assert rows[f"{kind}: 8 sensors"][5] <= 1.5
        assert rows[f"{kind}: 8 sensors"][6] >= 99.0
        assert rows[f"{kind}: no sensors"][6] >= 99.0
        assert rows[f"{kind}: map without temperature"][5] > 1.5
