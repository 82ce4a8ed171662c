"""The proof that a sender whose time has jumped is the sender, and not a recording of it.

A recording of this run repeats frames bit by bit, so what has been received before proves nothing. New frames
prove a restart if the time base began after the sender was last heard (it was switched on), or if the time went
ahead and the counter continues at its pace (its clock was set). Anything else stays unproven until somebody
confirms it. A recording of an earlier run can give all of this: only authentication excludes it.

A test stand that sends the same stimulus again and again is accepted without this proof if its user says so; then
any recording passes for the sender.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import nan

import numpy as np

from strainfmu.can.wire.compiled import ARRAY, INTEGER, NUMBER, Record, function, pointer

_WORDS = 1 << 20
"""Of 64 bits: the place of a word takes 20 bits of a CRC-32, and the places of two bits in it the other 12."""


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
    accepts : a jump of the time that ``new_frames`` cycles in a row confirm needs no more proof.
    """

    period: float
    new_frames: int
    startup_time: float
    pause: float
    max_delta: int
    counter_modulus: int | None
    accepts: bool = False


class ProofRecord(Record):
    """A proof for compiled code, which takes in the cycles."""

    position = 12
    _fields_ = (
        *((name, INTEGER) for name in ("new_frames", "max_delta", "modulus", "accepts")),
        *((name, NUMBER) for name in ("period", "startup_time", "pause")),
        *((name, INTEGER) for name in ("is_proven", "n_new", "begins", "has_begun", "has_last", "last_counter")),
        ("last_local", NUMBER),
        ("heard", NUMBER),
    )


class RestartProof:
    """Follows whether the sender is proven; at the start it is, as there is nothing to compare it with."""

    def __init__(self, limits: ProofLimits) -> None:
        self.limits = limits
        self.record = ProofRecord(
            new_frames=limits.new_frames,
            max_delta=limits.max_delta,
            modulus=limits.counter_modulus or 0,
            accepts=int(limits.accepts),
            period=limits.period,
            startup_time=limits.startup_time,
            pause=limits.pause,
            is_proven=1,
            n_new=0,
            begins=0,
            has_begun=0,
            has_last=0,
            last_counter=-1,
            last_local=0.0,
            heard=nan,
        )

    @property
    def is_proven(self) -> bool:
        """Whether the sender is proven."""
        return bool(self.record.is_proven)

    def confirm(self) -> None:
        """Take the sender for proven."""
        self.record.is_proven, self.record.n_new, self.record.has_last = 1, 0, 0


class _StrainTimeRecord(Record):
    position = 13
    _fields_ = (("local", NUMBER), ("seconds", NUMBER), ("proof", ARRAY))


class StrainTime:
    """The present time by the clock of the strains; compiled code takes in the cycles, which state it."""

    def __init__(self, proof: RestartProof | None) -> None:
        record = None if proof is None else proof.record
        self.record = _StrainTimeRecord(local=nan, seconds=nan, proof=record)
        self._now, self._found = NUMBER(), NUMBER()
        self._at = pointer(self.record), pointer(self._now), pointer(self._found)
        self._find = function("sb_strain_time", _StrainTimeRecord)

    def at(self, now: float) -> float:
        """Return it at ``now`` [s] of our clock [s]; NaN if it is not known, or its sender not proven."""
        self._now.value = now
        self._find(*self._at)
        return self._found.value
