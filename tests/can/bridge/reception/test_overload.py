"""A bridge slower than its input, in virtual time: the newest cycles are answered, none as fresher than it is."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from can_case import CYCLE, Projection, Truth, layout_of

from strainfmu.can.bridge.reception.backlog import Backlog
from strainfmu.can.bridge.reception.receiver import FrameQueue
from strainfmu.can.bridge.run_loop import QUEUED_CYCLES
from strainfmu.can.cycle.core import BridgeCore, bridge_core
from strainfmu.can.cycle.estimate.result import CycleResult, published
from strainfmu.can.cycle.frames.account import FrameClass
from strainfmu.can.cycle.states.quality import Cause, Quality
from strainfmu.can.settings import BridgeSettings
from strainfmu.can.wire.frame import Frame
from strainfmu.can.wire.strain_encoder import StrainEncoder

N = 10
SETTINGS = BridgeSettings()
SKIPPING = 0.2
"""What a skipped cycle takes [cycles]."""


@dataclass
class Time:
    """A clock that stands until it is moved [s]."""

    now: float = 0.0

    def __call__(self) -> float:
        return self.now


@dataclass
class Overloaded:
    """What a run came to: results as they went out, and frames sent and dropped."""

    core: BridgeCore
    results: list[CycleResult] = field(default_factory=list)
    sent: int = 0
    overrun: int = 0

    @property
    def answers(self) -> list[CycleResult]:
        return [result for result in self.results if result.arrival is not None]

    def count(self, quality: Quality) -> int:
        return sum(result.quality is quality for result in self.answers)

    def waits(self) -> list[float]:
        """Return how long after its last frame each cycle was answered [cycles]."""
        return [(r.time - r.arrival) / CYCLE for r in self.answers if r.arrival is not None]


def run(
    profile: str,
    service: float,
    n_cycles: int,
    stall: tuple[int, float] = (-1, 0.0),
    mach_number: float = np.nan,
    measured: bool = False,
) -> Overloaded:
    """Wire queue, backlog and core as the bridge does, an answer taking ``service`` [cycles].

    With a ``mach_number`` a frame of navigation is sent, which a cycle need not have.

    ``measured`` tells the backlog how long answers take.
    ``stall`` is a cycle at which the bridge stands still, and for how long [cycles].
    """
    layout, truth, step = layout_of(profile, N), Truth(N, 1), Projection(N)
    encoder, per_cycle = StrainEncoder(layout), layout.cycle_length
    frames = [
        replace(frame, time=k * CYCLE + 1e-5 * index)
        for k in range(n_cycles)
        for index, frame in enumerate(
            encoder.encode(*truth.cycle(k), cycle=k, sample_time=k * CYCLE, mach_number=mach_number)
        )
    ]
    clock, index = Time(), 0
    queue = FrameQueue(QUEUED_CYCLES * per_cycle, per_cycle, layout.optional_keys)
    backlog = Backlog(SETTINGS.max_age, CYCLE)
    over = Overloaded(bridge_core(layout, step, SETTINGS, start=0.0), sent=len(frames))
    while True:
        while index < len(frames) and frames[index].time <= clock.now:
            dropped = queue.put([frames[index]])
            over.overrun += dropped
            if dropped:
                over.core.note(Cause.OVERLOAD)
            index += 1
        items, known = queue.take(0.0, clock)
        is_answered = not items or backlog.is_answered(clock.now - items[-1].time)
        results = []
        for item in items:
            assert isinstance(item, Frame)
            results += over.core.receive(item, is_answered)
        if not is_answered:
            clock.now += SKIPPING * CYCLE
        for result in results + over.core.advance(known):
            clock.now += service * CYCLE
            if measured:
                backlog.answered(service * CYCLE)
            over.results.append(published(result, clock.now, SETTINGS.max_age * CYCLE))
        if items and stall[0] == items[0].time // CYCLE:
            clock.now, stall = clock.now + stall[1] * CYCLE, (-1, 0.0)
        if not items and index == len(frames):
            break
        if not items:
            clock.now = max(clock.now, frames[index].time)
    over.core.finish(clock.now)
    for result in over.answers:
        check_answer(result, truth, step)
    account = over.core.account
    assert account.received + over.overrun == over.sent
    assert account.unaccounted == account.pending == 0
    return over


def check_answer(result: CycleResult, truth: Truth, step: Projection) -> None:
    """Coefficients go out only of strains that are young enough, and are those of the cycle that they name."""
    if not result.quality.has_coefficients:
        return
    assert result.age <= SETTINGS.max_age * CYCLE
    assert result.sample_time is not None
    strain, pressure = truth.cycle(round(result.sample_time * 1e-6 / CYCLE))
    # Half a quantum of 0.25 um/m on every strain. q_inf as float32, and of the frame before if that came first.
    error = np.abs(result.coefficients - step.outputs(strain, pressure))
    assert error[:4].max() <= 0.125 * step.weights.sum(axis=1).max() + 1e-3
    assert error[4] <= 10.1


@pytest.mark.parametrize("profile", ["fd64", "classic-le"])
def test_a_bridge_that_keeps_up_answers_every_cycle(profile: str) -> None:
    over = run(profile, 0.8, 200)
    assert over.overrun == 0
    assert over.core.account.classes[FrameClass.SKIPPED] == 0
    assert over.count(Quality.VALID) == 197
    assert len(over.answers) == len(over.results) == 200


@pytest.mark.parametrize("profile", ["fd64", "classic-le"])
@pytest.mark.parametrize(
    ("service", "valid", "mach_number"),
    [(1.3, 0.8, np.nan), (1.6, 0.7, np.nan), (1.6, 0.7, 4.0), (2.3, 0.45, np.nan), (2.3, 0.45, 4.0)],
)
def test_an_overloaded_bridge_answers_the_newest_cycles(
    profile: str, service: float, valid: float, mach_number: float
) -> None:
    over = run(profile, service, 600, mach_number=mach_number)
    assert over.overrun == 0, "long before the queue is full"
    assert over.core.account.classes[FrameClass.SKIPPED] > 0
    # All but the first three have coefficients; those that follow a gap report it.
    good = over.count(Quality.VALID) + over.count(Quality.DEGRADED)
    assert good >= len(over.answers) - 3
    assert good >= 0.8 * 600 / service
    assert over.count(Quality.VALID) >= valid * len(over.answers)
    assert all(r.causes & Cause.OVERLOAD for r in over.answers if r.quality is Quality.DEGRADED)
    # Half of the largest age for the wait, and the answer itself.
    assert max(over.waits()) <= 0.5 * SETTINGS.max_age + service + 0.01
    assert len(over.results) <= len(over.answers) + 1, "not taken for silence, but once the sender has ended"


def test_an_answer_that_takes_longer_than_strains_may_be_old_is_never_valid() -> None:
    over = run("fd64", SETTINGS.max_age + 1.0, 300)
    assert over.count(Quality.VALID) == over.count(Quality.DEGRADED) == 0
    assert over.count(Quality.STALE) > 0


def test_even_if_skipping_is_too_slow_some_cycles_are_answered() -> None:
    """The bridge is behind for good: every 25 cycles it reports that strains are STALE."""
    backlog = Backlog(SETTINGS.max_age, CYCLE)
    answered = [backlog.is_answered(0.5) for _ in range(100)]
    assert [number for number, one in enumerate(answered) if one] == [25, 51, 77]


@pytest.mark.parametrize("length", [2.0, 20.0, 200.0])
def test_after_the_bridge_stood_still_it_answers_the_newest_and_is_soon_valid(length: float) -> None:
    over = run("fd64", 0.3, 400, stall=(100, length))
    behind = [r for r in over.answers if r.time > (100 + length) * CYCLE]
    # In the queue are 50 cycles at most, two of which are answered on the way as what they are. Behind a gap that
    # the queue made the first cycle is out of sequence; one more reports that frames were dropped.
    assert [r.quality for r in behind[5:]] == [Quality.VALID] * (len(behind) - 5)
    assert len(behind) >= 300 - length - 20
    assert (over.core.account.classes[FrameClass.SKIPPED] > 0) == (length > 2.5)
    assert (over.overrun > 0) == (length > QUEUED_CYCLES)


def test_cycles_are_skipped_from_half_the_largest_age_down_to_one_cycle() -> None:
    backlog = Backlog(5.0, 0.01)
    waited = [0.0, 0.024, 0.026, 0.02, 0.011, 0.009, 0.02, 0.024]
    assert [backlog.is_answered(one) for one in waited] == [True, True, False, False, False, True, True, True]


def test_frames_that_a_cycle_may_have_or_not_neither_split_it_nor_fill_the_queue() -> None:
    queue = FrameQueue(capacity=6, cycle=3, uncounted={9})
    first = [Frame(identifier=identifier, data=b"") for identifier in (0, 9, 1, 2)]
    assert queue.put(first * 2) == 0
    assert queue.take(0.0, Time())[0] == first
    assert queue.put(first) == 0
    assert queue.put(first[:1]) == 4, "the oldest cycle, whole"
    assert queue.put([first[1]] * 100) > 80
    assert queue.highest <= 12


def test_a_quick_bridge_that_was_held_up_skips_only_what_it_cannot_answer_in_time() -> None:
    backlog = Backlog(5.0, 0.01)
    for _ in range(3):
        backlog.answered(0.002)
    waited = [0.0, 0.026, 0.047, 0.049, 0.2, 0.047, 0.02]
    assert [backlog.is_answered(one) for one in waited] == [True, True, True, False, False, True, True]
    for _ in range(100):
        backlog.answered(0.008)
    assert [backlog.is_answered(one) for one in (0.024, 0.026, 0.011, 0.009)] == [True, False, False, True]


def test_a_quick_bridge_catches_up_without_a_gap() -> None:
    over = run("fd64", 0.3, 400, stall=(100, 4.0), measured=True)
    assert over.core.account.classes[FrameClass.SKIPPED] == 0
    assert over.count(Quality.VALID) == 397
    skipping = run("fd64", 0.3, 400, stall=(100, 4.0))
    assert skipping.core.account.classes[FrameClass.SKIPPED] > 0, "as without knowing how quick it is"
