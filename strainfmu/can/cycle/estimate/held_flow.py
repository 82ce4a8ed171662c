"""Flow and navigation of a step: the last received values while they may be used, or a dynamic pressure fixed for
the run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import isnan, nan
from typing import Any

import numpy as np

from strainfmu.can.cycle.frames.assembler import Arrival
from strainfmu.can.cycle.frames.decoder import STATUS_DEGRADED
from strainfmu.can.cycle.frames.restart_proof import SeenFrames, StrainTime
from strainfmu.can.cycle.states.quality import Cause
from strainfmu.can.e2e.sample_clock import SenderClock
from strainfmu.can.wire.compiled import ARRAY, INTEGER, NUMBER, Record, address, function, pointer
from strainfmu.can.wire.cycle_plan import CyclePlan
from strainfmu.can.wire.frame_layout import (
    ALTITUDE,
    DYNAMIC_PRESSURE,
    FLOW_QUANTITIES,
    LARGEST_PARAMETER,
    MACH_NUMBER,
    NAVIGATION,
    FlowSignal,
    InputFrame,
    is_parameter,
    is_parameter_std,
    is_reading,
    is_temperature,
)
from strainfmu.estimator.air_inputs import SAMPLE_INPUTS
from strainfmu.interface.input_names import OTHER_AIR_DATA

_SENSIBLE = {one.name: (one.smallest, one.largest) for one in SAMPLE_INPUTS}
"""Smallest and largest value of a quantity that may be used, in SI units, whatever its signal allows."""

_SENSIBLE_TEMPERATURE = (1.0, 5e3)
"""The same of a temperature [K]."""

_NOTHING_LOST = Cause.NONE


@dataclass(slots=True, kw_only=True)
class FlowState:
    """What is known of the flow at one time; NaN where it is not. Good until the next state is asked for.

    Attributes
    ----------
    dynamic_pressure : q_inf [Pa].
    mach_number, altitude : by navigation [1] and [m].
    lost : causes of what was known before and is not any more: navigation, a temperature, an auxiliary sensor, a
        flow parameter or its standard deviation.
    other_inputs : temperatures [K], readings of auxiliary sensors, thrust [N], p_inf [Pa], standard
        deviations of navigation, flow parameters and their standard deviations, by name of the estimator's input.
    """

    dynamic_pressure: float = nan
    mach_number: float = nan
    altitude: float = nan
    lost: Cause = Cause.NONE
    other_inputs: dict[str, float] = field(default_factory=dict)


class _Value(Record):
    position = 4
    _fields_ = (
        ("index", INTEGER),
        *((name, NUMBER) for name in ("to_si", "si_offset", "smallest", "largest", "tolerance", "max_age")),
        ("clock", ARRAY),
        ("new_frames", INTEGER),
        *((name, NUMBER) for name in ("value", "sampled", "stated", "stated_at")),
        *((name, INTEGER) for name in ("to_be_proven", "n_new", "shares_clock", "hides_delay", "was_known")),
    )


class _Flow(Record):
    position = 5
    _fields_ = (
        ("signals", ARRAY),
        *((name, INTEGER) for name in ("sample_time", "status", "worst_status")),
        ("prefix", ARRAY),
        ("length", INTEGER),
        ("seen", ARRAY),
        ("n_values", INTEGER),
        ("value", ARRAY),
        ("strain_time", ARRAY),
    )


class HeldValue:
    """Holds one quantity between its frames, up to a maximum age; compiled code takes in the frames.

    Parameters
    ----------
    frame, source : the frame, and the signal of it that holds the quantity.
    max_age : maximum time for which a value is held [s].
    clock : follows the sample times of the frame; None if it has none. No other value may use it.
    tolerance : largest difference from the time of the strains that counts as none [s].
    new_frames : frames in a row that were not received before, which prove that a sender behind a restart is no
        recording; 0: it needs no proof.
    """

    def __init__(
        self,
        frame: InputFrame,
        source: FlowSignal,
        max_age: float,
        clock: SenderClock | None,
        tolerance: float,
        new_frames: int = 3,
    ) -> None:
        self.frame, self._source = frame, source
        self._clock = clock
        self.quantity = source.quantity
        smallest, largest = self.sensible()
        self.record = record = _Value.empty()
        record.index, record.to_si, record.si_offset = source.index, source.to_si, source.offset
        record.smallest, record.largest, record.tolerance = smallest, largest, tolerance
        record.new_frames, record.max_age = new_frames, max_age
        if clock is not None and frame.sample_time is not None:
            record.clock = address(clock.record)
        record.value = record.sampled = record.stated = record.stated_at = nan

    def new_plan(self, *given: Any) -> CyclePlan:
        """Return the plan of the frame's signals."""
        return CyclePlan(*given)

    def sensible(self) -> tuple[float, float]:
        """Return the smallest and the largest value that may be used [SI]."""
        return _sensible(self.quantity)

    @property
    def status(self) -> int | None:
        """Index of the sender's own status in the frame, None where it has none."""
        return self.frame.status

    def confirm(self) -> None:
        """Take the sender for proven, and its present delay for the smallest."""
        self.record.to_be_proven = 0
        if self._clock is not None:
            self._clock.accept()
            self._clock.anchor()

    @property
    def was_known(self) -> bool:
        """A value has been taken since the start or the last reset."""
        return bool(self.record.was_known)

    def stated(self, now: float) -> float:
        """Return what the sender states [SI] at ``now`` [s]; NaN if that is nothing, or old.

        Air at rest is stated as 0, which is of no use for coefficients.
        """
        record = self.record
        return record.stated if now - record.stated_at <= record.max_age else nan


