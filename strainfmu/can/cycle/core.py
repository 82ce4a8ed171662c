"""The core of the bridge without threads and sockets: frames and times in, results out, each frame accounted for.

Results follow from the frames, their times of reception and the times to which the core is advanced. So a
recording gives the results of the live run again.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from strainfmu.can.cycle.estimate.result import CycleResult
from strainfmu.can.cycle.estimate.step import EstimatorStep
from strainfmu.can.cycle.estimate.taring import Taring
from strainfmu.can.cycle.frames.account import FrameAccount, FrameClass
from strainfmu.can.cycle.frames.assembler import Arrival, Cycle, Verdict
from strainfmu.can.cycle.frames.own_frames import OwnFrames, own_frames
from strainfmu.can.cycle.frames.sender_period import SenderPeriod
from strainfmu.can.cycle.judgement import CycleJudge
from strainfmu.can.cycle.parts import CycleParts, cycle_parts
from strainfmu.can.cycle.states.bus_state import BusState, state_after
from strainfmu.can.cycle.states.quality import Cause, Quality
from strainfmu.can.e2e.authentication import Authentication
from strainfmu.can.settings import BridgeSettings
from strainfmu.can.wire.compiled import ARRAY, INTEGER, Record, function, pointer
from strainfmu.can.wire.frame import Frame
from strainfmu.can.wire.frame_layout import DYNAMIC_PRESSURE, InputLayout
from strainfmu.can.wire.profiles import LARGEST_DYNAMIC_PRESSURE
from strainfmu.cosim.estimators.step import Step, needs_pressure, noise_of, sensor_range_of
from strainfmu.errors import InputError

_CATCH_UP = 10
"""Maximum number of status results in one call after the bridge itself stood still."""

_KEPT_SKIPS = 10_000

_ACCEPTED, _NOTHING = Verdict.ACCEPTED, Cause.NONE

_DUE, _SHED, _USED, _PENDING, _COMPLETE, _REFUSED = 0, 2, 3, 16, 20, 32
"""Events of strainbus.h: nothing before another thing; shed; of flow; in a cycle; its last; by its check."""

_CLASSES = {
    1: FrameClass.WRONG_FORMAT,
    _SHED: FrameClass.SHED,
    _USED: FrameClass.USED,
    4: FrameClass.NOT_USABLE,
    5: FrameClass.NOT_TRUSTED,
}
"""Class of a frame by the other events."""


class PortRecord(Record):
    """Where the frames of one identifier go in compiled code."""

    position = 15
    _fields_ = (
        ("bucket", ARRAY),
        ("slot", ARRAY),
        ("index", INTEGER),
        ("assembler", ARRAY),
        ("flow", ARRAY),
        ("is_strain", INTEGER),
        ("next_status", ARRAY),
    )


_REFUSALS, _REFUSALS_PER_CYCLE = 20.0, 2.0
"""Results without coefficients at once, and per cycle for long: a babbling input gets no babbling answer."""


class BridgeCore:
    """One layout of input frames in front of one estimator.

    Parameters
    ----------
    layout : the frames of the input.
    settings : limits and times.
    start : local monotonic clock [s] at the start.
    parts : of that layout.
    judge : of the same parts.
    """

    def __init__(
        self, layout: InputLayout, settings: BridgeSettings, *, start: float, parts: CycleParts, judge: CycleJudge
    ) -> None:
        self.layout, self.settings = layout, settings
        self.account = FrameAccount()
        self.bus_state = BusState.ERROR_ACTIVE
        # Two facts that a replay needs and that do not follow from frames and their times. Status results that
        # were passed over: pairs of the time at which the first was due and the time advanced to [s].
        self.skips: list[tuple[float, float]] = []
        # Frames in a row that were not to be answered: times of the first and the last [s].
        self.unanswered: list[tuple[float, float]] = []
        self._skipping = False
        self.own_frames = parts.own
        self._acceptance, self._reception = parts.acceptance, parts.reception
        self._assembler, self._judge = parts.assembler, judge
        self._held_slots = frozenset(layout.held_slots)
        self.taring = parts.taring
        self._command_slot = -1 if layout.command is None else len(layout.frames) - 1
        n_strain = len(layout.strain_frames)
        self._cycle_slots = frozenset(range(n_strain + (layout.trailer is not None))) - self._held_slots
        self._noted = Cause.NONE
        self._other_bridge = -float("inf")
        self._alarm, self._timeout = (
            settings.alarm_cycles * layout.cycle_time,
            settings.timeout * layout.cycle_time,
        )
        self._last_cycle = start
        self._refusals, self._last_refill = _REFUSALS, start
        # Time of the present frame, and when silence is to be answered [s]: compiled code compares both.
        self._kept_times = np.array([start, start + self._timeout])
        self._times: Any = self._kept_times.data
        self._at_time, self._receive = pointer(self._kept_times), function("sb_receive", PortRecord)
        self._kept_ports = self._new_ports(parts)
        self._ports = {key: pointer(port) for key, port in self._kept_ports.items()}

    def _new_ports(self, parts: CycleParts) -> dict[int, PortRecord]:
        """Return where compiled code takes frames in, by key; others come by :meth:`_take`."""
        layout, slots, n_strain = self.layout, parts.reception.slots, len(self.layout.strain_frames)
        return {
            key: PortRecord(
                bucket=parts.acceptance.buckets[key],
                slot=slots[slot],
                index=slot,
                assembler=parts.assembler.record,
                flow=None if slot < n_strain else parts.flow.record_of(layout.frames[slot]),
                is_strain=slot < n_strain,
                next_status=self._kept_times[1:],
            )
            for key, slot in parts.reception.direct_slots().items()
            if slot != self._command_slot and key in parts.acceptance.buckets
        }

    # --- frames and time in -----------------------------------------------------------------------------------

    def receive(self, frame: Frame, is_answered: bool = True) -> list[CycleResult]:
        """Take in one frame; return the results that are ready with it, in order.

        A cycle that ends with it while ``is_answered`` is False has no result, because there is no time for one:
        its counters and CRCs are checked, so that later cycles are trusted, but the estimator is not stepped.
        """
        time, port = frame.time, self._ports.get(frame.key)
        if not is_answered or self._skipping:
            self._remember(time, is_answered)
        if port is None or frame.is_error or frame.is_remote:
            return self._take(frame, is_answered)
        self._times[0] = time
        data, account, results = frame.data, self.account, []
        event = self._receive(port, self._at_time, data, len(data), frame.is_fd)
        if event == _DUE:
            results = self.advance(time)
            self._times[0] = time
            event = self._receive(port, self._at_time, data, len(data), frame.is_fd)
        account.received += 1
        if event == _PENDING:
            account.pending += 1
        elif event == _COMPLETE:
            account.pending += 1
            results += self._close(self._assembler.closed_one(), time, is_answered)
        elif event == _USED:
            account.settle(FrameClass.USED, time)
        elif event >= _REFUSED:
            account.settle(self._refused(frame, self._reception.refused(frame, event - _REFUSED)), time)
        elif event > _PENDING:
            verdict, closed = self._assembler.outcome(event - _PENDING)
            results += self._offered(frame, verdict, closed, is_answered)
        else:
            account.settle(_CLASSES[event], time)
            if event == _SHED:
                self.note(Cause.OVERLOAD)
        return results

    def _take(self, frame: Frame, is_answered: bool) -> list[CycleResult]:
        """Take in one frame part by part, which compiled code does not take in at once."""
        time = frame.time
        results = self.advance(time)
        self.account.received += 1
        refused = self._acceptance.refused(frame)
        if refused is None:
            arrival = self._reception.take(frame)
            if type(arrival) is Arrival and arrival.slot in self._cycle_slots:
                return results + self._offered(frame, *self._assembler.offer(arrival), is_answered)
            self._hold(self._refused(frame, arrival) if isinstance(arrival, FrameClass) else arrival, time)
            return results
        self.account.refuse(refused, frame.key, time)
        if refused is FrameClass.ERROR_FRAME:
            self.bus_state = state_after(self.bus_state, frame)
            if self.bus_state is not BusState.ERROR_ACTIVE:
                self.note(Cause.BUS)
        elif refused is FrameClass.SHED:
            self.note(Cause.OVERLOAD)
        elif refused is FrameClass.SECOND_BRIDGE:
            self._other_bridge = time
        return results

    def advance(self, now: float) -> list[CycleResult]:
        """Return the results due by ``now`` [s]: of cycles at their deadline, and of silence."""
        if now < self.next_event:
            return []
        results = []
        while True:
            deadline, next_status = self._assembler.deadline, self._times[1]
            if deadline <= min(now, next_status):
                results += self._close(self._assembler.due(deadline), deadline, is_answered=True)
            elif next_status <= now:
                results += self._be_silent(now)
            else:
                return results

    def pass_gap(self, end: float) -> CycleResult:
        """Return the last result of a silence up to ``end`` [s]; the next status is due a cycle later."""
        result = self.advance(end)[-1]
        self._times[1] = end + self.layout.cycle_time
        return result

    @property
    def next_event(self) -> float:
        """Latest time at which :meth:`advance` has something to do [s]."""
        return min(self._times[1], self._assembler.deadline)

    def note(self, cause: Cause) -> None:
        """Put ``cause`` into the next result, for what the core cannot observe, such as a full queue."""
        self._noted |= cause

    def confirm_sender(self) -> None:
        """Take the sender for proven, and its present delay for the smallest: somebody has checked both."""
        self._judge.confirm_sender()

    def restart(self, now: float) -> None:
        """Start again after the bus was reopened: nothing is trusted before it has proven itself."""
        self.finish(now)
        self._judge.forget_sender()
        self.bus_state = BusState.ERROR_ACTIVE
        self.note(Cause.BUS)

    def finish(self, now: float) -> None:
        """Settle the frames of an open cycle at the end."""
        for cycle in self._assembler.reset():
            for _ in range(cycle.n):
                self._settle(FrameClass.UNFINISHED, now)

    @property
    def authentication(self) -> Authentication | None:
        """The check of the authenticators, None if frames have none."""
        return self._reception.authentication

    @property
    def drift_ppm(self) -> float:
        """How much slower than ours the sender's clock runs [ppm]; NaN if not known."""
        return self._judge.drift_ppm

    @property
    def period(self) -> SenderPeriod:
        """The period of the sender, measured."""
        return self._judge.period

    def _remember(self, time: float, is_answered: bool) -> None:
        """Keep the intervals in which frames were not to be answered."""
        if is_answered:
            self._skipping = False
        elif self._skipping:
            self.unanswered[-1] = self.unanswered[-1][0], time
        elif len(self.unanswered) < _KEPT_SKIPS:
            self.unanswered.append((time, time))
            self._skipping = True

    # --- one frame --------------------------------------------------------------------------------------------

    def _hold(self, arrival: Arrival | FrameClass, time: float) -> None:
        """Hold what a frame that is in no cycle says, such as flow or navigation; settle it, or a refused one."""
        if isinstance(arrival, FrameClass):
            kind = arrival
            if kind is FrameClass.NOT_AUTHENTIC or kind is FrameClass.NOT_FRESH:
                self.note(Cause.NOT_AUTHENTIC)
        elif arrival.slot in self._held_slots:
            kind = self._judge.take_held(arrival)
        elif arrival.slot == self._command_slot:
            kind = self._judge.take_command(arrival)
        else:
            kind = self._judge.take_flow(arrival)
        self.account.settle(kind, time)

    def _refused(self, frame: Frame, kind: FrameClass) -> FrameClass:
        """Remember the strains of a refused frame, if it is one of the sender; return its class ``kind``."""
        if kind is FrameClass.WRONG_SEQUENCE:
            self._judge.remember(frame)
        return kind

    def _offered(
        self, frame: Frame, verdict: Verdict, closed: list[Cycle], is_answered: bool
    ) -> list[CycleResult]:
        """Note what became of a frame of a cycle; return the results of the cycles that it ends."""
        time = frame.time
        if verdict is not _ACCEPTED:
            if verdict is Verdict.LATE or verdict is Verdict.REPEATED:
                if verdict is Verdict.LATE:
                    self._judge.remember(frame)
                self.account.settle(FrameClass.LATE if verdict is Verdict.LATE else FrameClass.REPEATED, time)
                return []
            self._judge.forget_sender()
            self.note(Cause.CLOCK_JUMP)
        self.account.pending += 1
        return self._close(closed, time, is_answered) if closed else []

    # --- one cycle --------------------------------------------------------------------------------------------

    def _close(self, cycles: Iterable[Cycle], now: float, is_answered: bool) -> list[CycleResult]:
        """Turn closed cycles into results, or skip them."""
        results = []
        for cycle in cycles:
            self._last_cycle = now
            self._judge.keep_pace(cycle)
            self._times[1] = now + self._timeout
            if not is_answered:
                self._skip(cycle)
                continue
            result = self._result_of(cycle, now)
            if result.quality.has_coefficients or self._may_refuse(now):
                results.append(result)
            else:
                # The next result does not repeat why this cycle was refused, only what degrades the next one too.
                self.note(result.causes & (Cause.OVERLOAD | Cause.BUS))
        return results

    def _may_refuse(self, now: float) -> bool:
        """Take a token for a result without coefficients; return False if there is none left."""
        cycles = max(now - self._last_refill, 0.0) / self.layout.cycle_time
        self._last_refill = now
        self._refusals = min(self._refusals + cycles * _REFUSALS_PER_CYCLE, _REFUSALS)
        if self._refusals < 1.0:
            return False
        self._refusals -= 1.0
        return True

    def _result_of(self, cycle: Cycle, now: float) -> CycleResult:
        """Have a closed cycle judged, and settle its frames."""
        noted = self._take_noted(now)
        result, classes = self._judge.judge(cycle, now, noted)
        if isinstance(classes, FrameClass):
            account, n_frames = self.account, cycle.n
            account.pending -= n_frames
            account.settle(classes, cycle.first_time, n_frames, cycle.time_of_last)
            return result
        for slot, kind in zip(cycle.slots, classes, strict=True):
            self._settle(kind, cycle.time_of(slot))
        return result

    def _take_noted(self, now: float) -> Cause:
        """Return the causes noted since the last result, and those that last."""
        noted, self._noted = self._noted, _NOTHING
        if now - self._other_bridge <= self._alarm:
            noted |= Cause.SECOND_BRIDGE
        return noted

    def _skip(self, cycle: Cycle) -> None:
        """Check a closed cycle, and settle its frames without an answer."""
        refused = self._judge.pass_over(cycle)
        for slot in cycle.slots:
            self._settle(refused or FrameClass.SKIPPED, cycle.time_of(slot))
        self.note(Cause.OVERLOAD)

    def _settle(self, kind: FrameClass, time: float) -> None:
        """Put one frame of a cycle into its class."""
        self.account.pending -= 1
        self.account.settle(kind, time)

    # --- silence ----------------------------------------------------------------------------------------------

    def _be_silent(self, now: float) -> list[CycleResult]:
        """Answer the next cycle in which nothing came."""
        time, period = self._times[1], self.layout.cycle_time
        # After the bridge itself stood still, a status for every cycle of that time is useless.
        behind = int((now - time) / period) - _CATCH_UP
        if behind > 0 and len(self.skips) < _KEPT_SKIPS:
            self.skips.append((time, now))
        time += max(behind, 0) * period
        self._times[1] = time + period
        return self._answer_silence(time)

    def _answer_silence(self, time: float) -> list[CycleResult]:
        """Return the status at ``time`` [s] of a cycle in which nothing came."""
        self._reception.miss_cycle()
        silent = time - self._last_cycle
        is_short = silent <= self.settings.invalid_after * self.layout.cycle_time
        quality = Quality.STALE if is_short else Quality.INVALID
        causes = self._take_noted(time) | Cause.SILENT
        return [self._judge.silence(time, quality if self._judge.has_published else Quality.NO_DATA, causes)]


