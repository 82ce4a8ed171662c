"""A short live run over a virtual bus: a bridge of the synthetic FMU, fed by the virtual sender, with watchers.

Its clock is that of both, and waits for the bridge: however busy the machine, no frame is late that was not sent
late.
"""

import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from can_faults import Fault
from fault_injection import FaultySender
from synthetic_vehicle import N_GAUGES, synthetic_inverse_map

from strainfmu.atmosphere import dynamic_pressure
from strainfmu.can.authentic import freshness_file, next_trip
from strainfmu.can.bridge import Bridge
from strainfmu.can.frame_layout import InputLayout
from strainfmu.can.listener import BridgeSummary
from strainfmu.can.machine import Result
from strainfmu.can.observed import observed_bridge
from strainfmu.can.opening import BusSettings, open_bus
from strainfmu.can.options import BridgeOptions
from strainfmu.can.recording import MicrosecondClock
from strainfmu.can.sender import send_flight
from strainfmu.can.setup import input_layout
from strainfmu.can.strain_sources import FlownSample

CYCLE = 0.01
TURN = 1e-3
"""Longest time for which the bridge waits before it looks at the clock [s]."""
PATIENCE = 120.0
"""How long a thread may take for its turn on a busy machine [s]."""


@dataclass
class LiveRun:
    """Results and summary of the bridge, and the notes of its recorder and publisher."""

    results: list[Result]
    summary: BridgeSummary
    notes: list[str]


def flight(n_cycles: int, navigated: bool = False) -> list[FlownSample]:
    """Return pressure states that move, seen by the gauges of the synthetic map, with its noise."""
    inverse_map = synthetic_inverse_map(1)
    random = np.random.default_rng(2)
    state = 1e5 * np.sin(0.05 * np.arange(n_cycles)[:, None] + np.arange(3.0))
    strain = inverse_map.mean_strain + state @ inverse_map.state_operator.T
    strain += 1e-7 * random.normal(size=strain.shape)
    pressure = 9e4 + np.arange(n_cycles)
    mach = np.sqrt(pressure / dynamic_pressure(1.0, 20e3)) if navigated else np.full(n_cycles, np.nan)
    altitude = np.where(np.isnan(mach), np.nan, 20e3)
    return [
        FlownSample(d, float(q), np.full(5, np.nan), float(m), float(h))
        for d, q, m, h in zip(strain, pressure, mach, altitude, strict=True)
    ]


class SteppedClock(MicrosecondClock):
    """A clock that stands until it is moved, but for one microsecond with every reading: no two are equal."""

    def __init__(self) -> None:
        super().__init__()
        self._begin, self._passed = round(1e6 * self.start), 0
        self._lock = threading.Lock()

    def __call__(self) -> float:
        with self._lock:
            self._passed += 1
            return self.now

    @property
    def now(self) -> float:
        """The latest time read [s]."""
        return (self._begin + self._passed) / 1e6

    def move_to(self, time: float) -> None:
        """Let the time [s] come."""
        with self._lock:
            self._passed = max(self._passed, round(1e6 * time) - self._begin)


