"""The dynamic pressure of a step: the last received value while it may be used, or one fixed for the run."""

from __future__ import annotations

from math import isfinite, nan

from strainfmu.arrays import IntArray
from strainfmu.can.cycle.decoder import STATUS_DEGRADED, converter_ends
from strainfmu.can.e2e.sample_clock import SampleClock
from strainfmu.can.wire.frame_layout import InputFrame, SignalLayout
from strainfmu.can.wire.signal_plan import SignalPlan, unsigned


class HeldPressure:
    """Holds q_inf between its frames, up to a maximum age.

    Parameters
    ----------
    frame : the frame that holds q_inf, or None.
    fixed : q_inf of the whole run [Pa]; None to take it from the frame.
    max_age : maximum time for which a value is held [s].
    clock : follows the sample times of the frame; None if it has none.
    """

    def __init__(
        self, frame: InputFrame | None, fixed: float | None, max_age: float, clock: SampleClock | None
    ) -> None:
        self._frame, self._fixed = frame, fixed
        self._max_age, self._clock = max_age, clock
        self._value = nan
        self._sampled = nan
        if frame is not None:
            self._plan = SignalPlan(frame.layout)

    def reset(self) -> None:
        """Forget the sender."""
        self._value = self._sampled = nan
        if self._clock is not None:
            self._clock.reset()

    def take(self, raw: IntArray, time: float) -> bool:
        """Take in the raw numbers of a frame received at ``time`` [s]; return whether its value may be used."""
        frame = self._frame
        assert frame is not None
        assert frame.dynamic_pressure is not None
        value = self._plan.value(raw, frame.dynamic_pressure)
        delay = 0.0
        if self._clock is not None and frame.sample_time is not None:
            reading = self._clock.read(time, int(raw[frame.sample_time]))
            if reading.jumped:
                return False  # a repeated old frame or a restart: the next frames decide
            delay = reading.age
        signal, code = frame.layout.signals[frame.dynamic_pressure], int(raw[frame.dynamic_pressure])
        bad = (
            not isfinite(value)
            or self._has_no_value(signal, code)
            or self._is_out_of_range(signal, code, value)
            or self._is_refused_by_sender(raw)
        )
        self._value, self._sampled = (nan, nan) if bad else (value * frame.to_pascal, time - delay)
        return not bad

    def value(self, now: float) -> float:
        """Return q_inf [Pa] at ``now`` [s]; NaN if none may be used."""
        if self._fixed is not None:
            return self._fixed
        return nan if self._is_old(now) else self._value

    def _is_old(self, now: float) -> bool:
        return now - self._sampled > self._max_age

    def _has_no_value(self, signal: SignalLayout, code: int) -> bool:
        """Return whether the raw number ``code`` stands for "no value"."""
        return code in signal.no_value_codes

    def _is_out_of_range(self, signal: SignalLayout, code: int, value: float) -> bool:
        """Return whether a value is outside the limits, or at either end of its converter's range."""
        low = 0.0 if signal.minimum is None else signal.minimum
        outside = value < low or (signal.maximum is not None and value > signal.maximum)
        # As of strains: a converter at either end is overdriven, or its wire is broken.
        return outside or code in (converter_ends(signal) or ())

    def _is_refused_by_sender(self, raw: IntArray) -> bool:
        """Return whether the sender's own status forbids to use the value."""
        status = None if self._frame is None else self._frame.status
        return status is not None and unsigned(raw, status) > STATUS_DEGRADED