class FlowFrame:
    """Takes the values of one frame, which :class:`HeldValue` holds."""

    def __init__(self, values: Sequence[HeldValue], seen: SeenFrames, strain_time: StrainTime) -> None:
        first = values[0]
        frame = first.frame
        n = len(frame.layout.signals)
        plan = first.new_plan([frame.layout], [(0, index) for index in range(n)])
        status, sample_time = first.status, frame.sample_time
        self._kept = values, plan
        self.record = _Flow(
            signals=plan.record,
            sample_time=-1 if sample_time is None else sample_time,
            status=-1 if status is None else status,
            worst_status=STATUS_DEGRADED,
            # What distinguishes the data of a frame from those of another one.
            prefix=np.frombuffer(frame.layout.key.to_bytes(4, "little"), dtype=np.uint8),
            length=frame.layout.length,
            seen=seen.words,
            n_values=len(values),
            value=np.array([address(value.record) for value in values], dtype=np.uint64),
            strain_time=strain_time.record,
        )
        self._time, self._take = NUMBER(), function("sb_flow_take", _Flow)
        self._at, self._at_time = pointer(self.record), pointer(self._time)

    def take(self, data: bytes, time: float) -> bool:
        """Take in a frame received at ``time`` [s]; return whether any value of it may be used."""
        if len(data) != self.record.length:
            raise ValueError(f"expected {self.record.length} bytes, got {len(data)}")
        self._time.value = time
        return self._take(self._at, data, self._at_time) != 0