class PacedBridge:
    """A running bridge whose clock moves only while it has nothing to do, and a bus to send it frames.

    Attributes
    ----------
    clock : of bridge and sender.
    sent : number of frames sent to the bridge.
    summary, notes : of the bridge and of its recorder and publisher, once it has ended.
    """

    summary: BridgeSummary
    notes: list[str]

    def __init__(self, bridge: Bridge, clock: SteppedClock, bus: Any, thread: threading.Thread) -> None:
        self.clock, self.sent = clock, 0
        record = bridge.machine.plan.record
        self._next, self._modulus = int(record["first_result"][0]), int(record["n_counters"][0])
        self._sender: FaultySender | None = None
        self._bridge, self._bus, self._thread = bridge, bus, thread
        self._free_until = clock.now
        self._is_waiting, self._waits = False, threading.Event()
        connect, open_bus = bridge._connect, bridge._open_bus

        def connected() -> None:
            connect()
            get = self._inbox.get

            def received(begin: float, timeout: float) -> Any:
                self._is_waiting = True
                self._waits.set()
                try:
                    return get(begin, min(timeout, TURN))  # the clock may have moved meanwhile
                finally:
                    self._is_waiting = False

            self._inbox.get = received  # to see when the bridge waits

        def opened() -> Any:
            bus = open_bus()
            bus.__class__ = type("Unstamped", (type(bus),), {})  # its messages have no time but the clock's
            return bus

        bridge._connect = connected  # type: ignore[method-assign]  # of this one bridge
        bridge._open_bus = opened

    def sender(self, layout: InputLayout, faults: Sequence[Fault] = (), trip: int = 1) -> FaultySender:
        """Return a sender that hears the results from now on."""
        self._sender = FaultySender(layout, list(faults), trip=trip)
        return self._sender

    def result(self, result: Result) -> None:
        """Have the sender hear a result."""
        number, self._next = self._next, (self._next + 1) % self._modulus
        sender = self._sender
        if sender is not None and result.counter is not None and hasattr(sender, "start"):
            sender.hear(result.counter, number, result.time - sender.start)

    def send(self, message: Any) -> None:
        """Send a message of python-can."""
        self._bus.send(message)
        self.sent += 1

    def sleep(self, seconds: float) -> None:
        """Let so much time pass on the clock, from one event of the bridge to the next."""
        end = self.clock.now + seconds
        while self.clock.now < end - 1e-6:
            self._settle()
            self.clock.move_to(end if self._is_free else min(end, self._due))
            if not self._is_free and self._inbox is not None:  # an empty message ends its wait
                self._inbox._waiting.put((None, self.clock.now))
        self._settle()

    def stand_still(self, seconds: float) -> None:
        """Called by the bridge's thread: hold it up for ``seconds`` of the clock, which goes on meanwhile."""
        self._free_until = self.clock.now + seconds
        wait_until(lambda: not self._is_free)

    @property
    def _is_free(self) -> bool:
        """Whether time passes without the bridge."""
        return self.clock.now < self._free_until

    @property
    def _inbox(self) -> Any:
        return self._bridge._inbox

    @property
    def _due(self) -> float:
        return min(self._bridge.machine.next_event, self._bridge.listener.next_status)

    def _settle(self) -> None:
        """Wait until the bridge has taken all that was sent and has nothing due."""
        end = time.monotonic() + PATIENCE
        while not self._is_idle():
            assert time.monotonic() < end, "it did not happen"
            self._waits.wait(TURN)
            self._waits.clear()

    def _is_idle(self) -> bool:
        assert self._thread.is_alive(), "the bridge has ended"
        received = int(self._bridge.machine._account["received"][0])
        if self._is_free:  # all but the cycle at which it stands are in its queue
            waiting = self._inbox._waiting.qsize()
            return received + waiting > self.sent - self._bridge.machine.layout.cycle_length
        is_done = self._is_waiting and received == self.sent and self._due > self.clock.now
        return is_done and self._is_waiting


def wait_until(condition: Callable[[], bool], seconds: float = PATIENCE) -> None:
    """Wait until ``condition`` holds."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it did not happen"
        time.sleep(2e-4)


@contextmanager
def paced_bridge(fmu: Path, options: BridgeOptions, **watched: Any) -> Iterator[PacedBridge]:
    """Run a bridge on the virtual bus of ``options`` for as long as the context lasts; then there is its summary.

    ``watched`` are the watchers of :func:`observed_bridge`.
    """
    clock, running = SteppedClock(), list[PacedBridge]()
    also = watched.pop("also", None)

    def take(result: Result) -> None:
        running[0].result(result)
        if also is not None:
            also(result)

    with observed_bridge(fmu, options, clock=clock, also=take, **watched) as observed:
        bridge, summaries = observed.bridge, list[BridgeSummary]()
        thread = threading.Thread(target=lambda: summaries.append(bridge.run()), daemon=True)
        bus = open_bus(BusSettings(interface="virtual", channel=options.channel))
        paced = PacedBridge(bridge, clock, bus, thread)
        running.append(paced)
        thread.start()
        wait_until(lambda: bridge._inbox is not None)
        try:
            paced.sleep(0.1)
            yield paced
            paced.sleep(0.1)
        finally:
            bridge.stop()
            thread.join(PATIENCE)
            bus.shutdown()
        paced.summary, paced.notes = summaries[0], observed.notes()


def live_run(
    fmu: Path,
    channel: str,
    n_cycles: int = 60,
    faults: tuple[Fault, ...] = (),
    record: Path | None = None,
    publish: str | None = None,
    profile: str = "fd64",
    stall: tuple[int, float] = (-1, 0.0),
    navigated: bool = False,
    key: Path | None = None,
) -> LiveRun:
    """Run a bridge on the virtual channel while the sender sends ``n_cycles``.

    ``navigated`` sends Mach number and altitude too; ``key`` is that of profile fd64-sec. ``stall`` is the number
    of a result behind which the bridge stands still, and for how long [s].
    """
    options = BridgeOptions(interface="virtual", channel=channel, profile=profile, cycle_time=CYCLE, key_file=key)
    results: list[Result] = []
    running: list[PacedBridge] = []

    def keep(result: Result) -> None:
        results.append(result)
        if len(results) == stall[0]:
            running[0].stand_still(stall[1])

    watched = {"record": record, "publish": publish, "publish_rate": 1000.0, "also": keep}
    with paced_bridge(fmu, options, **watched) as paced:
        running.append(paced)
        layout, _ = input_layout(options, [f"G{i}" for i in range(N_GAUGES)])
        trip = 1 if layout.key is None or key is None else next_trip(freshness_file(key, "sender"), layout.key)
        samples, sender = flight(n_cycles, navigated), paced.sender(layout, faults, trip)
        send_flight(
            paced,
            layout,
            samples=samples,
            clock=paced.clock,
            sleep=paced.sleep,
            sender=sender,
        )
    return LiveRun(results, paced.summary, paced.notes)
