"""The backlog of a bridge that is too slow for its input: it answers the newest cycles and skips old ones."""

from __future__ import annotations

_CAUGHT_UP = 1.0
"""Wait [cycles] below which cycles are answered again."""

_MAX_SKIPPED = 25
"""Maximum number of cycles skipped in a row: the next is answered, even if its strains are STALE by then."""


class Backlog:
    """Decides by the waiting time of its frames whether a cycle is answered or skipped.

    A bridge that is behind and answers every cycle answers all of them too late. So once a cycle has waited for
    half of ``max_age``, cycles are skipped until one has waited for at most one cycle. Gaps are rare and long,
    because the answer after a gap is at best DEGRADED.

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

    def is_answered(self, waited: float) -> bool:
        """Return whether a cycle is answered whose frames have waited for ``waited`` [s]."""
        self._behind = waited > (self._caught_up if self._behind else self._longest)
        self._skipped = self._skipped + 1 if self._behind and self._skipped < _MAX_SKIPPED else 0
        return self._skipped == 0
