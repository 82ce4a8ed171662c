"""The state machine of the input: frames and times in, results out; no threads, no sockets, no clock of its own.

The machine is compiled; ``fmus/native/bus/bus.h`` documents it. Here are its plan, the estimator that it asks for
the loads of a cycle, and what of a frame Python must look at: its authenticator, and whether a result frame is an
own one.
"""

from __future__ import annotations

import ctypes
import struct
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import compress, product
from math import inf, isfinite, isnan, nan
from typing import Any

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.can.authentic import Authentication, Authenticity
from strainfmu.can.frame import EXTENDED_FLAG, FD_LENGTHS, LARGEST_IDENTIFIER, Frame, from_message
from strainfmu.can.frame_layout import DYNAMIC_PRESSURE, NAVIGATION, FrameLayout, InputLayout
from strainfmu.can.frame_queue import HEAD, IS_ERROR, FrameQueue, flags_of
from strainfmu.can.options import BridgeSettings
from strainfmu.can.plan import Plan
from strainfmu.can.profiles import LARGEST_DYNAMIC_PRESSURE
from strainfmu.can.quality import (
    LISTED_IDENTIFIERS,
    NUMBER_OF,
    BusState,
    Cause,
    FrameAccount,
    FrameClass,
    Quality,
    account_of,
    state_after,
)
from strainfmu.can.result_frames import FIRST_OTHER, OF_DETAIL, OF_RESULT, OF_STATUS, ResultFrames, output_names
from strainfmu.can.signals import ACCOUNT, BRIDGE, LOGGED, PLACES, RESULT, functions, pointer
from strainfmu.cosim.estimators.exchange import Record
from strainfmu.cosim.estimators.fmu_step import FmuStep
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
from strainfmu.estimator.core import library as library_of_estimator
from strainfmu.estimator.signal_names import COEFFICIENT_ARRAY, STRAIN

_TAKEN, _READY, _AGAIN, _AUTHENTICATE, _OTHER = range(5)
"""What a frame brings, in the order of bus.h and bridge.h."""

_KINDS = {
    flags: ((EXTENDED_FLAG if flags[0] else 0), sum(flag << place for place, flag in enumerate(flags[1:])))
    for flags in product((False, True), repeat=5)
}
"""Flag of the key and flags in the queue, by what python-can says of a message."""

_LONGEST = FD_LENGTHS[-1]
_ALONE, _WITH_DETAILS = (OF_RESULT,), (OF_RESULT, OF_DETAIL)

_VERDICTS = {Authenticity.AUTHENTIC: 2, Authenticity.FORGED: 4, Authenticity.NOT_FRESH: 8}
"""Flags of bus.h."""

_KEPT_STALLS = 10_000

_LONGEST_STEP = 100
"""Maximum number of cycles in one step of the estimator."""

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
    frames : that state it on the bus, where the machine composes any.
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
    frames: Sequence[Frame] = ()
    later: Callable[[Result], None] | None = None
    """Sets what is not set yet: few results are looked at in every part."""

    def __post_init__(self) -> None:
        if not len(self.reasons):
            self.reasons = np.zeros(len(self.strain), dtype=np.uint8)

    def __getattr__(self, name: str) -> Any:
        if name not in _SET_LATER or self.later is None:
            raise AttributeError(name)
        later, self.later = self.later, None
        later(self)
        return getattr(self, name)

    @property
    def envelope_score(self) -> float:
        """Standard deviations by which the coefficients leave what the map covers [1]; NaN if not known."""
        return self.other_outputs.get(ENVELOPE_SCORE, nan)


