"""Time as the bridge uses it: one monotonic clock, handed in."""

from __future__ import annotations

import time
from collections.abc import Callable

Clock = Callable[[], float]
"""Returns seconds that never go back."""

monotonic: Clock = time.monotonic
