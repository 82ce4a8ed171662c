"""The assembly of frames to cycles: a state machine in compiled code, frames and times in, closed cycles out.

A cycle is closed when it is complete, when a frame of the next one comes, or at its deadline. The sample time
separates cycles where every frame holds one; elsewhere the trailer does, or a frame that comes a second time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from math import inf
from typing import Any

import numpy as np

from strainfmu.arrays import IntArray
from strainfmu.can.wire.compiled import ARRAY, INTEGER, NUMBER, Record, address, function, pointer
from strainfmu.can.wire.frame import Frame
from strainfmu.can.wire.signal_plan import SignalPlan

_SAMPLE_TIME, _N_NUMBERS = 1, 4
"""Of strainbus.h."""


@dataclass(eq=False, slots=True)  # not frozen: one is made for every frame, and that costs thrice
class Arrival:
    """A frame of the input, of which only the numbers about it have been read.

    Attributes
    ----------
    slot : index of the frame in its cycle.
    frame : the frame.
    plan : its signals.
    sample_time : sender's clock [ticks], None if the frame has none.
    counter : E2E counter, None if the frame has none.
    status : sender's own status, 0 if the frame has none.
    """

    slot: int
    frame: Frame
    plan: SignalPlan
    sample_time: int | None = None
    counter: int | None = None
    status: int = 0

    @property
    def numbers(self) -> IntArray:
        """(4,) the numbers about it for compiled code: status, sample time, configuration, counter."""
        status = self.status - (1 << 64) if self.status >> 63 else self.status
        counter = -1 if self.counter is None else self.counter
        return np.array([status, self.sample_time or 0, 0, counter], dtype=np.int64)


arrival_without_fields = object.__new__
"""Makes an Arrival whose fields are all still to be set, in half the time of making one by them."""


class PartsRecord(Record):
    """The frames of a cycle by slot for compiled code."""

    position = 10
    _fields_ = (
        ("n", INTEGER),
        ("first_time", NUMBER),
        ("last_time", NUMBER),
        *((name, ARRAY) for name in ("data", "here", "order", "time", "number")),
    )


class Cycle:
    """Frames of one cycle. A later cycle takes the same place: it is good until the next frame is offered.

    Parameters
    ----------
    starts : where the bytes of each slot's frame begin, and the end of the last.
    """

    def __init__(self, starts: Sequence[int]) -> None:
        n = len(starts) - 1
        self._starts = starts
        self._data, self._here = np.zeros(starts[-1], dtype=np.uint8), np.zeros(n, dtype=np.uint8)
        order, time = np.zeros(n, dtype=np.int64), np.zeros(n)
        self._order: Any = order.data
        self._time: Any = time.data
        self._number = np.zeros((n, _N_NUMBERS), dtype=np.int64)
        self.record = PartsRecord(
            n=0,
            first_time=0.0,
            last_time=0.0,
            data=self._data,
            here=self._here,
            order=order,
            time=time,
            number=self._number,
        )
        self.address = pointer(self.record)

    @property
    def n(self) -> int:
        """Number of frames that have arrived."""
        return int(self.record.n)

    @property
    def slots(self) -> list[int]:
        """Slots of the frames that have arrived, in that order."""
        return self._order[: self.n].tolist()

    @property
    def first_time(self) -> float:
        """Arrival of its first frame [s]."""
        return float(self.record.first_time)

    @property
    def last_time(self) -> float:
        """The latest arrival of a frame [s]."""
        return float(self.record.last_time)

    @property
    def time_of_last(self) -> float:
        """Arrival of the frame that came last [s]; times may go back."""
        return float(self._time[self._order[self.n - 1]])

    @property
    def sample_time(self) -> int:
        """Sender's clock in its first frame [ticks], 0 of a frame without."""
        return int(self._number[self._order[0], _SAMPLE_TIME])

    def time_of(self, slot: int) -> float:
        """Return when the frame of a slot arrived [s]."""
        return float(self._time[slot])

    def hold(self, arrival: Arrival) -> None:
        """Complete the cycle by a frame that is held for it, and is none of its own."""
        slot, begin = arrival.slot, self._starts[arrival.slot]
        self._here[slot] = 1
        self._data[begin : self._starts[slot + 1]] = np.frombuffer(arrival.frame.data, dtype=np.uint8)
        self._number[slot] = arrival.numbers


