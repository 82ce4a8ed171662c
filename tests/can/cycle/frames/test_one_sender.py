"""One sender, here and now: creeping delay, recordings, second senders and second bridges, in virtual time."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest
from can_case import CYCLE, OWN, Projection, Truth, layout_of

from strainfmu.can.cycle.core import BridgeCore, bridge_core
from strainfmu.can.cycle.estimate.result import CycleResult
from strainfmu.can.cycle.frames.account import FrameClass
from strainfmu.can.cycle.frames.restart_proof import SeenFrames
from strainfmu.can.cycle.states.quality import Cause, Quality
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

    def switch_on(self, trip: int) -> None:
        """Restart an authenticated sender with a new trip counter."""
        self._encoder = StrainEncoder(self.layout, trip=trip)

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


def test_a_creeping_delay_of_190_ppm_does_not_stay_valid() -> None:
    """Of classic frames; test_guards.py has those of CAN FD."""
    found = creep(Bench("classic-le", cycle_time=0.1), 190e-6, 600.0)
    hidden = [true - result.age for true, result in found if result.quality is Quality.VALID]
    assert len(hidden) > 500
    assert max(hidden) < 10.5e-3
    assert found[-1][1].quality is not Quality.VALID
    assert found[-1][1].age > 0.09


@pytest.mark.parametrize("profile", ["fd64", "classic-le"])
@pytest.mark.parametrize("rate", [50e-6, -50e-6])
def test_a_sender_50_ppm_slow_or_fast_stays_valid_and_its_age_bounded(profile: str, rate: float) -> None:
    found = creep(Bench(profile, cycle_time=0.1), 0.0, 700.0, rate)
    assert {result.quality for _, result in found[10:]} == {Quality.VALID}
    assert all(abs(true - r.age) <= r.age_uncertainty + 1e-4 for true, r in found[10:])
    assert 0.01 < max(r.age_uncertainty for _, r in found) < 0.1
    assert found[-1][1].age_uncertainty < 1e-3, "its rate is measured"


# --- a recording taken for a restart


def replayed(bench: Bench, numbers: Iterable[int], begin: float) -> list[CycleResult]:
    """Send cycles that were sent before, from ``begin`` [s] on."""
    results = []
    for index, number in enumerate(numbers):
        results += bench.give(bench.cycle(number, begin + index * bench.layout.cycle_time))
    return results


@pytest.mark.parametrize("profile", ["fd64", "classic-le"])
def test_a_recording_of_a_second_ago_is_never_valid(profile: str) -> None:
    bench = Bench(profile)
    assert n_valid(bench.run(range(300))) > 290
    assert n_valid(replayed(bench, range(200, 300), 3.01)) == 0


def test_a_recording_of_the_senders_own_start_is_never_valid() -> None:
    bench = Bench()
    bench.run(range(300))
    assert n_valid(replayed(bench, range(300), 3.01)) == 0


@pytest.mark.parametrize("profile", ["fd64", "classic-le"])
def test_a_sender_that_was_switched_off_and_on_recovers_by_itself(profile: str) -> None:
    bench = Bench(profile)
    bench.run(range(300))
    results = []
    for number in range(60):
        frames = bench.cycle(400 + number, 4.0 + number * CYCLE, sample_time=number * CYCLE, counter=number)
        results += bench.give(frames)
    assert n_valid(results) >= 60 - BridgeSettings().recovery_cycles


# --- two senders, two bridges


@pytest.mark.parametrize("profile", ["fd64", "classic-le"])
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


@pytest.mark.parametrize("profile", ["fd64", "classic-le"])
def test_a_foreign_cycle_that_comes_first_now_and_then_takes_valid_away(profile: str) -> None:
    """Once in 12 cycles, ahead of the true one and with its counter: longer ago than the first alarm lasts."""
    bench = Bench(profile)
    assert n_valid(bench.run(range(50))) > 40
    results = []
    for number in range(50, 410):
        if number % 12 == 0:
            results += bench.give(bench.cycle(number, number * CYCLE, seed=1))
            results += bench.give(bench.cycle(number, number * CYCLE + 2e-3))
        else:
            results += bench.give(bench.cycle(number, number * CYCLE))
    assert n_valid(results[:20]) <= 12, "until the first foreign cycle is found by the true one behind it"
    assert n_valid(results[60:]) == 0, "in between as well"


def test_results_of_another_bridge_take_valid_away() -> None:
    bench = Bench()
    bench.run(range(50))
    results = []
    for number in range(50, 80):
        results += bench.give(bench.cycle(number, number * CYCLE))
        results += bench.give([replace(OWN, data=bytes([number]) + bytes(63), time=number * CYCLE + 5e-3)])
    assert n_valid(results) <= 1


def test_two_senders_in_turns_take_valid_away() -> None:
    """The same clock, other counters: as two racks with the same identifiers."""
    bench = Bench()
    bench.run(range(50))
    results = []
    for number in range(50, 80):
        results += bench.give(bench.cycle(number, number * CYCLE))
        results += bench.give(bench.cycle(number, number * CYCLE + 2e-3, counter=number + 100, seed=1))
    assert all(result.causes & Cause.SECOND_SENDER for result in results if result.time > 0.55)
    assert n_valid(results) <= 2


@pytest.mark.parametrize("silent", [14, 29])
def test_a_silence_of_once_round_the_counter_is_no_second_sender(silent: int) -> None:
    """Of the pressure alone, and of the whole sender, whose counters have 15 values."""
    for is_silent in (lambda bench, frame: frame.key == bench.layout.frames[-1].layout.key, lambda *_: True):
        bench = Bench("classic-le")
        results = []
        for number in range(200):
            frames = bench.cycle(number, number * CYCLE)
            off = 50 <= number < 50 + silent
            results += bench.give([frame for frame in frames if not (off and is_silent(bench, frame))])
        assert not any(result.causes & Cause.SECOND_SENDER for result in results)
        assert n_valid(results) >= 200 - silent - 15


def test_own_frames_that_come_back_are_own_once_each() -> None:
    bench = Bench()
    bench.run(range(50))
    results = []
    for number in range(50, 80):
        own = replace(OWN, data=bytes([number]) + bytes(63), time=number * CYCLE + 5e-3)
        bench.core.own_frames.sending(own)
        results += bench.give([*bench.cycle(number, number * CYCLE), own])
    assert n_valid(results) == 30
    assert bench.core.account.classes[FrameClass.OWN] == 30
    bench.give([replace(own, time=0.805)])
    assert bench.run([81])[-1].causes == Cause.SECOND_BRIDGE
    assert bench.core.account.classes[FrameClass.SECOND_BRIDGE] == 1


# --- what else a restart may be


def test_a_recording_of_the_dynamic_pressure_alone_is_not_used() -> None:
    bench, key = Bench(), layout_of("fd64", 4).flow_frames[0].layout.key
    bench.run(range(300))
    results = []
    for number in range(300, 360):
        strains = [frame for frame in bench.cycle(number, number * CYCLE) if frame.key != key]
        old = [frame for frame in bench.cycle(number - 100, number * CYCLE) if frame.key == key]
        results += bench.give(old + strains)
    pressures = {result.dynamic_pressure for result in results if np.isfinite(result.dynamic_pressure)}
    assert pressures == {Truth(4, 1).cycle(299)[1]}, "the last true one, for as long as it is held"
    assert n_valid(results) <= 10


def restarted(bench: Bench, first: int, at: float, clock: float, counter: int, n: int = 40) -> list[CycleResult]:
    """Send new strains from ``at`` [s] on, with a sender's clock that shows ``clock`` [s] then."""
    results = []
    for index in range(n):
        later = index * CYCLE
        results += bench.give(
            bench.cycle(first + index, at + later, sample_time=clock + later, counter=counter + index)
        )
    return results


