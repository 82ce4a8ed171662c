"""One rule of trust: every quality at every outlet, bus, columns, datagrams, page and listener, is the same."""

import json
from collections.abc import Callable
from ctypes import c_double
from dataclasses import replace
from itertools import product
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cantools
import numpy as np
import pytest
from can_case import CYCLE, Ears, Projection, Truth, layout_of
from recorded_case import read_csv
from scaled_maps import scaled_map

from strainfmu.can import load_listener, replay, setup
from strainfmu.can.dbc_writer import dbc_text
from strainfmu.can.encoder import StrainEncoder
from strainfmu.can.frame import to_message
from strainfmu.can.load_listener import LoadListener
from strainfmu.can.machine import Machine, Result
from strainfmu.can.options import BridgeOptions, BridgeSettings
from strainfmu.can.page_message import GaugePosition, result_message
from strainfmu.can.profiles import Identifiers
from strainfmu.can.quality import Cause, Quality
from strainfmu.can.replay import ReplaySummary
from strainfmu.can.result_frames import result_layouts
from strainfmu.can.signals import functions
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import save_inverse_map
from strainfmu.monitor.message import parsed
from strainfmu.monitor.state import Answer

pytestmark = pytest.mark.fast

N_GAUGES = scaled_map(2, seed=4).n_gauges
GOOD = (Quality.VALID, Quality.UNPROTECTED, Quality.DEGRADED)


class Wire:
    """Keeps what is sent."""

    def __init__(self) -> None:
        self.sent: list[Any] = []

    def send(self, message: Any, timeout: float | None = None) -> None:
        self.sent.append(message)


def flown(
    is_protected: bool, form: str, bus_file: Path, monkeypatch: pytest.MonkeyPatch
) -> tuple[list[Result], list[list[Any]], str]:
    """Return what a listener gives in every state, the messages that each result sent, and the DBC text of these.

    Cycles with every health and a gauge without a value, strains that another bridge answers, that freeze, and
    silence until results are INVALID.
    """
    layout, step, now = layout_of("fd64", N_GAUGES), Projection(N_GAUGES), [0.0]
    if not is_protected:
        frames = tuple(
            replace(frame, layout=replace(frame.layout, protection=None)) for frame in layout.strain_frames
        )
        layout = replace(layout, state=None, strain_frames=frames)
    layouts = result_layouts(form, Identifiers(), CYCLE)
    machine = Machine(layout, step, BridgeSettings(), start=0.0, own=[one.key for one in layouts])
    encoder, truth, wire, results = StrainEncoder(layout), Truth(N_GAUGES, 1), Wire(), list[Result]()
    ears, messages = Ears(encoder), list[list[Any]]()

    def keep(result: Result) -> None:
        results.extend(ears.hear([result]))
        messages.append(list(wire.sent))
        wire.sent.clear()

    # The public listener with the machine at hand, in virtual time, and a loop that leaves the time to the test.
    bus_file.write_text("")
    monkeypatch.setattr(setup, "make_machine", lambda *_, **__: (machine, layouts, 1, None))
    monkeypatch.setattr(load_listener, "time", SimpleNamespace(monotonic=lambda: now[0]))
    loop: Any = SimpleNamespace(call_soon=lambda _: None, call_later=lambda *_: None)
    estimator = Estimator(scaled_map(2, seed=4))
    listener = LoadListener(estimator, bus_file, on_result=keep, bus=wire, loop=loop)
    states = [*[HealthState.OK] * 12, *HealthState, *[HealthState.OK] * 30]
    for k, health in enumerate(states):
        now[0], step.health = k * CYCLE, health
        strain, pressure = truth.cycle(min(k, 42))
        strain = np.where((np.arange(N_GAUGES) == 3) & (k in (9, 10)), np.nan, strain)
        for frame in encoder.encode(strain, pressure, cycle=k, sample_time=k * CYCLE):
            listener(to_message(frame))
        if k == 25:
            machine._library.sb_note_bridge(machine._at[1], c_double(now[0] + 3 * CYCLE))
    for k in range(len(states), len(states) + 40):
        now[0] = k * CYCLE
        listener._look()
        wire.sent.clear()  # the status, of the result before
    assert listener.last is results[-1]
    return results, messages, dbc_text(list(layouts), "test")


@pytest.mark.parametrize(("is_protected", "form"), [(True, "fd"), (False, "fd"), (True, "classic-le")])
def test_every_quality_is_the_same_at_every_outlet(
    is_protected: bool, form: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    results, messages, text = flown(is_protected, form, tmp_path / "bus.toml", monkeypatch)
    reached = {result.quality for result in results}
    assert reached == set(Quality) - {Quality.UNPROTECTED if is_protected else Quality.VALID}
    stated = [result.usable for result in results]
    health = [HealthState.OK if result.health is None else HealthState(result.health) for result in results]
    assert stated == [
        result.quality in GOOD and one in (HealthState.OK, HealthState.DEGRADED)
        for result, one in zip(results, health, strict=True)
    ]
    # On the bus; of the FD form the bit is in the details, which come with further causes.
    truth = [(int(result.quality), result.usable) for result in results]
    database, n_bits = cantools.database.load_string(text, "dbc"), 0
    for sent, (quality, usable) in zip(messages, truth, strict=True):
        for one in sent:
            frame = database.decode_message(one.arbitration_id, one.data, decode_choices=False)
            assert frame.get("Quality", quality) == quality
            assert bool(frame.get("Usable", usable)) is usable
            n_bits += "Usable" in frame
    assert n_bits >= (3 if form == "fd" else len(results))
    # In the columns of a replay.
    save_inverse_map(scaled_map(2, seed=4), tmp_path / "map.h5")

    def replayed(*_: Any, on_result: Callable[[Result], None], **__: Any) -> ReplaySummary:
        for one in results:
            on_result(one)
        return ReplaySummary()

    monkeypatch.setattr(replay, "replay_log", replayed)
    output = tmp_path / "out.csv"
    replay.estimate_log(
        tmp_path / "map.h5", tmp_path / "no.blf", output, lambda _: BridgeOptions(interface="", channel="")
    )
    columns = read_csv(output)
    in_columns = zip(columns["quality [1]"].tolist(), columns["health.usable [1]"].tolist(), strict=True)
    assert [(int(quality), bool(usable)) for quality, usable in in_columns] == truth
    # In datagrams and on the page.
    positions = [GaugePosition(str(k)) for k in range(N_GAUGES)]
    for k, one in enumerate(results):
        message = {
            "timestamp": float(k),
            **result_message(one, positions, None, Cause.NONE),
            "bus_state": "ERROR_ACTIVE",
            "account": {},
        }
        answer = Answer()
        answer.take(parsed(json.dumps(message).encode()))
        shown = answer.content() or {}
        assert (message["quality"], bool(message["usable"])) == truth[k]
        assert bool(shown["usable"]) == truth[k][1]


def test_the_table_of_trust() -> None:
    """Every quality and health: usable is a column, so that they cannot disagree."""
    library = functions()
    for quality, health in product(Quality, HealthState):
        usable = quality in GOOD and health in (HealthState.OK, HealthState.DEGRADED)
        assert bool(library.sb_usable(int(quality), int(health))) is usable
    unknown = max(HealthState) + 1
    assert library.sb_quality(0, 0, 1, 5, 1, unknown, 1) == Quality.SUSPECT, "no better than what is not known"
