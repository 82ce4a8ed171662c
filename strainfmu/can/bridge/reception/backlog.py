"""The backlog of a bridge that is too slow for its input: it answers the newest cycles and skips old ones."""

from __future__ import annotations

_CAUGHT_UP = 1.0
"""Wait [cycles] below which cycles are answered again."""

_MAX_SKIPPED = 25
"""Maximum number of cycles skipped in a row: the next is answered, even if its strains are STALE by then."""


_QUICK = 0.5
"""Time of an answer [cycles] up to which a bridge that is behind catches up by itself."""

_FORGETTING = 0.05
"""Weight of the last answer in the mean time of answers."""


class Backlog:
    """Decides by the waiting time of its frames whether a cycle is answered or skipped.

    A bridge that is slower than its input and answers every cycle answers all of them too late. So once a cycle
    has waited for half of ``max_age``, cycles are skipped until one has waited for at most one cycle. Gaps are
    rare and long, because the answer after a gap is at best DEGRADED. A bridge whose answers take less than half a
    cycle, and that was only held up, catches up without a gap: it skips what cannot be answered in time, no more.

    Parameters
    ----------
    max_age : maximum age of strains that are used [cycles]; half of it is left for the answer itself.
    cycle_time : [s].
    """

    def __init__(self, max_age: float, cycle_time: float) -> None:
        self._caught_up = _CAUGHT_UP * cycle_time
        self._longest = max(0.5 * max_age * cycle_time, self._caught_up)
        self._behind = False
        self._skipped = 0
        self._in_time, self._quick = max_age * cycle_time, _QUICK * cycle_time
        self._answer_time: float | None = None

    def answered(self, seconds: float) -> None:
        """Note that the answer of a cycle took so long [s]."""
        known = self._answer_time
        self._answer_time = seconds if known is None else known + _FORGETTING * (seconds - known)

    def is_answered(self, waited: float) -> bool:
        """Return whether a cycle is answered whose frames have waited for ``waited`` [s]."""
        if self._answer_time is not None and self._answer_time <= self._quick:
            self._behind = waited > self._in_time - self._answer_time
        else:
            self._behind = waited > (self._caught_up if self._behind else self._longest)
        self._skipped = self._skipped + 1 if self._behind and self._skipped < _MAX_SKIPPED else 0
        return self._skipped == 0