@pytest.mark.parametrize(
    ("clock", "counter", "is_proven"),
    [
        (0.0, 0, True),  # switched on
        (0.9, 90, True),  # switched on just after it was heard, first heard again 0.9 s later
        (0.9, 120, False),  # a counter that is ahead of its clock
        (2.5, 250, False),  # a clock that began before the sender was last heard
        (30.0, 400, True),  # the clock was set ahead, the counter goes on
        (30.0, 450, False),  # the clock is ahead, the counter is not that of this sender
        (1.5, 400, False),  # the clock was set back
    ],
)
def test_proofs_of_a_restart(clock: float, counter: int, is_proven: bool) -> None:
    bench = Bench()
    bench.run(range(300))
    results = restarted(bench, first=1000, at=4.0, clock=clock, counter=counter)
    assert (n_valid(results) > 20) == is_proven
    if is_proven:
        return
    # Also not later, nor after the bus was reopened; only when somebody confirms it.
    assert results[-1].quality is Quality.UNCONFIRMED
    assert results[-1].causes & Cause.UNPROVEN_RESTART
    bench.core.restart(4.405)
    results = restarted(bench, first=1040, at=4.41, clock=clock + 0.41, counter=counter + 41)
    assert n_valid(results) == 0
    bench.core.confirm_sender()
    results = restarted(bench, first=1080, at=4.82, clock=clock + 0.82, counter=counter + 82)
    assert n_valid(results) == 40


ACCEPTING = BridgeSettings(restart="accept")


@pytest.mark.parametrize("profile", ["fd64", "classic-le"])
@pytest.mark.parametrize("pause", [0.0, 1.0, 5000.0])  # the last one wraps the sample time: it looks like a delay
def test_the_same_stimulus_again_is_valid_again_where_restarts_are_accepted(profile: str, pause: float) -> None:
    bench = Bench(profile, settings=ACCEPTING)
    for run in range(3):
        results = replayed(bench, range(100), run * (100 * CYCLE + pause))
        answers = [result for result in results if result.counter is not None]
        assert {result.quality for result in answers[12:]} == {Quality.VALID}
        if run > 0:
            causes = [result.causes for result in answers[:12]]
            assert any(cause & Cause.CLOCK_JUMP for cause in causes), "a restart is reported"
            assert answers[0].quality is not Quality.VALID


