"""Minimal biases against scipy's noncentral chi-square and against planted faults."""

import numpy as np
import pytest
from random_map import GaussianModel, random_model
from scipy.stats import binom, ncx2, norm

from builder.reports.findings.gauge_value import correlations, isolable_bias
from strainfmu.estimator.health import chi_square_limit, detectable_bias, outlier_threshold

pytestmark = pytest.mark.fast

N_GAUGES = 20
N_DRAWS = 4000


def test_it_is_the_noncentral_chi_square_of_one_degree_of_freedom() -> None:
    """Baarda's (z_(1 - alpha/2) + z_(1 - beta))^2; alpha 0.1 %, beta 20 % is his 17.07, and scipy's."""
    noncentrality = detectable_bias(np.ones(1), outlier_threshold(1, 1e-3), 0.2)[0] ** 2
    assert noncentrality == pytest.approx(17.07, abs=0.01)
    assert ncx2.cdf(chi_square_limit(1, 1e-3), 1, noncentrality) == pytest.approx(0.2, abs=1e-7)


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
    """4,000 draws: 10 % missed, inside the binomial 99.9 % interval."""
    precision = model.precision()
    allowed = binom.ppf([5e-4, 1.0 - 5e-4], N_DRAWS, 0.1)
    by_gauge = detectable_bias(np.diag(precision), outlier_threshold(1, 1e-3), 0.1)
    z = (residuals(model, gauge, by_gauge[gauge]) @ precision)[:, gauge] / np.sqrt(precision[gauge, gauge])
    assert allowed[0] <= np.sum(np.abs(z) < norm.isf(5e-4)) <= allowed[1]


@pytest.mark.parametrize("gauge", [0, 7, 13])
def test_minimal_isolable_bias_is_blamed_on_its_gauge(model: GaussianModel, gauge: int) -> None:
    """4,000 draws: wrong or silent in no more than the 5 % stated (binomial 99.9 %); at 0.8 of it in more."""
    precision, threshold = model.precision(), outlier_threshold(N_GAUGES, 1e-4)
    correlation = correlations(precision)
    bias = isolable_bias(np.diag(precision), correlation, threshold, 0.05)[gauge]
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
    delta = 2.0 * isolable_bias(np.diag(precision), correlations(precision), 0.0, 0.05)[0]
    z = np.random.default_rng(4).multivariate_normal([delta, rho * delta], [[1.0, rho], [rho, 1.0]], n)
    assert np.sum(np.abs(z[:, 1]) > np.abs(z[:, 0])) == pytest.approx(0.05 * n, abs=3.3 * np.sqrt(0.05 * 0.95 * n))


def test_what_cannot_be_isolated_needs_an_infinite_bias() -> None:
    """Two gauges that check each other alone: the bias can be detected, not isolated."""
    precision = np.array([[2.0, -2.0, 0.0], [-2.0, 2.0, 0.0], [0.0, 0.0, 4.0]])
    correlation = correlations(precision)
    found = isolable_bias(np.diag(precision), correlation, 4.0, 0.05)
    assert np.all(np.isinf(found[:2]))
    assert np.isfinite(found[2])
    detectable = detectable_bias(np.diag(precision), 4.0, 0.5)
    np.testing.assert_allclose(detectable, [np.sqrt(8.0), np.sqrt(8.0), 2.0], rtol=1e-12)
    assert np.isinf(detectable_bias(np.array([1.0, 0.0]), 4.0)[1])
