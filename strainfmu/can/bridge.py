"""The bridge: a listener with a loop of its own on a bus, which is opened again when it fails.

Where messages have the time at which this host received them, the loop receives, estimates and sends in one
thread: what waits in the socket is as old as it is. Elsewhere a thread of python-can receives and states the time.
"""

import gc
import queue
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from math import inf
from typing import Any

from strainfmu.can.frame import MalformedFrame, error_line, import_can
from strainfmu.can.listener import HOST_STAMPED, BridgeSummary, BusListener, Clock
from strainfmu.can.opening import OpenBus, kernel_drops, shut_down
from strainfmu.can.quality import BusState, Cause, FrameAccount, FrameClass
from strainfmu.errors import StrainfmuError

QUEUED_CYCLES = 50
"""Maximum number of cycles that wait between two threads; beyond it frames are dropped."""

HAND_OVER = 5e-4
"""Longest time for which a thread that records or publishes keeps Python to itself while the bridge waits [s]."""

GARBAGE = 20_000
"""New objects after which some are looked at: the usual 700 come together in some ten cycles."""

ERRORS_PER_SECOND = 200
"""Failed receptions within a second after which the bus counts as broken; single ones are ignored. Messages that
are no frames are no such failures."""

FRAMES_AFTER = 1.0
"""Time from the start at which a user is shown which frames have come [s]; longer where frames come seldom."""

_KEPT_SKIPS = 10_000
_LONGEST_WAIT = 0.1
_BUS_OFF = BusState.BUS_OFF


# --- reception ---------------------------------------------------------------------------------------------------

Received = tuple[Any, float, float]
"""A message, None for none; when it was read, or a time that no later message precedes; the present time [s]."""


class Inbox:
    """Reads a bus whose messages have the time of this host.

    Attributes
    ----------
    dropped : messages that were dropped since the last look.
    """

    def __init__(self, bus: Any, clock: Clock) -> None:
        self._bus, self._clock, self.dropped = bus, clock, 0

    def get(self, begin: float, timeout: float) -> Received:
        """Return the next message, or none that came from ``begin`` on [s], which has just passed, within
        ``timeout`` [s]; raise what python-can raises."""
        message, now = self._bus.recv(timeout), self._clock()
        return (None, begin + timeout, now) if message is None else (message, now, now)

    def close(self) -> None:
        """End reception; the bus is shut down next."""


class ThreadedInbox(Inbox):
    """Has a thread of python-can read a bus, so that messages have a time although they wait."""

    def __init__(self, bus: Any, clock: Clock, limit: int) -> None:
        super().__init__(bus, clock)
        self._limit = limit
        self._waiting: queue.SimpleQueue[tuple[Any, float]] = queue.SimpleQueue()
        self._notifier = import_can().Notifier(bus, [self], timeout=_LONGEST_WAIT)

    def __call__(self, message: Any) -> None:
        """Put a message, or the error of a reception, behind those that wait."""
        if self._waiting.qsize() < self._limit:
            self._waiting.put((message, self._clock()))
        else:
            self.dropped += 1

    on_error = __call__

    def get(self, begin: float, timeout: float) -> Received:
        """Return as :meth:`Inbox.get`."""
        try:
            message, when = self._waiting.get(timeout > 0.0, timeout)
        except queue.Empty:
            now = self._clock()
            return None, min(begin + timeout, now), now
        if isinstance(message, Exception):
            raise message
        return message, when, self._clock()

    def close(self) -> None:
        """End the thread."""
        self._notifier.stop()


def is_of_sender(error: BaseException) -> bool:
    """Return whether a failed reception is due to what was sent: a message that is no frame.

    python-can reports contents that it cannot unpack as it reports a broken socket, but by another cause.
    """
    if isinstance(error, MalformedFrame):
        return True
    cause = error.__cause__
    return isinstance(error, import_can().CanError) and cause is not None and not isinstance(cause, OSError)


def is_open(bus: Any) -> bool:
    """Return whether the bus still has its socket; a bus without one counts as open."""
    try:
        return bool(bus.fileno() >= 0) or type(bus).__name__ not in HOST_STAMPED[:2]
    except (NotImplementedError, AttributeError):
        return True
    except (OSError, ValueError):
        return False


