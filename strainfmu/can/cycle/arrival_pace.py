"""Cycles without a sample time that were held back: told by their pace, once the input has paused.

What a gateway has kept comes faster than any sender sends. The first cycle after a pause may be kept or new; so
none is believed until a few have come at a pace that a sender can mean.
"""

from __future__ import annotations

from collections import deque

_LOOKED_AT = 4
"""Cycles whose pace is looked at: more than one, as interfaces hand frames over by the pair."""


class ArrivalPace:
    """Follows when cycles come.

    Parameters
    ----------
    pause : time without a cycle [s] behind which cycles may have been held back for too long.
    fastest : cycles per second that a sender can mean.
    """

    def __init__(self, pause: float, fastest: float) -> None:
        self._pause, self._least_span = pause, (_LOOKED_AT - 1) / fastest
        self._last: float | None = None
        self._since_pause: deque[float] = deque(maxlen=_LOOKED_AT)
        self._has_paused = False

    def take(self, time: float) -> bool:
        """Take in a cycle that came at ``time`` [s]; tell whether it may have been held back."""
        if self._last is not None and time - self._last > self._pause:
            self._has_paused = True
            self._since_pause.clear()
        self._last = time
        if not self._has_paused:
            return False
        self._since_pause.append(time)
        span = time - self._since_pause[0]
        self._has_paused = len(self._since_pause) < _LOOKED_AT or span < self._least_span
        return self._has_paused
