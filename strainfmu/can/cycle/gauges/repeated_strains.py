"""Strains that repeat those of an earlier cycle bit by bit, as a sender sends that repeats a buffer.

The readings of each cycle are kept as a hash of 64 bits, at most PLACES of them. The noise of the gauges gives the
probability that two cycles have the same readings (:mod:`~strainfmu.can.cycle.gauges.quantised_noise`). This
probability times the number of cycles kept bounds the probability that chance repeats any of them. Below
FALSE_ALARM the strains are old. On rigs so quiet that chance repeats cycles, nothing is found.
"""

from __future__ import annotations

import numpy as np

from strainfmu.can.cycle.gauges.freeze_watch import FreezeWatch
from strainfmu.can.wire.compiled import ARRAY, INTEGER, NUMBER, Record, function, pointer

PLACES = 1 << 16
"""``SB_REPEATS_PLACES`` of strainbus.h."""


ALARM = 11
"""Cycles for which one that repeats an earlier one counts: of a buffer, some may never have come before."""


class _Repeats(Record):
    position = 17
    _fields_ = (
        ("hash", ARRAY),
        *((name, INTEGER) for name in ("n", "last", "counts", "alarm")),
        ("limit", NUMBER),
    )


class RepeatedStrains:
    """Remembers the readings of cycles, for compiled code."""

    def __init__(self) -> None:
        words = np.zeros(PLACES, dtype=np.uint64)
        self.record = _Repeats(hash=words, n=0, last=0, counts=0, alarm=ALARM, limit=FreezeWatch.limit)
        self._at, self._forget = pointer(self.record), function("sb_repeats_forget", _Repeats)

    def forget(self) -> None:
        """Forget all cycles, as somebody has checked the sender."""
        self._forget(self._at)
