"""The reference's update over time: steady state, considered errors, splits of covariances, motion."""

from __future__ import annotations

import numpy as np
import pytest
from flight_maps import whole_map

from strainfmu.estimator.reference.flight_filter import FlightFilterReference
from strainfmu.estimator.reference.kalman import Law, Rows, measured, predicted, seen_errors, white_and_lasting

pytestmark = pytest.mark.fast

PRIOR = Law(np.zeros(1), np.ones((1, 1)), np.zeros((1, 1)))


def step(law: Law, correlation: float, considered: float = 0.0) -> Law:
    return predicted(law, np.array([[correlation]]), PRIOR, considered)


def reading(law: Law, value: float, noise: float, lasting: float = 0.0) -> Law:
    rows = Rows(np.array([value]) - law.mean, np.ones((1, 1)), np.full((1, 1), lasting), np.full((1, 1), noise))
    return measured(law, rows)[0]


def test_variance_of_a_scalar_reaches_the_solution_of_its_riccati_equation() -> None:
    a, noise, law = 0.95, 0.3, PRIOR
    for _ in range(200):
        law = reading(step(law, a), 0.0, noise)
    # p = a^2 p r / (p + r) + 1 - a^2, a quadratic equation in p.
    b = noise * (1.0 - a * a) - (1.0 - a * a)
    expected = 0.5 * (-b + np.sqrt(b * b + 4.0 * noise * (1.0 - a * a)))
    assert step(law, a).covariance[0, 0] == pytest.approx(expected, rel=1e-12)


def test_stated_variance_is_that_of_a_series_with_an_error_that_lasts() -> None:
    lasting, noise, k = 0.5, 0.2, 30

    def estimate(readings: np.ndarray) -> Law:
        law = PRIOR
        for value in readings:
            law = reading(step(law, 1.0, considered=1.0), value, noise, lasting)
        return law

    weight = np.array([estimate(row).mean[0] for row in np.eye(k)])
    total = weight.sum()
    expected = (1.0 - total) ** 2 + (total * lasting) ** 2 + noise * np.sum(weight**2)
    stated = estimate(np.zeros(k)).covariance[0, 0]
    assert stated == pytest.approx(expected, rel=1e-9)
    assert stated > lasting**2 / (1.0 + lasting**2)


def test_considered_errors_without_memory_are_noise() -> None:
    both, noise = reading(PRIOR, 0.7, 0.2, 0.5), reading(PRIOR, 0.7, 0.45)
    np.testing.assert_allclose(both.mean, noise.mean, rtol=1e-14)
    np.testing.assert_allclose(both.covariance, noise.covariance, rtol=1e-14)


def test_two_steps_are_one_and_keep_the_stationary_law() -> None:
    reference = FlightFilterReference(whole_map(), 1.0)
    one, two = reference.transition(0.07), reference.transition(0.14)
    np.testing.assert_allclose(one @ one, two, rtol=0.0, atol=1e-12)
    std = np.sqrt(np.diag(reference.prior.covariance))
    forgotten = reference.prior.covariance - one @ reference.prior.covariance @ one.T
    assert np.all(np.linalg.eigvalsh(forgotten / np.outer(std, std)) > 0.0)


def test_seen_errors_and_the_rest_add_up() -> None:
    rng = np.random.default_rng(1)
    strain, load = rng.standard_normal((8, 30)) * 0.5 ** np.arange(30), rng.standard_normal((5, 30))
    seen = seen_errors(strain, strain @ load.T, load @ load.T, 1.0, np.ones(8))
    assert 0 < seen.strain.shape[1] < 8
    np.testing.assert_allclose(seen.strain @ seen.strain.T + seen.rest_strain, strain @ strain.T, atol=1e-12)
    np.testing.assert_allclose(seen.strain @ seen.load.T + seen.rest_cross, strain @ load.T, atol=1e-12)
    np.testing.assert_allclose(seen.load @ seen.load.T + seen.rest_load, load @ load.T, atol=1e-12)


def test_gauge_covariance_is_split_into_noise_common_and_lasting_errors() -> None:
    std, common = np.array([1.0, 1.5, 2.0, 1.0]), np.array([5.0, 5.0, 5.0, 5.0])
    covariance = np.diag(std**2) + np.outer(common, common)
    noise, columns, rest = white_and_lasting(covariance, std)
    np.testing.assert_allclose(noise, std**2)
    assert columns.shape == (4, 1)
    np.testing.assert_allclose(columns @ columns.T + rest + np.diag(noise), covariance)
