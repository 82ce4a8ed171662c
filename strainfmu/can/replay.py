"""The replay of a log through the state machine of the live run, whose clock are the time stamps; its file."""

import hashlib
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from strainfmu.can.bus_file import BusDescription
from strainfmu.can.frame import Frame
from strainfmu.can.frame_layout import FrameLayout
from strainfmu.can.listener import ResultCounts
from strainfmu.can.log_description import load_description
from strainfmu.can.log_frames import LogState, log_frames
from strainfmu.can.machine import Machine, Result
from strainfmu.can.options import BridgeOptions
from strainfmu.can.quality import Cause
from strainfmu.can.setup import make_machine
from strainfmu.can.signals import SignalPlan
from strainfmu.cosim.estimators.source import LOAD_OUTPUTS, open_step
from strainfmu.cosim.estimators.step import Step, load_groups_of
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import AIR_INPUTS, DYNAMIC_PRESSURE, FLOW_QUANTITIES
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES
from strainfmu.estimator.other_loads import output_units
from strainfmu.interface.health_names import CHI_SQUARE, ENVELOPE_SCORE, STATE, USABLE
from strainfmu.recorded.outputs import (
    ESTIMATE_COLUMNS,
    PartsWriter,
    check_output,
    estimate_writer,
    other_outputs_of,
)
from strainfmu.recorded.run import Progress

File = str | PathLike[str]

_OF_THE_MOMENT = ("E2E_CRC", "Age")
"""Signals of a result that depend on when it was sent, which no replay knows."""

_AHEAD = 64
"""Frames of a log that are read ahead: a sent frame is logged after it has been sent."""

_LONGEST_GAP = 1000
"""Cycles without any frame in a log beyond which they have one result."""

_UNMATCHED = 10_000
"""Maximum number of result frames kept without a counterpart: a log without sent frames has none."""


@dataclass(kw_only=True, eq=False)
class ReplaySummary(ResultCounts):
    """Summary of a replay.

    Attributes
    ----------
    compared, equal : number of result frames in the log, and of those that the replay repeated bit by bit, except
        for the age at the time of sending and the CRC over it.
    notes : lines for the user.
    """

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
    on_result: Callable[[Result], None],
    progress: Progress | None = None,
) -> ReplaySummary:
    """Send the received frames of ``log`` through a machine; call ``on_result`` with every result.

    Parameters
    ----------
    source : file of the estimator, compared with the one of the recording.
    step, gauge_names : of the estimator.
    options : makes the options from the recording's, None if the log has no description next to it.

    Raises
    ------
    InputError
        The log is damaged, or holds no frame of the channel that is read.
    """
    described = load_description(log)
    chosen = options(None if described is None else described["options"])
    summary, state = ReplaySummary(), LogState()
    state.channel = chosen.log_channel
    frames = log_frames(log, 0.0 if described is None else described["log_start"], state=state, progress=progress)
    first = next(frames, None)
    if first is None:
        channels = ", ".join(sorted(state.channels))
        where = f" on bus.log_channel {state.channel}, but on {channels}" if channels else ""
        raise InputError(f"{log}: holds no frame{where}")
    start = first[0].time if described is None else described["start"]
    counter = 0 if described is None else described["first_result"]
    machine, layouts, configuration, _ = make_machine(step, chosen, gauge_names, start=start, first=counter)
    state.keys = frozenset(machine.plan.slots)
    if machine.authentication is not None:
        machine.authentication.begin(None if described is None else described["freshness"])
    machine.compose(layouts, configuration)
    comparison = _Comparison(layouts)
    # Other loggers do not state which frames the bridge sent.
    machine.own.by_identifier = described is None

    def give(results: list[Result]) -> None:
        for result in results:
            summary.add(result)
            comparison.replayed(result)
            on_result(result)

    time, gaps = start, _Gaps(machine)
    stalls = dict(described.get("skips", ())) if described else {}
    unanswered = deque(described.get("unanswered", ()) if described else ())
    for frame, is_received in _ahead(chain([first], frames), machine):
        give(gaps.passed(time, frame.time, stalls))
        time = frame.time
        if is_received:
            give(_advanced(machine, time, stalls))
            give(machine.receive(frame))
            while unanswered and unanswered[0][1] <= time:
                unanswered.popleft()
            machine.skip(bool(unanswered) and unanswered[0][0] <= time)
        else:
            comparison.logged(frame)
    end = time if described is None or described.get("end") is None else described["end"]
    give(gaps.passed(time, end, stalls))
    give(_advanced(machine, end, stalls))
    machine.finish(time)
    summary.duration = time - start
    summary.account = machine.account
    summary.compared, summary.equal = comparison.compared, comparison.equal
    summary.notes += [*_notes(log, source, state=state, described=described), *gaps.notes(log, start)]
    partial = sum(n for causes, n in summary.causes.items() if causes & Cause.PARTIAL_CYCLE)
    if not summary.results or 2 * partial > summary.causes.total():
        summary.notes.append(f"{log}: {machine.frames_text()}")
    return summary


