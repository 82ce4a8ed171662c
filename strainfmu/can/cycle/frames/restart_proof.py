"""The proof that a sender whose time has jumped is the sender, and not a recording of it.

A recording of this run repeats frames bit by bit, so what has been received before proves nothing. New frames
prove a restart if the time base began after the sender was last heard (it was switched on), or if the time went
ahead and the counter continues at its pace (its clock was set). Anything else stays unproven until somebody
confirms it. A recording of an earlier run can give all of this: only authentication excludes it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from strainfmu.can.e2e.sample_clock import ClockReading, SenderClock
from strainfmu.can.wire.compiled import function, pointer

_WORDS = 1 << 20
"""Of 64 bits: the place of a word takes 20 bits of a CRC-32, and those of two bits in it the other 12."""


class SeenFrames:
    """Remembers frames of a run in 8 MiB, as a Bloom filter that keeps the bits of a frame in one word.

    No frame is ever forgotten. A new one is taken for an old one once in 500 after 10^6 frames and once in
    14 after 10^7, so a long run makes proofs slower and never easier. Source: F. Putze, P. Sanders, J. Singler,
    Cache-, hash- and space-efficient Bloom filters, ACM J. Exp. Algorithmics 14, 2009 (blocked filters).
    """

    def __init__(self) -> None:
        self.words = np.zeros(_WORDS, dtype=np.uint64)
        self._at, self._add = pointer(self.words), function("sb_seen_add")

    def add(self, frames: Iterable[bytes]) -> bool:
        """Remember ``frames``; return whether all of them are new."""
        add, at, are_new = self._add, self._at, True
        for data in frames:
            if not add(at, data, len(data)):
                are_new = False
        return are_new


@dataclass(frozen=True, kw_only=True)
class ProofLimits:
    """Limits of a proof.

    Attributes
    ----------
    period : nominal time from one frame to the next [s].
    new_frames : cycles in a row that must be new.
    startup_time : largest time of a clock at its start [s].
    pause : silence after which a sender without sample time may be a recording [s].
    max_delta : largest error of the counter.
    counter_modulus : number of counter values, None without a counter.
    """

    period: float
    new_frames: int
    startup_time: float
    pause: float
    max_delta: int
    counter_modulus: int | None


class RestartProof:
    """Follows whether the sender is proven; at the start it is, as there is nothing to compare it with."""

    def __init__(self, limits: ProofLimits) -> None:
        self.limits = limits
        self._last: tuple[float, int | None] | None = None
        self._new = 0
        self._heard: float | None = None
        self._begins = False
        self.is_proven = True

    def take(
        self,
        clock: SenderClock,
        reading: ClockReading,
        *,
        local: float,
        ticks: int,
        counter: int | None,
        is_new: bool,
    ) -> bool:
        """Take in a cycle with sample time; return whether its sender has been proven to be restarted with it.

        Parameters
        ----------
        reading : of ``clock`` at ``local`` [s] and ``ticks``.
        is_new : no frame of the cycle has been received before.
        """
        if not reading.jumped and (self.is_proven or reading.resumed):
            self.is_proven, self._new, self._last = True, 0, (local, counter)
            self._begins = False
            return False
        self._new = self._new + 1 if is_new else 0
        if reading.jumped:
            silence = 0.0 if self._last is None else local - self._last[0]
            self._begins = clock.seconds(ticks) <= self.limits.startup_time + silence
        if reading.jumped and not reading.restarted:
            return False
        self.is_proven = self._new >= self.limits.new_frames and (
            self._has_begun(clock, ticks, counter) or self._was_set_ahead(clock, local, ticks, counter)
        )
        if self.is_proven:
            self._last = local, counter
        return self.is_proven

    def take_untimed(self, local: float, is_new: bool) -> None:
        """Take in a cycle without sample time: behind a pause it may be a recording until it is new."""
        if self._heard is not None and local - self._heard > self.limits.pause:
            self.is_proven, self._new = False, 0
        self._heard = local
        self._new = self._new + 1 if is_new else 0
        self.is_proven = self.is_proven or self._new >= self.limits.new_frames

    def confirm(self) -> None:
        """Take the sender for proven."""
        self.is_proven, self._new, self._last = True, 0, None

    def _has_begun(self, clock: SenderClock, ticks: int, counter: int | None) -> bool:
        """Return whether the clock began after the sender was last heard, and the counter no earlier."""
        modulus, limits = self.limits.counter_modulus, self.limits
        largest = clock.seconds(ticks) / limits.period + limits.max_delta
        return self._begins and (modulus is None or counter is None or counter <= largest or largest >= modulus)

    def _was_set_ahead(self, clock: SenderClock, local: float, ticks: int, counter: int | None) -> bool:
        """Return whether the time went ahead while the counter continued at its pace."""
        if self._last is None or clock.seconds_ahead(local, ticks) <= 0.0:
            return False
        modulus, (since, last) = self.limits.counter_modulus, self._last
        if modulus is None or counter is None or last is None:
            return True
        error = counter - last - round((local - since) / self.limits.period)
        return abs((error + modulus // 2) % modulus - modulus // 2) <= self.limits.max_delta
