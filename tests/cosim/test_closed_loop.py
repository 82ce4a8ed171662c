"""The closed loop in many flights: scores of seeds, and of a fault of every third gauge."""

from __future__ import annotations

import pytest

from builder.stress import closed_loop
from strainfmu.cosim.models.flight_model import load_flight_model
from strainfmu.cosim.scenario import Scenario
from strainfmu.interface.plant_variables import GaugeFault


def test_seeds_differ_and_stand_in_the_table(scenario: Scenario, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(closed_loop, "SEEDS", (1, 2))
    found = closed_loop.without_fault(scenario, scenario.inverse_map)
    assert list(found) == ["feedback of truth", "nonlinear estimator", "linear estimator"]
    one, other = found["linear estimator"]
    assert one.angle_error != other.angle_error
    assert one.health == other.health == {"OK": 1.0}
    head, *lines = closed_loop.lines_of_seeds(found)
    assert head.startswith("deg")
    assert [line.split("  ")[0] for line in lines] == list(found)


def test_a_gauge_that_drops_out_is_reported_at_once(scenario: Scenario, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(closed_loop, "FAULTS", {"dropout": (GaugeFault.DROPOUT, 0.0)})
    monkeypatch.setattr(closed_loop, "FAILS_AT", 0.5 * scenario.stop_time)
    ((name, flights),) = closed_loop.with_faults(scenario)
    gauges = load_flight_model(scenario.flight_model).n_strain_gauges
    assert len(flights) == len(range(0, gauges, closed_loop.EVERY))
    line = closed_loop.line_of_fault(name, flights)
    assert line.startswith("dropout")
    assert f"holds in {len(flights)} of {len(flights)}; reported after 10, 10, 10 ms; isolated after -" in line
    assert line.endswith("healthy gauges out of use: 0")