class HeldFlow:
    """Holds q_inf, Mach number, altitude, temperatures, flow parameters and sigmas, each for itself.

    Parameters
    ----------
    values : those that the bus gives, at most one of each quantity.
    fixed : q_inf of the whole run [Pa]; None to take it from the bus.
    seen : frames received in this run.
    strain_time : time by the clock of the strains.
    constants : other inputs of the estimator that stay, and their values.
    """

    def __init__(
        self,
        values: Sequence[HeldValue],
        fixed: float | None,
        seen: SeenFrames,
        strain_time: StrainTime,
        constants: Sequence[tuple[str, float]] = (),
    ) -> None:
        self._values, self._fixed = tuple(values), fixed
        # By identity, as two frames may be alike; the values keep the frames alive.
        by_frame: dict[int, list[HeldValue]] = {}
        for value in values:
            by_frame.setdefault(id(value.frame), []).append(value)
        self._by_frame = {key: FlowFrame(own, seen, strain_time) for key, own in by_frame.items()}
        self.addresses = np.array([address(value.record) for value in values], dtype=np.uint64)
        """Of what is held, for compiled code."""
        self.known = np.full(len(values), nan)
        """What may be used of it at the last cycle [SI], NaN elsewhere; compiled code writes it."""
        self._known = self.known.data
        places = {value.quantity: index for index, value in enumerate(values)}
        self.pressure = places.get(DYNAMIC_PRESSURE)
        """Place of q_inf, None without."""
        self._mach_number, self._altitude = places.get(MACH_NUMBER), places.get(ALTITUDE)
        of_loss = {
            NAVIGATION.__contains__: Cause.NAVIGATION,
            is_temperature: Cause.TEMPERATURE,
            is_reading: Cause.SENSOR,
            is_parameter: Cause.NAVIGATION,
            is_parameter_std: Cause.NAVIGATION,
            OTHER_AIR_DATA.__contains__: Cause.NAVIGATION,
        }
        self._losses = [
            (place, cause) for name, place in places.items() for has, cause in of_loss.items() if has(name)
        ]
        self._others = [(one, place) for one, place in places.items() if one not in FLOW_QUANTITIES]
        self._state = FlowState(other_inputs=dict(constants))

    @property
    def is_fixed(self) -> bool:
        """q_inf is the same in the whole run."""
        return self._fixed is not None

    def confirm(self) -> None:
        """Take the senders for proven."""
        for value in self._values:
            value.confirm()

    def record_of(self, item: InputFrame) -> Record | None:
        """Return what takes in the layout's ``item`` in compiled code, None if none of its values is used."""
        own = self._by_frame.get(id(item))
        return None if own is None else own.record

    def take(self, item: InputFrame, arrival: Arrival) -> bool:
        """Take in a frame of the layout's ``item``; return whether any value of it may be used."""
        own, frame = self._by_frame.get(id(item)), arrival.frame
        return own is not None and own.take(frame.data, frame.time)

    def state(self, is_lost: bool) -> FlowState:
        """Return what is :attr:`known`; ``is_lost`` says whether anything was and is not any more."""
        state, known, fixed = self._state, self._known, self._fixed
        if fixed is not None:
            state.dynamic_pressure = fixed
        elif self.pressure is not None:
            state.dynamic_pressure = known[self.pressure]
        if self._mach_number is not None:
            state.mach_number = known[self._mach_number]
        if self._altitude is not None:
            state.altitude = known[self._altitude]
        for name, place in self._others:
            state.other_inputs[name] = known[place]
        state.lost = self._lost() if is_lost else _NOTHING_LOST
        return state

    def _lost(self) -> Cause:
        """Return the causes of what was known before and is not any more."""
        lost = _NOTHING_LOST
        for place, cause in self._losses:
            if self._values[place].was_known and isnan(self._known[place]):
                lost |= cause
        return lost

    def stated_pressure(self, now: float) -> float:
        """Return q_inf as it is stated [Pa] at ``now`` [s], also of air at rest; NaN if it is not known."""
        if self._fixed is not None:
            return self._fixed
        return nan if self.pressure is None else self._values[self.pressure].stated(now)


def _sensible(quantity: str) -> tuple[float, float]:
    """Return the smallest and largest value of a quantity that may be used."""
    if is_parameter(quantity) or is_reading(quantity):
        return -LARGEST_PARAMETER, LARGEST_PARAMETER
    if is_parameter_std(quantity):
        return 0.0, LARGEST_PARAMETER
    return _SENSIBLE.get(quantity, _SENSIBLE_TEMPERATURE)
