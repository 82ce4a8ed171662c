"""Frozen gauges and exact zeros against noise and quantisation of healthy gauges, in virtual time."""

from collections import Counter

import numpy as np
import pytest
from can_case import CYCLE, layout_of
from noisy_gauges import STEP, answers, strains_at_rest

from strainfmu.can.options import BridgeSettings
from strainfmu.can.quality import REASONS, Cause, Quality

NOISE = 0.24e-6
"""Noise of the demonstration's gauges [m/m], 0.96 quantisation steps."""

FIRST = 150
"""Cycle at which a fault begins."""


def last_valid(results: list) -> int:
    """Return the number of the last cycle from FIRST on that is VALID, counted from FIRST, 0 if none is."""
    valid = [k for k, result in enumerate(results[FIRST:], start=1) if result.quality is Quality.VALID]
    return valid[-1] if valid else 0


def frozen(strains: np.ndarray, gauges: np.ndarray | slice) -> np.ndarray:
    """Return ``strains`` with ``gauges`` frozen from FIRST on."""
    changed = np.rint(strains / STEP) * STEP
    changed[FIRST:, gauges] = changed[FIRST, gauges]
    return changed


def moving(strains: np.ndarray) -> np.ndarray:
    """Return ``strains`` with a manoeuvre of 1 Hz added, 100 um/m."""
    k, gauge = np.arange(len(strains))[:, None], np.arange(strains.shape[1])
    return strains + 100e-6 * np.sin(2.0 * np.pi * k / 100.0 + gauge)


@pytest.mark.fast
@pytest.mark.parametrize("alive", [1, 10, 20])
def test_gauges_that_are_frozen_beside_living_ones_take_valid_away_within_four_cycles(alive: int) -> None:
    """53 of 54 frozen, one alive: it was VALID for 22 cycles."""
    strains = moving(strains_at_rest(FIRST + 60, 54, NOISE, level=300e-6))
    results = answers(frozen(strains, slice(alive, None)), NOISE)
    assert {result.quality for result in results[10:FIRST]} == {Quality.VALID}
    assert last_valid(results) <= 4
    assert all(result.causes & Cause.FROZEN for result in results[FIRST + 5 :])
    left = [int(result.valid.sum()) for result in results[FIRST + 5 :]]
    assert max(left) <= alive


@pytest.mark.fast
@pytest.mark.parametrize("alive", [1, 9, 14])
def test_living_gauges_beside_frozen_ones_stay_in_use(alive: int) -> None:
    """14 of 54 alive: all were left out from the 42nd cycle on, as the scatter of all gauges was too little."""
    strains = moving(strains_at_rest(FIRST + 100, 54, NOISE, level=300e-6))
    results = answers(frozen(strains, slice(alive, None)), NOISE)[FIRST + 4 :]
    assert {result.quality for result in results} == {Quality.DEGRADED}
    assert all(result.valid[:alive].all() and not result.valid[alive:].any() for result in results)


@pytest.mark.parametrize("stated", [None, NOISE, 0.05e-6])
def test_quiet_gauges_that_do_not_change_by_chance_are_used_and_frozen_ones_are_found(
    stated: float | None,
) -> None:
    """No gauge of 54 near zero changes in half of the cycles: 44 of 2000 were STALE. One gauge sees the load."""
    strains = strains_at_rest(1080, 54, 0.05e-6)
    strains[:, 7] += 3e-6
    strains[1000:] = strains[1000]
    results = answers(strains, stated)
    # Now and then so many repeat by chance that their age is in doubt.
    found = Counter(result.quality for result in results[3:1000])
    assert found[Quality.VALID] >= 986
    assert set(found) <= {Quality.VALID, Quality.UNCONFIRMED}
    assert max(result.age for result in results[3:1000]) <= 5.1 * CYCLE
    assert {result.quality for result in results[1060:]} == {Quality.STALE}
    assert not any(result.quality is Quality.VALID for result in results[1030:])


@pytest.mark.parametrize(
    ("profile", "n_gauges", "held", "limit"),
    [
        ("fd64", 54, slice(27, 54), 4),
        ("classic-le", 54, slice(8, 12), 20),
    ],
)
def test_one_frozen_frame_is_found(profile: str, n_gauges: int, held: slice, limit: int) -> None:
    strains = moving(strains_at_rest(FIRST + 60, n_gauges, NOISE, level=300e-6))
    results = answers(frozen(strains, held), NOISE, layout=layout_of(profile, n_gauges))
    assert last_valid(results) <= limit
    assert results[-1].quality is Quality.DEGRADED
    np.testing.assert_array_equal(np.flatnonzero(~results[-1].valid), np.arange(n_gauges)[held])