# --- a bridge that is too slow, a bus that is lost ---------------------------------------------------------------


class Backlog:
    """Decides by the waiting time of its frames whether a cycle is answered or skipped.

    A bridge that is slower than its input and answers every cycle answers all of them too late. So once a cycle
    has waited for half of ``max_age``, cycles are skipped until one has waited for at most one cycle. Gaps are
    rare and long, because the answer after a gap is at best DEGRADED. A bridge whose answers take less than half a
    cycle, and that was only held up, catches up without a gap: it skips what cannot be answered in time, no more.

    Parameters
    ----------
    max_age : maximum age of strains that are used [cycles]; half of it is left for the answer itself.
    cycle_time : [s].
    """

    _QUICK, _FORGETTING = 0.5, 0.05
    _MOST_SKIPPED = 25
    """Cycles skipped in a row: the next is answered, even if its strains are STALE by then."""

    def __init__(self, max_age: float, cycle_time: float) -> None:
        self._caught_up = cycle_time
        self._longest = max(0.5 * max_age * cycle_time, self._caught_up)
        self.is_behind = False
        self._skipped = 0
        self._in_time, self._quick = max_age * cycle_time, self._QUICK * cycle_time
        self._answer_time: float | None = None
        self.soon = min(0.5 * self._caught_up, self._in_time - self._quick)
        """A frame that has waited for less is answered, unless the bridge is behind [s]."""

    def answered(self, seconds: float) -> None:
        """Note that the answer of a cycle took so long [s]."""
        known = self._answer_time
        self._answer_time = seconds if known is None else known + self._FORGETTING * (seconds - known)

    def is_answered(self, waited: float) -> bool:
        """Return whether a cycle is answered whose frames have waited for ``waited`` [s]."""
        if self._answer_time is not None and self._answer_time <= self._quick:
            self.is_behind = waited > self._in_time - self._answer_time
        else:
            self.is_behind = waited > (self._caught_up if self.is_behind else self._longest)
        self._skipped = self._skipped + 1 if self.is_behind and self._skipped < self._MOST_SKIPPED else 0
        return self._skipped == 0


@dataclass(kw_only=True)
class BackOff:
    """Waiting before each attempt to open a lost bus again: exponential back-off, a bounded number of attempts.

    Attributes
    ----------
    first, longest : waiting time before the first attempt, and the longest ever [s]; it doubles in between.
    attempts : attempts in a row before the bridge gives up.
    settle : time [s] a bus must work before the count starts again.
    due : time of the next attempt on the caller's monotonic clock [s], None without one.
    """

    first: float = 0.1
    longest: float = 5.0
    attempts: int = 10
    settle: float = 2.0
    due: float | None = None
    _failures: int = 0
    _opened: float | None = None

    @property
    def exhausted(self) -> bool:
        """No further attempt is allowed."""
        return self._failures > self.attempts

    def failed(self, now: float) -> None:
        """Note that the bus, or an attempt to open it, failed; :attr:`due` is the time of the next attempt."""
        if self._opened is not None and now - self._opened >= self.settle:
            self._failures = 0
        self._opened = None
        wait = min(self.first * 2.0**self._failures, self.longest)
        self._failures += 1
        self.due = now + wait

    def opened(self, now: float) -> None:
        """Note that a new bus is open."""
        self._opened, self.due = now, None


@contextmanager
def undisturbed(hand_over: float) -> Iterator[None]:
    """Let no thread keep Python to itself for longer than ``hand_over`` [s], and collect little garbage at a time.

    To look among all objects that a run begins with takes 70 ms or more, twice a minute at 1 kHz.
    """
    before = sys.getswitchinterval()
    sys.setswitchinterval(min(hand_over, before))
    gc.collect()
    gc.freeze()
    thresholds = gc.get_threshold()
    gc.set_threshold(GARBAGE, *thresholds[1:])
    try:
        yield
    finally:
        gc.set_threshold(*thresholds)
        gc.unfreeze()
        sys.setswitchinterval(before)


