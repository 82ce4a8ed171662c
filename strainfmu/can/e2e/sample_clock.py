"""The sender's clock seen from ours: age of a sample, jumps and drift of the clock.

The delay of a frame is known only relative to the smallest delay so far: a constant transmission time is not part
of the age. The smallest delay is forgotten slowly, but faster than clocks drift, so that drift never looks like
age.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

_WINDOW = 1.0
"""Length of the windows [s]; the drift is fitted to the smallest delays of these."""

_WINDOWS = 60


@dataclass(frozen=True)
class ClockReading:
    """What one sample time shows.

    Attributes
    ----------
    age : delay beyond the smallest one so far [s].
    jumped : the time does not continue those before: it went back, or forward by more than the delay can have
        shrunk. Data of the same frame are not to be used.
    restarted : enough readings have confirmed the jump; from the next reading on the new time counts.
    """

    age: float
    jumped: bool = False
    restarted: bool = False


@dataclass(kw_only=True)
class _Model:
    """State of a clock: last reading [ticks], its time by that clock and by ours [s], smallest delay [s]."""

    ticks: int
    source: float
    local: float
    offset: float
    readings: int = 1


class SampleClock:
    """Follows one sender's clock. A jump counts only after later readings have confirmed it.

    Parameters
    ----------
    tick : unit of the sample time [s].
    bits : length of the sample time, which wraps.
    drift : rate at which the smallest delay is forgotten [s/s].
    jump_tolerance : by how much a delay may be below the smallest one so far [s].
    confirmations : readings in a row, consistent with each other, that make a jump a restart.
    """

    def __init__(
        self, tick: float, bits: int, drift: float, jump_tolerance: float, confirmations: int = 3
    ) -> None:
        self._tick, self._half = tick, 1 << (bits - 1)
        self._drift, self._jump_tolerance = drift, jump_tolerance
        self._confirmations = confirmations
        self._minima: deque[tuple[float, float]] = deque(maxlen=_WINDOWS)
        self.reset()

    def reset(self) -> None:
        """Forget the sender."""
        self._known: _Model | None = None
        self._jumped: _Model | None = None
        self._begin_drift(np.inf, np.inf)

    def read(self, local: float, ticks: int) -> ClockReading:
        """Take in a sample time that arrived at ``local`` on our clock [s]."""
        if self._known is None:
            self._known = self._new(local, ticks)
            self._begin_drift(local, self._known.offset)
            return ClockReading(0.0)
        offset = self._follow(self._known, local, ticks)
        if offset is not None:
            self._jumped = None
            self._watch_drift(local, offset)
            return ClockReading(offset - self._known.offset)
        if self._jumped is None or self._follow(self._jumped, local, ticks) is None:
            self._jumped = self._new(local, ticks)
        if self._jumped.readings < self._confirmations:
            return ClockReading(0.0, jumped=True)
        self._known, self._jumped = self._jumped, None
        self._begin_drift(local, self._known.offset)
        return ClockReading(0.0, jumped=True, restarted=True)

    def _new(self, local: float, ticks: int) -> _Model:
        source = ticks * self._tick
        return _Model(ticks=ticks, source=source, local=local, offset=local - source)

    def _follow(self, model: _Model, local: float, ticks: int) -> float | None:
        """Update ``model`` with a reading and return its delay [s]; None, with no update, if they do not fit."""
        delta = (ticks - model.ticks + self._half) % (2 * self._half) - self._half
        source = model.source + delta * self._tick
        offset = local - source
        remembered = model.offset + self._drift * (local - model.local)
        if delta < 0 or offset < remembered - self._jump_tolerance:
            return None
        model.ticks, model.source, model.local = ticks, source, local
        model.offset = min(remembered, offset)
        model.readings += 1
        return offset

    def _begin_drift(self, local: float, offset: float) -> None:
        self._minima.clear()
        self._window_start, self._window_min = local, offset

    def _watch_drift(self, local: float, offset: float) -> None:
        """Keep the smallest delay of every window."""
        self._window_min = min(self._window_min, offset)
        if local - self._window_start >= _WINDOW:
            self._minima.append((self._window_start, self._window_min))
            self._window_start, self._window_min = local, offset

    @property
    def drift_ppm(self) -> float:
        """How much slower than ours the sender's clock runs [ppm]; NaN before there are enough readings."""
        if len(self._minima) < 5:
            return float("nan")
        time, minimum = np.array(self._minima).T
        return float(1e6 * np.polyfit(time - time[0], minimum - minimum[0], 1)[0])
