"""One thread that receives, and the bounded queue behind it. Nothing that a bus does ends the thread silently."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from strainfmu.can.cycle.acceptance import Acceptance
from strainfmu.can.cycle.frame_account import FrameAccount, FrameClass
from strainfmu.can.e2e.clock import Clock
from strainfmu.can.wire.frame import Frame, MalformedFrame, from_message
from strainfmu.can.wire.libraries import error_line, import_can

RECEIVE_TIMEOUT = 0.1
"""Longest wait in one call [s]: so long does a stop take at most."""

AT_ONCE = 64
"""Messages at most between two looks at the queue."""

ERRORS_PER_SECOND = 200
"""Failed receptions within a second after which the bus is taken for broken; single ones are passed over."""


@dataclass(frozen=True)
class BusFault:
    """The bus cannot be received from any more.

    Attributes
    ----------
    reason : one line.
    time : when it was found [s].
    """

    reason: str
    time: float


class FrameQueue:
    """A bounded queue between the receiving and the stepping thread; a full one drops the oldest cycle.

    Parameters
    ----------
    capacity : frames.
    cycle : frames of a cycle: so many are dropped at once, that one cycle is lost and not the ends of two, and so
        many are taken at once.
    """

    def __init__(self, capacity: int, cycle: int) -> None:
        # Whoever stamps and queues a frame holds it, so that no frame is older than a time already handed out.
        self.lock = threading.RLock()
        self._items: deque[Frame | BusFault] = deque()
        self._capacity, self._cycle = max(capacity, cycle), cycle
        self._ready = threading.Condition(self.lock)
        self.highest = 0

    def put(self, items: Iterable[Frame | BusFault]) -> int:
        """Add ``items``, then wake who waits for them; return how many frames were dropped for them."""
        with self._ready:
            dropped = 0
            for item in items:
                if len(self._items) >= self._capacity:
                    oldest = [self._items.popleft() for _ in range(self._cycle)]
                    dropped += sum(isinstance(old, Frame) for old in oldest)
                self._items.append(item)
                self.highest = max(self.highest, len(self._items))
            self._ready.notify()
        return dropped

    def take(self, timeout: float, clock: Clock) -> tuple[list[Frame | BusFault], float]:
        """Wait up to ``timeout`` [s] for an item; return a cycle's worth and a time no later item is before."""
        with self._ready:
            if not self._items and timeout > 0.0:
                self._ready.wait(timeout)
            items = [self._items.popleft() for _ in range(min(self._cycle, len(self._items)))]
            return items, self._items[0].time if self._items else clock()


class Receiver:
    """Receives from one bus until it is stopped or the bus fails, then says so through the queue.

    ``account`` holds the frames that went no further than here; it may be read once the thread has ended, or
    roughly while it runs. ``on_received`` is told every frame, in the order of their times. Behind the first
    message others are let gather for ``gather`` [s].
    """

    def __init__(
        self,
        bus: Any,
        queue: FrameQueue,
        acceptance: Acceptance,
        clock: Clock,
        on_received: Callable[[Frame], None] | None = None,
        gather: float = 0.0,
    ) -> None:
        self._bus, self._queue, self._acceptance, self._clock = bus, queue, acceptance, clock
        self._gather = gather
        self._on_received = on_received
        self.account = FrameAccount()
        self.failures = 0
        self.last_failure = ""
        self._failure_times: deque[float] = deque(maxlen=ERRORS_PER_SECOND)
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
            except Exception as error:  # whatever a backend raises, the bridge must know of it
                failures.append(error)
            try:
                failures += self._take(messages)
            except Exception as error:  # a thread that ended unseen would be silence for ever
                failures.append(error)
            if any(self._is_broken(failure) for failure in failures):
                return

    def _receive(self, messages: list[Any]) -> None:
        """Wait for a message, and put it and what waits behind it into ``messages``."""
        message = self._bus.recv(RECEIVE_TIMEOUT)
        if message is not None and self._gather > 0.0:
            # Two threads that take turns by the message wait for each other longer than all messages take.
            time.sleep(self._gather)
        while message is not None:
            messages.append(message)
            message = self._bus.recv(0.0) if len(messages) < AT_ONCE else None

    def _take(self, messages: Sequence[Any]) -> list[MalformedFrame]:
        """Queue the frames that are not refused here, all at once: to wake the stepping thread costs most.

        Messages that are no frames are passed over, and returned.
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
            dropped = self._queue.put([frame for frame in frames if self._is_let_in(frame)])
            if dropped:
                # The core never sees them: so they are received, and settled, here.
                self.account.received += dropped
                self.account.settle(FrameClass.OVERRUN, frames[-1].time, dropped)
        return malformed

    def _is_let_in(self, frame: Frame) -> bool:
        """Tell of a frame; refuse it here, or tell that it is to be queued."""
        if self._on_received is not None:
            self._on_received(frame)
        refused = self._acceptance.refused(frame)
        if refused is None or refused is FrameClass.ERROR_FRAME:
            return True
        self.account.received += 1
        self.account.refuse(refused, frame.key, frame.time)
        return False

    def _is_broken(self, error: Exception) -> bool:
        """Count a failed reception; tell whether the bus is to be given up, and say so to the bridge."""
        now = self._clock()
        self.failures += 1
        self.last_failure = error_line(error)
        self._failure_times.append(now)
        full = len(self._failure_times) == ERRORS_PER_SECOND
        too_many = full and now - self._failure_times[0] < 1.0
        passed_over = isinstance(error, MalformedFrame | import_can().CanError)
        if not too_many and passed_over and self._is_open():
            return False
        self._queue.put([BusFault(self.last_failure, now)])
        return True

    def _is_open(self) -> bool:
        """Tell whether the bus still has its socket; a bus without one is believed."""
        try:
            return bool(self._bus.fileno() >= 0)
        except (NotImplementedError, AttributeError):
            return True
        except (OSError, ValueError):
            return False