# --- the loop ----------------------------------------------------------------------------------------------------


class Bridge:
    """Runs a listener on a bus until it is stopped.

    Parameters
    ----------
    listener : takes in the frames.
    open_bus : opens the bus, also after it failed.
    max_age : maximum age of strains that are used [cycles].

    Attributes
    ----------
    skips : intervals in which the bridge was too slow, behind the first of two frames up to the second [s].
    """

    def __init__(
        self,
        listener: BusListener,
        open_bus: OpenBus,
        max_age: float = 5.0,
        back_off: BackOff | None = None,
        queued_cycles: int = QUEUED_CYCLES,
    ) -> None:
        self.listener, self.machine, self._open_bus = listener, listener.machine, open_bus
        self._clock = listener.taps.clock
        layout = self.machine.layout
        self._limit = queued_cycles * max(layout.cycle_length, 1)
        self._backlog = Backlog(max_age, layout.cycle_time)
        self._answering, self._is_skipping = 0.0, False
        self.skips: list[tuple[float, float]] = []
        self._back_off = back_off or BackOff()
        self._bus: Any = None
        self._inbox: Inbox | None = None
        self._failure_times: deque[float] = deque(maxlen=ERRORS_PER_SECOND)
        self._stop = self._is_confirmed = False
        self.say: Callable[[str], None] | None = None
        """Shows a line to the user."""
        slowest = max([frame.layout.cycle_time or layout.cycle_time for frame in layout.frames])
        self._frames_at = self._clock() + max(FRAMES_AFTER, 3.0 * slowest)
        self._start, self._cpu = self._clock(), time.process_time()

    def stop(self) -> None:
        """End :meth:`run`; may be called from a signal handler or another thread."""
        self._stop = True

    def confirm(self) -> None:
        """Take the sender for proven and its delay for the smallest; may be called from a signal handler."""
        self._is_confirmed = True

    def run(self, duration: float | None = None) -> BridgeSummary:
        """Run until stopped, or for ``duration`` [s]; return the summary.

        Raises
        ------
        StrainfmuError
            The bus cannot be opened, is lost and cannot be opened again, or the FMU failed for good.
        """
        with undisturbed(HAND_OVER):
            self._connect()
            end = inf if duration is None else self._clock() + duration
            try:
                now = self._clock()
                while not self._stop and now < end:
                    now = self._turn(now, end)
            finally:
                self._disconnect()
        self.machine.finish(self.listener.known)
        return self.summary()

    def _turn(self, now: float, end: float) -> float:
        """Wait for a message or for the next event, and process it; return the time then [s]."""
        if self._is_confirmed or now >= self._frames_at:
            self._attend(now)
        listener, inbox, due = self.listener, self._inbox, self._back_off.due
        event = min(self.machine.next_event, listener.next_status, end)
        event = event if due is None else min(event, due)
        wait = event - now
        wait = 0.0 if wait < 0.0 else wait if wait < _LONGEST_WAIT else _LONGEST_WAIT
        if inbox is None:
            time.sleep(wait)
            now = self._clock()
            listener.advance(now)
        else:
            try:
                message, when, now = inbox.get(now, wait)
            except Exception as error:  # whatever an interface raises, go on, or open the bus again
                self._note_failure(error)
                now = self._clock()
            else:
                if inbox.dropped:
                    dropped, inbox.dropped = inbox.dropped, 0
                    self.machine.count(FrameClass.OVERRUN, listener.known, dropped)
                    self.machine.note(Cause.OVERLOAD)
                now = self._take(message, when, now)
        if self._bus is not None and (listener.is_broken or self.machine.bus_state is _BUS_OFF):
            self._lose_bus(listener.failure if listener.is_broken else "bus off")
        if due is not None and now >= due:
            self._reconnect(now)
            now = self._clock()
        return now

    def _take(self, message: Any, when: float, begin: float) -> float:
        """Have the listener take in what was received, at ``begin``; cycles that have waited for too long are not
        answered. Return the time then [s]."""
        listener = self.listener
        if message is None:
            listener.advance(when)
            return self._clock()
        n_answered, now = listener.answered, begin
        listener.take(message, when)
        if listener.answered > n_answered:
            now = self._clock()
            self._backlog.answered((now - begin) / (listener.answered - n_answered))
        backlog = self._backlog
        if self._is_skipping or backlog.is_behind or begin - listener.known > backlog.soon:
            self._skip(begin - listener.known)
        if now >= listener.next_status:
            listener.send_status(now)
        return now

    def _skip(self, waited: float) -> None:
        """Begin or end to skip cycles, or go on, by how long a frame has waited [s]."""
        known, is_skipping = self.listener.known, not self._backlog.is_answered(waited)
        if self._is_skipping:
            self.skips[-1] = self.skips[-1][0], known
        if is_skipping != self._is_skipping:
            self._is_skipping = is_skipping
            self.machine.skip(is_skipping)
            if is_skipping and len(self.skips) < _KEPT_SKIPS:
                self.skips.append((known, known))

    def _attend(self, now: float) -> None:
        """Do what the user has asked for, and say which frames have come."""
        if self._is_confirmed:
            self._is_confirmed = False
            self.machine.confirm()
        if now >= self._frames_at:
            self._frames_at = inf
            if self.say is not None:
                self.say(self.machine.frames_text())

    def _note_failure(self, error: Exception) -> None:
        """Count a message that is no frame, or a failed reception; give the bus up if it is broken."""
        if is_of_sender(error):
            self.listener.count_malformed(error)
            return
        now = self._clock()
        self.listener.summary.failures += 1
        self._failure_times.append(now)
        is_full = len(self._failure_times) == ERRORS_PER_SECOND
        is_known = isinstance(error, import_can().CanError | OSError)
        if (is_full and now - self._failure_times[0] < 1.0) or not is_known or not is_open(self._bus):
            self._lose_bus(error_line(error))

    # --- the bus -------------------------------------------------------------------------------------------------

    def _connect(self) -> None:
        """Open a new bus and receive from it."""
        self._bus = self._open_bus()
        is_stamped, clock = type(self._bus).__name__ in HOST_STAMPED, self._clock
        self._inbox = Inbox(self._bus, clock) if is_stamped else ThreadedInbox(self._bus, clock, self._limit)
        self._failure_times.clear()
        self.listener.use(self._bus)

    def _disconnect(self) -> None:
        """End reception and shut the bus down, in this order."""
        self.listener.use(None)
        if self._inbox is not None:
            self._inbox.close()
            self._inbox = None
        if self._bus is not None:
            summary, drops = self.listener.summary, kernel_drops(self._bus)
            summary.kernel_drops = summary.kernel_drops if drops is None else (summary.kernel_drops or 0) + drops
            shut_down(self._bus)
            self._bus = None

    def _lose_bus(self, reason: str) -> None:
        """Give up a bus that failed; it is opened again after a while."""
        self.listener.summary.last_fault = reason
        self._disconnect()
        now = self._clock()
        self.machine.restart(now)
        self.machine.bus_state = BusState.DISCONNECTED
        self._back_off.failed(now)

    def _reconnect(self, now: float) -> None:
        """Try to open a new bus."""
        try:
            self._connect()
        except StrainfmuError as error:
            self.listener.summary.last_fault = str(error)
            self._back_off.failed(now)
            if self._back_off.exhausted:
                raise StrainfmuError(f"the bus was lost and could not be opened again: {error}") from error
            return
        self._back_off.opened(now)
        self.listener.summary.reconnects += 1
        if self._back_off.exhausted:
            self._disconnect()
            raise StrainfmuError(f"the bus was lost again and again: {self.listener.summary.last_fault}")
        self.machine.restart(now)

    # --- what it has done ----------------------------------------------------------------------------------------

    def account(self) -> FrameAccount:
        """Return the account of all frames so far."""
        return self.machine.account

    def summary(self) -> BridgeSummary:
        """Return the summary of the run so far."""
        summary = self.listener.summary
        summary.duration, summary.cpu = self._clock() - self._start, time.process_time() - self._cpu
        summary.account, summary.period_text = self.account(), self.machine.period_text
        return summary
