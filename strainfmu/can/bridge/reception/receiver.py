"""The receiving thread and the bounded queue behind it. No failure of a bus ends the thread silently."""

from __future__ import annotations

import threading
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from strainfmu.can.cycle.frames.acceptance import Acceptance
from strainfmu.can.cycle.frames.account import FrameAccount, FrameClass
from strainfmu.can.e2e.clock import Clock
from strainfmu.can.wire.frame import Frame, MalformedFrame, from_message
from strainfmu.can.wire.libraries import error_line, import_can

RECEIVE_TIMEOUT = 0.1
"""Maximum wait in one call [s], and so the maximum time to stop."""

AT_ONCE = 64
"""Maximum number of messages between two turns of the queue."""

ERRORS_PER_SECOND = 200
"""Failed receptions within a second after which the bus counts as broken; single ones are ignored. Messages that
are no frames are no such failures."""


@dataclass(frozen=True)
class BusFault:
    """End of reception from a bus.

    Attributes
    ----------
    reason : one line.
    time : of the failure [s].
    """

    reason: str
    time: float
    key: ClassVar[int] = -1
    """That of no frame."""


class FrameQueue:
    """A bounded queue between the receiving and the stepping thread; when full, it drops the oldest cycle.

    Parameters
    ----------
    capacity : frames.
    cycle : frames of a cycle. So many are dropped at once, so that one cycle is lost and not parts of two, and so
        many are taken at once.
    uncounted : keys of frames that a cycle may have or not. They count neither for a cycle nor, up to twice the
        capacity, for the queue.
    """

    def __init__(self, capacity: int, cycle: int, uncounted: Collection[int] = ()) -> None:
        # Held while frames are stamped and queued, so that no frame is older than a time already returned.
        self.lock = threading.RLock()
        self._items: deque[Frame | BusFault] = deque()
        self._capacity, self._cycle = max(capacity, cycle), cycle
        self._uncounted, self._counted = frozenset(uncounted), 0
        self._ready = threading.Condition(self.lock)  # entered through its lock, which is not in Python
        self.highest, self._is_waited_for = 0, False

    def put(self, items: Sequence[Frame | BusFault]) -> int:
        """Add ``items`` and wake the waiting thread; return the number of frames dropped for them."""
        with self.lock:
            dropped, waiting, capacity = 0, self._items, self._capacity
            if len(waiting) + len(items) <= capacity:
                uncounted = self._uncounted
                self._counted += len([None for item in items if item.key not in uncounted])
                waiting.extend(items)
            else:
                for item in items:
                    if self._counted >= capacity or len(waiting) >= 2 * capacity:
                        dropped += sum(isinstance(old, Frame) for old in self._oldest_cycle())
                    waiting.append(item)
                    self._counted += item.key not in self._uncounted
            if len(waiting) > self.highest:
                self.highest = len(waiting)
            if self._is_waited_for:
                self._ready.notify()
        return dropped

    def __len__(self) -> int:
        """Number of waiting items."""
        return len(self._items)

    def take(self, timeout: float, clock: Clock) -> tuple[list[Frame | BusFault], float]:
        """Wait up to ``timeout`` [s]; return at most a cycle of items and a time that no later item precedes."""
        with self.lock:
            if not self._items and timeout > 0.0:
                self._is_waited_for = True
                self._ready.wait(timeout)
                self._is_waited_for = False
            items = self._oldest_cycle()
            return items, self._items[0].time if self._items else clock()

    def _oldest_cycle(self) -> list[Frame | BusFault]:
        """Take out the oldest cycle; the lock must be held."""
        waiting, left = self._items, self._cycle
        if len(waiting) <= left:
            items = list(waiting)
            waiting.clear()
            self._counted = 0
            return items
        items = []
        while waiting and left:
            item = waiting.popleft()
            items.append(item)
            counts = item.key not in self._uncounted
            left -= counts
            self._counted -= counts
        return items


