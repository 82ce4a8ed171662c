"""The closed loop in many flights: errors over seeds, and a fault of some gauges."""

import json

import pytest
from slender_vehicle import SlenderFiles

from builder.pipeline.closed_loop_trial import closed_loop_rows, with_fault, without_fault
from builder.reporting import Silent
from builder.trial.cases import ClosedLoop, load_trial
from strainfmu.cosim.models.flight_model import load_flight_model
from strainfmu.cosim.scenario import Scenario
from strainfmu.errors import InputError


def short(**changes: object) -> ClosedLoop:
    loop = load_trial("closed_loop").closed_loop
    assert loop is not None
    return loop.model_copy(update=changes)


def test_seeds_differ(scenario: Scenario) -> None:
    rows = without_fault(scenario, "linear", short(seeds=2))
    assert [row["load"] for row in rows] == ["tracking error, rms", "settled error, largest", "angle error, rms"]
    assert all(row["estimator"] == "feedback of linear" for row in rows)
    assert 0.0 < rows[2]["smallest_deg"] < rows[2]["largest_deg"]


def test_a_gauge_that_drops_out_is_reported_at_once(scenario: Scenario) -> None:
    loop = short(every=27)
    (row,) = with_fault(scenario, loop.fault[0], loop)
    count = len(range(0, load_flight_model(scenario.flight_model).n_strain_gauges, loop.every))
    assert (row["case"], row["samples"], row["holds"], row["healthy_out_of_use"]) == ("dropout", count, count, 0)
    assert (row["reported_first_ms"], row["reported_last_ms"]) == pytest.approx((10.0, 10.0))
    assert (row["reported_never"], row["isolated_never"]) == (0, count)
    assert json.loads(json.dumps(row))["holds"] == count


def test_the_nonlinear_estimator_needs_tables(files: SlenderFiles) -> None:
    with pytest.raises(InputError, match=r"map\.h5: expected a map with tables"):
        closed_loop_rows(short(), files.scenario, None, (), Silent())
