"""Quantiles in the tail of a sample, and the alarm levels that follow from them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2, genpareto

from builder.inverse.envelope.tail_quantile import tail_quantile
from builder.trial.levels import RATE, alarm_levels, alarm_scales
from strainfmu.estimator.health import chi_square_limit

pytestmark = pytest.mark.fast


@pytest.mark.parametrize(
    "law", [chi2(49), genpareto(0.2), genpareto(-0.3)], ids=["chi-square", "heavy", "bounded"]
)
@pytest.mark.parametrize("probability", [0.1, 1e-3, 1e-4])
def test_tail_quantile_is_that_of_the_law(law: object, probability: float) -> None:
    """200,000 samples: the probability beyond the quantile found is within a factor 1.3 of the one requested."""
    values = law.rvs(size=200_000, random_state=4)  # type: ignore[attr-defined]  # a frozen law of scipy
    beyond = law.sf(tail_quantile(np.asarray(values), probability))  # type: ignore[attr-defined]
    assert probability / 1.3 < beyond < probability * 1.3


def test_levels_of_the_theory_are_found_on_data_of_the_theory() -> None:
    """Chi-square and the largest of 54 squared normals, independent: each has half of the rate."""
    random, n, freedom = np.random.default_rng(3), 300_000, 49
    chi_square = random.chisquare(freedom, size=n) / chi_square_limit(freedom)
    outlier = np.max(random.standard_normal((n, 54)) ** 2, axis=1) / chi2(1).isf(1e-4 / 54)
    levels = alarm_levels(chi_square, outlier, np.ones(n), random.uniform(size=n))
    assert levels.slope == 0.0
    half = 0.5 * RATE
    expected = chi2(freedom).isf(half) / chi_square_limit(freedom)
    assert levels.chi_square_scale == pytest.approx(expected, abs=0.06)
    assert levels.outlier_scale == pytest.approx(chi2(1).isf(half / 54) / chi2(1).isf(1e-4 / 54), abs=0.12)
    rate = np.mean((chi_square > levels.chi_square_scale) | (outlier > levels.outlier_scale))
    assert 0.5 * RATE < rate < 2.0 * RATE


def test_levels_follow_what_rises_with_the_incidence() -> None:
    """Chi-square over its level rises by 0.3 of what the expected one does: a half of the samples finds it.

    Of the other half the rate in each tenth is at most 3 times the mean; with constant factors half of all alarms
    are in the last tenth.
    """
    random, n, freedom = np.random.default_rng(5), 600_000, 49
    incidence = random.uniform(size=n)
    expected = np.exp(1.5 * incidence**2 - 0.5)
    rise = 0.7 + 0.3 * expected
    of_gauge = np.max(random.standard_normal((n, 54)) ** 2, axis=1) / chi2(1).isf(1e-4 / 54)
    ratios = np.stack([random.chisquare(freedom, size=n) / chi_square_limit(freedom), of_gauge]) * rise
    one, other = slice(0, n // 2), slice(n // 2, n)
    levels = alarm_levels(*ratios[:, one], expected[one], incidence[one])
    assert levels.slope == pytest.approx(0.3, abs=0.06)
    scales = np.array([[levels.chi_square_scale], [levels.outlier_scale]])
    followed = (ratios[:, other] > scales * (1.0 + levels.slope * (expected[other] - 1.0))).any(axis=0)
    assert 0.5 * RATE < followed.mean() < 2.0 * RATE
    tenth = np.floor(10.0 * incidence[other]).astype(int)
    assert max(followed[tenth == k].mean() for k in range(10)) < 3.0 * followed.mean()
    fixed = (ratios[:, other] > alarm_scales(ratios[:, one])[:, None]).any(axis=0)
    assert np.mean(tenth[fixed] == 9) > 0.5


def test_three_tests_share_the_rate() -> None:
    random = np.random.default_rng(4)
    ratios = np.array([[0.05], [0.1], [0.2]]) * random.standard_normal((3, 400_000)) ** 2
    scales = alarm_scales(ratios)
    again = np.array([[0.05], [0.1], [0.2]]) * random.standard_normal((3, 2_000_000)) ** 2
    rates = np.mean(again > scales[:, None], axis=1)
    assert 0.5 * RATE < rates.sum() < 2.0 * RATE
    assert np.all(np.abs(rates / rates.mean() - 1.0) < 0.7)
