"""The clock of a bridge: monotonic, passed in by the caller."""

from __future__ import annotations

import time
from collections.abc import Callable

Clock = Callable[[], float]
"""Returns seconds that never go back."""

monotonic: Clock = time.monotonic


def synchronised_shift(clock: Clock) -> float:
    """Return the system's time less ``clock`` [s]; the system's is synchronised by PTP or NTP, if anything is."""
    return time.time() - clock()
