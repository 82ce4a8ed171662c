"""The dynamic pressure of a step: the last one received that may still be used, or one fixed for the run."""

from __future__ import annotations

from math import isfinite, nan

from strainfmu.arrays import IntArray
from strainfmu.can.cycle.decoded_cycle import STATUS_DEGRADED, converter_ends
from strainfmu.can.e2e.sample_clock import SampleClock
from strainfmu.can.guards import Guards
from strainfmu.can.settings import BridgeSettings
from strainfmu.can.wire.frame_layout import InputFrame
from strainfmu.can.wire.signal_plan import SignalPlan, unsigned


class HeldPressure:
    """Holds q_inf between its frames, and no longer than it may be held.

    Parameters
    ----------
    frame : the frame that holds q_inf, or None.
    fixed : q_inf of the whole run [Pa]; None to take it from the frame.
    cycle_time : nominal period of the strains [s].
    """

    def __init__(
        self,
        frame: InputFrame | None,
        fixed: float | None,
        cycle_time: float,
        settings: BridgeSettings,
        guards: Guards,
    ) -> None:
        self._frame, self._fixed, self._guards = frame, fixed, guards
        self._value = nan
        self._sampled = nan
        # A frame that is sent more slowly than the strains may be held for as many of its own periods.
        period = max(cycle_time, (frame.layout.cycle_time or 0.0) if frame is not None else 0.0)
        self._max_age = settings.pressure_max_age * period
        self._clock: SampleClock | None = None
        if frame is not None:
            self._plan = SignalPlan(frame.layout)
            if frame.sample_time is not None:
                bits = frame.layout.signals[frame.sample_time].length
                self._clock = SampleClock(
                    frame.tick,
                    bits,
                    settings.clock_drift,
                    settings.jump_tolerance * cycle_time,
                    settings.jump_confirmations,
                )

    def reset(self) -> None:
        """Forget the sender."""
        self._value = self._sampled = nan
        if self._clock is not None:
            self._clock.reset()

    def take(self, raw: IntArray, time: float) -> bool:
        """Take in the raw numbers of a frame that was received at ``time`` [s]; tell whether it may be used."""
        frame = self._frame
        assert frame is not None
        assert frame.dynamic_pressure is not None
        signal = frame.layout.signals[frame.dynamic_pressure]
        code = int(raw[frame.dynamic_pressure])
        value = self._plan.value(raw, frame.dynamic_pressure)
        delay = 0.0
        if self._clock is not None and frame.sample_time is not None:
            reading = self._clock.read(time, int(raw[frame.sample_time]))
            if reading.jumped and self._guards.clock_jump:
                return False  # an old frame played again, or a restart: the next ones will tell
            delay = reading.age if self._guards.age else 0.0
        bad = not isfinite(value) or (self._guards.not_available and code in signal.no_value_codes)
        if self._guards.range:
            low = 0.0 if signal.minimum is None else signal.minimum
            bad |= value < low or (signal.maximum is not None and value > signal.maximum)
            # As of strains: a converter at either end is overdriven, or its wire is broken.
            bad |= code in (converter_ends(signal) or ())
        if self._guards.sender_status and frame.status is not None:
            bad |= unsigned(raw, frame.status) > STATUS_DEGRADED
        self._value, self._sampled = (nan, nan) if bad else (value * frame.to_pascal, time - delay)
        return not bad

    def value(self, now: float) -> float:
        """Return q_inf [Pa] at ``now`` [s]; NaN if there is none that may be used."""
        if self._fixed is not None:
            return self._fixed
        old = now - self._sampled > self._max_age
        return nan if old and self._guards.pressure_age else self._value
