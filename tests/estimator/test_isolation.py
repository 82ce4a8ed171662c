"""Leave-one-out residuals against leaving one out, and faults that are planted."""

from dataclasses import replace

import numpy as np
import pytest
from random_map import GaussianModel, map_of, missing, random_model
from scipy.stats import binom, norm

from builder.reports.findings.gauge_value import ambiguous_groups, correlations
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import FALSE_ALARM_PROBABILITY, HealthState, outlier_threshold

pytestmark = pytest.mark.fast

Q = 1.2e5
N_GAUGES = 54
N_DRAWS = 4000


@pytest.fixture(scope="module", params=[(0.0, False), (0.0, True), (1.0, False), (1.0, True)], ids=str)
def model(request: pytest.FixtureRequest) -> GaussianModel:
    gamma, full = request.param
    return random_model(gamma, full, N_GAUGES)


def standardised(precision: np.ndarray, residual: np.ndarray) -> np.ndarray:
    """z of each residual."""
    return precision @ residual / np.sqrt(np.diag(precision))


@pytest.mark.parametrize("gamma", [0.0, 1.0])
def test_z_is_the_error_of_predicting_one_gauge_from_all_others(gamma: float) -> None:
    """(d_i - m_i - prediction) / standard deviation, to 1e-7.

    State and e_i predicted from the others: universal kriging (Cressie, Statistics for Spatial Data, 3.4.5).
    """
    model = random_model(gamma, n_gauges=12, n_states=3)
    residual = model.draw(1, 5)[0][0] - model.m
    found = standardised(model.precision(), residual)
    for i in range(12):
        others, rest = ~missing(12, i), model.without(missing(12, i))
        weight = np.linalg.solve(rest.noise_covariance, model.noise_covariance[others, i])
        of_state = model.a[i] - weight @ rest.a
        hessian = rest.a.T @ np.linalg.solve(rest.noise_covariance, rest.a) + gamma * np.eye(3)
        prediction = of_state @ rest.gain() @ residual[others] + weight @ residual[others]
        variance = model.noise_covariance[i, i] - weight @ model.noise_covariance[others, i]
        variance += of_state @ np.linalg.solve(hessian, of_state)
        assert found[i] == pytest.approx((residual[i] - prediction) / np.sqrt(variance), abs=1e-7)


def test_z_is_standard_normal_and_correlated_as_stated(model: GaussianModel) -> None:
    """4,000 draws: mean 0, variance 1 and correlations to 4.5 errors over all gauges and pairs."""
    precision = model.precision()
    strain, _ = model.draw(N_DRAWS, 6)
    z = np.array([standardised(precision, d - model.m) for d in strain])
    np.testing.assert_allclose(z.mean(axis=0), 0.0, atol=4.5 / np.sqrt(N_DRAWS))
    found = z.T @ z / N_DRAWS
    np.testing.assert_allclose(found, correlations(precision), atol=4.5 * np.sqrt(2.0 / N_DRAWS))


@pytest.mark.parametrize(("n_gauges", "probability"), [(1, 1e-4), (54, 1e-4), (54, 0.05)])
def test_threshold_is_bonferronis(n_gauges: int, probability: float) -> None:
    """scipy's normal quantile; 3.9 for one gauge and 4.8 for 54 at 1e-4."""
    expected = norm.isf(probability / (2 * n_gauges))
    assert outlier_threshold(n_gauges, probability) == pytest.approx(expected, rel=1e-9)


def test_outlier_alarms_are_no_more_than_stated(model: GaussianModel) -> None:
    """4,000 draws at 5 %: below the binomial 99.9 % bound, and not for being far too high: above half of it."""
    precision, (strain, _) = model.precision(), model.draw(N_DRAWS, 8)
    threshold = outlier_threshold(N_GAUGES, 0.05)
    z = np.array([standardised(precision, d - model.m) for d in strain])
    alarms = int(np.sum(np.abs(z).max(axis=1) > threshold))
    assert alarms <= binom.isf(1e-3, N_DRAWS, 0.05)
    assert alarms >= binom.isf(1.0 - 1e-3, N_DRAWS, 0.025)


