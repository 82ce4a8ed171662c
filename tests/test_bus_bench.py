"""The benchmark of the bus: every cycle sent on time has an outcome, and its table holds the figures."""

import shutil
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from flight_fmu import whole_map
from flight_maps import NOISE_STD
from synthetic_vehicle import SyntheticFiles

from benchmarks.bench_flight import PROFILE, bench_flight
from benchmarks.bus_bench import SETTLING_CYCLES, _outcome, bus_rows, bus_run, core_cost, linear_cost
from strainfmu.can.options import BridgeOptions
from strainfmu.can.quality import Quality
from strainfmu.can.setup import make_machine
from strainfmu.cosim.estimators.fmu_step import FmuStep
from strainfmu.estimator.map.inverse_map import load_inverse_map, save_inverse_map
from strainfmu.fmu.export import export_estimator

CALLS_PER_CYCLE = 195
"""Calls of functions that a cycle of two frames may take the core, those written in C included; it takes 179."""

OPTIONS = BridgeOptions(
    interface="virtual", channel="bench", profile=PROFILE, cycle_time=1e-3, restart="accept"
)  # the sender hears no results


@pytest.fixture
def folder(synthetic: SyntheticFiles, tmp_path: Path) -> Path:
    shutil.copy(synthetic.map_1, tmp_path / "map.h5")
    shutil.copy(synthetic.estimator_1, tmp_path / "estimator.fmu")
    return tmp_path


@pytest.mark.slow
def test_the_table_of_a_short_run(folder: Path) -> None:
    cost, run = core_cost(folder, 200), bus_run(folder, 200.0, 1.0)
    rows = dict(bus_rows(cost, run))
    assert 0.0 < cost.core < 0.1
    assert 0.0 < cost.observed < 0.1
    assert run.sent == 200 - SETTLING_CYCLES
    assert sum(run.outcome.values()) == run.on_time <= run.sent
    assert rows["frames: not accounted for"] == "0"
    assert run.python_can_received == run.python_can_sent == 600
    assert 0.0 < run.load < 1.0
    assert 0.0 < run.python_can_load < 1.0
    assert 0.0 < run.answered_load < 1.0
    assert "us a cycle" in rows["virtual time: core"]


def test_a_map_with_tables_flies_what_it_holds_for_possible(tmp_path: Path) -> None:
    """The mean strain of a map at its nominal q_inf is no flight state: 3 % of the cycles were DEGRADED."""
    inverse_map = replace(whole_map(), noise_std=np.full(whole_map().n_gauges, NOISE_STD))
    save_inverse_map(inverse_map, tmp_path / "map.h5")
    export_estimator(tmp_path / "map.h5", tmp_path / "estimator.fmu")
    flight = bench_flight(inverse_map, 1e-3)
    with FmuStep(tmp_path / "estimator.fmu") as step:
        core, *_ = make_machine(step, OPTIONS, gauge_names=step.gauge_names, start=0.0)
        results = [result for k in range(1010) for frame in flight.cycle(k) for result in core.receive(frame)]
    # The quantisation is more than the noise of this map states.
    assert sum(result.quality is Quality.VALID for result in results) >= 1000


def test_a_cycle_takes_the_core_few_calls(folder: Path) -> None:
    """Counted, as times depend on the machine: what is asked in every cycle without need shows here."""
    flight = bench_flight(load_inverse_map(folder / "map.h5"), 1e-3)
    calls, counted = 0, 64

    def count(_frame: object, event: str, _argument: object) -> None:
        nonlocal calls
        calls += event in ("call", "c_call")

    with FmuStep(folder / "estimator.fmu") as step:
        core, *_ = make_machine(step, OPTIONS, gauge_names=step.gauge_names, start=0.0)
        for k in range(300 + counted):
            frames = flight.cycle(k)
            if k >= 300:
                sys.setprofile(count)
            results = [result for frame in frames for result in core.receive(frame)]
            sys.setprofile(None)
        assert [result.quality for result in results] == [Quality.VALID]
    assert calls / counted < CALLS_PER_CYCLE


def test_the_cost_with_the_linear_estimator_of_the_same_map(folder: Path) -> None:
    assert linear_cost(folder, 10) is None
    save_inverse_map(whole_map(), folder / "map.h5")
    cost = linear_cost(folder, 100)
    assert cost is not None
    assert 0.0 < cost.core < 0.1
    assert 0.0 < cost.observed < 0.1


@pytest.mark.fast
def test_cycles_are_counted_by_what_was_answered_first() -> None:
    answers = [(0, "VALID"), (1000, "VALID"), (1000, "STALE: OLD"), (3000, "DEGRADED: OVERLOAD"), (None, "STALE")]
    assert _outcome(answers, np.array([0, 1, 2, 3]), 1e-3) == {
        "VALID": 2,
        "no result": 1,
        "DEGRADED: OVERLOAD": 1,
    }
