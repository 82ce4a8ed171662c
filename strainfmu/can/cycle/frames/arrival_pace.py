"""The pace of cycles without a sample time: it shows which were held back after the input has paused.

A gateway releases the cycles that it kept faster than any sender sends. The first cycle after a pause may be kept
or new, so none is trusted until a few have come at the pace of a sender.
"""

from __future__ import annotations

from collections import deque

_LOOKED_AT = 4
"""Cycles over which the pace is taken: more than two, as interfaces hand frames over in pairs."""


class ArrivalPace:
    """Follows the arrival of cycles.

    Parameters
    ----------
    pause : time without a cycle [s] after which cycles may have been held back for too long.
    fastest : maximum number of cycles per second of a sender.
    """

    def __init__(self, pause: float, fastest: float) -> None:
        self._pause, self._min_span = pause, (_LOOKED_AT - 1) / fastest
        self._last: float | None = None
        self._since_pause: deque[float] = deque(maxlen=_LOOKED_AT)
        self._has_paused = False

    def take(self, time: float) -> bool:
        """Take in a cycle that came at ``time`` [s]; return whether it may have been held back."""
        if self._last is not None and time - self._last > self._pause:
            self._has_paused = True
            self._since_pause.clear()
        self._last = time
        if not self._has_paused:
            return False
        self._since_pause.append(time)
        span = time - self._since_pause[0]
        self._has_paused = len(self._since_pause) < _LOOKED_AT or span < self._min_span
        return self._has_paused