_SET_LATER = frozenset(
    ("valid", STRAIN, "reasons", "other_inputs", COEFFICIENT_ARRAY, f"{COEFFICIENT_ARRAY}_std", "other_outputs")
)


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

    def comes_back(self, key: int, data: bytes) -> bool:
        """Return whether a received frame with one of the keys is one that was sent."""
        if not self.by_identifier:
            try:
                self._sent[key].remove(data)
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
    bridge, output_names : ``SbBridge`` with its arrays; outputs that it has behind loads and chi-square.

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
        self._now, self._step, self._last_step = now, step, nan
        self._navigation_taken = tuple(name for name in NAVIGATION if name in other_inputs(step))
        self._constants = dict(layout.constants)
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
        self._valid = part(parts[5], np.bool_, n)
        self._parts, self._flow_numbers = bytes_of[parts[3] : parts[7]].data, self._flow.data
        kinds = zip((np.float64, np.float64, np.bool_, np.uint8), (n_flow, n, n, n), parts[3:7], strict=True)
        self._places = [(kind, count, place - parts[3]) for kind, count, place in kinds]
        where, given = {name: place for place, name in enumerate(plan.quantities)}, dict(layout.constants)
        self._navigation = [(where.get(name), given.get(name, nan)) for name in NAVIGATION]
        # Deadline of the open cycle, time of the next result of silence, measured period [s].
        self._times: Any = self._state[:3].data
        self._flags = bytes_of[24:32].view(np.int32)  # the period is wrong; cycles are skipped
        self._time = ctypes.c_double()
        self._at_time = ctypes.byref(self._time)
        self._hear, self._due = library.sb_hear, library.sb_due
        self._conclude, self._compose = library.sb_conclude, library.sb_compose
        self._compose_status = library.sb_compose_status
        # The call of another's code lets other threads run.
        self._estimate = library_of_estimator().sb_estimate
        self._composed: ResultFrames | None = None
        self._library, self._slots = library, plan.slots
        self._causes = part(PLACES["result"], RESULT, 1)["causes"].data
        self._join(step)
        self._unknown: dict[int, int] = {}
        self.stalls: list[tuple[float, float]] = []
        """Times without a call, whose status results were passed over: when the first was due; the call [s]."""
        self.on_cycle: Callable[[Result, float, int], Cause] | None = None
        """Called with a result, the q_inf that the bus states [Pa] and the number of the last command (-1 for
        none), before the result is published; returns causes for it."""

    # --- frames and time in --------------------------------------------------------------------------------------

    def receive(self, frame: Frame) -> list[Result]:
        """Take in one frame; return the results that are ready with it, in order."""
        head = frame.time, frame.key, len(frame.data), flags_of(frame), 1, 0
        HEAD.pack_into(self._heard, 0, *head)
        return self._offer(frame.time, frame.data, frame)

    def hear(self, message: Any, time: float) -> list[Result]:
        """Take in python-can's ``message`` that came at ``time`` [s]; return as :meth:`receive`.

        Raises MalformedFrame.
        """
        try:
            wide, flags = _KINDS[
                message.is_extended_id,
                message.is_fd,
                message.bitrate_switch,
                message.is_error_frame,
                message.is_remote_frame,
            ]
            identifier, data = message.arbitration_id, message.data
            if (
                data.__class__ is not bytearray
                or len(data) > _LONGEST
                or not 0 <= identifier <= LARGEST_IDENTIFIER
            ):
                return self.receive(from_message(message, time))
            head = time, identifier | wide, len(data), flags, 1, 0
            HEAD.pack_into(self._heard, 0, *head)
        except (KeyError, TypeError, struct.error):
            return self.receive(from_message(message, time))
        return self._offer(time, bytes(data), message)

    def _offer(self, time: float, data: bytes, source: Any) -> list[Result]:
        """Offer compiled code the frame that was heard, ``source`` before; return the results."""
        times = self._times
        results = self.advance(time) if times[0] <= time or times[1] <= time else []
        while True:
            event = self._hear(self._at_bridge, data)
            if event == _TAKEN:
                return results
            if event == _OTHER:
                _, key, _, flags, *_ = HEAD.unpack_from(self._heard)
                if key in self.own.keys and not flags & IS_ERROR and self.own.comes_back(key, data):
                    self.count(FrameClass.OWN, time)
                    return results
                self._refuse(source if isinstance(source, Frame) else from_message(source, time))
                return results
            if event == _AUTHENTICATE:
                assert self.authentication is not None
                head = HEAD.unpack_from(self._heard)
                verdict = _VERDICTS[self.authentication.check(self._slots[head[1]], data)]
                HEAD.pack_into(self._heard, 0, *head[:-1], verdict)
                continue
            self._publish(results)
            if event == _READY:
                return results

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
        for layout in (frame.layout for frame in self.plan.frames):
            names.setdefault(self._slots[layout.key], []).append(f"0x{layout.identifier:X} {layout.name}")
        came = set(compress(self._slots.values(), self._came))
        heard = sum(len(frame_names) for slot, frame_names in names.items() if slot in came)
        missing = [name for slot, frame_names in names.items() if slot not in came for name in frame_names]
        return f"expected frames: {heard} heard; never heard: {', '.join(missing) or 'none'}"

    # --- one frame, one result -----------------------------------------------------------------------------------

    def _refuse(self, frame: Frame) -> None:
        """Account for a frame that is no data frame of the input."""
        kind, key = self._library.sb_refuse(self._at_bridge, frame.data), frame.key
        if frame.is_error:
            self.bus_state = state_after(self.bus_state, frame)
            if self.bus_state is not BusState.ERROR_ACTIVE:
                self.note(Cause.BUS)
        elif kind == NUMBER_OF[FrameClass.UNKNOWN_IDENTIFIER] and (
            key in self._unknown or len(self._unknown) < LISTED_IDENTIFIERS
        ):
            self._unknown[key] = self._unknown.get(key, 0) + 1

    def _join(self, step: Step) -> None:
        """Let compiled code judge what the estimator makes of a cycle; an FMU it steps by itself."""
        self._fmu = step if isinstance(step, FmuStep) else None
        self.bridge, quantities = Record(BRIDGE), self.plan.quantities
        places = np.full(len(quantities) + 1, -1, dtype=np.int32)
        self.output_names: Sequence[str] = (ENVELOPE_SCORE,)
        if (fmu := self._fmu) is not None:
            self.output_names = fmu.other_outputs
            given = dict.fromkeys(NAVIGATION, nan) | self._constants | dict.fromkeys(quantities, nan)
            for name in fmu.other_inputs:
                fmu.inputs[fmu.places[name]] = given.get(name, fmu.inputs[fmu.places[name]])
            places[:-1] = [fmu.places[name] if name in fmu.other_inputs else -1 for name in quantities]
        slots = self._slots | dict.fromkeys(self.own.keys, -1)
        keys = np.array([*slots], dtype=np.uint32)
        self._came, heard = np.zeros(len(keys), dtype=bool), np.zeros(1, dtype=LOGGED)
        self._heard = heard.view(np.uint8).data
        self.bridge.set(
            plan=self.plan.record,
            state=self._state,
            place=places,
            key=keys,
            slot=np.array([*slots.values()], dtype=np.int32),
            has_come=self._came,
            heard=heard,
        )
        record, number = self.bridge.record, self.bridge.numbers
        record["last_step"], record["needs_pressure"], record["score"] = nan, needs_pressure(step), -1
        record["n_keys"], record["alarm"] = len(keys), self.plan.bridge_alarm
        self._at_bridge = pointer(record)
        self._pressure = number("pressure", "f8")
        self._is_stepped, self._n_used = number("is_stepped", "i4"), number("n_gauges", "i4")
        self._use_outputs()

    def _use_outputs(self) -> None:
        """Tell compiled code where the outputs are: of an FMU, whose instance may be new, or of Python."""
        record, fmu = self.bridge.record, self._fmu
        self._output = np.zeros(FIRST_OTHER + len(self.output_names) + 1) if fmu is None else fmu.outputs
        self._output_numbers = self._output.data
        self.bridge.set(output=self._output)
        record["n_outputs"] = len(self._output)
        if fmu is not None:
            self.bridge.set(estimator=fmu.exchange.record)
            record["mask"] = fmu.first_mask % len(fmu.inputs)

    def log_to(self, queue: FrameQueue) -> None:
        """Have every received frame but own ones wait in ``queue``."""
        self.bridge.set(queue=queue.record)

    def compose(self, layouts: Sequence[FrameLayout], configuration: int) -> None:
        """Have the frames of every result composed with it; ``configuration`` as in the frames, 0 for none."""
        if self._fmu is None:
            self.output_names = output_names(layouts)
            self._use_outputs()
        first = int(self.plan.record["first_result"][0])
        self._composed = ResultFrames(self.bridge, layouts, configuration, first, self.output_names)

    def status_frames(self, now: float, send_failures: int, reconnects: int) -> list[Frame]:
        """Return the frames of the bridge's status [s], and the details of the last result."""
        record, self._time.value = self.bridge.record, now
        record["bus_state"], record["send_failures"] = self.bus_state, send_failures
        record["reconnects"] = reconnects
        return self._frames(self._compose_status, self._at_time, kinds=(OF_STATUS, OF_DETAIL))

    def _publish(self, results: list[Result]) -> None:
        """Have the estimator answer the result that is ready; add it to ``results`` unless it is held back."""
        step: Any = None
        if failed := self._estimate(self._at_bridge):
            assert self._fmu is not None
            self._fmu.failed(failed)
            self._use_outputs()
        elif self._fmu is None and self._n_used[0]:
            step = self._step_in_python()
        self._time.value = -inf if self._now is None else self._now()
        is_sent = self._conclude(self._at_bridge, self._at_time)
        time, arrival, age, uncertainty, lag, stated, sample_time, counter, silent, *verdict = self._result()
        _, causes, quality, usable, request = verdict
        result = _new(Result)
        result.time, result.quality, result.usable = time, _QUALITIES[quality], usable != 0
        result.causes = Cause(causes) if causes else Cause.NONE
        result.dynamic_pressure, result.gap = self._pressure[0] if not silent else nan, nan
        result.mach_number, result.altitude = (
            value if place is None else self._flow_numbers[place] for place, value in self._navigation
        )
        result.age, result.age_uncertainty, result.held, result.arrival = age, uncertainty, lag, arrival
        result.sample_time = None if sample_time < 0 else sample_time
        result.counter = None if counter < 0 else counter
        result.chi_square, result.health, result.frames, outputs = nan, None, (), None
        if self._is_stepped[0]:
            outputs = bytearray(self._output_numbers)
            result.chi_square, result.health = self._output_numbers[FIRST_OTHER - 1], int(self._output_numbers[-1])
        result.later = partial(self._complete, bytearray(self._parts), outputs, step)
        if self.on_cycle is not None and not silent:
            result.causes |= self.on_cycle(result, stated, request)
            self._causes[0] = int(result.causes)
        if is_sent:
            result.frames = self._frames(self._compose, kinds=_WITH_DETAILS if result.causes >> 16 else _ALONE)
            results.append(result)

    def _split(self, flow: FloatArray) -> tuple[dict[str, float], dict[str, float]]:
        """Return the estimator's inputs and what navigation gives, by name."""
        known = dict(zip(self.plan.quantities, flow.tolist(), strict=True)) | self._constants
        known.pop(DYNAMIC_PRESSURE, nan)
        return known, {name: known.pop(name, nan) for name in NAVIGATION}

    def _complete(self, parts: bytearray, outputs: bytearray | None, step: Any, result: Result) -> None:
        """Set the rest of a result, from the ``parts`` of the machine and the estimator's ``outputs`` then."""
        arrays: list[Any] = [np.frombuffer(parts, kind, count, place) for kind, count, place in self._places]
        flow, result.strain, result.valid, result.reasons = arrays
        result.other_inputs, _ = self._split(flow)
        result.coefficients, result.coefficients_std, result.other_outputs = _NOTHING, _NOTHING, {}
        if outputs is not None:
            values = np.frombuffer(outputs)
            named = zip(self.output_names, values[FIRST_OTHER:-1].tolist(), strict=True)
            result.other_outputs = dict(named) if step is None else step.other_outputs
            if result.quality.has_coefficients:
                result.coefficients, result.coefficients_std = values[:5], values[5:10]

    def _step_in_python(self) -> Any:
        """Return what an estimator in Python makes of a result, and give it to compiled code; None if it refuses.

        A step is the time since the last one, in whole cycles.
        """
        now, period = self._result()[0], self.layout.cycle_time
        cycles = 1 if isnan(self._last_step) else round((now - self._last_step) / period)
        self._last_step = now
        size = period if cycles <= 1 else min(cycles, _LONGEST_STEP) * period
        known, navigation = self._split(self._flow)
        known |= {name: navigation[name] for name in self._navigation_taken}
        mask = (self._valid.tobytes(),) if takes_mask(self._step) else ()
        try:
            step = self._step(self._strain.copy(), self._pressure[0], size, *mask, **known)
        except StepRefused:
            return None
        output, self._is_stepped[0] = self._output, True
        output[:5], output[5:10] = step.coefficients, step.coefficients_std
        output[10], output[-1] = step.chi_square, step.health
        output[FIRST_OTHER:-1] = [step.other_outputs.get(name, nan) for name in self.output_names]
        return step

    def _frames(self, compose: Callable[..., int], *now: Any, kinds: Iterable[int]) -> list[Frame]:
        """Return the frames of these kinds, which compiled code composes."""
        if self._composed is None:
            return []
        if compose(self._at_bridge, *now) >= 0:
            raise InputError("results: expected values that their frames can hold, got others")
        return [frame.with_data(bytes(data)) for kind in kinds for frame, data in self._composed.of_kind[kind]]


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
