"""Strains that repeat an earlier cycle's bit by bit, as a sender sends that repeats a buffer.

The readings of each frame and of each cycle are kept as a hash of 64 bits, at most PLACES of them, also of frames
that were refused by counter or time. The noise of the gauges gives the probability that two frames have
the same readings (:mod:`~strainfmu.can.cycle.gauges.quantised_noise`). Times the number of hashes, it bounds
the probability that chance repeats any of them. Below FALSE_ALARM the strains are old. Frames of few gauges, or on
rigs so quiet that chance repeats them, are not kept.
"""

from __future__ import annotations

import numpy as np

from strainfmu.can.cycle.gauges.freeze_watch import FreezeWatch
from strainfmu.can.cycle.gauges.noise import GaugeNoise
from strainfmu.can.cycle.gauges.plausibility import GaugeChecks
from strainfmu.can.wire.compiled import ARRAY, INTEGER, NUMBER, Record, function, pointer
from strainfmu.can.wire.cycle_plan import DecodedCycle

PLACES = 1 << 18
"""``SB_REPEATS_PLACES`` of strainbus.h."""


ALARM = 11
"""Cycles for which one that repeats an earlier one counts: of a buffer, some may never have come before."""


class _Repeats(Record):
    position = 17
    _fields_ = (
        ("hash", ARRAY),
        ("last", ARRAY),
        ("is_kept", ARRAY),
        *((name, INTEGER) for name in ("n_groups", "n", "counts", "alarm")),
        ("limit", NUMBER),
    )


class RepeatedStrains:
    """Remembers the readings of cycles, for compiled code; ``noise`` is the gauges' noise."""

    def __init__(self, noise: GaugeNoise) -> None:
        probability = FreezeWatch(noise).log_repeated()
        n_groups, is_kept = len(probability), probability < FreezeWatch.limit
        is_kept[0] &= n_groups > 2  # a single frame holds all gauges
        self.record = _Repeats(
            hash=np.zeros(PLACES, dtype=np.uint64),
            last=np.zeros(n_groups, dtype=np.uint64),
            is_kept=is_kept,
            n_groups=n_groups,
            n=0,
            counts=0,
            alarm=ALARM,
            limit=FreezeWatch.limit,
        )
        self._at = pointer(self.record)
        self._remember = function("sb_repeats_remember", _Repeats)
        self._forget = function("sb_repeats_forget", _Repeats)

    def remember(self, checks: GaugeChecks, cycle: DecodedCycle) -> None:
        """Remember the frames of a cycle that is not judged."""
        self._remember(self._at, pointer(checks.record), cycle.address)

    def forget(self) -> None:
        """Forget all cycles, as somebody has checked the sender."""
        self._forget(self._at)