class Verdict(Enum):
    """Fate of an offered frame."""

    ACCEPTED = "accepted"
    REPEATED = "repeated"
    LATE = "late"
    RESTARTED = "accepted after a restart of the sender"


_VERDICTS = (Verdict.ACCEPTED, Verdict.REPEATED, Verdict.LATE, Verdict.RESTARTED)
"""In the order of strainbus.h."""


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Definition of a cycle.

    Attributes
    ----------
    n_slots : number of frames of a complete cycle, trailer included.
    trailer : slot that ends a cycle, or None.
    deadline : from the first frame to the end [s].
    clock_bits : length of the sample time, or None where frames have none.
    late_limit : late frames in a row after which the sender is taken to have been restarted.
    """

    n_slots: int
    trailer: int | None
    deadline: float
    clock_bits: int | None
    late_limit: int


class AssemblerRecord(Record):
    """The assembly for compiled code."""

    position = 11
    _fields_ = (
        *((name, INTEGER) for name in ("n_slots", "n_whole", "trailer", "is_timed", "bits", "late_limit")),
        ("wait", NUMBER),
        ("start", ARRAY),
        ("parts", ARRAY),
        *((name, INTEGER) for name in ("open", "has_newest", "newest", "late")),
        ("deadline", NUMBER),
        ("closed", ARRAY),
    )


class CycleAssembler:
    """Puts frames into cycles, in compiled code. At most one cycle is open; frames of older ones are refused.

    Parameters
    ----------
    limits : what a cycle is.
    lengths : of the frames by slot: strains, then the trailer.
    """

    def __init__(self, limits: Limits, lengths: Sequence[int]) -> None:
        starts, closed = np.cumsum([0, *lengths], dtype=np.int64), np.zeros(2, dtype=np.int64)
        self._lengths = tuple(lengths)
        self._cycles = Cycle(starts.tolist()), Cycle(starts.tolist())
        self.record = AssemblerRecord(
            n_slots=len(lengths),
            n_whole=limits.n_slots,
            trailer=-1 if limits.trailer is None else limits.trailer,
            is_timed=limits.clock_bits is not None,
            bits=limits.clock_bits or 1,
            late_limit=limits.late_limit,
            wait=limits.deadline,
            start=starts,
            parts=np.array([address(cycle.record) for cycle in self._cycles], dtype=np.uint64),
            open=-1,
            has_newest=0,
            newest=0,
            late=0,
            deadline=inf,
            closed=closed,
        )
        self._time = NUMBER()
        self._at, self._at_time = pointer(self.record), pointer(self._time)
        self._offer, self._close = function("sb_offer", AssemblerRecord), function("sb_close", AssemblerRecord)
        self._one = [self._cycles[0]], [self._cycles[1]]
        self._last_closed: Any = closed.data

    @property
    def deadline(self) -> float:
        """Time at which the open cycle ends [s], infinite if none is open."""
        return float(self.record.deadline)

    def reset(self) -> list[Cycle]:
        """Forget the sender; return the open cycle, if any."""
        self.record.has_newest = self.record.late = 0
        return self._closed()

    def due(self, now: float) -> list[Cycle]:
        """Return the open cycle if its deadline is over at ``now`` [s]."""
        return self._closed() if self.deadline <= now else []

    def offer(self, arrival: Arrival) -> tuple[Verdict, list[Cycle]]:
        """Take in a frame; return its fate and the cycles that it closes, the older first.

        Raises
        ------
        ValueError
            The frame has another length than its slot's.
        """
        frame, slot = arrival.frame, arrival.slot
        if len(frame.data) != self._lengths[slot]:
            raise ValueError(f"expected {self._lengths[slot]} bytes, got {len(frame.data)}")
        self._time.value, numbers = frame.time, arrival.numbers
        return self.outcome(self._offer(self._at, slot, frame.data, pointer(numbers), self._at_time))

    def outcome(self, found: int) -> tuple[Verdict, list[Cycle]]:
        """Return fate and closed cycles by what compiled code returns of a frame."""
        count, closed = found // len(_VERDICTS), self._last_closed
        return _VERDICTS[found % len(_VERDICTS)], [self._cycles[closed[k]] for k in range(count)]

    def closed_one(self) -> list[Cycle]:
        """Return the cycle that the last frame has closed, where it is one."""
        return self._one[self._last_closed[0]]

    def _closed(self) -> list[Cycle]:
        index = self._close(self._at)
        return [] if index < 0 else [self._cycles[index]]
