"""A day of bus time with faults, in virtual time: sender, bridge, estimator, recording and page; nothing grows."""

import gc
from collections import Counter
from pathlib import Path
from time import sleep

import numpy as np
import pytest
from can_case import Ears
from can_faults import NEED_A_KEY, FaultKind, random_faults
from composed_frames import ResultFrames
from fault_injection import FaultySender
from synthetic_vehicle import SyntheticFiles, synthetic_inverse_map
from test_endurance import grows, resident_memory

from strainfmu.can.frame_layout import NAVIGATION
from strainfmu.can.log_description import sidecar
from strainfmu.can.machine import Result
from strainfmu.can.options import BridgeOptions
from strainfmu.can.page_message import gauge_positions
from strainfmu.can.publisher import Publisher
from strainfmu.can.quality import BusState, Cause, Quality
from strainfmu.can.recording import WAITING_FRAMES, MicrosecondClock, Recorder
from strainfmu.can.setup import make_machine
from strainfmu.cosim.estimators.fmu_step import FmuStep
from strainfmu.cosim.estimators.step import ENVELOPE_SCORE
from strainfmu.monitor.server import Monitor

HOURS, CYCLE, CYCLES_APART = 24, 0.05, 1000
"""Length of the run [h], its cycle [s], and cycles between two faults."""


class Chain:
    """Sender with random faults, machine, real estimator, result frames, recorder and live page, in virtual time.

    Attributes
    ----------
    qualities : number of results by quality.
    recorded, lost : frames of the closed recordings.
    """

    def __init__(self, step: FmuStep, folder: Path, monitor: Monitor, n_faults: int) -> None:
        options = BridgeOptions(interface="virtual", channel="soak", profile="fd64", cycle_time=CYCLE)
        made = make_machine(step, options, gauge_names=step.gauge_names, start=0.0)
        self.machine, layouts, configuration, _ = made
        kinds = tuple(kind for kind in FaultKind if kind not in NEED_A_KEY)
        self.faults = random_faults(n_faults, kinds, seed=24, gap=CYCLES_APART, longest=40)
        self.sender = FaultySender(self.machine.layout, self.faults)
        self._ears, self._composer = Ears(self.sender), ResultFrames(layouts, configuration)
        self._publisher = Publisher(
            monitor.listens_at, gauge_positions(step.path), rate=1e6, account=lambda: self.machine.account
        )
        self._folder, self._random = folder, np.random.default_rng(5)
        self.qualities = Counter[Quality]()
        self.recorded = self.lost = self.frames = 0

    def hour(self, first: int, n_cycles: int) -> None:
        """Send ``n_cycles`` from cycle ``first``, with a recording of their own, and count its frames."""
        recorder = Recorder(self._folder / f"from_{first}.blf", MicrosecondClock())
        inverse_map = synthetic_inverse_map(1)
        for number in range(first, first + n_cycles):
            time = number * CYCLE
            state = 1e5 * np.sin(0.05 * number + np.arange(3.0))
            strain = inverse_map.mean_strain + inverse_map.state_operator @ state
            strain += 1e-7 * self._random.normal(size=len(strain))
            results = list[Result]()
            for frame in self.sender.cycle(number, time, strain, 9e4 + number % 1000):
                recorder.queue.put(frame, True)
                self.frames += 1
                results += self.machine.receive(frame)
            results += self.machine.advance(time + 0.99 * CYCLE)
            if self.machine.bus_state is BusState.BUS_OFF and not self.sender.bus_off:
                self.machine.restart(time + 0.99 * CYCLE)
            for result in self._ears.hear(results):
                self.qualities[result.quality] += 1
                for answer in self._composer.of_result(result):
                    answer.time = result.time
                    recorder.queue.put(answer, False)
                    self.frames += 1
                self._publisher.result(result)
            if results and results[-1].causes & Cause.UNPROVEN_RESTART:
                self.machine.confirm()
            while len(recorder.queue) > WAITING_FRAMES // 2:  # time is quicker than the disk here
                sleep(0.01)
        recorder.close()
        assert not recorder.failure
        self.recorded, self.lost = self.recorded + recorder.recorded, self.lost + recorder.lost
        recorder.path.unlink()
        sidecar(recorder.path).unlink(missing_ok=True)

    def close(self) -> None:
        """End the threads of the page's messages."""
        self._publisher.close()


def soak(fmu: Path, folder: Path, hours: int, cycles: int) -> list[int]:
    """Run ``hours`` pieces of ``cycles`` each; return the memory after each piece [byte]."""
    memory, monitor = list[int](), Monitor(("127.0.0.1", 0), ("127.0.0.1", 0))
    with FmuStep(fmu, NAVIGATION, (ENVELOPE_SCORE,)) as step:
        chain = Chain(step, folder, monitor, n_faults=hours * cycles // (CYCLES_APART + 20))
        for hour in range(hours):
            chain.hour(hour * cycles, cycles)
            gc.collect()
            memory.append(resident_memory())
        chain.close()
    chain.machine.finish(hours * cycles * CYCLE)
    monitor.close()
    account = chain.machine.account
    print(
        dict(account.rows()),
        {q.name: n for q, n in chain.qualities.items()},
        chain.recorded,
        monitor.state.datagrams,
    )
    assert account.unaccounted == account.pending == 0
    assert (chain.recorded, chain.lost) == (chain.frames, 0)
    assert monitor.state.datagrams > 0
    assert monitor.state.refused == 0
    # A fault lasts 20 of 1,000 cycles on average, and the recovery from it about as long.
    assert chain.qualities[Quality.VALID] > 0.9 * hours * cycles
    return memory


@pytest.mark.slow
def test_a_day_without_growth(synthetic: SyntheticFiles, tmp_path: Path) -> None:
    """An hour of cycles and a recording after the other; memory as at the start, every frame accounted for."""
    memory = soak(synthetic.estimator_1, tmp_path, HOURS, round(3600.0 / CYCLE))
    print(f"resident memory after each hour [kB]: {[round(m / 1000) for m in memory]}")
    assert grows(memory) < 2e6
