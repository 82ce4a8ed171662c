"""The replay of a log through the state machines of the live run; the time stamps are the clock."""

from __future__ import annotations

import hashlib
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import chain
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from strainfmu.can.bridge.options import BridgeOptions
from strainfmu.can.bridge.results.frames import ResultFrames
from strainfmu.can.bridge.setup import make_core
from strainfmu.can.cycle.core import BridgeCore
from strainfmu.can.cycle.estimate.result import CycleResult
from strainfmu.can.cycle.frames.acceptance import Acceptance
from strainfmu.can.cycle.frames.account import FrameAccount, FrameClass
from strainfmu.can.cycle.states.quality import Cause, Quality
from strainfmu.can.tools.log_description import load_description
from strainfmu.can.tools.log_frames import LogState, log_frames
from strainfmu.can.wire.frame import Frame
from strainfmu.can.wire.frame_layout import FrameLayout
from strainfmu.can.wire.signal_plan import SignalPlan
from strainfmu.cosim.estimators.step import Step

_OF_THE_MOMENT = ("E2E_CRC", "Age")
"""Signals of a result that depend on when it was sent, which no replay knows."""

_AHEAD = 64
"""Frames of a log that are read ahead: a sent frame is logged after it has been sent."""

_LONGEST_GAP = 1000
"""Cycles without any frame in a log beyond which they have one result."""

_UNMATCHED = 10_000
"""Maximum number of result frames kept without a counterpart: a log without sent frames has none."""


@dataclass(kw_only=True)
class ReplaySummary:
    """Summary of a replay.

    Attributes
    ----------
    duration : of the log [s].
    account, qualities, healths, navigated : as of a live run.
    compared, equal : number of result frames in the log, and of those that the replay repeated bit by bit, except
        for the age at the time of sending and the CRC over it.
    notes : lines for the user.
    """

    duration: float = 0.0
    account: FrameAccount = field(default_factory=FrameAccount)
    qualities: Counter[Quality] = field(default_factory=Counter)
    healths: Counter[int] = field(default_factory=Counter)
    navigated: int = 0
    compared: int = 0
    equal: int = 0
    notes: list[str] = field(default_factory=list)

    @property
    def results(self) -> int:
        """Number of results that have coefficients."""
        return sum(number for quality, number in self.qualities.items() if quality.has_coefficients)


def replay_log(
    log: Path,
    source: Path,
    step: Step,
    gauge_names: Sequence[str],
    options: Callable[[BridgeOptions | None], BridgeOptions],
    on_result: Callable[[CycleResult], None],
    progress: Callable[[int, int], None] | None = None,
) -> ReplaySummary:
    """Send the received frames of ``log`` through a core; call ``on_result`` with every result.

    Parameters
    ----------
    source : file of the estimator, compared with the one of the recording.
    step, gauge_names : of the estimator.
    options : makes the options from the recording's, None if the log has no description next to it.

    Raises
    ------
    InputError
        The log, its description or an option is wrong.
    StrainfmuError
        The FMU failed for good.
    """
    described = load_description(log)
    chosen = options(None if described is None else described["options"])
    summary, state = ReplaySummary(), LogState()
    frames = log_frames(log, 0.0 if described is None else described["log_start"], state=state, progress=progress)
    first = next(frames, None)
    if first is None:
        summary.notes.append(f"{log}: holds no frame")
        return summary
    start = first[0].time if described is None else described["start"]
    core, layouts, configuration = make_core(step, chosen, gauge_names=gauge_names, start=start)
    if core.authentication is not None:
        core.authentication.begin(None if described is None else described["freshness"])
    comparison = _Comparison(layouts, configuration)
    # Other loggers do not tell which frames the bridge sent.
    core.own_frames.by_identifier = described is None
    acceptance = Acceptance(core.layout, core.own_frames, core.settings)
    account = FrameAccount()

    def give(results: list[CycleResult]) -> None:
        for result in results:
            summary.qualities[result.quality] += 1
            if result.health is not None:
                summary.healths[result.health] += 1
            summary.navigated += isfinite(result.mach_number) and isfinite(result.altitude)
            comparison.replayed(result)
            on_result(result)

    time, gaps = start, _Gaps(core)
    skips = dict(described.get("skips", ())) if described else {}
    unanswered = deque(described.get("unanswered", ()) if described else ())
    for frame, is_received in _ahead(chain([first], frames), core):
        give(gaps.passed(time, frame.time, skips))
        time = frame.time
        if is_received:
            give(_received(core, acceptance, account=account, frame=frame, skips=skips, unanswered=unanswered))
        else:
            comparison.logged(frame)
    end = time if described is None or described.get("end") is None else described["end"]
    give(gaps.passed(time, end, skips))
    give(_advanced(core, end, skips))
    core.finish(time)
    summary.duration = time - start
    summary.account = account.plus(core.account)
    summary.compared, summary.equal = comparison.compared, comparison.equal
    summary.notes += [*_notes(log, source, state=state, described=described), *gaps.notes(log, start)]
    return summary


