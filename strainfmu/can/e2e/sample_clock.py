"""The sender's clock seen from ours: age of a sample and how well it is known, jumps and drift of the clock.

The delay of a frame is known only relative to the smallest delay so far: a constant transmission time is not part
of the age. A clock that runs slower than ours looks like a delay that grows. So the smallest delay is raised, but
no faster than an oscillator may drift and by no more than is allowed in all; what grows beyond that is age. A
delay that a fast clock hides cannot be seen at all, it is part of the uncertainty.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Protocol

import numpy as np

_WINDOW = 1.0
"""Length of the windows [s]; the drift is fitted to the smallest delays of these."""

_WINDOWS = 60

_STEADY = 0.5
"""Fraction of the jump tolerance by which the delay may shrink while a jump is confirmed."""

_ROUND_OFF = 1e-9
"""Difference of two times [s] that is none."""


@dataclass(frozen=True, kw_only=True)
class ClockLimits:
    """Limits of a sender's clock.

    Attributes
    ----------
    rate : known rate by which it runs slower than ours [s/s].
    tolerance : largest difference of its rate from that [s/s].
    hidden : largest sum of delays that is taken for drift [s].
    jump_tolerance : by how much a delay may be below the smallest one so far [s].
    confirmations : readings in a row, consistent with each other, that make a jump a restart.
    """

    rate: float = 0.0
    tolerance: float = 1e-4
    hidden: float = 0.01
    jump_tolerance: float
    confirmations: int = 3


@dataclass(slots=True)  # not frozen: one is made for every frame with a sample time
class ClockReading:
    """What one sample time shows.

    Attributes
    ----------
    age : delay beyond the smallest one so far [s].
    jumped : the time does not continue those before: it went back, or forward by more than the delay can have
        shrunk. Data of the same frame are not to be used.
    restarted : enough readings have confirmed the jump; from the next reading on the new time counts.
    uncertainty : by how much the age may be larger [s].
    hides_delay : as much delay as is allowed has been taken for drift.
    resumed : the time continues that of before a restart which was not accepted.
    """

    age: float
    jumped: bool = False
    restarted: bool = False
    uncertainty: float = 0.0
    hides_delay: bool = False
    resumed: bool = False


_without_fields = object.__new__
"""Makes a reading whose fields are all still to be set, in half the time of making one by them."""


class SenderClock(Protocol):
    """A clock that dates samples; ``range`` is the time after which it wraps [s]."""

    range: float

    def read(self, local: float, ticks: int) -> ClockReading:
        """Take in a sample time that arrived at ``local`` on our clock [s]."""
        ...

    def reset(self) -> None:
        """Forget the sender."""
        ...

    def accept(self) -> None:
        """Take the time of the last restart for the sender's: that of before does not come back."""
        ...

    def anchor(self) -> None:
        """Take the delay of the last reading for the smallest one: somebody has checked it."""
        ...

    def seconds(self, ticks: int) -> float:
        """Return a sample time [s]."""
        ...

    def seconds_ahead(self, local: float, ticks: int) -> float:
        """Return by how much a sample time is ahead of the accepted clock at ``local`` [s]."""
        ...

    @property
    def drift_ppm(self) -> float:
        """How much slower than ours the sender's clock runs [ppm]; NaN if not known."""
        ...


@dataclass(kw_only=True, slots=True)
class _Model:
    """State of a clock.

    Attributes
    ----------
    ticks, source, local : last reading [ticks], its time by that clock and by ours [s].
    floor : smallest delay, raised with time [s].
    lowest : least value of the floor, less what was hidden before a restart [s].
    start : our time of the first reading [s].
    fastest : delay at the start of the fastest clock that no reading contradicts [s].
    """

    ticks: int
    source: float
    local: float
    floor: float
    lowest: float
    start: float
    fastest: float
    readings: int = 1