def _ahead(frames: Iterable[tuple[Frame, bool]], machine: Machine) -> Iterator[tuple[Frame, bool]]:
    """Yield ``frames``; the machine has those that were sent a little ahead, as they may come back first."""
    waiting: deque[tuple[Frame, bool]] = deque()
    for frame, is_received in frames:
        if not is_received and frame.key in machine.own.keys:
            machine.own.sending(frame)
        waiting.append((frame, is_received))
        if len(waiting) > _AHEAD:
            yield waiting.popleft()
    yield from waiting


def _advanced(machine: Machine, time: float, stalls: dict[float, float]) -> list[Result]:
    """Advance event by event, as a live bridge does, except where it stood still (see ``Machine.stalls``)."""
    results = []
    while machine.next_event <= time:
        results += machine.advance(stalls.get(machine.next_event, machine.next_event))
    return results


class _Gaps:
    """Times without any frame, sent or received: what a live bridge says then every cycle is said once."""

    def __init__(self, machine: Machine) -> None:
        self._machine, self._begin = machine, float("nan")
        self._longest, self._number = 0.0, 0

    def passed(self, begin: float, end: float, stalls: dict[float, float]) -> list[Result]:
        """Return the results from ``begin`` to ``end`` [s], of successive frames, if it is a gap; else none.

        They are the results of the cycles before it, and one of the gap, with its length.
        """
        machine, period = self._machine, self._machine.layout.cycle_time
        if end - begin <= _LONGEST_GAP * period:
            return []
        self._number += 1
        if end - begin > self._longest:
            self._begin, self._longest = begin, end - begin
        results: list[Result] = []
        while not (results and results[-1].causes & Cause.SILENT):
            results += _advanced(machine, machine.next_event, stalls)
        row = machine.pass_gap(end)
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


class _Comparison:
    """Comparison of the result frames of the log with the result frames of the replay, in order."""

    def __init__(self, layouts: tuple[FrameLayout, ...]) -> None:
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

    def replayed(self, result: Result) -> None:
        for frame in result.frames:
            self._add(self._replayed, frame)

    def _add(self, side: dict[int, list[bytes]], frame: Frame) -> None:
        plan = self._plans.get(frame.key)
        if plan is None or len(frame.data) != plan.length:
            return
        if len(side[frame.key]) >= _UNMATCHED:
            return
        side[frame.key].append(frame.data)
        mine, replayed = self._logged[frame.key], self._replayed[frame.key]
        while mine and replayed:
            self.compared += 1
            raw = [plan.raw(data.pop(0))[self._kept[frame.key]] for data in (mine, replayed)]
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


