"""The run loop of the bridge: receiver, queue, core and transmitter on a bus, which is reopened when it fails.

From a raw socket (``raw_bus``) the caller's thread receives, steps and sends; from other interfaces of python-can
a second thread receives. Results go to the bus first, then to ``on_result``, which must not block.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable
from math import isfinite, nan
from time import process_time
from typing import Any

import numpy as np

from strainfmu.can.bridge.bus.opening import OpenBus, kernel_drops, shut_down
from strainfmu.can.bridge.bus.raw_bus import raw_bus
from strainfmu.can.bridge.bus.reconnect import BackOff, BackOffSettings
from strainfmu.can.bridge.reception.backlog import Backlog
from strainfmu.can.bridge.reception.inline_receiver import InlineReceiver
from strainfmu.can.bridge.reception.receiver import BusFault, FrameQueue, Receiver, ReceiverBase
from strainfmu.can.bridge.results.frames import BridgeStatus, ResultFrames
from strainfmu.can.bridge.results.layouts import STATUS_PERIOD
from strainfmu.can.bridge.results.transmitter import Transmitter
from strainfmu.can.bridge.summary import BridgeSummary
from strainfmu.can.bridge.undisturbed import undisturbed
from strainfmu.can.cycle.core import BridgeCore
from strainfmu.can.cycle.estimate.result import CycleResult, published
from strainfmu.can.cycle.frames.acceptance import Acceptance
from strainfmu.can.cycle.frames.account import FrameAccount, FrameClass
from strainfmu.can.cycle.states.bus_state import BusState
from strainfmu.can.cycle.states.quality import Cause, Quality
from strainfmu.can.e2e.clock import Clock, monotonic
from strainfmu.can.wire.frame import Frame
from strainfmu.can.wire.frame_layout import FrameLayout
from strainfmu.errors import StrainfmuError

QUEUED_CYCLES = 50
"""Maximum number of waiting cycles; beyond it the oldest are dropped."""

COLLECT, MAX_COLLECT = 0.2, 2e-4
"""Time for which frames are collected after the first: in cycles, and its maximum [s]."""

HAND_OVER = 5e-4
"""Longest time for which a thread that records or publishes keeps Python to itself while the bridge waits [s]."""

_LONGEST_WAIT = 0.1
# Members of an Enum by name: through its class each use takes as long as a call.
_OVERRUN, _SHED, _BUS_OFF = FrameClass.OVERRUN, FrameClass.SHED, BusState.BUS_OFF
_GOOD = (Quality.VALID, Quality.UNPROTECTED)
_LATENCIES = 200_000
"""Number of latencies kept for the percentiles, the latest ones."""


class Bridge:
    """Runs a core on a bus until it is stopped.

    Parameters
    ----------
    core : judges the input and steps the estimator.
    open_bus : opens the bus, also after it failed.
    result_layouts : frames that it sends.
    configuration : number of the gauge assignment, 0 for none.
    clock : the one clock of the whole run [s].
    on_result : called with every result after it was sent.
    on_received, on_sent : called with every frame and its time, all in the order of their times; must not block. A
        sent frame that comes back is not received once more.
    """

    def __init__(
        self,
        core: BridgeCore,
        open_bus: OpenBus,
        result_layouts: tuple[FrameLayout, ...],
        configuration: int = 0,
        back_off: BackOffSettings | None = None,
        clock: Clock = monotonic,
        on_result: Callable[[CycleResult], None] | None = None,
        queued_cycles: int = QUEUED_CYCLES,
        on_received: Callable[[Frame], None] | None = None,
        on_sent: Callable[[Frame], None] | None = None,
    ) -> None:
        self._core, self._open_bus, self._clock = core, open_bus, clock
        self._frames = ResultFrames(result_layouts, configuration)
        report = None if on_sent is None else self._report_sent
        self._transmitter = Transmitter(report, on_sending=core.own_frames.sending)
        n_frames = core.layout.cycle_length
        self._queue = FrameQueue(queued_cycles * n_frames, n_frames, core.layout.optional_keys)
        self._backlog = Backlog(core.settings.max_age, core.layout.cycle_time)
        self._max_age = core.settings.max_age * core.layout.cycle_time
        self._answering = 0.0
        self._back_off = BackOff(back_off or BackOffSettings())
        self._on_result = on_result
        self._on_received, self._on_sent = on_received, on_sent
        self.known = clock()
        self._bus: Any = None
        self._receiver: ReceiverBase | None = None
        self._past_receivers = FrameAccount()
        self._drops = 0
        self._drops_known = False
        self._malformed = self._failures = 0
        self._last_malformed = ""
        self._shed = 0
        self._stop = self._is_confirmed = False
        self._qualities: Counter[Quality] = Counter()
        self._answered = 0
        self._latency: deque[float] = deque(maxlen=_LATENCIES)
        self._last_valid: CycleResult | None = None
        self._last: CycleResult | None = None
        self._healths: Counter[int] = Counter()
        self._navigated = 0
        self._last_fault = ""
        self._next_status = clock()
        self._start = clock()
        self._cpu = process_time()

    def stop(self) -> None:
        """End :meth:`run`; may be called from a signal handler or another thread."""
        self._stop = True

    def confirm_sender(self) -> None:
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
            end = float("inf") if duration is None else self._clock() + duration
            try:
                while not self._stop and (now := self._clock()) < end:
                    self._turn(now, end)
            finally:
                self._disconnect()
        now = self._clock()
        while items := self._queue.take(0.0, self._clock)[0]:
            for item in items:
                if isinstance(item, Frame):
                    self._publish(self._core.receive(item))
        self._core.finish(now)
        return self.summary()

    def summary(self) -> BridgeSummary:
        """Return the summary of the run so far."""
        return BridgeSummary(
            duration=self._clock() - self._start,
            cpu=process_time() - self._cpu,
            account=self.account(),
            qualities=Counter(self._qualities),
            healths=Counter(self._healths),
            navigated=self._navigated,
            latency=np.array(self._latency),
            sent=self._transmitter.sent,
            send_failures=self._transmitter.failures,
            malformed=self._malformed + (self._receiver.malformed if self._receiver else 0),
            last_malformed=(self._receiver and self._receiver.last_malformed) or self._last_malformed,
            failures=self._failures + (self._receiver.failures if self._receiver else 0),
            reconnects=self._back_off.reconnects,
            kernel_drops=self._drops if self._drops_known else None,
            queue_highest=self._queue.highest,
            drift_ppm=self._core.drift_ppm,
            period_text=self.period_text,
            last_fault=self._last_fault,
        )

    def _turn(self, now: float, end: float) -> None:
        """Wait for frames or for the next event, and process it."""
        due = min(self._core.next_event, self._next_status, end)
        items, known = self._next_items(min(max(due - now, 0.0), _LONGEST_WAIT))
        self.known = known
        self._watch_receiver()
        if self._is_confirmed:
            self._is_confirmed = False
            self._core.confirm_sender()
        begin = self._clock()
        is_answered = not items or self._backlog.is_answered(begin - items[-1].time)
        n_answered = self._answered
        for item in items:
            if isinstance(item, BusFault):
                self._lose_bus(item.reason, item.time)
                continue
            if results := self._core.receive(item, is_answered):
                self._publish(results)
        now = self._clock()
        if items and is_answered:
            self._note_answer(now - begin, self._answered - n_answered)
        # Only up to the time by which all frames are known, so that a recording gives the same results.
        if results := self._core.advance(known):
            self._publish(results)
        if now >= self._next_status:
            self._send_status(now)
        if self._core.bus_state is _BUS_OFF and self._bus is not None:
            self._lose_bus("bus off", now)
        if self._back_off.due is not None and now >= self._back_off.due:
            self._reconnect(now)

    def _note_answer(self, seconds: float, n_results: int) -> None:
        """Note the time [s] of a turn in which so many results went out: one may take in the start of a cycle."""
        self._answering += seconds
        if n_results:
            self._backlog.answered(self._answering / n_results)
            self._answering = 0.0

    def _next_items(self, timeout: float) -> tuple[list[Frame | BusFault], float]:
        """Wait up to ``timeout`` [s]; return the frames of a cycle and a time that no later frame precedes."""
        if isinstance(self._receiver, InlineReceiver):
            known = self._receiver.collect(0.0 if len(self._queue) else timeout)
            return self._queue.take(0.0, lambda: known)
        return self._queue.take(timeout, self._clock)

    def _publish(self, results: list[CycleResult]) -> None:
        """Send results, then count them and pass them on."""
        self._answered += len(results)
        for judged in results:
            result = published(judged, self._clock(), self._max_age)
            working = self._transmitter.send(self._frames.of_result(result))
            self._qualities[result.quality] += 1
            self._last = result
            if result.health is not None:
                self._healths[result.health] += 1
            self._navigated += isfinite(result.mach_number) and isfinite(result.altitude)
            if result.quality in _GOOD:
                self._last_valid = result
            if result.arrival is not None:
                self._latency.append(self._clock() - result.arrival)
            if self._on_result is not None:
                self._on_result(result)
            if not working:
                self._lose_bus(self._transmitter.last_failure, self._clock())

    def _report_sent(self, frame: Frame) -> None:
        """Report a sent frame under the receiver's lock, so that sent and received frames are in order of time."""
        with self._queue.lock:
            if self._on_sent is not None:
                frame.time = self._clock()
                self._on_sent(frame)

    def _send_status(self, now: float) -> None:
        last = self._last
        status = BridgeStatus(
            time=now,
            quality=Quality.NO_DATA if last is None else last.quality,
            bus_state=self._core.bus_state,
            last_valid=self._last_valid,
            account=self.account(),
            cycles=self._answered,
            send_failures=self._transmitter.failures,
            reconnects=self._back_off.reconnects,
            drift_ppm=self._core.drift_ppm,
            envelope_score=nan if last is None else last.envelope_score,
            causes=Cause.NONE if last is None else last.causes,
            age_uncertainty=nan if last is None else last.age_uncertainty,
            counter=None if last is None else last.counter,
            usable=last is not None and last.usable,
        )
        self._transmitter.send(self._frames.of_status(status))
        # Without catching up: a late status is useless.
        self._next_status = max(self._next_status + STATUS_PERIOD, now)

    def _watch_receiver(self) -> None:
        """Report to the core that frames were dropped or shed ahead of it."""
        if self._receiver is None:
            return
        classes = self._receiver.account.classes
        lost = classes[_OVERRUN] + classes[_SHED]
        if lost > self._shed:
            self._shed = lost
            self._core.note(Cause.OVERLOAD)

    # --- the bus ------------------------------------------------------------------------------------------------

    def _connect(self) -> None:
        """Open a new bus and receive from it."""
        core = self._core
        self._bus = self._open_bus()
        acceptance = Acceptance(core.layout, core.own_frames, core.settings)
        collect_time = min(COLLECT * core.layout.cycle_time, MAX_COLLECT)
        raw = raw_bus(self._bus)
        if raw is None:
            self._receiver = Receiver(
                self._bus,
                self._queue,
                acceptance=acceptance,
                clock=self._clock,
                on_received=self._on_received,
                collect_time=collect_time,
            )
        else:
            self._receiver = InlineReceiver(
                raw,
                self._queue,
                acceptance=acceptance,
                clock=self._clock,
                on_received=self._on_received,
                collect_time=collect_time,
                cycle=core.layout.cycle_length,
                cycle_time=core.layout.cycle_time,
            )
        self._shed = 0
        self._transmitter.use(self._bus, raw)
        self._receiver.start()

    def _disconnect(self) -> None:
        """End reception and shut the bus down, in this order."""
        self._transmitter.use(None)
        if self._receiver is not None:
            self._receiver.stop()
            self._past_receivers = self._past_receivers.plus(self._receiver.account)
            self._malformed += self._receiver.malformed
            self._failures += self._receiver.failures
            self._last_malformed = self._receiver.last_malformed or self._last_malformed
            self._receiver = None
        if self._bus is not None:
            drops = kernel_drops(self._bus)
            self._drops_known |= drops is not None
            self._drops += drops or 0
            shut_down(self._bus)
            self._bus = None

    def _lose_bus(self, reason: str, now: float) -> None:
        """Give up a bus that failed; it is opened again after a while."""
        if self._bus is None:
            return
        self._last_fault = reason
        self._disconnect()
        self._core.restart(now)
        self._core.bus_state = BusState.DISCONNECTED
        self._back_off.failed(now)

    def _reconnect(self, now: float) -> None:
        """Try to open a new bus.

        Raises
        ------
        StrainfmuError
            The number of attempts is used up.
        """
        try:
            self._connect()
        except StrainfmuError as error:
            self._last_fault = str(error)
            self._back_off.failed(now)
            if self._back_off.exhausted:
                raise StrainfmuError(f"the bus was lost and could not be opened again: {error}") from error
            return
        self._back_off.opened(now)
        if self._back_off.exhausted:
            self._disconnect()
            raise StrainfmuError(f"the bus was lost again and again: {self._last_fault}")
        self._core.restart(now)

    @property
    def skips(self) -> list[tuple[float, float]]:
        """Intervals in which the bridge stood still and passed over status results: due at, advanced to [s]."""
        return self._core.skips

    @property
    def unanswered(self) -> list[tuple[float, float]]:
        """Intervals in which it was too slow to answer all cycles: first and last frame skipped [s]."""
        return self._core.unanswered

    @property
    def period_text(self) -> str:
        """The sender's period in words, "" before it is measured."""
        return self._core.period.text

    @property
    def last_fault(self) -> str:
        """Last failure of the bus, "" if there was none."""
        return self._last_fault

    @property
    def reconnects(self) -> int:
        """How often the bus was reopened."""
        return self._back_off.reconnects

    @property
    def bus_state(self) -> BusState:
        """State of the bus controller."""
        return self._core.bus_state

    def account(self) -> FrameAccount:
        """Return the account of all receivers and of the core so far."""
        total = self._past_receivers.plus(self._core.account)
        return total if self._receiver is None else total.plus(self._receiver.account)
