"""The state machine of the input: frames and times in, results out; no threads, no sockets, no clock of its own.

The machine is compiled; ``fmus/native/bus/bus.h`` documents it. Here are its plan, the estimator that it asks for
the loads of a cycle, and what of a frame Python must look at: its authenticator, and whether a result frame is an
own one.
"""

from __future__ import annotations

import ctypes
import struct
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from math import isfinite, nan
from typing import Any

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.can.authentic import Authentication, Authenticity
from strainfmu.can.frame import EXTENDED_FLAG, Frame
from strainfmu.can.frame_layout import ALTITUDE, DYNAMIC_PRESSURE, MACH_NUMBER, NAVIGATION, InputLayout
from strainfmu.can.options import BridgeSettings
from strainfmu.can.plan import Plan
from strainfmu.can.profiles import LARGEST_DYNAMIC_PRESSURE
from strainfmu.can.quality import (
    LISTED_IDENTIFIERS,
    NUMBER_OF,
    REASONS,
    BusState,
    Cause,
    FrameAccount,
    FrameClass,
    Quality,
    account_of,
    state_after,
)
from strainfmu.can.signals import ACCOUNT, PLACES, RESULT, functions, pointer
from strainfmu.cosim.estimators.step import (
    ENVELOPE_SCORE,
    Step,
    StepRefused,
    needs_pressure,
    noise_of,
    other_inputs,
    sensor_range_of,
    takes_mask,
)
from strainfmu.errors import InputError
from strainfmu.estimator.health import HealthState

_TAKEN, _READY, _AGAIN, _AUTHENTICATE = range(4)
"""What a frame brings, in the order of bus.h."""

_FD = 1
_VERDICTS = {Authenticity.AUTHENTIC: 2, Authenticity.FORGED: 4, Authenticity.NOT_FRESH: 8}
"""Flags of bus.h."""

_KEPT_STALLS = 10_000

_LONGEST_STEP = 100
"""Maximum number of cycles in one step of the estimator."""

_NO_COEFFICIENTS = int(HealthState.NO_COEFFICIENTS)

_REMEMBERED = 200
"""Sent frames of an identifier that may still come back: fewer than their counter has values."""

_QUALITIES = tuple(Quality)
_NOTHING = np.full(5, nan)
_NOTHING.setflags(write=False)


@dataclass(slots=True, kw_only=True, eq=False)
class Result:
    """One published result.

    Attributes
    ----------
    time : at which it was ready, local monotonic clock [s].
    quality, causes : how far to trust it, and what limits that.
    usable : loads may be used with their standard deviations.
    valid : (n_d,) gauges that were used.
    strain : (n_d,) strains that were used [m/m]; NaN where not valid.
    reasons : (n_d,) why a gauge is not used, places in ``quality.REASONS``.
    dynamic_pressure : q_inf that was used [Pa], or NaN.
    mach_number, altitude : by navigation at ``time`` [1] and [m], NaN where not known.
    other_inputs : what else of the flow was used, by name of the estimator's input, NaN where not known:
        temperatures [K], readings of auxiliary sensors, thrust [N], flow parameters, their standard deviations.
    age : of the strains at ``time`` [s]; NaN if there are none.
    age_uncertainty : by how much they may be older [s]; NaN if nothing dates them.
    held : by how much the oldest strains that are held are older than the cycle's own [s]; a part of the age.
    sample_time : sender's clock at the sample [ticks], None if not known.
    counter : E2E counter of the cycle it answers, None if not known.
    coefficients, coefficients_std, chi_square, health : the estimate; NaN and None without one.
    arrival : of the last frame of the cycle [s], NaN of a status without frames.
    gap : how long nothing came, of the one result of a gap in a log [s]; NaN of all others.
    other_outputs : other outputs of the estimator that were asked for, by name; none without an estimate.
    """

    time: float
    quality: Quality
    causes: Cause
    valid: BoolArray
    strain: FloatArray
    usable: bool = False
    reasons: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=np.uint8))
    dynamic_pressure: float = nan
    mach_number: float = nan
    altitude: float = nan
    other_inputs: Mapping[str, float] = field(default_factory=dict)
    age: float = nan
    age_uncertainty: float = nan
    held: float = 0.0
    sample_time: int | None = None
    counter: int | None = None
    coefficients: FloatArray = field(default_factory=lambda: _NOTHING)
    coefficients_std: FloatArray = field(default_factory=lambda: _NOTHING)
    chi_square: float = nan
    health: int | None = None
    arrival: float = nan
    gap: float = nan
    other_outputs: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not len(self.reasons):
            self.reasons = np.zeros(len(self.strain), dtype=np.uint8)

    @property
    def envelope_score(self) -> float:
        """Standard deviations by which the coefficients leave what the map covers [1]; NaN if not known."""
        return self.other_outputs.get(ENVELOPE_SCORE, nan)

    def gauge_reasons(self) -> list[str]:
        """Return why each gauge is not used, in words; "" for those that are."""
        return [REASONS[reason] for reason in self.reasons.tolist()]