def test_an_accepted_restart_needs_cycles_in_a_row_that_fit() -> None:
    bench = Bench(settings=ACCEPTING)
    bench.run(range(100))
    results = []
    for number in range(60):  # a time of before in each cycle, which no other one confirms
        frames = bench.cycle(number, 2.0 + number * CYCLE, sample_time=0.07 * (7 * number % 13))
        results += bench.give(frames)
    assert n_valid(results) == 0
    assert any(result.counter is not None for result in results)


def test_frames_without_sample_time_are_accepted_behind_a_pause_too() -> None:
    timed = layout_of("fd64", 4)
    bench = Bench()
    bench.layout = replace(timed, strain_frames=tuple(replace(f, sample_time=None) for f in timed.strain_frames))
    bench.core = bridge_core(bench.layout, Projection(4), ACCEPTING, start=0.0)
    assert n_valid(bench.run(range(100))) > 90
    assert n_valid(replayed(bench, range(100), 1.2)) > 85


def test_an_authenticated_sender_restarts_by_a_new_trip_alone() -> None:
    bench = Bench("fd64-sec", settings=ACCEPTING)
    assert n_valid(bench.run(range(100))) > 90
    assert n_valid(replayed(bench, range(100), 2.0)) == 0
    bench.switch_on(trip=2)
    assert n_valid(replayed(bench, range(100), 4.0)) > 85


def test_the_true_sender_comes_back_behind_a_recording_by_itself() -> None:
    bench = Bench()
    bench.run(range(300))
    replayed(bench, range(200, 260), 3.01)
    assert n_valid(bench.run(range(370, 400))) > 20


def test_a_synchronised_sender_needs_no_proof_and_its_recording_is_old() -> None:
    bench = Bench(settings=BridgeSettings(synchronised=1e-3))
    assert n_valid(bench.run(range(300))) > 290
    results = replayed(bench, range(200, 260), 3.01)
    assert {result.quality for result in results if result.counter is not None} == {Quality.STALE}
    results = restarted(bench, first=1000, at=5.0, clock=5.0, counter=7)
    assert n_valid(results) > 30
    assert results[-1].age_uncertainty == 1e-3


def test_a_constant_delay_of_a_synchronised_sender_is_age() -> None:
    bench = Bench(settings=BridgeSettings(synchronised=1e-3))
    assert bench.run(range(50), later=0.03)[-1].age == pytest.approx(0.03, abs=1e-4)
    results = bench.run(range(100, 150), later=0.06)
    assert n_valid(results) == 0


def test_an_uncertainty_beyond_its_limit_is_not_valid() -> None:
    bench = Bench(cycle_time=0.1, settings=BridgeSettings(max_uncertainty=5e-3))
    results = bench.run(range(1000))
    assert [r.quality for r in results if 2.0 < r.time < 49.0] == [Quality.VALID] * 470
    assert results[-1].causes == Cause.HIDDEN_DELAY


@pytest.mark.parametrize(
    ("growth", "rate"), [(0.0, -90e-6), (0.0, 90e-6), (90e-6, -90e-6), (300e-6, 0.0), (300e-6, 90e-6)]
)
def test_no_valid_result_is_older_than_stated_whatever_the_clock(growth: float, rate: float) -> None:
    found = creep(Bench(cycle_time=0.5), growth, 600.0, rate)
    beyond = [
        true - result.age - result.age_uncertainty for true, result in found if result.quality is Quality.VALID
    ]
    assert len(beyond) > 50
    assert max(beyond) < 1e-5


def test_frames_without_sample_time_behind_a_pause_may_be_a_recording() -> None:
    timed = layout_of("fd64", 4)
    frames = tuple(replace(frame, sample_time=None) for frame in timed.strain_frames)
    bench = Bench()
    bench.layout = replace(timed, strain_frames=frames)
    bench.core = bridge_core(bench.layout, Projection(4), BridgeSettings(), start=0.0)
    assert n_valid(bench.run(range(100))) > 90
    assert n_valid(replayed(bench, range(40, 90), 1.2)) == 0
    assert n_valid(bench.run(range(200, 240))) > 25


def test_frames_that_were_seen_are_known_again_and_few_new_ones_are_taken_for_them() -> None:
    seen, content = SeenFrames(), np.random.default_rng(5).bytes(64)
    frames = [number.to_bytes(4, "little") + content for number in range(40_000)]
    mistaken = sum(not seen.add((frame,)) for frame in frames)
    assert mistaken <= 40, "one in a thousand, with a 25th of the frames that give one in 500"
    assert not any(seen.add((frame,)) for frame in frames)
    assert not seen.add((b"new", frames[0])), "one old frame among new ones"
    assert not seen.add((b"new",)), "it was remembered"