LOG_COLUMNS = (
    *ESTIMATE_COLUMNS,
    ("quality", "1"),
    ("causes", "1"),
    ("age", "s"),
    ("counter", "1"),
    ("sample_time", "tick"),
    *(
        (air_input.name, air_input.unit)
        for air_input in AIR_INPUTS
        if air_input.name in FLOW_QUANTITIES and air_input.name != DYNAMIC_PRESSURE
    ),
    (ENVELOPE_SCORE, "1"),
    ("age_uncertainty", "s"),
    (USABLE, "1"),
    ("gap", "s"),
)
"""Columns of a replay's output; loads behind the five follow where the estimator gives them."""

_SIGMAS = tuple(f"sigma.{name}" for name in COEFFICIENT_NAMES)

_BLOCK = 2000


def replay_described(
    log: Path, source: File, output: File, described: BusDescription, progress: Progress | None
) -> ReplaySummary:
    """Replay a log; what ``described`` does not state is as in the recorded run."""

    def options(recorded: BridgeOptions | None) -> BridgeOptions:
        return described.options(recorded or BridgeOptions(interface="replay", channel=log.name))

    return estimate_log(Path(source), log, Path(output), options, progress)


def estimate_log(
    source: Path,
    log: Path,
    output: Path,
    options: Callable[[BridgeOptions | None], BridgeOptions],
    progress: Progress | None = None,
) -> ReplaySummary:
    """Replay ``log`` with the FMU or map ``source`` and write every result to ``output``; ``options`` as of
    :func:`replay_log`."""
    check_output(output)
    recorded = load_description(log)
    zeros = options(None if recorded is None else recorded["options"]).zeros
    with open_step(source, zeros, with_loads=True) as ready:
        output_columns = other_outputs_of(output_units(load_groups_of(ready.step)).items())
        with estimate_writer(output, (*LOG_COLUMNS, *output_columns.values())) as writer:
            rows = _Rows(writer, [*output_columns])
            summary = replay_log(
                log,
                source,
                step=ready.step,
                gauge_names=ready.gauge_names,
                options=options,
                on_result=rows.add,
                progress=progress,
            )
            rows.flush()
    return summary


class _Rows:
    """Collects results and writes them block by block, with the outputs ``others`` behind the other columns."""

    def __init__(self, writer: PartsWriter, output_names: Sequence[str]) -> None:
        self._writer, self._others = writer, output_names
        self._rows: list[list[float]] = []

    def add(self, result: Result) -> None:
        # A result without coefficients has no such loads.
        known = result.other_outputs if result.quality.has_coefficients else {}
        self._rows.append([*_row(result, known), *(known.get(name, float("nan")) for name in self._others)])
        if len(self._rows) == _BLOCK:
            self.flush()

    def flush(self) -> None:
        if self._rows:
            self._writer.write(np.array(self._rows).T)
            self._rows.clear()


def _row(result: Result, outputs: Mapping[str, float]) -> list[float]:
    """Return the values of :data:`LOG_COLUMNS`, NaN where there is none; loads are among the ``outputs``."""
    values: dict[str, float | None] = {
        "time": result.time,
        **{name: outputs.get(name) for name in LOAD_OUTPUTS},
        **dict(zip(COEFFICIENT_NAMES, result.coefficients.tolist(), strict=True)),
        **dict(zip(_SIGMAS, result.coefficients_std.tolist(), strict=True)),
        **{name: getattr(result, name) for name in FLOW_QUANTITIES},
        CHI_SQUARE: result.chi_square,
        STATE: result.health,
        "gauges_used": int(result.valid.sum()),
        "quality": int(result.quality),
        "causes": int(result.causes),
        "age": result.age,
        "counter": result.counter,
        "sample_time": result.sample_time,
        ENVELOPE_SCORE: result.envelope_score,
        "age_uncertainty": result.age_uncertainty,
        USABLE: float(result.usable),
        "gap": result.gap,
    }
    cells = (values[name] for name, _ in LOG_COLUMNS)
    return [float("nan") if value is None else value for value in cells]