def bridge_core(
    layout: InputLayout,
    step: Step,
    settings: BridgeSettings,
    *,
    start: float,
    own_keys: OwnFrames | Iterable[int] = (),
    dynamic_pressure: float | None = None,
    taring: Taring | None = None,
) -> BridgeCore:
    """Return a core for ``layout`` in front of the estimator ``step``.

    Parameters
    ----------
    settings : limits and times.
    start : local monotonic clock [s] at the start.
    own_keys : keys of the frames that the bridge sends, or these frames.
    dynamic_pressure : q_inf of the whole run [Pa], or None to take it from its frame.
    taring : takes the zeros of the gauges on command; None where that is not allowed.

    Raises
    ------
    InputError
        The layout has no frame of q_inf, none is given, and the estimator needs it; or own identifiers are among
        the input's.
    """
    own = own_frames(own_keys)
    settings = replace(settings, sensor_range=min(settings.sensor_range, sensor_range_of(step)))
    _check_input(layout, own.keys, dynamic_pressure, is_needed=needs_pressure(step))
    noise_std = noise_of(step) if settings.gauge_noise is None else settings.gauge_noise
    parts = cycle_parts(layout, settings, own=own, dynamic_pressure=dynamic_pressure, noise_std=noise_std)
    parts = replace(parts, taring=taring)
    judge = CycleJudge(layout, EstimatorStep(layout, step), settings=settings, parts=parts)
    return BridgeCore(layout, settings, start=start, parts=parts, judge=judge)


def _check_input(
    layout: InputLayout, own_keys: frozenset[int], dynamic_pressure: float | None, *, is_needed: bool
) -> None:
    """Refuse an input that cannot work; ``is_needed`` says whether the estimator needs q_inf."""
    if layout.frame_of(DYNAMIC_PRESSURE) is None and dynamic_pressure is None and is_needed:
        raise InputError(f"{layout.name}: no frame holds the dynamic pressure; state it by --dynamic-pressure")
    if dynamic_pressure is not None and not 0.0 < dynamic_pressure <= LARGEST_DYNAMIC_PRESSURE:
        raise InputError(
            f"dynamic pressure: expected a positive number up to {LARGEST_DYNAMIC_PRESSURE:g} Pa, "
            f"got {dynamic_pressure:g} Pa"
        )
    common = own_keys & {frame.layout.key for frame in layout.frames}
    if common:
        raise InputError(
            f"identifier 0x{min(common) & 0x1FFFFFFF:X}: is both input and result; choose another base"
        )
