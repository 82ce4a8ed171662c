"""Flow and navigation of a step: the last received values while they may be used, or a dynamic pressure fixed for
the run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import inf, isfinite, isnan, nan

from strainfmu.can.cycle.frames.assembler import Arrival
from strainfmu.can.cycle.frames.decoder import STATUS_DEGRADED
from strainfmu.can.cycle.frames.restart_proof import SeenFrames
from strainfmu.can.cycle.states.quality import Cause
from strainfmu.can.e2e.sample_clock import SenderClock
from strainfmu.can.wire.cycle_plan import raw_ends
from strainfmu.can.wire.frame_layout import (
    ALTITUDE,
    DYNAMIC_PRESSURE,
    FLOW_STDS,
    LARGEST_PARAMETER,
    MACH_NUMBER,
    STATIC_PRESSURE,
    FlowSignal,
    InputFrame,
    is_parameter,
    is_parameter_std,
    is_reading,
    is_temperature,
)
from strainfmu.can.wire.profile_signals import LARGEST_DYNAMIC_PRESSURE, LEAST_DYNAMIC_PRESSURE
from strainfmu.can.wire.signal_plan import SignalPlan
from strainfmu.interface.input_names import OTHER_AIR_DATA

_SENSIBLE = {
    DYNAMIC_PRESSURE: (LEAST_DYNAMIC_PRESSURE, LARGEST_DYNAMIC_PRESSURE),
    MACH_NUMBER: (0.0, 100.0),
    ALTITUDE: (-2e3, 2e5),
    STATIC_PRESSURE: (LEAST_DYNAMIC_PRESSURE, LARGEST_DYNAMIC_PRESSURE),
    **dict.fromkeys(FLOW_STDS.values(), (0.0, LARGEST_PARAMETER)),
}
"""Smallest and largest value of a quantity that may be used, in SI units, whatever its signal allows."""

_SENSIBLE_TEMPERATURE = (1.0, 5e3)
"""The same of a temperature [K]."""

_NOTHING_LOST = Cause.NONE

_NEW_FRAMES = 3
"""Frames in a row that were not received before, which prove that a sender behind a restart is no recording."""


@dataclass(slots=True, kw_only=True)
class FlowState:
    """What is known of the flow at one time; NaN where it is not. Good until the next state is asked for.

    Attributes
    ----------
    dynamic_pressure : q_inf [Pa].
    mach_number, altitude : by navigation [1] and [m].
    lost : causes of what was known before and is not any more: navigation, a temperature, an auxiliary sensor, a
        flow parameter or its standard deviation.
    further : temperatures [K], readings of auxiliary sensors, thrust [N], p_inf [Pa], deviations of navigation,
        flow parameters and their deviations, by name of the estimator's input.
    hides_delay : more delay of the dynamic pressure may hide than is allowed.
    """

    dynamic_pressure: float = nan
    mach_number: float = nan
    altitude: float = nan
    lost: Cause = Cause.NONE
    hides_delay: bool = False
    further: dict[str, float] = field(default_factory=dict)


class HeldValue:
    """Holds one quantity between its frames, up to a maximum age.

    Parameters
    ----------
    frame, source : the frame, and the signal of it that holds the quantity.
    max_age : maximum time for which a value is held [s].
    clock : follows the sample times of the frame; None if it has none. No other value may use it.
    tolerance : largest difference from the time of the strains that counts as none [s].
    """

    def __init__(
        self,
        frame: InputFrame,
        source: FlowSignal,
        max_age: float,
        clock: SenderClock | None,
        tolerance: float,
    ) -> None:
        self._tolerance = tolerance
        self._frame, self._source = frame, source
        self._max_age, self._clock = max_age, clock
        self._value = nan
        self._sampled = nan
        self._stated = self._stated_at = nan
        self._to_be_proven, self._new = False, 0
        self._shares_clock = False
        self.hides_delay = False
        """More delay may hide than is allowed."""
        self._plan = SignalPlan(frame.layout)
        signal = frame.layout.signals[source.index]
        self._no_value = signal.no_value_codes
        self._low = -inf if signal.minimum is None else signal.minimum
        self._high = inf if signal.maximum is None else signal.maximum
        self._smallest, self._largest = _sensible(source.quantity)
        self._ends = raw_ends(signal) or ()
        self._value_of = self._plan.value_reader(source.index)
        self._doubtful = frozenset((*self._no_value, *self._ends))
        self.quantity = source.quantity
        self.was_known = False
        """A value has been taken since the start or the last reset."""

    def reset(self) -> None:
        """Forget the sender."""
        self._value = self._sampled = self._stated = self._stated_at = nan
        self.was_known = False
        self._to_be_proven, self._new = True, 0
        if self._clock is not None:
            self._clock.reset()

    def confirm(self) -> None:
        """Take the sender for proven, and its present delay for the smallest."""
        self._to_be_proven = False
        if self._clock is not None:
            self._clock.accept()
            self._clock.anchor()

    @property
    def frame(self) -> InputFrame:
        """The frame that holds the quantity."""
        return self._frame

    def take(self, raw: Sequence[int], time: float, is_new: bool = True, strain_time: float | None = None) -> bool:
        """Take in the raw numbers of a frame received at ``time`` [s]; return whether its value may be used.

        ``is_new`` says that the frame has not been received before in this run; ``strain_time`` is the present
        time by the clock of a proven sender of strains [s], None if it is not known.
        """
        index = self._source.index
        code, value_of = raw[index], self._value_of
        value, delay = value_of(code), 0.0
        if self._clock is not None and self._frame.sample_time is not None:
            ticks = int(raw[self._frame.sample_time])
            reading = self._clock.read(time, ticks)
            self._new = self._new + 1 if is_new else 0
            self._to_be_proven = (self._to_be_proven or reading.restarted) and not reading.resumed
            if reading.jumped:
                return False  # a repeated old frame or a restart: the next frames decide
            agrees = self._agrees(self._clock, ticks, strain_time)
            # A frame behind a restart is no recording if it is new, or at the time of the strains.
            if self._to_be_proven and not agrees and (self._shares_clock or self._new < _NEW_FRAMES):
                return False
            if self._to_be_proven:
                self._accept(self._clock)
            self._shares_clock = agrees if strain_time is not None else self._shares_clock
            delay, self.hides_delay = reading.age, reading.hides_delay
        sampled, in_si = time - delay, self._source.si(value)
        status = self._frame.status
        is_inside = self._low <= value <= self._high and self._smallest <= in_si <= self._largest
        if is_inside and code not in self._doubtful and (status is None or 0 <= raw[status] <= STATUS_DEGRADED):
            # What every check below would find, too.
            self._stated = self._value = in_si
            self._stated_at = self._sampled = sampled
            self.was_known = True
            return True
        is_stated = isfinite(value) and not (self._has_no_value(code) or self._is_refused_by_sender(raw))
        is_usable = is_stated and not self._is_out_of_range(code, value)
        self._stated, self._stated_at = in_si if is_stated else nan, sampled
        self._value, self._sampled = (in_si, sampled) if is_usable else (nan, nan)
        self.was_known = self.was_known or is_usable
        return is_usable

    def _agrees(self, clock: SenderClock, ticks: int, strain_time: float | None) -> bool:
        """Return whether a sample time is that of the strains, as far as the clock's range tells."""
        if strain_time is None:
            return False
        whole = clock.range
        half = 0.5 * whole
        difference = (clock.seconds(ticks) - strain_time + half) % whole - half
        return abs(difference) <= self._tolerance

    def _accept(self, clock: SenderClock) -> None:
        """Take the sender for proven after a restart."""
        self._to_be_proven = False
        clock.accept()

    def value(self, now: float) -> float:
        """Return the quantity [SI] at ``now`` [s]; NaN if none may be used."""
        return nan if now - self._sampled > self._max_age and self._expires() else self._value

    def stated(self, now: float) -> float:
        """Return what the sender states [SI] at ``now`` [s]; NaN if that is nothing, or old.

        Air at rest is stated as 0, which is of no use for coefficients.
        """
        return self._stated if now - self._stated_at <= self._max_age else nan

    def _expires(self) -> bool:
        """Return whether a value may be too old to be used."""
        return True

    def _has_no_value(self, code: int) -> bool:
        """Return whether the raw number ``code`` stands for "no value"."""
        return code in self._no_value

    def _is_out_of_range(self, code: int, value: float) -> bool:
        """Return whether a value is outside the limits, or at either end of its converter's range."""
        is_sensible = self._smallest <= self._source.si(value) <= self._largest
        # As of strains: a converter at either end is overdriven, or its wire is broken.
        return not (self._low <= value <= self._high and is_sensible) or code in self._ends

    def _is_refused_by_sender(self, raw: Sequence[int]) -> bool:
        """Return whether the sender's own status forbids to use the value."""
        status = self._frame.status
        # Of 64 bits the largest come as negative numbers.
        return status is not None and not 0 <= raw[status] <= STATUS_DEGRADED