class ReceiverBase(ABC):
    """What all receivers do with frames and failures; ``account`` holds the frames refused or dropped here.

    Attributes
    ----------
    malformed : number of messages that were no frames: the sender's fault, never a reason to give up the bus.
    failures : number of failed receptions.
    last_failure, last_malformed : the latest of each in words.
    """

    def __init__(
        self,
        queue: FrameQueue,
        acceptance: Acceptance,
        clock: Clock,
        on_received: Callable[[Frame], None] | None = None,
    ) -> None:
        self._queue, self._acceptance, self._clock = queue, acceptance, clock
        self._on_received = on_received
        self.account = FrameAccount()
        self.malformed = self.failures = 0
        self.last_failure = self.last_malformed = ""
        self._failure_times: deque[float] = deque(maxlen=ERRORS_PER_SECOND)

    @abstractmethod
    def start(self) -> None:
        """Begin to receive."""

    @abstractmethod
    def stop(self) -> None:
        """End reception; shut the bus down only after that."""

    def _is_accepted(self, frame: Frame) -> bool:
        """Report a frame to ``on_received``; return whether it is to be queued, and count it here if not."""
        refused = self._acceptance.refused(frame)
        if self._on_received is not None and refused is not FrameClass.OWN:
            self._on_received(frame)
        return refused is None or self._is_reported(frame, refused)

    def _is_reported(self, frame: Frame, refused: FrameClass) -> bool:
        """Return whether a refused frame is to be queued all the same; count it here if not."""
        if self._acceptance.is_reported(refused, frame):
            return True
        self.account.received += 1
        self.account.refuse(refused, frame.key, frame.time)
        return False

    def _count_dropped(self, dropped: int, time: float) -> None:
        """Count frames that the queue dropped by ``time`` [s]; they never reach the core."""
        if dropped:
            self.account.received += dropped
            self.account.settle(FrameClass.OVERRUN, time, dropped)

    def _count_malformed(self, error: Exception) -> None:
        """Count a message that is no frame."""
        self.malformed += 1
        self.last_malformed = error_line(error)

    def _is_broken(self, error: Exception) -> bool:
        """Count a failed reception; if the bus is to be given up, report it to the bridge and return True."""
        if is_of_sender(error):
            self._count_malformed(error)
            return False
        now = self._clock()
        self.failures += 1
        self.last_failure = error_line(error)
        self._failure_times.append(now)
        full = len(self._failure_times) == ERRORS_PER_SECOND
        too_many = full and now - self._failure_times[0] < 1.0
        if not too_many and isinstance(error, import_can().CanError | OSError) and self._is_open():
            return False
        self._queue.put([BusFault(self.last_failure, now)])
        return True

    def _is_open(self) -> bool:
        """Return whether the bus still has its socket."""
        return True


def is_of_sender(error: BaseException) -> bool:
    """Return whether a failed reception is due to what was sent: a message that is no frame.

    python-can reports contents that it cannot unpack as it reports a broken socket, but by another cause.
    """
    if isinstance(error, MalformedFrame):
        return True
    cause = error.__cause__
    return isinstance(error, import_can().CanError) and cause is not None and not isinstance(cause, OSError)


class Receiver(ReceiverBase):
    """Receives from one bus until it is stopped, or until the bus fails, which it reports through the queue.

    ``account`` is exact once the thread has ended, and approximate while it runs.

    Parameters
    ----------
    on_received : called with every frame but own ones that come back, in the order of their times.
    collect_time : after the first message of a batch, further ones are collected for this time [s].
    """

    def __init__(
        self,
        bus: Any,
        queue: FrameQueue,
        acceptance: Acceptance,
        clock: Clock,
        on_received: Callable[[Frame], None] | None = None,
        collect_time: float = 0.0,
    ) -> None:
        super().__init__(queue, acceptance, clock=clock, on_received=on_received)
        self._bus, self._collect_time = bus, collect_time
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="CAN receiver", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def stop(self) -> None:
        """Stop the thread and wait for its end; shut the bus down only after that."""
        self._stop.set()
        self._thread.join(20.0 * RECEIVE_TIMEOUT)

    def _run(self) -> None:
        while not self._stop.is_set():
            messages: list[Any] = []
            failures: list[Exception] = []
            try:
                self._receive(messages)
            except Exception as error:  # whatever a backend raises, the bridge must learn of it
                failures.append(error)
            try:
                failures += self._take(messages)
            except Exception as error:  # a thread that ended unnoticed would mean silence for ever
                failures.append(error)
            if any(self._is_broken(failure) for failure in failures):
                return

    def _receive(self, messages: list[Any]) -> None:
        """Wait for a message; put it and those that wait behind it into ``messages``."""
        message = self._bus.recv(RECEIVE_TIMEOUT)
        if message is not None and self._collect_time > 0.0:
            # Two threads that alternate message by message wait longer for each other than the messages take.
            time.sleep(self._collect_time)
        while message is not None:
            messages.append(message)
            message = self._bus.recv(0.0) if len(messages) < AT_ONCE else None

    def _take(self, messages: Sequence[Any]) -> list[MalformedFrame]:
        """Queue the frames that are accepted, all at once: waking the stepping thread is what costs most.

        Messages that are no frames are skipped; their errors are returned.
        """
        frames: list[Frame] = []
        malformed: list[MalformedFrame] = []
        if not messages:
            return malformed
        with self._queue.lock:
            for message in messages:
                try:
                    frames.append(from_message(message, self._clock()))
                except MalformedFrame as error:
                    malformed.append(error)
            dropped = self._queue.put([frame for frame in frames if self._is_accepted(frame)])
            if dropped:
                self._count_dropped(dropped, frames[-1].time)
        return malformed

    def _is_open(self) -> bool:
        """Return whether the bus still has its socket; a bus without one counts as open."""
        try:
            return bool(self._bus.fileno() >= 0)
        except (NotImplementedError, AttributeError):
            return True
        except (OSError, ValueError):
            return False
