"""A run without pauses of Python itself: threads hand over soon, garbage is looked for among new objects alone."""

from __future__ import annotations

import gc
import sys
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def undisturbed(hand_over: float) -> Iterator[None]:
    """Let no thread keep Python to itself for longer than ``hand_over`` [s], and collect little garbage at a time.

    To look among all objects that a run begins with takes 70 ms or more, twice a minute at 1 kHz.
    """
    before = sys.getswitchinterval()
    sys.setswitchinterval(min(hand_over, before))
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()
        sys.setswitchinterval(before)