class HeldFlow:
    """Holds q_inf, Mach number, altitude, temperatures, further parameters and deviations, each for itself.

    Parameters
    ----------
    values : those that the bus gives, at most one of each quantity.
    fixed : q_inf of the whole run [Pa]; None to take it from the bus.
    seen : frames received in this run.
    constants : further inputs of the estimator that stay, and their values.
    """

    def __init__(
        self,
        values: Sequence[HeldValue],
        fixed: float | None,
        seen: SeenFrames,
        constants: Sequence[tuple[str, float]] = (),
    ) -> None:
        self._seen = seen
        self._values, self._fixed = tuple(values), fixed
        # By identity, as two frames may be alike; the values keep the frames alive.
        self._by_frame: dict[int, list[HeldValue]] = {}
        for value in values:
            self._by_frame.setdefault(id(value.frame), []).append(value)
        # What distinguishes the data of a frame from those of another one.
        self._prefix = {
            key: value.frame.layout.key.to_bytes(4, "little") for key, (value, *_) in self._by_frame.items()
        }
        by_quantity = {value.quantity: value for value in values}
        self._pressure = by_quantity.get(DYNAMIC_PRESSURE)
        self._mach_number, self._altitude = by_quantity.get(MACH_NUMBER), by_quantity.get(ALTITUDE)
        of_loss = {
            is_temperature: Cause.TEMPERATURE,
            is_reading: Cause.SENSOR,
            is_parameter: Cause.NAVIGATION,
            is_parameter_std: Cause.NAVIGATION,
            OTHER_AIR_DATA.__contains__: Cause.NAVIGATION,
        }
        self._further = [(one, cause) for one in values for has, cause in of_loss.items() if has(one.quantity)]
        self._state = FlowState(further=dict(constants))

    @property
    def has_pressure(self) -> bool:
        """q_inf is fixed or among what the bus gives."""
        return self._fixed is not None or self._pressure is not None

    def reset(self) -> None:
        """Forget the sender."""
        for value in self._values:
            value.reset()

    def confirm(self) -> None:
        """Take the senders for proven."""
        for value in self._values:
            value.confirm()

    def take(self, item: InputFrame, arrival: Arrival, strain_time: float | None = None) -> bool:
        """Take in a frame of the layout's ``item``; return whether any value of it may be used.

        ``strain_time`` is the present time by the clock of the strains [s], None if it is not known.
        """
        values = self._by_frame.get(id(item))
        if values is None:
            return False
        frame, data = arrival.frame, arrival.frame.data
        raw, time, is_usable = arrival.plan.numbers(data), frame.time, False
        is_new = self._seen.add((self._prefix[id(item)] + data,))
        for value in values:
            is_usable |= value.take(raw, time, is_new, strain_time)
        return is_usable

    def state(self, now: float) -> FlowState:
        """Return what is known at ``now`` [s]."""
        state, pressure, hides_delay, lost = self._state, self._fixed, False, _NOTHING_LOST
        if pressure is None:
            pressure = nan if self._pressure is None else self._pressure.value(now)
            for value in self._values:
                if value.hides_delay:
                    hides_delay = True
        state.dynamic_pressure, state.hides_delay = pressure, hides_delay
        mach_number, altitude = self._mach_number, self._altitude
        if mach_number is not None:
            state.mach_number = mach_number.value(now)
            if mach_number.was_known and isnan(state.mach_number):
                lost = Cause.NAVIGATION
        if altitude is not None:
            state.altitude = altitude.value(now)
            if altitude.was_known and isnan(state.altitude):
                lost = Cause.NAVIGATION
        for held, cause in self._further:
            number = state.further[held.quantity] = held.value(now)
            if held.was_known and isnan(number):
                lost |= cause
        state.lost = lost
        return state

    def stated_pressure(self, now: float) -> float:
        """Return q_inf as it is stated [Pa] at ``now`` [s], also of air at rest; NaN if it is not known."""
        if self._fixed is not None:
            return self._fixed
        return nan if self._pressure is None else self._pressure.stated(now)


def _sensible(quantity: str) -> tuple[float, float]:
    """Return the smallest and largest value of a quantity that may be used."""
    if is_parameter(quantity) or is_reading(quantity):
        return -LARGEST_PARAMETER, LARGEST_PARAMETER
    if is_parameter_std(quantity):
        return 0.0, LARGEST_PARAMETER
    return _SENSIBLE.get(quantity, _SENSIBLE_TEMPERATURE)
