"""Random faults in virtual time: nothing false is VALID, every frame is counted, and the bridge recovers.

The oracle (can_case.Oracle) compares every VALID result with the true strains of the last cycles; it uses nothing
on which the core bases its decisions. Without any one of the guards, these tests find something wrong.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from can_case import CYCLE, LOSING, N_GAUGES, Campaign, Projection, layout_of, mixed_layout, run_campaign
from weakened_bus import WITHOUT, MakeCore, core_without

from strainfmu.can.cycle.core import bridge_core
from strainfmu.can.cycle.frame_account import FrameClass
from strainfmu.can.cycle.quality import Cause, Quality
from strainfmu.can.settings import BridgeSettings
from strainfmu.can.tools.faults import NEED_A_KEY, Fault, FaultKind, random_faults
from strainfmu.can.wire.frame import Frame
from strainfmu.can.wire.profiles import PROFILES
from strainfmu.cosim.step import StepResult
from strainfmu.estimator.health import HealthState

SETTINGS = BridgeSettings()
GAP = SETTINGS.recovery_cycles + 3
SIZES = {"fd64": N_GAUGES, "fd64-sec": N_GAUGES, "classic-le": 10, "classic-be": 10, "float2": 6}


def campaign(profile: str, n_faults: int, seed: int) -> Campaign:
    kinds = tuple(FaultKind)
    # Long enough for single gauges to be found stuck, now and then.
    faults = random_faults(n_faults, kinds, seed=seed, gap=GAP, longest=40)
    n_cycles = faults[-1].start + faults[-1].cycles + GAP
    return run_campaign(layout_of(profile, SIZES[profile]), faults, n_cycles, seed=seed, keep=False)


@pytest.mark.parametrize("profile", PROFILES)
def test_random_faults_never_give_a_false_valid_and_are_recovered_from(profile: str) -> None:
    run = campaign(profile, 25, seed=11)
    assert run.false_valid == []
    assert run.late_recovery == []
    assert run.core.account.unaccounted == 0


def mixed_campaign(n_faults: int, seed: int) -> Campaign:
    gap = 5 * SETTINGS.recovery_cycles + 15
    faults = random_faults(n_faults, tuple(FaultKind), seed=seed, gap=gap, longest=40, first=100)
    n_cycles = faults[-1].start + faults[-1].cycles + gap
    return run_campaign(mixed_layout(), faults, n_cycles, seed=seed, keep=False)


def test_random_faults_on_frames_of_two_rates() -> None:
    """One frame of strains comes at a fifth of the rate and is held."""
    run = mixed_campaign(8, seed=12)
    assert run.false_valid == []
    assert run.late_recovery == []
    assert run.core.account.unaccounted == 0


@pytest.mark.parametrize(
    "kind", [FaultKind.JUMP, FaultKind.STUCK_GAUGE, FaultKind.ZERO_GAUGE, FaultKind.OUT_OF_RANGE]
)
def test_a_fault_of_a_held_gauge(kind: FaultKind) -> None:
    """Seeds that hit one of the three gauges of the slow frame."""
    held = [s for s in range(200) if int(np.random.default_rng(s).integers(N_GAUGES)) >= 27 and s % 2][:2]
    gap = 5 * SETTINGS.recovery_cycles + 15
    faults = [Fault(kind=kind, start=100 + (gap + 30) * k, cycles=30, seed=s) for k, s in enumerate(held)]
    run = run_campaign(mixed_layout(), faults, 100 + 2 * (gap + 30))
    assert run.false_valid == []
    assert run.late_recovery == []


def test_a_sender_of_two_rates_freezes_at_any_time_between_its_slow_frames() -> None:
    """A slow frame that comes first then is not newer than the fast ones that repeat theirs."""
    gap = 5 * SETTINGS.recovery_cycles + 15
    faults = [Fault(kind=FaultKind.FREEZE, start=100 + (gap + 26) * k + k, cycles=25) for k in range(5)]
    run = run_campaign(mixed_layout(), faults, faults[-1].start + gap)
    assert run.false_valid == []
    assert run.late_recovery == []


@pytest.mark.slow
def test_a_thousand_random_faults_on_frames_of_two_rates() -> None:
    run = mixed_campaign(1000, seed=2025)
    print(f"mixed rates: 1000 faults; {run.core.account.rows()}")
    assert run.false_valid == []
    assert run.late_recovery == []
    assert run.core.account.unaccounted == 0


@pytest.mark.slow
@pytest.mark.parametrize("profile", PROFILES)
def test_ten_thousand_random_faults(profile: str) -> None:
    run = campaign(profile, 2500, seed=2024)
    print(f"{profile}: 2500 faults; {run.core.account.rows()}")
    assert run.false_valid == []
    assert run.late_recovery == []
    assert run.core.account.unaccounted == 0


@pytest.mark.parametrize("kind", FaultKind)
def test_every_fault_by_itself(kind: FaultKind) -> None:
    """Each fault alone, short and long: none is missed by chance of the draw."""
    faults = [Fault(kind=kind, start=20, cycles=1, seed=3), Fault(kind=kind, start=22 + GAP, cycles=30, seed=8)]
    run = run_campaign(layout_of("fd64"), faults, 52 + 2 * GAP)
    assert run.false_valid == []
    assert run.late_recovery == []


@pytest.mark.parametrize("profile", ["fd64", "classic-le"])
def test_every_fault_twice_at_once(profile: str) -> None:
    """None undoes itself: two senders with other gauges are no sender with ours."""
    faults = [
        Fault(kind=kind, start=60 + (15 + GAP) * number, cycles=15, seed=2 * number + which)
        for number, kind in enumerate(FaultKind)
        for which in (3, 50)
    ]
    run = run_campaign(layout_of(profile, SIZES[profile]), faults, 60 + (15 + GAP) * len(FaultKind))
    assert run.false_valid == []
    assert run.core.account.unaccounted == 0


@pytest.mark.parametrize("profile", ["fd64", "fd64-sec", "classic-le"])
def test_a_gauge_that_sticks_as_the_sender_restarts_is_found_once_its_cycles_count(profile: str) -> None:
    kinds = (FaultKind.RESTART, FaultKind.STUCK_GAUGE)
    faults = [Fault(kind=kind, start=60, cycles=40, seed=3) for kind in kinds]
    run = run_campaign(layout_of(profile, SIZES[profile]), faults, 150)
    assert run.false_valid == []
    assert run.late_recovery == []


def test_any_two_faults_at_once_can_be_injected() -> None:
    """Faults act on what others have left of a frame: cut, inserted or taken away."""
    kinds = [kind for kind in FaultKind if kind not in NEED_A_KEY]
    pairs = [(a, b) for index, a in enumerate(kinds) for b in kinds[index + 1 :]]
    faults = [
        Fault(kind=kind, start=5 + index, cycles=1, seed=index)
        for index, pair in enumerate(pairs)
        for kind in pair
    ]
    run = run_campaign(layout_of("classic-le", 4), faults, len(pairs) + 10)
    assert run.false_valid == []


def test_dither_that_a_gateway_holds_back_until_it_is_over() -> None:
    """Released before its detection is due, it is off by its bit, and as old as stated."""
    faults = [
        Fault(kind=kind, start=40 + 80 * index, cycles=cycles, seed=index)
        for index, cycles in enumerate((3, 7, 11))
        for kind in (FaultKind.DITHER, FaultKind.DELAY)
    ]
    for profile in ("classic-be", "fd64"):
        run = run_campaign(layout_of(profile, SIZES[profile]), faults, 280)
        assert run.false_valid == []
        assert run.late_recovery == []


def test_strains_that_are_both_repeated_and_held_back_are_old() -> None:
    for profile in PROFILES:
        pairs = ((FaultKind.DELAY, FaultKind.FREEZE), (FaultKind.FREEZE, FaultKind.CLOCK_JUMP))
        faults = [
            Fault(kind=kind, start=40 + 80 * index, cycles=29, seed=3)
            for index, pair in enumerate(pairs)
            for kind in pair
        ]
        run = run_campaign(layout_of(profile, SIZES[profile]), faults, 230)
        assert run.false_valid == []
        assert run.late_recovery == []


@pytest.mark.parametrize("profile", ["fd64", "classic-le"])
@pytest.mark.parametrize("losing", [*sorted(LOSING, key=lambda kind: kind.value), FaultKind.SILENCE])
def test_strains_that_freeze_while_frames_are_lost_are_as_old_as_the_lost_ones(
    profile: str, losing: FaultKind
) -> None:
    """What comes through first looks new, and is not."""
    faults = [
        Fault(kind=kind, start=40 + 60 * number, cycles=cycles, seed=number)
        for number in range(15)
        for kind, cycles in ((FaultKind.FREEZE, 26), (losing, 2 if losing is FaultKind.SILENCE else 26))
    ]
    run = run_campaign(layout_of(profile, SIZES[profile]), faults, 950)
    assert run.false_valid == []


def test_live_strains_behind_lost_cycles_are_in_doubt_only_where_too_much_may_hide() -> None:
    """One cycle of 10 ms may hide 10 ms: VALID, and its uncertainty says so. Two: UNCONFIRMED once."""
    for lost, quality in ((1, Quality.VALID), (2, Quality.UNCONFIRMED)):
        run = run_campaign(layout_of("fd64"), [Fault(kind=FaultKind.SILENCE, start=40, cycles=lost)], 60)
        behind = [result for result in run.results if (result.arrival or 0.0) > 40 * CYCLE]
        assert [result.quality for result in behind] == [quality] + [Quality.VALID] * (len(behind) - 1)
        assert len(behind) == 20 - lost
        assert behind[0].age_uncertainty - behind[1].age_uncertainty == pytest.approx(lost * CYCLE, abs=1e-4)


def test_without_faults_all_cycles_are_answered_and_valid() -> None:
    run = run_campaign(layout_of("fd64"), [], 300)
    # MinOkStateInit good checks behind the first, which only leaves NODATA.
    assert [result.quality for result in run.results] == [Quality.NO_DATA] * 3 + [Quality.VALID] * 297
    assert run.core.account.received == 900


@pytest.mark.parametrize("profile", PROFILES)
def test_results_name_the_cycle_that_they_answer(profile: str) -> None:
    run = run_campaign(layout_of(profile, SIZES[profile]), [], 300)
    assert [result.counter for result in run.results] == [number % 256 for number in range(300)]


class SickStep(Projection):
    """An estimator that reports ill health, or whose outputs are not finite."""

    def __init__(self, n_gauges: int, health: HealthState, coefficient: float) -> None:
        super().__init__(n_gauges)
        self._sick, self._coefficient = health, coefficient

    def __call__(self, strain: np.ndarray, dynamic_pressure: float, step_size: float) -> StepResult:
        good = super().__call__(strain, dynamic_pressure, step_size)
        return replace(good, health=int(self._sick), coefficients=good.coefficients + self._coefficient)


def of_kind(
    *kinds: FaultKind, cycles: int = 12, step: Projection | None = None, profile: str = "fd64"
) -> Callable[[MakeCore], Campaign]:
    """Return a run of single faults of ``kinds`` through a core that is made for it."""

    def run(make_core: MakeCore) -> Campaign:
        faults = [
            Fault(kind=kind, start=40 + 80 * index, cycles=cycles, seed=index) for index, kind in enumerate(kinds)
        ]
        n_cycles = 40 + 80 * len(kinds) + cycles
        return run_campaign(layout_of(profile), faults, n_cycles, step=step, make_core=make_core)

    return run


def has_false_valid(run: Campaign) -> bool:
    return bool(run.false_valid)


def count(run: Campaign, kind: FrameClass) -> int:
    return run.core.account.classes[kind]


def ill(health: HealthState = HealthState.OK, coefficient: float = 0.0) -> SickStep:
    return SickStep(N_GAUGES, health, coefficient)


# For every guard: a scenario, and what is wrong without it.
SCENARIOS: dict[str, tuple[Callable[[MakeCore], Campaign], Callable[[Campaign], bool]]] = {
    "own_frames": (of_kind(FaultKind.OWN_IDENTIFIER), lambda run: count(run, FrameClass.OWN) == 0),
    "second_bridge": (
        of_kind(FaultKind.SECOND_BRIDGE),
        lambda run: run.qualities[Quality.UNCONFIRMED] < 10 or count(run, FrameClass.SECOND_BRIDGE) != 12,
    ),
    "second_sender": (of_kind(FaultKind.CONFLICT), has_false_valid),
    "creep": (lambda make_core: slow_creep(make_core), has_false_valid),
    "restart_proof": (lambda make_core: recording(make_core), has_false_valid),
    "error_frames": (of_kind(FaultKind.ERROR_FRAMES), lambda run: count(run, FrameClass.CORRUPT) > 0),
    "remote_frames": (of_kind(FaultKind.REMOTE_FRAMES), lambda run: count(run, FrameClass.WRONG_FORMAT) > 0),
    "format": (of_kind(FaultKind.IDENTIFIER_WIDTH), lambda run: run.qualities[Quality.STALE] == 0),
    "babbling": (of_kind(FaultKind.BABBLING), lambda run: count(run, FrameClass.CORRUPT) > 1000),
    "crc": (of_kind(FaultKind.CORRUPTION), has_false_valid),
    "counter": (of_kind(FaultKind.REPETITION), lambda run: pressure_used_twice(run)),
    "configuration": (of_kind(FaultKind.CONFIGURATION), has_false_valid),
    "state_machine": (of_kind(), lambda run: run.results[0].quality is Quality.VALID),
    "order": (of_kind(FaultKind.SEQUENCE), lambda run: count(run, FrameClass.LATE) == 0),
    "completeness": (of_kind(FaultKind.LOSS), has_false_valid),
    "silence": (of_kind(FaultKind.SILENCE), lambda run: run.qualities[Quality.STALE] == 0),
    "age": (of_kind(FaultKind.DELAY, cycles=30), has_false_valid),
    "pace": (lambda make_core: held_back(make_core), has_false_valid),
    "clock_jump": (
        of_kind(FaultKind.CLOCK_JUMP),
        lambda run: not any(result.causes & Cause.CLOCK_JUMP for result in run.results),
    ),
    "frozen": (of_kind(FaultKind.FREEZE), has_false_valid),
    "partial_freeze": (of_kind(FaultKind.PARTIAL_FREEZE), has_false_valid),
    "dither": (of_kind(FaultKind.DITHER, cycles=30), has_false_valid),
    "stuck": (of_kind(FaultKind.STUCK_GAUGE, cycles=60), has_false_valid),
    "zero": (of_kind(FaultKind.ZERO_GAUGE), has_false_valid),
    "not_available": (lambda make_core: value_inside_the_range(make_core), has_false_valid),
    "range": (of_kind(FaultKind.OUT_OF_RANGE), has_false_valid),
    "rate": (of_kind(FaultKind.JUMP), has_false_valid),
    "sender_status": (of_kind(FaultKind.SENDER_STATUS), has_false_valid),
    "pressure_age": (of_kind(FaultKind.PRESSURE_SILENCE, cycles=30), has_false_valid),
    "health": (of_kind(step=ill(HealthState.INCONSISTENT)), lambda run: run.qualities[Quality.VALID] > 0),
    "finite_output": (of_kind(step=ill(coefficient=np.nan)), lambda run: run.qualities[Quality.VALID] > 0),
    "authenticator": (of_kind(FaultKind.FORGERY, profile="fd64-sec"), has_false_valid),
    "freshness": (of_kind(FaultKind.EARLIER_RUN, profile="fd64-sec"), has_false_valid),
}


def pressure_used_twice(run: Campaign) -> bool:
    """Return whether more frames of q_inf were used than were sent: one per cycle, on an identifier of its own."""
    used = count(run, FrameClass.USED)
    sent = run.core.layout.cycle_length * (40 + 80 + 12)
    return used > sent - 9


def value_inside_the_range(make_core: MakeCore) -> Campaign:
    """A layout whose "not available" lies among the strains: only its code distinguishes it."""
    layout = layout_of("fd64")
    marker = 1500
    frames = tuple(
        replace(
            frame,
            layout=replace(
                frame.layout,
                signals=tuple(
                    replace(s, not_available=marker) if s.not_available is not None else s
                    for s in frame.layout.signals
                ),
            ),
        )
        for frame in layout.strain_frames
    )
    faults = [Fault(kind=FaultKind.NO_VALUE, start=40, cycles=12, seed=1)]
    return run_campaign(replace(layout, strain_frames=frames), faults, 80, make_core=make_core)


def recording(make_core: MakeCore) -> Campaign:
    """Forty cycles that the sender sent before it was switched off."""
    faults = [Fault(kind=FaultKind.RECORDING, start=80, cycles=40, seed=48)]
    return run_campaign(layout_of("fd64"), faults, 160, make_core=make_core)


def slow_creep(make_core: MakeCore) -> Campaign:
    """A gateway whose queue grows by 190 ppm for 200 s."""

    def gateway(number: int, frames: list[Frame]) -> list[Frame]:
        return [replace(frame, time=frame.time * (1.0 + 190e-6)) for frame in frames]

    return run_campaign(layout_of("fd64", 4, 0.1), [], 2000, change=gateway, make_core=make_core)


def held_back(make_core: MakeCore) -> Campaign:
    """Frames without a sample time that a gateway keeps for half a second, then sends one behind the other."""
    timed = layout_of("fd64")
    frames = tuple(replace(frame, sample_time=None) for frame in timed.strain_frames)
    kept: list[Frame] = []

    def gateway(number: int, frames: list[Frame]) -> list[Frame]:
        kept.extend(frames)
        if 60 <= number < 110:
            return []
        sent = [replace(frame, time=number * CYCLE + 20e-6 * index) for index, frame in enumerate(kept)]
        kept.clear()
        return sent

    return run_campaign(replace(timed, strain_frames=frames), [], 160, change=gateway, make_core=make_core)


def test_held_back_cycles_are_stale_and_live_ones_are_trusted_at_once() -> None:
    run = held_back(bridge_core)
    at_once = [result.quality for result in run.results if result.arrival and 1.1 <= result.arrival < 1.105]
    assert Quality.STALE in at_once
    assert not any(quality.has_coefficients for quality in at_once)
    # The first live cycle still comes close behind the others.
    assert [r.quality for r in run.results if r.arrival and r.arrival > 1.115] == [Quality.VALID] * 48


@pytest.mark.parametrize("guard", WITHOUT)
def test_every_guard_is_needed(guard: str) -> None:
    scenario, is_wrong = SCENARIOS[guard]
    assert not is_wrong(scenario(bridge_core))
    assert is_wrong(scenario(WITHOUT[guard]))


def test_every_guard_has_its_scenario() -> None:
    assert set(SCENARIOS) == set(WITHOUT)
    assert len(WITHOUT) == 33


def test_a_core_with_nothing_replaced_is_the_shipped_one() -> None:
    """What the weakened cores differ in is the replaced part alone."""
    for profile in PROFILES:
        faults = random_faults(8, tuple(FaultKind), seed=5, gap=GAP)
        runs = [
            run_campaign(layout_of(profile, SIZES[profile]), faults, 300, make_core=make_core)
            for make_core in (bridge_core, core_without())
        ]
        shipped, composed = ([repr(result) for result in run.results] for run in runs)
        assert shipped == composed
        assert runs[0].core.account == runs[1].core.account


def test_the_oracle_sees_a_single_wrong_strain() -> None:
    """The oracle itself: 20 um/m on one of 30 gauges are found."""
    layout = layout_of("fd64")
    shifted = run_campaign(layout, [], 60, step=Shifted(layout.n_gauges))
    assert len(shifted.false_valid) >= 50


class Shifted(Projection):
    """An estimator that adds 20 um/m to one gauge: what the oracle expects is left alone."""

    def __call__(self, strain: np.ndarray, dynamic_pressure: float, step_size: float) -> StepResult:
        wrong = strain.copy()
        wrong[7] += 20e-6
        return super().__call__(wrong, dynamic_pressure, step_size)
