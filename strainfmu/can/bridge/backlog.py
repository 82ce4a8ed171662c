"""Which cycles are answered when there is no time for all: the newest, not the old ones behind each other."""

from __future__ import annotations

_CAUGHT_UP = 1.0
"""Wait [cycles] from which on cycles are answered again."""

_MOST_SKIPPED = 25
"""Cycles in a row that are not answered: the next says what the strains are by then, be it STALE."""


class Backlog:
    """Tells by how long frames have waited whether their cycle is answered or skipped.

    A bridge that is behind and answers every cycle answers all of them too late. So once one has waited for half
    of ``max_age``, cycles are skipped until one has waited for no more than one cycle: seldom and several at once,
    because the answer behind a gap is at best DEGRADED.

    Parameters
    ----------
    max_age : largest age of strains that are used [cycles]; half of it is left for the answer itself.
    cycle_time : [s].
    """

    def __init__(self, max_age: float, cycle_time: float) -> None:
        self._caught_up = _CAUGHT_UP * cycle_time
        self._longest = max(0.5 * max_age * cycle_time, self._caught_up)
        self._behind = False
        self._skipped = 0

    def is_answered(self, waited: float) -> bool:
        """Tell whether the cycle is answered whose frames have waited for ``waited`` [s]."""
        self._behind = waited > (self._caught_up if self._behind else self._longest)
        self._skipped = self._skipped + 1 if self._behind and self._skipped < _MOST_SKIPPED else 0
        return self._skipped == 0
