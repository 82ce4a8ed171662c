"""Whether loads may be used: one rule of quality and health, at every place where a result leaves the bridge."""

from __future__ import annotations

import json
from collections.abc import Callable
from itertools import product
from pathlib import Path
from typing import Any

import cantools
import numpy as np
import pytest
from can_case import CYCLE, bus_options
from recorded_case import read_csv
from scaled_maps import scaled_map

from strainfmu.can.bridge.displays.page_message import GaugePosition, result_message
from strainfmu.can.bridge.options import BridgeOptions
from strainfmu.can.bridge.results.frames import BridgeStatus, ResultFrames
from strainfmu.can.bridge.results.layouts import result_layouts
from strainfmu.can.cycle.estimate.result import CycleResult
from strainfmu.can.cycle.frames.account import FrameAccount
from strainfmu.can.cycle.states.bus_state import BusState
from strainfmu.can.cycle.states.quality import Cause, Quality
from strainfmu.can.tools import log_estimates
from strainfmu.can.tools.dbc_export import write_dbc
from strainfmu.can.tools.replay import ReplaySummary
from strainfmu.can.wire.profiles import Identifiers, result_form_of
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import save_inverse_map
from strainfmu.monitor.answer import Answer
from strainfmu.monitor.message import parsed

pytestmark = pytest.mark.fast

N_GAUGES = scaled_map(2, seed=4).n_gauges
STATES = tuple(product(Quality, (None, *HealthState)))
USABLE = [
    quality in (Quality.VALID, Quality.UNPROTECTED, Quality.DEGRADED)
    and health in (HealthState.OK, HealthState.DEGRADED)
    for quality, health in STATES
]
"""UNCONFIRMED and SUSPECT are for information, the remaining qualities have no coefficients."""


def results() -> list[CycleResult]:
    """Return a result of every quality and health; a cause above bit 15 brings the frame of details."""
    return [
        CycleResult(
            time=0.01 * k,
            quality=quality,
            causes=Cause.TARE_RUNNING,
            valid=np.ones(N_GAUGES, dtype=bool),
            strain=np.zeros(N_GAUGES),
            health=None if health is None else int(health),
        )
        for k, (quality, health) in enumerate(STATES)
    ]


@pytest.fixture
def map_file(tmp_path: Path) -> Path:
    save_inverse_map(scaled_map(2, seed=4), tmp_path / "map.h5")
    return tmp_path / "map.h5"


@pytest.mark.parametrize("profile", ["fd64", "classic-le"])
def test_on_the_bus(profile: str, map_file: Path, tmp_path: Path) -> None:
    write_dbc(map_file, tmp_path / "m.dbc", bus_options(profile))
    database = cantools.database.load_file(tmp_path / "m.dbc")
    composer = ResultFrames(result_layouts(result_form_of(profile), Identifiers(), CYCLE), 0)
    seen: list[set[int]] = []
    for result in results():
        status = BridgeStatus(
            time=0.0,
            quality=result.quality,
            bus_state=BusState.ERROR_ACTIVE,
            last_valid=None,
            account=FrameAccount(),
            cycles=1,
            send_failures=0,
            reconnects=0,
            drift_ppm=0.0,
            usable=result.usable,
        )
        signals = [
            database.decode_message(frame.identifier, frame.data, decode_choices=False)
            for frame in (*composer.of_result(result), *composer.of_status(status))
        ]
        seen.append({int(frame["Usable"]) for frame in signals if "Usable" in frame})
    assert seen == [{int(usable)} for usable in USABLE]


def test_in_the_columns_of_a_replay(map_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def replayed(*_: Any, on_result: Callable[[CycleResult], None], **__: Any) -> ReplaySummary:
        for result in results():
            on_result(result)
        return ReplaySummary()

    monkeypatch.setattr(log_estimates, "replay_log", replayed)
    log_estimates.estimate_log(map_file, tmp_path / "no.blf", tmp_path / "out.csv", lambda _: BridgeOptions())
    assert read_csv(tmp_path / "out.csv")["health.usable [1]"].tolist() == USABLE


def test_in_datagrams_and_on_the_page() -> None:
    positions = [GaugePosition(str(k)) for k in range(N_GAUGES)]
    stated, shown, of_older_bridges = [], [], []
    for k, result in enumerate(results()):
        message = {
            "timestamp": float(k),
            **result_message(result, positions, None, Cause.NONE),
            "bus_state": "ERROR_ACTIVE",
            "account": {},
        }
        stated.append(message["usable"])
        for usable, answers in ((message["usable"], shown), (1, of_older_bridges)):
            answer = Answer()
            answer.take(parsed(json.dumps({**message, "usable": usable}).encode()))
            answers.append((answer.content() or {})["usable"])
    assert stated == USABLE
    assert shown == USABLE
    assert of_older_bridges == USABLE
