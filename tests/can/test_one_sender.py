"""One sender, here and now: creeping delay, restarts, recordings, second senders and bridges, in virtual time."""

from collections.abc import Iterable
from dataclasses import replace
from itertools import count

import numpy as np
import pytest
from can_case import CYCLE, OWN, Projection, Truth, layout_of

from strainfmu.can.encoder import StrainEncoder
from strainfmu.can.frame import Frame
from strainfmu.can.frame_layout import InputLayout
from strainfmu.can.machine import Machine, Result
from strainfmu.can.options import BridgeSettings
from strainfmu.can.quality import Cause, FrameClass, Quality

pytestmark = pytest.mark.fast

PROFILES = ("fd64", "classic-le", "fd64-sec")
ACCEPTING = BridgeSettings(restart="accept")


class Bench:
    """A layout, a sender that hears the results, and a machine, in virtual time.

    Attributes
    ----------
    rate : by how much the sender's clock is slower than the bridge's [s/s].
    sent : frames of each cycle, for a recording.
    """

    def __init__(
        self,
        profile: str = "fd64",
        cycle_time: float = CYCLE,
        settings: BridgeSettings | None = None,
        has_state: bool = True,
        is_answered: bool = True,
        start: float = 0.0,
    ) -> None:
        layout = layout_of(profile, 4, cycle_time)
        self.layout: InputLayout = layout if has_state else replace(layout, state=None)
        self.core: Machine = Machine(
            self.layout,
            Projection(4),
            settings or BridgeSettings(),
            start=start,
            own=[OWN.key],
            is_answered=is_answered,
        )
        self.encoder = StrainEncoder(self.layout)
        self._truth, self._number, self.rate = Truth(4, 1), count(), 0.0
        self._hears, self._clock_at = has_state and is_answered, 0.0
        self.sent: dict[int, list[Frame]] = {}

    def cycle(
        self,
        number: int,
        at: float,
        sample_time: float | None = None,
        counter: int | None = None,
        seed: int = 0,
        late: float = 0.0,
    ) -> list[Frame]:
        """Return the frames of a cycle, received at ``at`` [s], ``late`` [s] behind their sampling.

        ``seed`` other than 0 is for other strains.
        """
        own, pressure = self._truth.cycle(number)
        if seed:
            own = own + 20e-6 * np.random.default_rng((seed, number)).normal(size=own.shape)
        clock = number * self.layout.cycle_time if sample_time is None else sample_time
        frames = self.encoder.encode(
            own, pressure, cycle=number if counter is None else counter, sample_time=clock
        )
        self._clock_at = clock - (at - late)
        self.sent[number] = [replace(frame, time=at + 1e-6 * index) for index, frame in enumerate(frames)]
        return self.sent[number]

    def give(self, frames: Iterable[Frame]) -> list[Result]:
        """Return the results of ``frames``, in the order of their times."""
        results = []
        for frame in sorted(frames, key=lambda frame: frame.time):
            results += self.core.receive(frame)
        for result in results:
            number = next(self._number) % 256
            if self._hears and result.counter is not None:
                self.encoder.hear(result.counter, number, result.time + self._clock_at)
        assert self.core.account.unaccounted == 0
        return results

    def run(self, numbers: Iterable[int], later: float = 0.0) -> list[Result]:
        """Return the results of the true sender's cycles, sent ``later`` [s] than they should be."""
        results = []
        for number in numbers:
            results += self.give(self.cycle(number, number * self.layout.cycle_time + later))
        return results

    def replay(self, numbers: Iterable[int], begin: float) -> list[Result]:
        """Send frames again that were sent before, from ``begin`` [s] on."""
        results = []
        for index, number in enumerate(numbers):
            at, first = begin + index * self.layout.cycle_time, self.sent[number][0].time
            results += self.give([replace(frame, time=at + frame.time - first) for frame in self.sent[number]])
        return results

    def restarted(self, at: float, clock: float = 0.0, counter: int = 0, n: int = 60) -> list[Result]:
        """Send new strains from ``at`` [s] on, by a clock that shows ``clock`` [s] then."""
        results, first = [], max(self.sent, default=0) + 1000
        for index in range(n):
            later = index * self.layout.cycle_time
            frames = self.cycle(first + index, at + later, sample_time=clock + later, counter=counter + index)
            results += self.give(frames)
        return results


def n_valid(results: Iterable[Result]) -> int:
    return sum(result.quality is Quality.VALID for result in results)


def answers(results: Iterable[Result]) -> list[Result]:
    return [result for result in results if result.counter is not None]