class SampleClock:
    """Follows one sender's clock. A jump counts only after later readings have confirmed it.

    Parameters
    ----------
    tick : unit of the sample time [s].
    bits : length of the sample time, which wraps.
    limits : of the clock.
    """

    def __init__(self, tick: float, bits: int, limits: ClockLimits) -> None:
        self._tick, self._half, self._whole = tick, 1 << (bits - 1), 1 << bits
        self.range = self._whole * tick
        """Time after which it wraps [s]."""
        # Time [s] below which it has not wrapped for certain, whatever the round-off.
        self._unwrapped = (self._half - 1) * tick
        self._limits = limits
        # Read for every frame with a sample time.
        self._pace, self._tolerance, self._hidden = 1.0 - limits.rate, limits.tolerance, limits.hidden
        self._jump_tolerance, self._sums_hide = limits.jump_tolerance, limits.hidden - _ROUND_OFF
        self._minima: deque[tuple[float, float]] = deque(maxlen=_WINDOWS)
        self._window_start = self._window_min = np.inf
        self.reset()

    def reset(self) -> None:
        """Forget the sender."""
        self._known: _Model | None = None
        self._jumped: _Model | None = None
        self._before: _Model | None = None
        self._begin_drift(np.inf, np.inf)

    def read(self, local: float, ticks: int) -> ClockReading:
        """Take in a sample time that arrived at ``local`` on our clock [s]."""
        local *= self._pace
        known = self._known
        if known is None:
            self._known = known = self._new(local, ticks)
            self._begin_drift(local, known.floor)
            return ClockReading(0.0)
        offset = self._follow(known, local, ticks)
        if offset is not None:
            self._jumped = None
            if offset < self._window_min:
                self._window_min = offset
            if local - self._window_start >= _WINDOW:
                self._minima.append((self._window_start, self._window_min))
                self._window_start, self._window_min = local, offset
            return self._reading(known, offset, False)
        if self._before is not None and (offset := self._follow(self._before, local, ticks)) is not None:
            self._known, self._before, self._jumped = self._before, None, None
            self._begin_drift(local, self._known.floor)
            return self._reading(self._known, offset, True)
        return self._jump(local, ticks)

    def _jump(self, local: float, ticks: int) -> ClockReading:
        """Take in a sample time that does not fit."""
        assert self._known is not None
        # Cycles that were held back come one behind the other, each a cycle less late than the one before.
        if self._jumped is None or self._follow(self._jumped, local, ticks, _STEADY) is None:
            self._jumped = self._new(local, ticks)
        if self._jumped.readings < self._limits.confirmations:
            return ClockReading(0.0, jumped=True)
        old = self._before or self._known
        # A queue on the way outlives a restart of the sender: what may hide in it still may.
        self._jumped.lowest -= old.floor - old.lowest
        self._jumped.fastest -= self._uncertainty(old, local)
        self._known, self._before, self._jumped = self._jumped, old, None
        self._begin_drift(local, self._known.floor)
        return ClockReading(0.0, jumped=True, restarted=True)

    def accept(self) -> None:
        """Take the time of the last restart for the sender's: that of before does not come back."""
        self._before = None

    def anchor(self) -> None:
        """Take the delay of the last reading for the smallest one: somebody has checked it."""
        if (known := self._known) is not None:
            known.lowest = known.fastest = known.floor = known.local - known.source
            known.start = known.local

    def seconds(self, ticks: int) -> float:
        """Return a sample time [s]."""
        return ticks * self._tick

    def seconds_ahead(self, local: float, ticks: int) -> float:
        """Return by how much a sample time is ahead of the accepted clock at ``local`` [s]."""
        model = self._before or self._known
        if model is None:
            return 0.0
        expected = model.ticks + round((local * (1.0 - self._limits.rate) - model.local) / self._tick)
        return ((ticks - expected + self._half) % (2 * self._half) - self._half) * self._tick

    def _new(self, local: float, ticks: int) -> _Model:
        source = ticks * self._tick
        delay = local - source
        return _Model(
            ticks=ticks, source=source, local=local, floor=delay, lowest=delay, start=local, fastest=delay
        )

    def _follow(self, model: _Model, local: float, ticks: int, tolerated: float = 1.0) -> float | None:
        """Update ``model`` with a reading and return its delay [s]; None, with no update, if they do not fit.

        ``tolerated`` is the fraction of the jump tolerance by which the delay may shrink.
        """
        # Without min() and max(), as calls are what this takes most of its time for.
        elapsed, half, floor, lowest = local - model.local, self._half, model.floor, model.lowest
        if elapsed < 0.0:
            elapsed = 0.0
        if elapsed < self._unwrapped:
            since = (ticks - model.ticks + half) % self._whole - half
        else:
            # After half the range our clock tells how often the time wrapped.
            expected = round(elapsed / self._tick)
            if expected < half:
                expected = 0
            since = expected + (ticks - model.ticks - expected + half) % self._whole - half
        source = model.source + since * self._tick
        offset, tolerance = local - source, self._tolerance
        drift = tolerance * elapsed
        if source < model.source or offset < floor - drift - tolerated * self._jump_tolerance:
            return None
        raised, highest = floor + drift, lowest + self._hidden
        if highest < raised:
            raised = highest
        if raised > floor:
            floor = raised
        if offset < floor:
            floor = offset
        model.ticks, model.source, model.local, model.floor = ticks, source, local, floor
        if floor < lowest:
            model.lowest = floor
        fastest = offset + tolerance * (local - model.start)
        if fastest < model.fastest:
            model.fastest = fastest
        model.readings += 1
        return offset

    def _reading(self, model: _Model, offset: float, resumed: bool) -> ClockReading:
        floor, reading = model.floor, _without_fields(ClockReading)
        reading.age, reading.jumped, reading.restarted, reading.resumed = offset - floor, False, False, resumed
        reading.uncertainty = floor - model.fastest + self._tolerance * (model.local - model.start)
        reading.hides_delay = floor - model.lowest >= self._sums_hide
        return reading

    def _uncertainty(self, model: _Model, local: float) -> float:
        """Return by how much delays may be larger than stated [s]: as much as with the fastest clock possible."""
        return model.floor - model.fastest + self._limits.tolerance * (local - model.start)

    def _begin_drift(self, local: float, offset: float) -> None:
        self._minima.clear()
        self._window_start, self._window_min = local, offset

    @property
    def drift_ppm(self) -> float:
        """How much slower than ours the sender's clock runs [ppm]; NaN before there are enough readings."""
        if len(self._minima) < 5:
            return float("nan")
        time, minimum = np.array(self._minima).T
        slope = np.polyfit(time - time[0], minimum - minimum[0], 1)[0]
        return float(1e6 * (slope + self._limits.rate))
