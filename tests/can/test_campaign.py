"""Random faults in virtual time: nothing false is VALID, every frame is counted, and the bridge recovers.

The oracle (can_case.Oracle) compares every VALID result with the true strains of the last cycles; it uses nothing
on which the core bases its decisions. Without any one of the guards, these tests find something wrong.
"""

import numpy as np
import pytest
from can_case import CYCLE, GAP, LOSING, N_GAUGES, SIZES, Campaign, layout_of, mixed_layout, run_campaign
from can_faults import NEED_A_KEY, Fault, FaultKind, random_faults
from sweeps import crossed, sweep

from strainfmu.can.options import BridgeSettings
from strainfmu.can.profiles import PROFILES
from strainfmu.can.quality import Quality

SETTINGS = BridgeSettings()


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
    run = mixed_campaign(5, seed=12)
    assert run.false_valid == []
    assert run.late_recovery == []
    assert run.core.account.unaccounted == 0


@pytest.mark.parametrize(
    "kind", [FaultKind.JUMP, FaultKind.STUCK_GAUGE, FaultKind.ZERO_GAUGE, FaultKind.OUT_OF_RANGE]
)
def test_a_fault_of_a_held_gauge(kind: FaultKind) -> None:
    """A seed that hits one of the three gauges of the slow frame."""
    held = [s for s in range(200) if int(np.random.default_rng(s).integers(N_GAUGES)) >= 27 and s % 2][:1]
    gap = 5 * SETTINGS.recovery_cycles + 15
    faults = [Fault(kind=kind, start=100 + (gap + 30) * k, cycles=30, seed=s) for k, s in enumerate(held)]
    run = run_campaign(mixed_layout(), faults, 100 + gap + 30)
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
    faults = [Fault(kind=kind, start=20, cycles=1, seed=3), Fault(kind=kind, start=140, cycles=30, seed=8)]
    run = run_campaign(layout_of("fd64"), faults, 170 + GAP)
    assert run.false_valid == []
    assert run.late_recovery == []


@pytest.mark.parametrize("profile", sweep(["fd64", "classic-le"], ["fd64"]))
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


@pytest.mark.parametrize(
    ("losing", "profile"),
    crossed([*sorted(LOSING, key=lambda kind: kind.value), FaultKind.SILENCE], ["fd64", "classic-le"]),
)
def test_strains_that_freeze_while_frames_are_lost_are_as_old_as_the_lost_ones(
    profile: str, losing: FaultKind
) -> None:
    """What comes through first looks new, and is not."""
    faults = [
        Fault(kind=kind, start=40 + 60 * number, cycles=cycles, seed=number)
        for number in range(6)
        for kind, cycles in ((FaultKind.FREEZE, 26), (losing, 2 if losing is FaultKind.SILENCE else 26))
    ]
    run = run_campaign(layout_of(profile, SIZES[profile]), faults, 410)
    assert run.false_valid == []


def test_live_strains_behind_lost_cycles_are_in_doubt_only_where_too_much_may_hide() -> None:
    """Each cycle of 10 ms may hide 10 ms, and the uncertainty says so: five exceed the largest age, once."""
    for lost, quality in ((1, Quality.VALID), (2, Quality.VALID), (5, Quality.UNCONFIRMED)):
        run = run_campaign(layout_of("fd64"), [Fault(kind=FaultKind.SILENCE, start=40, cycles=lost)], 60)
        behind = [result for result in run.results if result.arrival > 40 * CYCLE]
        assert [result.quality for result in behind] == [quality] + [Quality.VALID] * (len(behind) - 1)
        refused = lost >= BridgeSettings().timeout  # a counter so far ahead is out of sequence once
        assert len(behind) == 20 - lost - refused
        hidden = (lost + refused) * CYCLE
        # Strains may repeat the strains of a lost cycle, and the sender's clock may have been set ahead meanwhile.
        assert hidden <= behind[0].age_uncertainty - behind[1].age_uncertainty + 1e-4 <= 2.0 * hidden + 2e-4


def test_without_faults_all_cycles_are_answered_and_valid() -> None:
    run = run_campaign(layout_of("fd64"), [], 300)
    # MinOkStateInit good checks behind the first, which only leaves NODATA.
    expected = [Quality.NO_DATA] * 3 + [Quality.VALID] * 297
    assert [result.quality for result in run.results] == expected
    assert run.core.account.received == 1200


@pytest.mark.parametrize("profile", PROFILES)
def test_results_name_the_cycle_that_they_answer(profile: str) -> None:
    run = run_campaign(layout_of(profile, SIZES[profile]), [], 300)
    assert [result.counter for result in run.results] == [number % 256 for number in range(300)]
