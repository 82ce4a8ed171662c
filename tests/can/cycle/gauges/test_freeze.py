"""Frozen gauges, dither and exact zeros against noise and quantisation of healthy gauges, in virtual time."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from can_case import CYCLE, layout_of
from noisy_gauges import STEP, answers, strains_at_rest

from strainfmu.can.cycle.gauges.freeze_watch import FreezeWatch
from strainfmu.can.cycle.gauges.noise import like_gauges
from strainfmu.can.cycle.gauges.plausibility import RARE
from strainfmu.can.cycle.gauges.quantised_noise import noise_table
from strainfmu.can.cycle.states.quality import Cause, Quality
from strainfmu.can.settings import BridgeSettings
from strainfmu.estimator.numerics.quantisation import longest_repetition

NOISE = 0.24e-6
"""Noise of the demonstration's gauges [m/m], 0.96 quantisation steps."""

FIRST = 150
"""Cycle at which a fault begins."""


def last_valid(results: list) -> int:
    """Return the number of the last cycle from FIRST on that is VALID, counted from FIRST, 0 if none is."""
    valid = [k for k, result in enumerate(results[FIRST:], start=1) if result.quality is Quality.VALID]
    return valid[-1] if valid else 0


def frozen(strains: np.ndarray, gauges: np.ndarray | slice, dither: int = 0, seed: int = 3) -> np.ndarray:
    """Return ``strains`` with ``gauges`` frozen from FIRST on, 0 .. ``dither`` steps added at random."""
    changed = np.rint(strains / STEP) * STEP
    random = np.random.default_rng(seed)
    held = np.broadcast_to(changed[FIRST], changed[FIRST:].shape)
    held = held + STEP * random.integers(0, dither + 1, size=held.shape)
    changed[FIRST:, gauges] = held[:, gauges]
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
    assert {result.quality for result in results[3:1000]} == {Quality.VALID}
    assert max(result.age for result in results[3:1000]) <= 5.1 * CYCLE
    assert results[1030].age_uncertainty == pytest.approx(26 * CYCLE, abs=2.0 * CYCLE)
    assert {result.quality for result in results[1060:]} == {Quality.STALE}
    bounded = answers(strains, stated, settings=BridgeSettings(max_uncertainty=0.1))
    assert bounded[1030].quality is Quality.UNCONFIRMED


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


def test_a_frozen_sender_with_one_bit_of_dither_is_found() -> None:
    strains = moving(strains_at_rest(FIRST + 100, 54, NOISE, level=300e-6))
    results = answers(frozen(strains, slice(None), dither=1), NOISE)
    assert {result.quality for result in results[10:FIRST]} == {Quality.VALID}
    assert last_valid(results) <= 60
    assert all(result.causes & Cause.FROZEN for result in results[FIRST + 60 :])
    assert not any(result.quality.has_coefficients for result in results[FIRST + 60 :])


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


@pytest.mark.parametrize("noise", [NOISE, 0.1e-6])
def test_rest_after_motion_is_not_taken_for_frozen(noise: float) -> None:
    strains = strains_at_rest(900, 54, noise, level=200e-6)
    strains[:450] = moving(strains[:450])
    results = answers(strains, NOISE)
    assert {result.quality for result in results[3:]} == {Quality.VALID}


def test_an_amplifier_may_sample_at_a_third_of_the_rate() -> None:
    strains = np.repeat(moving(strains_at_rest(200, 54, NOISE, level=200e-6)), 3, axis=0)
    assert {result.quality for result in answers(strains, NOISE)[3:]} == {Quality.VALID}


def test_a_gauge_that_fails_to_zero_near_zero_is_left_out_in_the_stated_number_of_cycles() -> None:
    strains = strains_at_rest(FIRST + 100, 54, NOISE, level=0.5e-6)
    strains[FIRST:, 7] = 0.0
    for settings, limit in ((None, 35), (BridgeSettings(zero_cycles=10), 10)):
        results = answers(strains, NOISE, settings=settings)
        lost = next(k for k, result in enumerate(results[FIRST:], start=1) if not result.valid[7])
        assert lost <= limit
        assert all(not result.valid[7] for result in results[FIRST + limit :])


@pytest.mark.fast
@pytest.mark.parametrize("ratio", [0.2, 0.96, 3.0])
def test_the_table_of_quantised_noise_is_that_of_drawn_noise(ratio: float) -> None:
    """Probability of repetition to 5 % of itself (200,000 draws, at least 2,500 hits), variance to 1 %."""
    random, table = np.random.default_rng(1), noise_table()
    row = int(table.row(np.array([ratio]))[0])
    near = float(table.ratio[row])
    noise = near * random.normal(size=(200_000, 3))
    zero, drawn = np.rint(noise), np.rint(random.uniform(-0.5, 0.5, (200_000, 1)) + noise)
    for readings, expected in ((drawn, table.log_repeated), (zero, table.log_repeated_zero)):
        for repeats in (1, 2):
            found = (readings[:, : repeats + 1] == readings[:, :1]).all(axis=1).mean()
            assert np.exp(expected[row, repeats]) == pytest.approx(found, rel=0.05)
    assert table.variance[row] == pytest.approx(drawn.var(axis=1, ddof=1).mean(), rel=0.01)
    assert table.ratio_of(table.variance_of(np.array([near])))[0] == pytest.approx(near, rel=0.02)


@pytest.mark.fast
def test_the_number_of_zeros_follows_from_noise_and_quantisation() -> None:
    """P(|0.96 z| < 0.5)^m = 1e-9 gives 22.5; 0.2 steps of noise 1658."""
    assert longest_repetition(0.96, RARE) == pytest.approx(22.46, abs=0.01)
    assert longest_repetition(0.2, RARE) == pytest.approx(1658.0, abs=1.0)
    assert longest_repetition(0.01, RARE) == np.inf


@pytest.mark.fast
def test_evidence_of_healthy_gauges_stays_far_below_the_limit() -> None:
    """20,000 cycles of 4 gauges at the stated noise: the least of a frame, where chance is greatest."""
    strains = np.rint(strains_at_rest(20_000, 4, NOISE, level=1e-4) / STEP) * STEP
    watch, run, last = FreezeWatch(like_gauges(4, std=NOISE)), np.zeros(4, dtype=np.int64), np.full(4, np.nan)
    for strain in strains:
        run = np.where(strain == last, run + 1, 0)
        assert watch.update(strain, strain - last, run=run, present=np.ones(4, dtype=bool)) is None
        last = strain