@pytest.mark.parametrize("noise", [NOISE, 0.05e-6, 0.1e-6, 2e-6])
@pytest.mark.parametrize("stated", [None, NOISE])
def test_healthy_gauges_about_zero_are_not_lost(noise: float, stated: float | None) -> None:
    """18 of 400 cycles lost one; with noise of 0.05 um/m 567 of 608 were INVALID. One gauge sees the load."""
    strains = strains_at_rest(600, 54, noise, level=0.05e-6)
    strains[:, 7] += 3e-6
    results = answers(strains, stated)
    assert Counter(result.quality for result in results[3:]) == {Quality.VALID: 597}


@pytest.mark.parametrize("pause", [24, 26, 60, 500])
def test_healthy_gauges_are_used_at_once_behind_a_pause(pause: int) -> None:
    """The first readings behind it repeat the last ones before it by chance, up to 25 of 54."""
    strains = strains_at_rest(FIRST + pause + 30, 54, NOISE, level=300e-6)
    results = answers(strains, NOISE, lost=range(FIRST, FIRST + pause))
    behind = [result for result in results if result.counter is not None and result.time > (FIRST + pause) * CYCLE]
    assert len(behind) >= 29
    assert not any(result.causes & (Cause.GAUGE_INVALID | Cause.FROZEN) for result in behind)
    again = next(k for k, result in enumerate(behind) if result.valid.any())
    assert all(result.valid.all() for result in behind[again:])
    assert behind[-1].quality is Quality.VALID


def test_of_a_stuck_gauge_the_readings_count_whatever_is_lost_between_them() -> None:
    """Every other cycle is lost: 30 repetitions take 60 cycles."""
    strains = moving(strains_at_rest(FIRST + 80, 54, NOISE, level=300e-6))
    strains[FIRST:, 7] = strains[FIRST, 7]
    settings = BridgeSettings(stuck_cycles=30)
    results = answers(strains, NOISE, settings=settings, lost=range(FIRST + 1, FIRST + 80, 2))
    left_out = [result.time / CYCLE - FIRST for result in results if result.arrival and not result.valid[7]]
    assert next(time for time in left_out if time >= 0.0) == pytest.approx(60.0, abs=1.0)


def test_rest_after_motion_is_not_taken_for_frozen() -> None:
    strains = strains_at_rest(900, 54, NOISE, level=200e-6)
    strains[:450] = moving(strains[:450])
    results = answers(strains, NOISE)
    assert {result.quality for result in results[3:]} == {Quality.VALID}


def test_an_amplifier_may_sample_at_a_third_of_the_rate() -> None:
    strains = np.repeat(moving(strains_at_rest(200, 54, NOISE, level=200e-6)), 3, axis=0)
    assert {result.quality for result in answers(strains, NOISE)[3:]} == {Quality.VALID}


def test_a_gauge_that_fails_to_zero_near_zero_is_left_out_in_the_stated_number_of_cycles() -> None:
    strains = strains_at_rest(FIRST + 100, 54, NOISE, level=0.5e-6)
    strains[FIRST:, 7] = 0.0
    results = answers(strains, NOISE)
    lost = next(k for k, result in enumerate(results[FIRST:], start=1) if not result.valid[7])
    assert lost <= 35
    assert all(not result.valid[7] for result in results[FIRST + 35 :])


@pytest.mark.parametrize("noise", [0.05e-6, NOISE])
def test_a_gauge_that_is_stuck_from_the_start_is_found_on_a_quiet_rig(noise: float) -> None:
    """It teaches nothing about itself: its neighbours' rate of repetition counts, or a quiet rig's."""
    strains = strains_at_rest(1600, 54, noise, level=300e-6)
    strains[:, 7] = strains[0, 7]
    results = answers(strains, NOISE)
    assert not results[-1].valid[7]
    assert results[-1].valid.sum() >= 50


def test_coded_non_values_say_nothing_about_a_gauge() -> None:
    """A gauge that reports "not available" for long is not called frozen, and counts from then on afresh."""
    strains = moving(strains_at_rest(FIRST + 160, 54, NOISE, level=300e-6))
    strains[FIRST : FIRST + 100, 7] = np.nan
    results = answers(strains, NOISE)
    without = [REASONS[result.reasons[7]] for result in results[FIRST : FIRST + 100]]
    assert set(without) == {"no value or out of signal range"}
    assert not any(result.causes & Cause.FROZEN for result in results)
    assert results[-1].quality is Quality.VALID


@pytest.mark.parametrize("period", [200, 500])
def test_a_looped_stimulus_is_used_in_every_pass(period: int) -> None:
    """The same readings again and again, as from a file in a loop: counters and times go on."""
    loop = np.rint(moving(strains_at_rest(period, 54, NOISE, level=300e-6)) / STEP) * STEP
    results = answers(np.tile(loop, (3, 1)), NOISE)
    assert Counter(result.quality for result in results[3:]) == {Quality.VALID: 3 * period - 3}