def test_false_alarms_of_a_step_are_as_rare_as_stated(model: GaussianModel) -> None:
    """4,000 steps, at most 2e-4 by both alarms together: 0.8 expected, 6 or more has probability 2e-4."""
    estimator = Estimator(map_of(model))
    alarms = np.sum(estimator.estimate(model.draw(N_DRAWS, 9)[0], Q).health != HealthState.OK)
    assert alarms <= binom.isf(1e-3, N_DRAWS, 2.0 * FALSE_ALARM_PROBABILITY)


def test_a_ten_sigma_bias_is_found_and_blamed_on_its_gauge() -> None:
    """4,000 steps of a map of 54 gauges, 10 sigma on a random gauge: found in 99 %, isolated in 95 %.

    Truncated modes up to half of the gauge noise; those far above it hide a bias, which
    test_detectability holds to the stated minimal biases.
    """
    model = random_model(0.0, False, N_GAUGES)
    truncated = 1e-7 * np.random.default_rng(1).normal(size=(N_GAUGES, 6))
    model = replace(model, noise_covariance=model.noise_covariance + truncated @ truncated.T)
    sigma = np.sqrt(np.diag(model.noise_covariance))
    estimator = Estimator(map_of(model))
    gauges = np.random.default_rng(2).integers(N_GAUGES, size=N_DRAWS)
    strain = model.draw(N_DRAWS, 10)[0]
    strain[np.arange(N_DRAWS), gauges] += 10.0 * sigma[gauges]
    found = estimator.estimate(strain, Q)
    assert np.isin(found.health, [HealthState.INCONSISTENT, HealthState.SUSPECT]).sum() >= 0.99 * N_DRAWS
    isolated = [suspects == (gauge,) for suspects, gauge in zip(found.suspects, gauges, strict=True)]
    assert sum(isolated) >= 0.95 * N_DRAWS


def test_loads_without_the_suspect_are_those_of_a_healthy_map() -> None:
    """10 sigma on one gauge, masked once suspected: rms error within 1.2 of the stated sigma of the clean mask."""
    model = random_model(0.0, False, N_GAUGES)
    estimator = Estimator(map_of(model))
    masked_std = estimator.estimate(model.m, Q, valid=~missing(N_GAUGES, 7)).loads_std
    strain, loads = model.draw(1000, 11)
    strain[:, 7] += 10.0 * np.sqrt(model.noise_covariance[7, 7])
    suspects = estimator.estimate(strain, Q).suspects
    valid = np.array([~missing(N_GAUGES, *of_sample) for of_sample in suspects])
    errors = estimator.estimate(strain, Q, valid=valid).loads - loads
    assert np.all(np.sqrt(np.mean(np.square(errors), axis=0)) < 1.2 * masked_std)


def two_alike() -> GaussianModel:
    """Gauges 4 and 9 alone see the last state, nearly alike: only their difference is checked, by both."""
    model = random_model(0.0, False, 12, 4)
    a = model.a.copy()
    a[[i for i in range(12) if i not in (4, 9)], -1] = 0.0
    return replace(model, a=a)


def test_gauges_that_cannot_be_told_apart_are_suspected_together() -> None:
    model = two_alike()
    estimator = Estimator(map_of(model))
    assert ambiguous_groups(correlations(model.precision())) == ((4, 9),)
    for gauge in (4, 9):
        strain = model.m.copy()
        strain[gauge] += 2e-5
        assert estimator.estimate(strain, Q).suspects == (4, 9)


def test_groups_are_chains_of_correlation() -> None:
    """0-3 and 3-5 linked make one group, the sign does not matter, the limit counts as linked."""
    correlation = np.eye(6)
    for i, j, value in [(0, 3, -0.95), (3, 5, 0.9), (1, 2, 0.99), (4, 5, 0.89)]:
        correlation[i, j] = correlation[j, i] = value
    assert ambiguous_groups(correlation) == ((0, 3, 5), (1, 2))
    assert ambiguous_groups(correlation, 0.98) == ((1, 2),)
    assert ambiguous_groups(np.eye(4)) == ()


def test_gauge_that_nothing_checks_is_correlated_with_none() -> None:
    precision = np.diag([1.0, 1e-13, 0.0])
    np.testing.assert_array_equal(correlations(precision, 1e-10), np.diag([1.0, 0.0, 0.0]))
