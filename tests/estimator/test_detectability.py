"""Minimal biases against scipy's noncentral chi-square and against planted faults."""

from __future__ import annotations

import numpy as np
import pytest
from random_map import GaussianModel, random_model
from scipy.stats import binom, ncx2, norm

from strainfmu.errors import InputError
from strainfmu.estimator.alarm_limits import (
    correlations,
    detectable_noncentrality,
    minimal_detectable_bias,
    minimal_isolable_bias,
    noncentral_survival,
    outlier_threshold,
)
from strainfmu.estimator.health import chi_square_limit

pytestmark = pytest.mark.fast

N_GAUGES = 20
N_DRAWS = 4000


@pytest.mark.parametrize("freedom", [1, 2, 22, 49])
@pytest.mark.parametrize("noncentrality", [1e-3, 1.0, 30.0, 2000.0])
def test_survival_is_that_of_the_noncentral_chi_square(freedom: int, noncentrality: float) -> None:
    """scipy's to 1e-9, at the mean and 3 deviations to both sides."""
    mean, std = freedom + noncentrality, np.sqrt(2.0 * freedom + 4.0 * noncentrality)
    for value in (max(mean - 3.0 * std, 0.1), mean, mean + 3.0 * std):
        expected = ncx2.sf(value, freedom, noncentrality)
        assert noncentral_survival(value, freedom, noncentrality) == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_without_noncentrality_it_is_the_chi_square() -> None:
    assert noncentral_survival(chi_square_limit(7, 0.01), 7, 0.0) == pytest.approx(0.01, rel=1e-9)
    assert noncentral_survival(0.0, 7, 3.0) == 1.0


@pytest.mark.parametrize("freedom", [1, 10, 49])
def test_detectable_noncentrality_is_missed_as_often_as_stated(freedom: int) -> None:
    """scipy: probability below the limit is 1 % there, to 1e-7."""
    found = detectable_noncentrality(freedom, 1e-4, 0.01)
    assert ncx2.cdf(chi_square_limit(freedom, 1e-4), freedom, found) == pytest.approx(0.01, abs=1e-7)


def test_one_degree_of_freedom_is_the_test_of_one_gauge() -> None:
    """Baarda's (z_(1 - alpha/2) + z_(1 - beta))^2; alpha 0.1 %, beta 20 % is his 17.07."""
    expected = (norm.isf(5e-4) + norm.isf(0.2)) ** 2
    assert detectable_noncentrality(1, 1e-3, 0.2) == pytest.approx(expected, rel=1e-8)
    assert expected == pytest.approx(17.07, abs=0.01)


@pytest.mark.parametrize(("alarm", "miss"), [(0.0, 0.1), (1.0, 0.1), (0.1, 0.0), (0.1, 0.95), (np.nan, 0.1)])
def test_impossible_probabilities_are_refused(alarm: float, miss: float) -> None:
    with pytest.raises(InputError, match=r"probability .* found, must be"):
        detectable_noncentrality(5, alarm, miss)


@pytest.fixture(scope="module", params=[(0.0, False), (0.0, True), (1.0, True)], ids=str)
def model(request: pytest.FixtureRequest) -> GaussianModel:
    gamma, full = request.param
    return random_model(gamma, full, N_GAUGES)


def residuals(model: GaussianModel, gauge: int, bias: float) -> np.ndarray:
    """(4000, n_d) d - m with ``bias`` on one gauge."""
    found = model.draw(N_DRAWS, 20 + gauge)[0] - model.m
    found[:, gauge] += bias
    return found


@pytest.mark.parametrize("gauge", [0, 7, 13])
def test_minimal_detectable_bias_is_missed_as_often_as_stated(model: GaussianModel, gauge: int) -> None:
    """4,000 draws, by chi-square and by the gauge's own z: 10 % missed, inside the binomial 99.9 % interval."""
    precision = model.precision()
    freedom = N_GAUGES - (model.a.shape[1] if model.gamma == 0.0 else 0)
    allowed = binom.ppf([5e-4, 1.0 - 5e-4], N_DRAWS, 0.1)
    by_chi_square = minimal_detectable_bias(precision, detectable_noncentrality(freedom, 1e-3, 0.1))
    residual = residuals(model, gauge, by_chi_square[gauge])
    chi_square = np.sum(residual @ precision * residual, axis=1)
    assert allowed[0] <= np.sum(chi_square < chi_square_limit(freedom, 1e-3)) <= allowed[1]
    by_gauge = minimal_detectable_bias(precision, detectable_noncentrality(1, 1e-3, 0.1))
    z = (residuals(model, gauge, by_gauge[gauge]) @ precision)[:, gauge] / np.sqrt(precision[gauge, gauge])
    assert allowed[0] <= np.sum(np.abs(z) < norm.isf(5e-4)) <= allowed[1]


@pytest.mark.parametrize("gauge", [0, 7, 13])
def test_minimal_isolable_bias_is_blamed_on_its_gauge(model: GaussianModel, gauge: int) -> None:
    """4,000 draws: wrong or silent in no more than the 5 % stated (binomial 99.9 %); at 0.8 of it in more."""
    precision, threshold = model.precision(), outlier_threshold(N_GAUGES, 1e-4)
    correlation = correlations(precision)
    bias = minimal_isolable_bias(precision, correlation, threshold, 0.05)[gauge]
    missed = []
    for size in (bias, 0.8 * bias):
        z = residuals(model, gauge, size) @ precision / np.sqrt(np.diag(precision))
        blamed = (np.abs(z).argmax(axis=1) == gauge) & (np.abs(z[:, gauge]) > threshold)
        missed.append(np.sum(~blamed))
    assert missed[0] <= binom.isf(1e-3, N_DRAWS, 0.05) < missed[1]


@pytest.mark.parametrize("rho", [0.9, -0.9])
def test_minimal_isolable_bias_of_two_alike(rho: float) -> None:
    """40,000 draws of two z at rho, no level to pass: 5 % are blamed on the other, to the binomial 99.9 %."""
    precision, n = np.array([[4.0, 2.0 * rho], [2.0 * rho, 1.0]]), 40_000
    delta = 2.0 * minimal_isolable_bias(precision, correlations(precision), 0.0, 0.05)[0]
    z = np.random.default_rng(4).multivariate_normal([delta, rho * delta], [[1.0, rho], [rho, 1.0]], n)
    assert np.sum(np.abs(z[:, 1]) > np.abs(z[:, 0])) == pytest.approx(0.05 * n, abs=3.3 * np.sqrt(0.05 * 0.95 * n))


def test_what_cannot_be_isolated_needs_an_infinite_bias() -> None:
    """Two gauges that check each other alone: the bias can be detected, not isolated."""
    precision = np.array([[2.0, -2.0, 0.0], [-2.0, 2.0, 0.0], [0.0, 0.0, 4.0]])
    correlation = correlations(precision)
    found = minimal_isolable_bias(precision, correlation, 4.0, 0.05)
    assert np.all(np.isinf(found[:2]))
    assert np.isfinite(found[2])
    detectable = minimal_detectable_bias(precision, 16.0)
    np.testing.assert_allclose(detectable, [np.sqrt(8.0), np.sqrt(8.0), 2.0], rtol=1e-12)
    assert np.isinf(minimal_detectable_bias(np.diag([1.0, 0.0]), 16.0)[1])
    with pytest.raises(InputError, match=r"miss probability 0\.0 found"):
        minimal_isolable_bias(precision, correlation, 4.0, 0.0)