# --- age: a delay that creeps, clocks that differ


def creep(bench: Bench, growth: float, duration: float, rate: float = 0.0) -> list[tuple[float, Result]]:
    """Return results with their true ages.

    The delay grows by ``growth`` [s/s]; the sender's clock runs slower than the bridge's by ``rate`` [s/s].
    """
    period, found = bench.layout.cycle_time, []
    for number in range(int(duration / period)):
        sampled = number * period
        arrival = sampled + growth * sampled
        frames = bench.cycle(number, arrival, sample_time=sampled * (1.0 - rate), late=growth * sampled)
        for result in answers(bench.give(frames)):
            found.append((result.time - sampled, result))
    return found


@pytest.mark.parametrize("has_state", [True, False])
@pytest.mark.parametrize(("growth", "rate"), [(0.0, -90e-6), (0.0, 90e-6), (90e-6, -90e-6), (300e-6, 0.0)])
def test_no_result_in_use_is_older_than_stated_whatever_the_clock(
    has_state: bool, growth: float, rate: float
) -> None:
    """But without echo for what the tolerance of 100 ppm does not cover."""
    found = creep(Bench(cycle_time=0.5, has_state=has_state), growth, 600.0, rate)
    in_use = [(true, result) for true, result in found if result.quality is Quality.VALID]
    covered = growth + rate <= 100e-6 or has_state
    assert len(in_use) > 1000
    beyond = [true - result.age - result.age_uncertainty for true, result in in_use]
    assert not covered or max(beyond) < 1e-5
    if has_state:
        assert max(result.age + result.age_uncertainty for _, result in in_use) < 0.51, "since the last result"


def test_without_echo_the_tolerance_of_clocks_enters_as_time_goes() -> None:
    """From VALID to UNCONFIRMED when age and uncertainty exceed what is allowed; a confirmation begins anew."""
    bench = Bench(cycle_time=0.5, has_state=False)
    results = answers(bench.run(range(800)))
    assert results[-1].age_uncertainty == pytest.approx(1e-4 * 400.0, rel=0.02)
    short = Bench(cycle_time=0.5, has_state=False, settings=BridgeSettings(max_age=0.06))
    results = answers(short.run(range(800)))
    assert [r.quality for r in results[10:580]] == [Quality.VALID] * 570
    assert results[-1].quality is Quality.UNCONFIRMED
    assert results[-1].causes == Cause.HIDDEN_DELAY
    short.core.confirm()
    assert answers(short.run(range(800, 805)))[-1].quality is Quality.VALID


@pytest.mark.parametrize("profile", PROFILES)
def test_an_age_is_at_most_the_time_since_the_last_result_was_sent(profile: str) -> None:
    bench = Bench(profile)
    results = answers(bench.run(range(300)))
    assert n_valid(results) >= 295
    assert max(result.age + result.age_uncertainty for result in results[5:]) < 1.1 * CYCLE
    assert np.median([result.age_uncertainty for result in results[5:]]) < 2e-3


def test_before_the_first_result_is_heard_nothing_is_confirmed_unless_restarts_are_accepted() -> None:
    for settings, quality in ((BridgeSettings(), Quality.UNCONFIRMED), (ACCEPTING, Quality.VALID)):
        bench = Bench(settings=settings)
        bench._hears = False
        assert answers(bench.run(range(40)))[-1].quality is quality
    bench = Bench()
    bench._hears = False
    bench.run(range(40))
    bench.core.confirm()
    assert answers(bench.run(range(40, 50)))[-1].quality is Quality.VALID


def test_a_bridge_that_only_listens_dates_by_the_first_reading_and_waits_behind_a_restart() -> None:
    bench = Bench(is_answered=False)
    assert n_valid(bench.run(range(100))) > 90
    bench.encoder.begin()
    results = answers(bench.restarted(at=3.0))
    assert results[-1].quality is Quality.UNCONFIRMED
    assert results[-1].causes & Cause.UNPROVEN_RESTART
    bench.core.confirm()
    assert n_valid(bench.restarted(at=3.6, clock=0.6, counter=60)) > 50


# --- restarts and recordings


