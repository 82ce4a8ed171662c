"""The assembly of frames to cycles: a pure state machine, frames and times in, closed cycles out.

A cycle is closed when it is complete, when a frame of the next one comes, or at its deadline. The sample time
separates cycles where every frame holds one; elsewhere the trailer does, or a frame that comes a second time.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

from strainfmu.arrays import IntArray
from strainfmu.can.wire.frame import Frame
from strainfmu.can.wire.signal_plan import SignalPlan


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
    def raw(self) -> IntArray:
        """(k,) raw numbers of its k signals."""
        return self.plan.raw(self.frame.data)


arrival_without_fields = object.__new__
"""Makes an Arrival whose fields are all still to be set, in half the time of making one by them."""


@dataclass(eq=False, slots=True)
class Cycle:
    """Frames of one cycle by slot; ``first`` came at ``first_time``, the last one at ``last_time`` [s]."""

    first: Arrival
    first_time: float
    last_time: float
    arrivals: dict[int, Arrival] = field(default_factory=dict)


class Verdict(Enum):
    """Fate of an offered frame."""

    ACCEPTED = "accepted"
    REPEATED = "repeated"
    LATE = "late"
    RESTARTED = "accepted after a restart of the sender"


_ACCEPTED, _REPEATED, _LATE, _RESTARTED = Verdict


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


class CycleAssembler:
    """Puts frames into cycles. At most one cycle is open; frames of older ones are refused."""

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self._is_timed = limits.clock_bits is not None
        self._n_slots, self._trailer, self._deadline = limits.n_slots, limits.trailer, limits.deadline
        self._half = 1 << ((limits.clock_bits or 1) - 1)
        self._whole = 2 * self._half
        self._open: Cycle | None = None
        self.deadline: float | None = None
        """Time at which the open cycle ends [s], None if none is open."""
        self._newest: int | None = None
        self._late = 0

    def reset(self) -> list[Cycle]:
        """Forget the sender; return the open cycle, if any."""
        self._newest, self._late = None, 0
        return self._close()

    def due(self, now: float) -> list[Cycle]:
        """Return the open cycle if its deadline is over at ``now`` [s]."""
        deadline = self.deadline
        return self._close() if deadline is not None and deadline <= now else []

    def offer(self, arrival: Arrival) -> tuple[Verdict, list[Cycle]]:
        """Take in a frame; return its fate and the cycles that it closes, the older first."""
        verdict, slot, current = _ACCEPTED, arrival.slot, self._open
        closed: list[Cycle] = []
        if self._is_timed:
            verdict = self._in_time(arrival)
            if verdict is _LATE or verdict is _REPEATED:
                return verdict, closed
            is_next = arrival.sample_time != self._newest or verdict is _RESTARTED
        else:
            is_next = current is not None and slot in current.arrivals
        if is_next and current is not None:
            closed.append(current)
            current = None
        self._late = 0
        time = arrival.frame.time
        if current is None:
            self._open = current = Cycle(arrival, time, time, {})
            self.deadline, self._newest = time + self._deadline, arrival.sample_time
        elif time > current.last_time:
            current.last_time = time
        arrivals = current.arrivals
        arrivals[slot] = arrival
        if len(arrivals) == self._n_slots or slot == self._trailer:
            closed.append(current)
            self._open = self.deadline = None
        return verdict, closed

    def _in_time(self, arrival: Arrival) -> Verdict:
        """Compare the sample time of ``arrival`` with that of the newest cycle."""
        sample_time, newest, current = arrival.sample_time, self._newest, self._open
        assert sample_time is not None
        if newest is None:
            return _ACCEPTED
        # Its own time if it is ahead by less than half of the range, that of the newest cycle, or an old one.
        ahead = (sample_time - newest) % self._whole
        if 0 < ahead < self._half:
            return _ACCEPTED
        if current is not None and ahead == 0 and arrival.counter == current.first.counter:
            return _REPEATED if arrival.slot in current.arrivals else _ACCEPTED
        self._late += 1
        return _LATE if self._late <= self._limits.late_limit else _RESTARTED

    def _close(self) -> list[Cycle]:
        closed = [] if self._open is None else [self._open]
        self._open = self.deadline = None
        return closed
