"""The covariance of loads in sums of positive terms against the difference it stands for, and against draws."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from runtime_map import GaussianModel, random_model

from strainfmu.errors import InputError
from strainfmu.load_errors import LoadErrorModel, load_error_covariance, load_error_model


def error_model(model: GaussianModel, load_covariance: np.ndarray) -> LoadErrorModel:
    return load_error_model(
        load_covariance,
        model.a,
        model.noise_covariance,
        model.load_per_state,
        model.load_gain(),
        model.strain_load_covariance,
        known_prior=model.gamma > 0.0,
    )


@pytest.mark.parametrize("gamma", [0.0, 1.0, 10.0])
def test_covariance_of_the_own_gain_comes_back(gamma: float) -> None:
    model = random_model(gamma)
    found = load_error_covariance(error_model(model, model.load_covariance()), model.load_gain())
    np.testing.assert_allclose(found, model.load_covariance(), rtol=0.0, atol=1e-12 * np.abs(found).max())


@pytest.mark.parametrize("gamma", [1.0, 10.0])
def test_any_gain_has_the_covariance_of_draws(gamma: float) -> None:
    """A gain 20 % off the best one, 20,000 draws: e' C^-1 e has mean 5 to 3 errors."""
    model, n = random_model(gamma), 20_000
    gain = 0.8 * model.load_gain()
    covariance = load_error_covariance(error_model(model, model.load_covariance()), gain)
    strain, loads = model.draw(n, 3)
    errors = (strain - model.m) @ gain.T + model.load_of_mean - loads
    distance = np.sum(errors * np.linalg.solve(covariance, errors.T).T, axis=1)
    assert distance.mean() == pytest.approx(5.0, abs=3.0 * np.sqrt(10.0 / n))


def test_a_variance_stays_positive_where_the_difference_would_not() -> None:
    """Load that follows its strain exactly, known 1e9 times better than it is large: C stays positive."""
    model = random_model()
    of_strain = np.random.default_rng(1).normal(size=(5, 27)) * 1e9
    x = model.noise_covariance @ of_strain.T
    model = replace(model, strain_load_covariance=x, load_noise_covariance=of_strain @ x + 1e-9 * np.eye(5))
    gain = model.load_gain()
    whole = gain - of_strain
    covariance = whole @ model.noise_covariance @ whole.T + 1e-9 * np.eye(5)
    found = load_error_covariance(error_model(model, covariance), of_strain)
    assert np.linalg.eigvalsh(found)[0] >= 0.0


@pytest.mark.parametrize("gamma", [0.0, 1.0])
def test_a_covariance_below_that_of_its_terms_is_refused(gamma: float) -> None:
    model = random_model(gamma, full=False)
    without_remainder = model.load_covariance() - model.load_noise_covariance
    with pytest.raises(InputError, match="load_covariance is less than noise_covariance and the prior alone"):
        error_model(model, 0.9 * without_remainder)
    np.testing.assert_allclose(error_model(model, without_remainder).remainder, 0.0, atol=1e-9)
