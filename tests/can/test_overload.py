"""A bridge slower than its input, in virtual time: the newest cycles are answered, none as fresher than it is."""

from collections import deque
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from can_case import CYCLE, Ears, Projection, Truth, layout_of

from strainfmu.can.bridge import QUEUED_CYCLES, Backlog
from strainfmu.can.encoder import StrainEncoder
from strainfmu.can.frame import Frame
from strainfmu.can.machine import Machine, Result
from strainfmu.can.options import BridgeSettings
from strainfmu.can.quality import Cause, FrameClass, Quality
from strainfmu.cosim.estimators.step import StepResult

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

    core: Machine
    results: list[Result] = field(default_factory=list)
    sent: int = 0
    overrun: int = 0

    @property
    def answers(self) -> list[Result]:
        return [result for result in self.results if result.arrival == result.arrival]

    def count(self, quality: Quality) -> int:
        return sum(result.quality is quality for result in self.answers)

    def waits(self) -> list[float]:
        """Return how long after its last frame each cycle was answered [cycles]."""
        return [(r.time - r.arrival) / CYCLE for r in self.answers]


def run(
    profile: str,
    service: float,
    n_cycles: int,
    stall: tuple[int, float] = (-1, 0.0),
    mach_number: float = np.nan,
    measured: bool = False,
) -> Overloaded:
    """Wire queue, backlog and machine as the bridge does, an answer taking ``service`` [cycles].

    With a ``mach_number`` a frame of navigation is sent, which a cycle need not have. ``measured`` tells the
    backlog how long answers take. ``stall``: a cycle at which the bridge stands still, and for how long [cycles].
    """
    layout, truth, step, clock = layout_of(profile, N), Truth(N, 1), Projection(N), Time()
    encoder, waiting, number, index = StrainEncoder(layout), deque[Frame](), 0, 0
    limit = QUEUED_CYCLES * layout.cycle_length
    backlog, is_skipping = Backlog(SETTINGS.max_age, CYCLE), False
    over, ears = Overloaded(Machine(layout, step, SETTINGS, start=0.0, now=clock)), Ears(encoder)
    coming: list[Frame] = []

    def step_slowly(*given: object) -> StepResult:
        clock.now += service * CYCLE
        return step(*given)  # type: ignore[arg-type]

    over.core._step = step_slowly  # it takes time, which the machine's clock sees
    while True:
        while number < n_cycles and number * CYCLE <= clock.now:
            frames = encoder.encode(
                *truth.cycle(number), cycle=number, sample_time=number * CYCLE, mach_number=mach_number
            )
            coming += [replace(frame, time=number * CYCLE + 1e-5 * k) for k, frame in enumerate(frames)]
            number += 1
        for frame in coming:
            if len(waiting) < limit:
                waiting.append(frame)
            else:
                over.overrun += 1
                over.core.count(FrameClass.OVERRUN, frame.time)
                over.core.note(Cause.OVERLOAD)
        over.sent += len(coming)
        coming.clear()
        if not waiting:
            if number == n_cycles:
                break
            clock.now = max(clock.now, number * CYCLE)
            continue
        frame = waiting.popleft()
        begin = clock.now = max(clock.now, frame.time)
        results = over.core.receive(frame)
        over.results += ears.hear(results)
        if measured and results:
            backlog.answered(service * CYCLE)
        if stall[0] == frame.time // CYCLE:
            clock.now, stall = clock.now + stall[1] * CYCLE, (-1, 0.0)
        is_last = index == 0 or not waiting or waiting[0].time - frame.time > 0.5 * CYCLE
        is_behind = not backlog.is_answered(begin - frame.time)
        if is_behind and is_last:
            clock.now += SKIPPING * CYCLE
        if is_behind != is_skipping:
            is_skipping = is_behind
            over.core.skip(is_skipping)
        index += 1
    over.core.finish(clock.now)
    for result in over.answers:
        check_answer(result, truth, step)
    account = over.core.account
    assert account.received == over.sent
    assert account.unaccounted == account.pending == 0
    return over


def check_answer(result: Result, truth: Truth, step: Projection) -> None:
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
    # All but the first three are used; those that follow a gap report it.
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
    assert over.count(Quality.NO_DATA) == len(over.answers), "nothing was ever used"


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