def _ahead(frames: Iterable[tuple[Frame, bool]], core: BridgeCore) -> Iterator[tuple[Frame, bool]]:
    """Yield ``frames``; the core learns of those that were sent a little ahead, as they may come back first."""
    waiting: deque[tuple[Frame, bool]] = deque()
    for frame, is_received in frames:
        if not is_received:
            core.own_frames.sending(frame)
        waiting.append((frame, is_received))
        if len(waiting) > _AHEAD:
            yield waiting.popleft()
    yield from waiting


def _advanced(core: BridgeCore, time: float, skips: dict[float, float]) -> list[CycleResult]:
    """Advance event by event, as a live bridge does, except where it stood still (see ``BridgeCore.skips``)."""
    results = []
    while core.next_event <= time:
        results += core.advance(skips.get(core.next_event, core.next_event))
    return results


class _Gaps:
    """Times without any frame, sent or received: what a live bridge says then every cycle is said once."""

    def __init__(self, core: BridgeCore) -> None:
        self._core, self._begin = core, float("nan")
        self._longest, self._number = 0.0, 0

    def passed(self, begin: float, end: float, skips: dict[float, float]) -> list[CycleResult]:
        """Return the results from ``begin`` to ``end`` [s], of successive frames, if it is a gap; else none.

        They are the results of the cycles before it, and one of the gap, with its length.
        """
        core, period = self._core, self._core.layout.cycle_time
        if end - begin <= _LONGEST_GAP * period:
            return []
        self._number += 1
        if end - begin > self._longest:
            self._begin, self._longest = begin, end - begin
        results: list[CycleResult] = []
        while not (results and results[-1].causes & Cause.SILENT):
            results += _advanced(core, core.next_event, skips)
        row = core.pass_gap(end)
        row.time, row.gap = results[-1].time, end - begin
        row.causes |= results[-1].causes
        return [*results[:-1], row]

    def notes(self, log: Path, start: float) -> list[str]:
        """Return a line on the gaps; ``start`` is the log's [s]."""
        if not self._number:
            return []
        return [
            f"{log}: {self._number} gaps without a frame, the longest of {self._longest:.6g} s, "
            f"{self._begin - start:.6g} s behind the start: each has one row, with its length in column gap"
        ]


def _received(
    core: BridgeCore,
    acceptance: Acceptance,
    account: FrameAccount,
    frame: Frame,
    skips: dict[float, float],
    unanswered: deque[Sequence[float]],
) -> list[CycleResult]:
    """Pass a frame through the receiver's acceptance into the core; answer it only if the live run did."""
    refused = acceptance.refused(frame)
    if refused is None or acceptance.is_reported(refused, frame):
        while unanswered and unanswered[0][1] < frame.time:
            unanswered.popleft()
        is_answered = not unanswered or frame.time < unanswered[0][0]
        return _advanced(core, frame.time, skips) + core.receive(frame, is_answered)
    account.received += 1
    account.refuse(refused, frame.key, frame.time)
    if refused is FrameClass.SHED:
        core.note(Cause.OVERLOAD)
    return []


class _Comparison:
    """Comparison of the result frames of the log with the result frames of the replay, in order."""

    def __init__(self, layouts: tuple[FrameLayout, ...], configuration: int) -> None:
        self._frames = ResultFrames(layouts, configuration)
        self._plans = {layout.key: SignalPlan(layout) for layout in layouts if layout.cycle_time is not None}
        self._kept = {
            key: np.array([signal.name not in _OF_THE_MOMENT for signal in plan.signals])
            for key, plan in self._plans.items()
        }
        self._logged: dict[int, list[bytes]] = {key: [] for key in self._plans}
        self._replayed: dict[int, list[bytes]] = {key: [] for key in self._plans}
        self.compared = self.equal = 0

    def logged(self, frame: Frame) -> None:
        self._add(self._logged, frame)

    def replayed(self, result: CycleResult) -> None:
        for frame in self._frames.of_result(result):
            self._add(self._replayed, frame)

    def _add(self, side: dict[int, list[bytes]], frame: Frame) -> None:
        plan = self._plans.get(frame.key)
        if plan is None or len(frame.data) != plan.length:
            return
        if len(side[frame.key]) >= _UNMATCHED:
            return
        side[frame.key].append(frame.data)
        mine, other = self._logged[frame.key], self._replayed[frame.key]
        while mine and other:
            self.compared += 1
            raw = [plan.raw(data.pop(0))[self._kept[frame.key]] for data in (mine, other)]
            self.equal += bool(np.array_equal(raw[0], raw[1]))


def _notes(log: Path, source: Path, state: LogState, described: dict[str, Any] | None) -> list[str]:
    """Return notes for the user."""
    notes = []
    if described is None:
        notes.append(f"{log}: no description next to it; the bridge is taken to have started with the first frame")
    elif described["fmu_sha256"] != hashlib.sha256(source.read_bytes()).hexdigest():
        notes.append(f"{source}: is not the FMU of the recording, '{described['fmu']}'")
    if described is not None and described.get("lost"):
        notes.append(f"{log}: {described['lost']} frames of the live run were not recorded")
    if state.ends_early:
        notes.append(f"{log}: {state.ends_early}")
    if state.backwards:
        notes.append(f"{log}: {state.backwards} frames with a time before the last, taken as of that time")
    return notes
