"""The benchmark of the bus: every cycle sent on time has an outcome, and its table holds the figures."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from synthetic_vehicle import SyntheticFiles

from strainfmu.can.tools.bus_bench import SETTLING_CYCLES, _outcome, bus_run, core_cost
from strainfmu.cli.bench_bus import bus_rows


@pytest.fixture
def folder(synthetic: SyntheticFiles, tmp_path: Path) -> Path:
    shutil.copy(synthetic.map_1, tmp_path / "map.h5")
    shutil.copy(synthetic.estimator_1, tmp_path / "estimator.fmu")
    return tmp_path


def test_the_table_of_a_short_run(folder: Path) -> None:
    cost, run = core_cost(folder, 200), bus_run(folder, 200.0, 1.0)
    rows = dict(bus_rows(cost, run))
    assert 0.0 < cost.core < 0.1
    assert 0.0 < cost.observed < 0.1
    assert run.sent == 200 - SETTLING_CYCLES
    assert sum(run.outcome.values()) == run.on_time <= run.sent
    assert rows["frames: not accounted for"] == "0"
    assert run.python_can_received == run.python_can_sent == 400
    assert 0.0 < run.load < 1.0
    assert 0.0 < run.python_can_load < 1.0
    assert "us a cycle" in rows["virtual time: core"]


@pytest.mark.fast
def test_cycles_are_counted_by_what_was_answered_first() -> None:
    answers = [(0, "VALID"), (1000, "VALID"), (1000, "STALE: OLD"), (3000, "DEGRADED: OVERLOAD"), (None, "STALE")]
    assert _outcome(answers, np.array([0, 1, 2, 3]), 1e-3) == {
        "VALID": 2,
        "no result": 1,
        "DEGRADED: OVERLOAD": 1,
    }
