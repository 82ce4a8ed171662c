"""One sender, here and now: creeping delay, recordings, second senders and second bridges, in virtual time."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest
from can_case import CYCLE, OWN, Projection, Truth, layout_of

from strainfmu.can.cycle.core import BridgeCore, bridge_core
from strainfmu.can.cycle.quality import Quality
from strainfmu.can.cycle.result import CycleResult
from strainfmu.can.settings import BridgeSettings
from strainfmu.can.wire.frame import Frame
from strainfmu.can.wire.frame_layout import InputLayout
from strainfmu.can.wire.strain_encoder import StrainEncoder

pytestmark = pytest.mark.fast


class Bench:
    """A layout, a sender and a core in virtual time."""

    def __init__(
        self,
        profile: str = "fd64",
        n_gauges: int = 4,
        cycle_time: float = CYCLE,
        settings: BridgeSettings | None = None,
    ) -> None:
        self.layout: InputLayout = layout_of(profile, n_gauges, cycle_time)
        self.core: BridgeCore = bridge_core(
            self.layout, Projection(n_gauges), settings or BridgeSettings(), start=0.0, own_keys=[OWN.key]
        )
        self._encoder = StrainEncoder(self.layout)
        self._truth = Truth(n_gauges, 1)

    def cycle(
        self,
        number: int,
        at: float,
        sample_time: float | None = None,
        counter: int | None = None,
        seed: int = 0,
        strain: np.ndarray | None = None,
    ) -> list[Frame]:
        """Return the frames of a cycle, received at ``at`` [s]; ``seed`` other than 0 for other strains."""
        own, pressure = self._truth.cycle(number)
        if seed:
            own = own + 20e-6 * np.random.default_rng((seed, number)).normal(size=own.shape)
        frames = self._encoder.encode(
            own if strain is None else strain,
            pressure,
            cycle=number if counter is None else counter,
            sample_time=number * self.layout.cycle_time if sample_time is None else sample_time,
        )
        return [replace(frame, time=at + 1e-6 * index) for index, frame in enumerate(frames)]

    def give(self, frames: Iterable[Frame]) -> list[CycleResult]:
        """Return the results of ``frames``, in the order of their times."""
        results = []
        for frame in sorted(frames, key=lambda frame: frame.time):
            results += self.core.receive(frame)
        assert self.core.account.unaccounted == 0
        return results

    def run(self, numbers: Iterable[int], later: float = 0.0) -> list[CycleResult]:
        """Return the results of the true sender's cycles, sent ``later`` [s] than they should be."""
        results = []
        for number in numbers:
            results += self.give(self.cycle(number, number * self.layout.cycle_time + later))
        return results


def n_valid(results: Iterable[CycleResult]) -> int:
    return sum(result.quality is Quality.VALID for result in results)


# --- a delay that creeps


def creep(bench: Bench, growth: float, duration: float, rate: float = 0.0) -> list[tuple[float, CycleResult]]:
    """Return results with their true ages.

    The delay grows by ``growth`` [s/s]; the sender's clock runs slower than the bridge's by ``rate`` [s/s].
    """
    period, found = bench.layout.cycle_time, []
    for number in range(int(duration / period)):
        sampled = number * period
        arrival = sampled + growth * sampled
        for result in bench.give(bench.cycle(number, arrival, sample_time=sampled * (1.0 - rate))):
            found.append((result.time - sampled, result))
    return found


@pytest.mark.parametrize("profile", ["fd64", "classic-le"])
def test_a_creeping_delay_of_190_ppm_does_not_stay_valid(profile: str) -> None:
    found = creep(Bench(profile, cycle_time=0.1), 190e-6, 600.0)
    hidden = [true - result.age for true, result in found if result.quality is Quality.VALID]
    assert len(hidden) > 500
    assert max(hidden) < 10.5e-3
    assert found[-1][1].quality is not Quality.VALID
    assert found[-1][1].age > 0.09


# --- a recording taken for a restart


def replayed(bench: Bench, numbers: Iterable[int], begin: float) -> list[CycleResult]:
    """Send cycles that were sent before, from ``begin`` [s] on."""
    results = []
    for index, number in enumerate(numbers):
        results += bench.give(bench.cycle(number, begin + index * bench.layout.cycle_time))
    return results


@pytest.mark.parametrize("profile", ["fd64", "classic-le", "classic-be", "float2"])
def test_a_recording_of_a_second_ago_is_never_valid(profile: str) -> None:
    bench = Bench(profile)
    assert n_valid(bench.run(range(300))) > 290
    assert n_valid(replayed(bench, range(200, 300), 3.01)) == 0


def test_a_recording_of_the_senders_own_start_is_never_valid() -> None:
    bench = Bench()
    bench.run(range(300))
    assert n_valid(replayed(bench, range(300), 3.01)) == 0


@pytest.mark.parametrize("profile", ["fd64", "classic-le", "classic-be", "float2"])
def test_a_sender_that_was_switched_off_and_on_recovers_by_itself(profile: str) -> None:
    bench = Bench(profile)
    bench.run(range(300))
    results = []
    for number in range(60):
        frames = bench.cycle(400 + number, 4.0 + number * CYCLE, sample_time=number * CYCLE, counter=number)
        results += bench.give(frames)
    assert n_valid(results) >= 60 - BridgeSettings().recovery_cycles


# --- two senders, two bridges


@pytest.mark.parametrize("profile", ["fd64", "classic-le", "classic-be", "float2"])
def test_conflicting_duplicates_take_valid_away(profile: str) -> None:
    bench = Bench(profile)
    assert n_valid(bench.run(range(50))) > 40
    results = []
    for number in range(50, 80):
        results += bench.give(bench.cycle(number, number * CYCLE))
        results += bench.give(bench.cycle(number, number * CYCLE + 2e-3, seed=1))
    # The first cycle was answered before its duplicate came.
    assert n_valid(results) <= 1
    assert n_valid(bench.run(range(80, 130))) > 25


def test_results_of_another_bridge_take_valid_away() -> None:
    bench = Bench()
    bench.run(range(50))
    results = []
    for number in range(50, 80):
        results += bench.give(bench.cycle(number, number * CYCLE))
        results += bench.give([replace(OWN, data=bytes([number]) + bytes(63), time=number * CYCLE + 5e-3)])
    assert n_valid(results) <= 1