class OwnFrames:
    """The bridge's own frames as they come back, known by their content. Each may come back once.

    Parameters
    ----------
    keys : of the frames that the bridge sends.

    Attributes
    ----------
    returned : number of those that have come back.
    """

    def __init__(self, keys: Iterable[int]) -> None:
        self.keys = frozenset(keys)
        self.by_identifier = False
        """Take every frame with one of the keys for an own one, as in a log that does not mark own frames."""
        self._sent: dict[int, deque[bytes]] = {key: deque(maxlen=_REMEMBERED) for key in self.keys}
        self.returned = 0

    def sending(self, frame: Frame) -> None:
        """Remember a frame that is about to be sent."""
        self._sent[frame.key].append(frame.data)

    def comes_back(self, frame: Frame) -> bool:
        """Return whether a received frame with one of the keys is one that was sent."""
        if not self.by_identifier:
            try:
                self._sent[frame.key].remove(frame.data)
            except ValueError:
                return False
        self.returned += 1
        return True


class Machine:
    """Frames and times in, results out; every frame in exactly one class of :attr:`account`.

    Parameters
    ----------
    layout : frames of the input.
    step : the estimator.
    settings : limits and times; the estimator's range of strain holds where it is smaller.
    start : local monotonic clock [s] at the start.
    own : keys of the frames that the bridge sends.
    dynamic_pressure : q_inf of the whole run [Pa], or None to take it from its frame.
    is_answered, counters : as of :class:`~strainfmu.can.plan.Plan`.
    now : local clock at the time of sending [s]; None: results are sent when they are ready, as in a replay.

    Attributes
    ----------
    authentication : checks authenticators, by slot of the plan; None where frames have none.

    Raises
    ------
    InputError
        No frame holds the dynamic pressure, none is given, and the estimator needs it; own identifiers are among
        the input's; or frames are authenticated, and there is no key.
    """

    def __init__(
        self,
        layout: InputLayout,
        step: Step,
        settings: BridgeSettings,
        *,
        start: float,
        own: Iterable[int] = (),
        dynamic_pressure: float | None = None,
        is_answered: bool = True,
        counters: tuple[int, int] = (0, 256),
        now: Callable[[], float] | None = None,
    ) -> None:
        self.own = OwnFrames(own)
        _check_input(layout, step, self.own.keys, dynamic_pressure)
        library = functions()
        plan = Plan(
            layout,
            replace(settings, sensor_range=min(settings.sensor_range, sensor_range_of(step))),
            dynamic_pressure=dynamic_pressure,
            noise_std=noise_of(step),
            is_answered=is_answered,
            counters=counters,
        )
        self.layout, self.plan, self.start = layout, plan, start
        self.bus_state = BusState.ERROR_ACTIVE
        self.authentication: Authentication | None = None
        if layout.is_authenticated and layout.key is not None:
            self.authentication = Authentication([frame.layout.secured for frame in plan.frames], layout.key)
        self._now, self._step = now, _Stepper(step, layout.cycle_time)
        self._needs_pressure, self._constants = needs_pressure(step), dict(layout.constants)
        self._state = np.zeros(library.sb_size(pointer(plan.record)) // 8 + 1)
        self._at = pointer(plan.record), pointer(self._state)
        library.sb_begin(*self._at, ctypes.c_double(start))
        bytes_of = self._state.view(np.uint8)
        offset, n, n_flow = PLACES["parts"], layout.n_gauges, len(plan.quantities)
        parts = bytes_of[offset : offset + 32].view(np.int32).tolist()

        def part(place: int, kind: Any, count: int) -> Any:
            return bytes_of[place : place + np.dtype(kind).itemsize * count].view(kind)

        # In a quarter of the time that numpy takes for a record.
        fields = struct.Struct("".join(RESULT[name].char for name in RESULT.names or ()))
        self._result = partial(fields.unpack_from, part(PLACES["result"], np.uint8, RESULT.itemsize).data)
        self._account = part(PLACES["account"], ACCOUNT, 1)
        self._flow, self._strain = part(parts[3], np.float64, n_flow), part(parts[4], np.float64, n)
        self._valid, self._reason = part(parts[5], np.bool_, n), part(parts[6], np.uint8, n)
        # Deadline of the open cycle, time of the next result of silence, measured period [s].
        self._times: Any = self._state[:3].data
        self._flags = bytes_of[24:32].view(np.int32)  # the period is wrong; cycles are skipped
        self._time = ctypes.c_double()
        self._at_time = ctypes.byref(self._time)
        self._take, self._due, self._answer = library.sb_take, library.sb_due, library.sb_answer
        self._library, self._slots = library, plan.slots
        self._every = np.ones(n, dtype=bool)
        self._every.setflags(write=False)
        self._unknown: dict[int, int] = {}
        self.heard = set[int]()
        """First slots of the identifiers that have come."""
        self.stalls: list[tuple[float, float]] = []
        """Times without a call, whose status results were passed over: when the first was due; the call [s]."""
        self._fixed = nan if plan.dynamic_pressure is None else plan.dynamic_pressure
        self.on_cycle: Callable[[Result, float, int], Cause] | None = None
        """Called with a result, the q_inf that the bus states [Pa] and the number of the last command (-1 for
        none), before the result is published; returns causes for it."""

    # --- frames and time in --------------------------------------------------------------------------------------

    def receive(self, frame: Frame) -> list[Result]:
        """Take in one frame; return the results that are ready with it, in order."""
        arrival, data, times = frame.time, frame.data, self._times
        slot = self._slots.get(frame.key)
        results = self.advance(arrival) if times[0] <= arrival or times[1] <= arrival else []
        if slot is None or frame.is_error or frame.is_remote:
            self._refuse(frame)
            return results
        self.heard.add(slot)
        time, flags = self._time, _FD if frame.is_fd else 0
        time.value = arrival
        while True:
            event = self._take(*self._at, slot, self._at_time, data, len(data), flags)
            if event == _TAKEN:
                return results
            if event == _AUTHENTICATE:
                assert self.authentication is not None
                flags |= _VERDICTS[self.authentication.check(slot, data)]
                continue
            self._publish(results)
            if event == _READY:
                return results
            time.value = arrival

    def advance(self, now: float) -> list[Result]:
        """Return the results due by ``now`` [s]: of cycles at their deadline, and of silence."""
        results: list[Result] = []
        while (due := self.next_event) <= now:
            self._time.value = now
            if self._due(*self._at, self._at_time) == _READY:
                if self._result()[0] > due and len(self.stalls) < _KEPT_STALLS:
                    self.stalls.append((due, now))
                self._publish(results)
        return results

    def pass_gap(self, end: float) -> Result:
        """Return the last result of a silence up to ``end`` [s]; the next status is due a cycle later."""
        result = self.advance(end)[-1]
        self._times[1] = end + self.layout.cycle_time
        return result

    @property
    def next_event(self) -> float:
        """Latest time at which :meth:`advance` has something to do [s]."""
        deadline: float = self._times[0]
        silence: float = self._times[1]
        return min(deadline, silence)

    def skip(self, is_skipping: bool) -> None:
        """Settle cycles that end without an answer from now on, or answer them again."""
        self._flags[1] = is_skipping

    def note(self, cause: Cause) -> None:
        """Put ``cause`` into the next result, for what the machine cannot observe, such as a full queue."""
        self._library.sb_note(self._at[1], int(cause))

    def confirm(self) -> None:
        """Take the sender for proven, and its present delay for the smallest: somebody has checked both."""
        self._library.sb_confirm(*self._at)

    def restart(self, now: float) -> None:
        """Start again after the bus was reopened: nothing is trusted before it has proven itself."""
        self._library.sb_restart(*self._at, ctypes.c_double(now))
        self.bus_state = BusState.ERROR_ACTIVE

    def finish(self, now: float) -> None:
        """Settle the frames of an open cycle at the end [s]."""
        self._library.sb_finish(*self._at, ctypes.c_double(now))

    def count(self, kind: FrameClass, time: float, number: int = 1) -> None:
        """Account for frames that are not taken in, such as those that a full queue dropped at ``time`` [s]."""
        for _ in range(number):
            self._library.sb_count(self._at[1], NUMBER_OF[kind], ctypes.c_double(time))

    @property
    def account(self) -> FrameAccount:
        """The frames so far."""
        return account_of(self._account[0], self._unknown)

    @property
    def period_text(self) -> str:
        """The sender's period in words, "" before it is measured."""
        measured, expected = self._times[2], self.layout.cycle_time
        if not isfinite(measured):
            return ""
        if self._flags[0]:
            return f"period: expected {1e3 * expected:.4g} ms, measured {1e3 * measured:.3g} ms"
        return f"period: measured {1e3 * measured:.3g} ms, as expected"

    def frames_text(self) -> str:
        """Return which of the expected frames have come, in words."""
        names = dict[int, list[str]]()
        for frame in self.plan.frames:
            frame_layout = frame.layout
            names.setdefault(self._slots[frame_layout.key], []).append(
                f"0x{frame_layout.identifier:X} {frame_layout.name}"
            )
        heard = sum(len(frame_names) for slot, frame_names in names.items() if slot in self.heard)
        missing = [name for slot, frame_names in names.items() if slot not in self.heard for name in frame_names]
        return f"expected frames: {heard} heard; never heard: {', '.join(missing) or 'none'}"

    # --- one frame, one result -----------------------------------------------------------------------------------

    def _refuse(self, frame: Frame) -> None:
        """Account for a frame that is no data frame of the input."""
        key, time = frame.key, frame.time
        if frame.is_error:
            kind = FrameClass.ERROR_FRAME
            self.bus_state = state_after(self.bus_state, frame)
            if self.bus_state is not BusState.ERROR_ACTIVE:
                self.note(Cause.BUS)
        elif key in self.own.keys:
            kind = FrameClass.OWN if self.own.comes_back(frame) else FrameClass.SECOND_BRIDGE
            if kind is FrameClass.SECOND_BRIDGE:
                self._library.sb_note_bridge(self._at[1], ctypes.c_double(time + self.plan.bridge_alarm))
        elif key in self._slots:
            kind = FrameClass.REMOTE_FRAME
        elif key ^ EXTENDED_FLAG in self._slots:
            kind = FrameClass.WRONG_FORMAT
        else:
            kind = FrameClass.UNKNOWN_IDENTIFIER
            if key in self._unknown or len(self._unknown) < LISTED_IDENTIFIERS:
                self._unknown[key] = self._unknown.get(key, 0) + 1
        self._library.sb_count(self._at[1], NUMBER_OF[kind], ctypes.c_double(time))

    def _publish(self, results: list[Result]) -> None:
        """Have the estimator answer the result that is ready; add it to ``results`` unless it is held back."""
        time, arrival, _, _, _, stated, sample_time, counter, silent, n_used, *_, request = self._result()
        strain, reasons = self._strain.copy(), self._reason.copy()
        valid = self._every if n_used == len(strain) else self._valid.copy()
        known = dict(zip(self.plan.quantities, self._flow.tolist(), strict=True)) | self._constants
        on_bus = known.pop(DYNAMIC_PRESSURE, nan)
        pressure = on_bus if self._fixed != self._fixed else self._fixed
        navigation = {name: known.pop(name, nan) for name in NAVIGATION}
        step, is_finite, health = None, False, -1
        if n_used:
            step = self._step(strain, pressure, navigation, known, valid, time)
        if step is not None:
            health = _NO_COEFFICIENTS if self._needs_pressure and pressure != pressure else step.health
            is_finite = _is_finite(step)
        self._time.value = time if self._now is None else max(self._now(), time)
        is_sent = self._answer(*self._at, self._at_time, health, is_finite)
        time, arrival, age, uncertainty, lag, *_, causes, quality, usable, _ = self._result()
        result = _new(Result)
        result.time, result.quality = time, _QUALITIES[quality]
        result.causes = Cause(causes) if causes else Cause.NONE
        result.usable, result.valid, result.strain, result.reasons = usable != 0, valid, strain, reasons
        result.dynamic_pressure = pressure if not silent else nan
        result.mach_number, result.altitude = navigation[MACH_NUMBER], navigation[ALTITUDE]
        result.other_inputs, result.gap = known, nan
        result.age, result.age_uncertainty, result.held, result.arrival = age, uncertainty, lag, arrival
        result.sample_time = None if sample_time < 0 else sample_time
        result.counter = None if counter < 0 else counter
        result.chi_square, result.health, result.other_outputs = nan, None, {}
        result.coefficients = result.coefficients_std = _NOTHING
        if step is not None:
            result.chi_square, result.health = step.chi_square, step.health
            result.other_outputs = step.other_outputs
            if result.quality.has_coefficients:
                result.coefficients, result.coefficients_std = step.coefficients, step.coefficients_std
        if self.on_cycle is not None and not silent:
            result.causes |= self.on_cycle(result, stated, request)
        if is_sent:
            results.append(result)


_new = object.__new__


def _check_input(
    layout: InputLayout, step: Step, own_keys: frozenset[int], dynamic_pressure: float | None
) -> None:
    """Refuse an input without q_inf or key where one is needed, and identifiers of both input and results."""
    if layout.frame_of(DYNAMIC_PRESSURE) is None and dynamic_pressure is None and needs_pressure(step):
        raise InputError(f"{layout.name}: no frame holds the dynamic pressure; state it by --dynamic-pressure")
    if dynamic_pressure is not None and not 0.0 < dynamic_pressure <= LARGEST_DYNAMIC_PRESSURE:
        raise InputError(
            f"dynamic pressure: expected a positive number up to {LARGEST_DYNAMIC_PRESSURE:g} Pa, "
            f"got {dynamic_pressure:g} Pa"
        )
    if common := own_keys & {frame.layout.key for frame in layout.frames}:
        raise InputError(
            f"identifier 0x{min(common) & 0x1FFFFFFF:X}: is both input and result; choose another base"
        )
    if layout.is_authenticated and layout.key is None:
        raise InputError(f"{layout.name}: frames are authenticated, and no key is given: state it as input.key")


def _is_finite(step: Any) -> bool:
    """Return whether coefficients and their standard deviations are finite."""
    return all(map(isfinite, [*step.coefficients.tolist(), *step.coefficients_std.tolist()]))


class _Stepper:
    """Steps an estimator by whole cycles of ``period`` [s]."""

    def __init__(self, step: Step, period: float) -> None:
        self._step, self._period, self._takes_mask = step, period, takes_mask(step)
        self._navigation = tuple(name for name in NAVIGATION if name in other_inputs(step))
        self._last: float | None = None

    def __call__(
        self,
        strain: FloatArray,
        pressure: float,
        navigation: dict[str, float],
        other_inputs: dict[str, float],
        valid: BoolArray,
        now: float,
    ) -> Any:
        """Return the outputs at ``now`` [s], None if the estimator refused."""
        taken = {name: navigation[name] for name in self._navigation}
        mask = (valid.tobytes(),) if self._takes_mask else ()
        try:
            return self._step(strain, pressure, self._size(now), *mask, **other_inputs, **taken)
        except StepRefused:
            return None

    def _size(self, now: float) -> float:
        """Return the time since the last step [s], in whole cycles."""
        period, cycles = self._period, 1
        if self._last is not None:
            cycles = round((now - self._last) / period)
        self._last = now
        return period if cycles <= 1 else min(cycles, _LONGEST_STEP) * period
