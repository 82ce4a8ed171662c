"""A bridge in a thread of its own on a python-can bus, and a sender beside it."""

import threading
import time
from collections.abc import Callable

import can
import numpy as np
from can_case import Ears, Projection, Truth, layout_of

from strainfmu.can.bridge import QUEUED_CYCLES, BackOff, Bridge
from strainfmu.can.encoder import StrainEncoder
from strainfmu.can.frame import to_message
from strainfmu.can.listener import BridgeSummary, BusListener, Taps
from strainfmu.can.machine import Machine, Result
from strainfmu.can.options import BridgeSettings
from strainfmu.can.profiles import Identifiers
from strainfmu.can.quality import Quality
from strainfmu.can.result_frames import result_layouts
from strainfmu.cosim.estimators.step import StepResult

N = 30
CYCLE = 0.03
"""Period of the strain frames [s]: long enough for a busy host to be on time, now and then."""
PATIENCE = 600.0


class Pace:
    """When a sender of a period [s] sends next: a host that sleeps too long does not make its period longer."""

    def __init__(self, period: float) -> None:
        self._period, self._due = period, time.monotonic()

    def wait(self) -> float:
        """Return the time until the next cycle [s]; a late one is sent at once, those before it are left out."""
        now = time.monotonic()
        self._due = max(self._due + self._period, now - self._period)
        return max(self._due - now, 0.0)


class Slow(Projection):
    """An estimator that ``waits`` in a step."""

    waits: Callable[[], None] = staticmethod(lambda: None)

    def __call__(self, strain: np.ndarray, dynamic_pressure: float, step_size: float) -> StepResult:
        self.waits()
        return super().__call__(strain, dynamic_pressure, step_size)


class Running:
    """A bridge in a thread of its own, and a sender's bus beside it.

    Attributes
    ----------
    states_results : the sender names the results that it has heard; False of profiles of version 1.
    """

    def __init__(
        self,
        open_one: Callable[[], can.BusABC],
        sender: can.BusABC,
        queued_cycles: int = QUEUED_CYCLES,
        n_gauges: int = N,
        cycle: float = CYCLE,
    ) -> None:
        layout = layout_of("fd64", n_gauges, cycle)
        results = result_layouts("fd", Identifiers(), cycle)
        self.step = Slow(n_gauges)
        core = Machine(
            layout,
            self.step,
            BridgeSettings(),
            start=time.monotonic(),
            own=[r.key for r in results],
            now=time.monotonic,
        )
        self.results: list[Result] = []
        self.buses: list[can.BusABC] = []
        self.sender, self.cycle, self._truth, self.port = sender, 0, Truth(n_gauges, 1), 0
        assert layout.state is not None
        self._state_key, self.states_results = layout.state.layout.key, True
        self._encoder, self._start, self._pace = StrainEncoder(layout), time.monotonic(), Pace(cycle)

        def opened() -> can.BusABC:
            self.buses.append(open_one())
            return self.buses[-1]

        self._ears = Ears(self._encoder, lambda _: time.monotonic() - self._start)
        back_off = BackOff(first=0.02, longest=0.1, attempts=5, settle=0.2)
        listener = BusListener(core, results, 1, Taps(on_result=self._take))
        self.bridge = Bridge(listener, opened, back_off=back_off, queued_cycles=queued_cycles)
        self.summary: BridgeSummary | None = None
        self.error: Exception | None = None
        self._thread = threading.Thread(target=self._run)
        self._thread.start()
        self.wait(lambda: bool(self.buses))

    def _take(self, result: Result) -> None:
        self.results += self._ears.hear([result])

    def _run(self) -> None:
        try:
            self.summary = self.bridge.run()
        except Exception as error:
            self.error = error

    def send(self, n_cycles: int) -> None:
        """Send cycles in real time."""
        for _ in range(n_cycles):
            self.cycle += 1
            now = time.monotonic() - self._start
            for frame in self._encoder.encode(*self._truth.cycle(self.cycle), cycle=self.cycle, sample_time=now):
                if self.states_results or frame.key != self._state_key:
                    self.sender.send(to_message(frame))
            time.sleep(self._pace.wait())

    def wait(self, until: Callable[[], bool], seconds: float = PATIENCE) -> None:
        """Wait until something is so."""
        end = time.monotonic() + seconds
        while not until():
            assert time.monotonic() < end, "it did not happen"
            time.sleep(0.005)

    def send_while(self, until: Callable[[], bool]) -> None:
        """Send until something is so."""
        end = time.monotonic() + PATIENCE
        while not until():
            assert time.monotonic() < end, f"it did not happen: {self.results[-5:]}"
            self.send(1)

    def send_until(self, quality: Quality, number: int = 1) -> None:
        """Send until so many new results have ``quality``."""
        known = len(self.results)
        self.send_while(lambda: sum(result.quality is quality for result in self.results[known:]) >= number)

    def wait_for_four_cycles(self) -> None:
        """Wait until four further cycles are on the bus, or no more come."""
        begin, now = self.cycle, time.monotonic()
        while self.cycle < begin + 4 and time.monotonic() < now + 1.0:
            time.sleep(1e-3)

    def end(self) -> BridgeSummary:
        """Stop the bridge and return its summary, whose account must sum."""
        self.bridge.stop()
        self._thread.join(PATIENCE)
        assert not self._thread.is_alive()
        if self.error is not None:
            raise self.error
        assert self.summary is not None
        assert self.summary.account.unaccounted == 0
        assert self.summary.account.pending == 0
        return self.summary