@pytest.mark.parametrize(
    ("profile", "pause", "cycle_time"),
    [
        *((profile, 1.0, CYCLE) for profile in PROFILES),
        ("classic-le", 60.0, CYCLE),  # its sample time wraps in 6.6 s
        ("fd64", 3600.0, 0.5),
        ("fd64-sec", 3600.0, 0.5),
    ],
)
def test_a_new_run_of_the_sender_is_valid_by_itself_and_as_sure_as_before(
    profile: str, pause: float, cycle_time: float
) -> None:
    bench = Bench(profile, cycle_time)
    bench.run(range(300))
    bench.encoder.begin()
    results = answers(bench.restarted(at=300 * cycle_time + pause, n=100))
    assert n_valid(results) >= 100 - BridgeSettings().recovery_cycles
    assert max(result.age_uncertainty for result in results[-50:]) < 2e-3
    assert max(result.age for result in results[-50:]) < CYCLE


def test_restarts_go_on_being_confirmed_for_ever() -> None:
    bench = Bench()
    for run in range(70):
        assert n_valid(answers(bench.restarted(at=1.0 * run, n=30))) >= 10
        bench.encoder.begin()


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("numbers", [range(200, 300), range(300)])
def test_a_recording_is_never_in_use(profile: str, numbers: range) -> None:
    """Of a second ago, and of the sender's own start; then the true sender comes back by itself."""
    bench = Bench(profile)
    assert n_valid(bench.run(range(300))) > 290
    assert n_valid(bench.replay(numbers, 3.01)) == 0
    assert n_valid(bench.run(range(700, 800))) > 70


def test_frames_of_an_earlier_run_are_of_an_old_session() -> None:
    bench = Bench()
    bench.run(range(100))
    bench.encoder.begin()
    bench.restarted(at=2.0)
    old = [frame for number in range(50, 100) for frame in bench.sent[number][:1]]
    before = bench.core.account.classes[FrameClass.OLD_SESSION]
    bench.give(replace(frame, time=3.0 + k * CYCLE) for k, frame in enumerate(old))
    assert bench.core.account.classes[FrameClass.OLD_SESSION] - before == 50


def test_a_restart_while_a_gateway_holds_frames_back_is_never_young() -> None:
    """A new run whose frames all wait for 0.2 s: a session number proves a new run, not a young one."""
    bench = Bench()
    bench.run(range(100))
    bench.encoder.begin()
    results, held = [], list[list[Frame]]()
    for index in range(100):
        at = 2.0 + index * CYCLE + 0.2
        held.append(bench.cycle(1000 + index, at, sample_time=index * CYCLE, counter=index, late=0.2))
        if index >= 20:
            results += answers(bench.give(held[index - 20]))
    assert not any(result.quality.has_coefficients and result.usable for result in results)


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
    for is_silent in (lambda bench, frame: frame.key == bench.layout.flow_frames[0].layout.key, lambda *_: True):
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
        bench.core.own.sending(own)
        results += bench.give([*bench.cycle(number, number * CYCLE), own])
    assert n_valid(results) == 30
    assert bench.core.account.classes[FrameClass.OWN] == 30
    bench.give([replace(own, time=0.805)])
    assert bench.run([81])[-1].causes == Cause.SECOND_BRIDGE
    assert bench.core.account.classes[FrameClass.SECOND_BRIDGE] == 1


# --- senders without state: version 1 of the profiles, and a user's own frames


@pytest.mark.parametrize("profile", ["fd64", "classic-le"])
@pytest.mark.parametrize(("clock", "counter"), [(0.0, 0), (2.5, 250), (1.5, 400)])
def test_a_restart_without_session_waits_for_somebody_to_confirm_it(
    profile: str, clock: float, counter: int
) -> None:
    bench = Bench(profile, has_state=False)
    bench.run(range(300))
    results = bench.restarted(at=4.0, clock=clock, counter=counter, n=40)
    assert n_valid(results) == 0
    assert results[-1].quality is Quality.UNCONFIRMED
    assert results[-1].causes & Cause.UNPROVEN_RESTART
    # Also not later, nor after the bus was reopened; only when somebody confirms it.
    bench.core.restart(4.405)
    assert n_valid(bench.restarted(at=4.41, clock=clock + 0.41, counter=counter + 41, n=40)) == 0
    bench.core.confirm()
    assert n_valid(bench.restarted(at=4.82, clock=clock + 0.82, counter=counter + 82, n=40)) == 40


@pytest.mark.parametrize("profile", ["fd64", "classic-le"])
@pytest.mark.parametrize("pause", [0.0, 1.0, 5000.0])  # the last one wraps the sample time: it looks like a delay
def test_the_same_stimulus_again_is_valid_again_where_restarts_are_accepted(profile: str, pause: float) -> None:
    bench = Bench(profile, settings=ACCEPTING, has_state=False)
    bench.run(range(100))
    for run in (1, 2):
        results = answers(bench.replay(range(100), run * (100 * CYCLE + pause)))
        assert {result.quality for result in results[12:]} == {Quality.VALID}
        assert any(result.causes & Cause.CLOCK_JUMP for result in results[:12]), "a restart is reported"
        assert results[0].quality is not Quality.VALID


