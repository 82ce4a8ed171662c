"""Reception in the stepping thread itself, from a raw socket: no second thread to wait for, frames in batches."""

from __future__ import annotations

import time
from collections.abc import Callable
from math import inf

from strainfmu.can.bridge.bus.raw_bus import RawBus
from strainfmu.can.bridge.reception.receiver import AT_ONCE, FrameQueue, ReceiverBase
from strainfmu.can.cycle.frames.acceptance import Acceptance
from strainfmu.can.cycle.frames.account import FrameClass
from strainfmu.can.e2e.clock import Clock
from strainfmu.can.wire.frame import Frame, MalformedFrame

_FEW = 2
"""Cycles of frames that wait at once in which the core alone finds wrong formats and a babbling sender."""

_OWN = FrameClass.OWN

LONGEST_EXPECTED = 0.005
"""Longest cycle [s] that is waited for by its expected end; in longer ones a wake-up more costs little, and what a
sender comes earlier than expected is not waited for."""

EXPECTED_LATE = 0.5
"""Time after the expected end of a cycle at which it is looked for, as part of the time for which is collected."""


class InlineReceiver(ReceiverBase):
    """Reads one bus whenever it is called; the socket's own buffer holds what comes meanwhile.

    A frame has the time at which the kernel received it, so that its age holds the time for which it waited; it is
    never older than a time that :meth:`collect` has returned.

    Parameters
    ----------
    cycle : frames of a cycle; while fewer have come, further ones are collected for ``collect_time`` [s].
    cycle_time : period of the cycles [s]; infinite if it is not known.
    """

    def __init__(
        self,
        raw: RawBus,
        queue: FrameQueue,
        acceptance: Acceptance,
        clock: Clock,
        on_received: Callable[[Frame], None] | None = None,
        collect_time: float = 0.0,
        cycle: int = 1,
        cycle_time: float = inf,
    ) -> None:
        super().__init__(queue, acceptance, clock=clock, on_received=on_received)
        self._raw, self._collect_time, self._cycle = raw, collect_time, cycle
        self._cycle_time = cycle_time if cycle_time <= LONGEST_EXPECTED else -inf
        self._newest = self._last_whole = -inf
        self._few = _FEW * cycle
        self._known = clock()
        self._is_broken_off = self._is_drained = False

    def start(self) -> None:
        """Do nothing: there is no thread."""

    def stop(self) -> None:
        """Queue what still waits and free the socket; the bus is shut down after that."""
        self._is_drained = False
        try:
            while self._raw.is_open and not self._is_broken_off and not self._is_drained:
                self._take()
        except OSError:
            pass  # of a bus that failed nothing more is expected
        self._raw.close()

    def collect(self, timeout: float) -> float:
        """Wait up to ``timeout`` [s] for frames and queue them; return a time that no later frame precedes."""
        if self._is_broken_off:
            return self._clock()
        begin = self._clock()
        try:
            # Own frames have come back by then: they are taken without waking once more for them.
            self._await_whole_cycle(begin, timeout)
            n_queued = self._take_open()
            if n_queued == 0 and timeout > 0.0:
                self._raw.wait(max(timeout - (self._clock() - begin), 0.0))
                n_queued = self._take_open()
            if 0 < n_queued < self._cycle and self._collect_time > 0.0:
                time.sleep(self._collect_time)
                n_queued += self._take()
            # Without stamps a cycle seems to come when it is looked for, and would be looked for ever later.
            if n_queued >= self._cycle:
                self._last_whole = self._newest if self._raw.is_stamped else -inf
        except Exception as error:  # whatever a socket raises, the bridge must learn of it
            self._known = max(self._clock(), self._known)
            self._is_broken_off = self._is_broken(error)
        return self._known

    def _await_whole_cycle(self, now: float, timeout: float) -> None:
        """Sleep until a cycle is expected to be complete: to wake for its first frame, and again, costs as much.

        What comes at another time is found by the wait behind this one, or is as old as it has waited.
        """
        pause = self._last_whole + self._cycle_time + EXPECTED_LATE * self._collect_time - now
        if 0.0 < pause <= timeout:
            time.sleep(pause)

    def _take_open(self) -> int:
        """Take the frames of a bus that is still open, as :meth:`_take`; of one that was shut down none counts."""
        if not self._raw.is_open:
            raise OSError("the socket was closed")
        return self._take()

    def _take(self) -> int:
        """Queue the frames that wait, up to :data:`AT_ONCE`; return the number of those that were accepted."""
        now = max(self._clock(), self._known)
        found, self._is_drained = self._raw.read(AT_ONCE)
        frames: list[Frame] = []
        stamped = self._clock() if found else now
        after, frame_of = min(self._known, stamped), self._raw.frame
        refused_as, on_received = self._acceptance.refused, self._on_received
        returned, is_own = self._raw.returned, self._acceptance.is_own
        # The core looks at formats and rates too: looking here as well only keeps a flood from the queue.
        is_few = len(found) <= self._few
        inputs = self._acceptance.buckets
        for datagram, waited in found:
            # In whole microseconds, which every log format holds exactly.
            came = round(1e6 * (stamped - waited)) / 1e6
            if came > after:
                after = came if came < stamped else stamped
            sent = returned(datagram)
            if sent is not None and is_own(sent):
                self.account.received += 1
                self.account.settle(_OWN, after)
                continue
            try:
                frame = frame_of(datagram, after)
            except MalformedFrame as error:
                self._count_malformed(error)
                continue
            is_input = frame.key in inputs and not (frame.is_error or frame.is_remote)
            refused = None if is_few and is_input else refused_as(frame)
            if on_received is not None and refused is not _OWN:
                on_received(frame)
            if refused is None or self._is_reported(frame, refused):
                frames.append(frame)
        if frames:
            self._newest = frames[-1].time
            self._count_dropped(self._queue.put(frames), after)
        # Once nothing waits, all that came before is known; else what waits is younger than what was taken.
        self._known = max(after, now) if self._is_drained else after
        return len(frames)

    def _is_open(self) -> bool:
        return self._raw.is_open
