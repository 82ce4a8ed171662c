"""The listener of a bus: messages of python-can in, results out, to a function and as frames on the bus.

A bridge is a listener with a loop (:mod:`strainfmu.can.bridge`); a replay gives it the messages of a log.
"""

import time
from collections import Counter, deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from math import isfinite, nan
from typing import Any

from strainfmu.can.frame import Frame, MalformedFrame, error_line, import_can, to_message
from strainfmu.can.frame_layout import FrameLayout
from strainfmu.can.frame_queue import FrameQueue
from strainfmu.can.machine import Machine, Result
from strainfmu.can.quality import Cause, FrameAccount, Quality
from strainfmu.can.result_frames import STATUS_PERIOD

Clock = Callable[[], float]
"""Returns seconds that never go back."""

HOST_STAMPED = ("SocketcanBus", "UdpMulticastBus", "VirtualBus")
"""Buses of python-can whose messages have the time of this host at their reception, since 1970."""

_LONGEST_WAIT = 60.0
"""Time for which a message may have waited [s]; one that seems older has a time of another clock."""

FAILURES_IN_A_ROW = 20
"""Failed transmissions in a row after which the bus counts as broken."""

_LATENCIES = 200_000
"""Number of latencies kept for the percentiles, the latest ones."""


@dataclass(frozen=True, kw_only=True)
class Taps:
    """The clock of a run and the functions that are called in it, which must not block.

    Attributes
    ----------
    queue : takes in every frame; a sent one that comes back is not received once more.
    on_result : called with every result after it was sent.
    """

    clock: Clock = time.monotonic
    queue: FrameQueue | None = None
    on_result: Callable[[Result], None] | None = None


@dataclass(kw_only=True, eq=False)
class ResultCounts:
    """Results by quality and by causes, estimates by state of health, and number of results with Mach number and
    altitude; of a run or a log of a ``duration`` [s], with the account of all its frames."""

    duration: float = 0.0
    account: FrameAccount = field(default_factory=FrameAccount)
    qualities: Counter[Quality] = field(default_factory=Counter)
    causes: Counter[Cause] = field(default_factory=Counter)
    healths: Counter[int] = field(default_factory=Counter)
    navigated: int = 0

    def add(self, result: Result) -> None:
        """Count a result."""
        self.qualities[result.quality] += 1
        self.causes[result.causes] += 1
        if result.health is not None:
            self.healths[result.health] += 1
        self.navigated += isfinite(result.mach_number) and isfinite(result.altitude)


@dataclass(kw_only=True, eq=False)
class BridgeSummary(ResultCounts):
    """Summary of a run.

    Attributes
    ----------
    cpu : processor time of the whole process in the run [s].
    latency : from the last frame of a cycle to its results on the bus [s], the latest ones.
    sent, send_failures, failures, reconnects : frames sent and not sent, failed receptions, buses reopened.
    malformed, last_malformed : number of messages that were no frames, and why the last one was none.
    kernel_drops : datagrams that the system dropped, None where that is not known.
    period_text : the sender's period in words, "" where it was not measured.
    last_fault : last failure of the bus.
    """

    cpu: float = 0.0
    latency: deque[float] = field(default_factory=lambda: deque(maxlen=_LATENCIES))
    sent: int = 0
    send_failures: int = 0
    failures: int = 0
    malformed: int = 0
    last_malformed: str = ""
    reconnects: int = 0
    kernel_drops: int | None = None
    period_text: str = ""
    last_fault: str = ""


class BusListener:
    """Takes in the messages of a bus and the time; sends the results of its machine.

    Parameters
    ----------
    machine : of the input.
    result_layouts : frames that are sent.
    configuration : number of the gauge assignment, 0 for none.
    taps : clock and functions of the run.

    Attributes
    ----------
    summary : of the run so far, as far as a listener knows it.
    failure : last failure to send; ``is_broken``: too many in a row.
    """

    def __init__(
        self,
        machine: Machine,
        result_layouts: tuple[FrameLayout, ...],
        configuration: int = 0,
        taps: Taps | None = None,
    ) -> None:
        self.machine, self.taps = machine, taps or Taps()
        self._clock = self.taps.clock
        machine.compose(result_layouts, configuration)
        if self.taps.queue is not None:
            machine.log_to(self.taps.queue)
        self._bus: Any = None
        self._is_stamped = False
        self.known = self._clock()
        """A time that no later frame precedes [s]."""
        self.summary, self.answered = BridgeSummary(), 0
        self.last: Result | None = None
        self._failed_in_a_row, self.failure, self.is_broken = 0, "", False
        self.next_status = self._clock()

    def use(self, bus: Any) -> None:
        """Send on ``bus`` from now on, on none if None."""
        self._bus, self._failed_in_a_row, self.is_broken = bus, 0, False
        self._is_stamped = type(bus).__name__ in HOST_STAMPED
        self._errors = () if bus is None else (import_can().CanError, OSError, ValueError)

    # --- in ------------------------------------------------------------------------------------------------------

    def take(self, message: Any, now: float) -> None:
        """Take in a message that is read at ``now`` [s].

        Its time is when this host received it, where it has stamped it, in whole microseconds, which every log
        holds exactly.
        """
        when = now
        if self._is_stamped:
            waited = time.time() - message.timestamp
            when = round(1e6 * (now - waited)) / 1e6 if 0.0 < waited < _LONGEST_WAIT else now
        self.known = when = when if when > self.known else self.known
        try:
            results = self.machine.hear(message, when)
        except MalformedFrame as error:
            self.count_malformed(error)
            return
        if results:
            self._publish(results)

    def advance(self, known: float) -> None:
        """Answer what is due by ``known`` [s], a time that no later frame precedes."""
        self.known = max(known, self.known)
        if results := self.machine.advance(self.known):
            self._publish(results)
        if known >= self.next_status:
            self.send_status(known)

    def count_malformed(self, error: BaseException) -> None:
        """Count a message that is no frame."""
        self.summary.malformed += 1
        self.summary.last_malformed = error_line(error)

    # --- out -----------------------------------------------------------------------------------------------------

    def _publish(self, results: list[Result]) -> None:
        """Send results, then count them and pass them on."""
        self.answered += len(results)
        for result in results:
            sent = self._send(result.frames)
            self.summary.add(result)
            self.last = result
            if result.arrival == result.arrival:
                self.summary.latency.append(sent - result.arrival)
            if self.taps.on_result is not None:
                self.taps.on_result(result)

    def send_status(self, now: float) -> None:
        """Send the state of the bridge at ``now`` [s]."""
        self._send(self.machine.status_frames(now, self.summary.send_failures, self.summary.reconnects))
        # Without catching up: a late status is useless.
        self.next_status = max(self.next_status + STATUS_PERIOD, now)

    def _send(self, frames: Iterable[Frame]) -> float:
        """Send ``frames``, each at most once and at once: a result that cannot be sent now would be old later.

        Return the time then [s].
        """
        now = nan
        sending, queue = self.machine.own.sending, self.taps.queue
        for frame in () if self._bus is None else frames:
            sending(frame)  # it may come back before the call returns
            try:
                self._bus.send(to_message(frame), timeout=0.0)
            except self._errors as error:
                self.summary.send_failures += 1
                self._failed_in_a_row += 1
                self.is_broken = self._failed_in_a_row >= FAILURES_IN_A_ROW
                self.failure = error_line(error)
                continue
            self._failed_in_a_row = 0
            self.summary.sent += 1
            frame.time = now = self._clock()
            if queue is not None:
                queue.put(frame, False)
        return now if now == now else self._clock()