@pytest.mark.parametrize("profile", ["fd64", "classic-le"])
def test_a_clock_that_is_set_ahead_is_valid_again_where_restarts_are_accepted(profile: str) -> None:
    bench = Bench(profile, settings=ACCEPTING, has_state=False)
    bench.run(range(100))
    results = answers(bench.restarted(at=1.0, clock=2.5, counter=100, n=20))
    assert {result.quality for result in results[:2]} == {Quality.STALE}
    assert {result.quality for result in results[4:]} == {Quality.VALID}


def test_an_accepted_restart_needs_cycles_in_a_row_that_fit() -> None:
    bench = Bench(settings=ACCEPTING, has_state=False)
    bench.run(range(100))
    results = []
    for number in range(60):  # a time of before in each cycle, which no other one confirms
        frames = bench.cycle(number, 2.0 + number * CYCLE, sample_time=0.07 * (7 * number % 13))
        results += bench.give(frames)
    assert n_valid(results) == 0
    assert answers(results)


def test_the_true_sender_without_session_comes_back_behind_a_recording_by_itself() -> None:
    bench = Bench(has_state=False)
    bench.run(range(300))
    assert n_valid(bench.replay(range(200, 260), 3.01)) == 0
    assert n_valid(bench.run(range(370, 400))) > 20


def undated(settings: BridgeSettings) -> Bench:
    """Return a bench of frames without sample time."""
    bench = Bench(has_state=False)
    frames = tuple(replace(frame, sample_time=None) for frame in bench.layout.strain_frames)
    bench.layout = replace(bench.layout, strain_frames=frames)
    bench.core = Machine(bench.layout, Projection(4), settings, start=0.0)
    bench.encoder = StrainEncoder(bench.layout)
    return bench


def test_frames_without_sample_time_are_used_behind_a_pause_once_they_come_at_the_pace_of_a_sender() -> None:
    bench = undated(BridgeSettings())
    assert n_valid(bench.run(range(100))) > 90
    kept = [replace(f, time=1.5 + 1e-4 * k) for k, f in enumerate([f for n in range(50) for f in bench.sent[n]])]
    assert n_valid(bench.give(kept)) == 0, "released by a gateway, faster than a sender sends"
    assert n_valid(bench.run(range(200, 240))) > 25


def test_an_authenticated_sender_restarts_by_a_new_trip_alone() -> None:
    bench = Bench("fd64-sec", settings=ACCEPTING)
    assert n_valid(bench.run(range(100))) > 90
    assert n_valid(bench.replay(range(100), 2.0)) == 0
    bench.encoder.begin()
    assert n_valid(bench.restarted(at=4.0, n=100)) > 85


# --- synchronised clocks


def test_a_synchronised_sender_needs_no_proof_and_its_recording_is_old() -> None:
    bench = Bench(settings=BridgeSettings(synchronised=1e-3), has_state=False)
    assert n_valid(bench.run(range(300))) > 290
    results = bench.replay(range(200, 260), 3.01)
    assert {result.quality for result in answers(results)} == {Quality.STALE}
    results = bench.restarted(at=5.0, clock=5.0, counter=7, n=40)
    assert n_valid(results) > 30
    assert results[-1].age_uncertainty == 1e-3
    assert bench.run(range(600, 650), later=0.03)[-1].age == pytest.approx(0.03, abs=1e-4)
    assert n_valid(bench.run(range(700, 750), later=0.06)) == 0


def test_a_recording_of_the_dynamic_pressure_alone_is_not_used() -> None:
    bench, key = Bench(), layout_of("fd64", 4).flow_frames[0].layout.key
    bench.run(range(300))
    results = []
    for number in range(300, 360):
        strains = [frame for frame in bench.cycle(number, number * CYCLE) if frame.key != key]
        old = [replace(f, time=strains[0].time) for f in bench.sent[number - 100] if f.key == key]
        results += bench.give(old + strains)
    pressures = {result.dynamic_pressure for result in results if np.isfinite(result.dynamic_pressure)}
    assert pressures == {Truth(4, 1).cycle(299)[1]}, "the last true one, for as long as it is held"
    assert n_valid(results) <= 10
