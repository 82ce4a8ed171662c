"""Modes, projections, variances and samples of the pressure field."""

from __future__ import annotations

import numpy as np
import pytest
from inverse_case import Case, gaussian

from builder.campaign.snapshots import Snapshots
from builder.inverse.cases.field import (
    data_informed_modes,
    estimated_field,
    field_variance,
    posterior_samples,
    project_on_modes,
)
from strainfmu.errors import InputError
from strainfmu.estimator.pressure_modes import LowRankPrior, area_weights
from strainfmu.estimator.state_map import gaussian_map


def test_modes_are_orthogonal_in_the_data(case: Case, prior: LowRankPrior) -> None:
    """b_j' Z' Gamma^-1 Z b_k = lambda_k delta_jk, to 1e-9 of lambda_1."""
    spectrum = gaussian(case, prior).spectrum
    b = data_informed_modes(prior, spectrum)
    assert b.shape == (len(prior.mean), 54)
    whitened = case.strain_operator @ b / case.noise_std[:, None]
    expected = np.diag(spectrum.eigenvalues)
    np.testing.assert_allclose(whitened.T @ whitened, expected, rtol=0.0, atol=1e-9 * expected[0, 0])
    with pytest.raises(InputError, match="modes: 55 found, must be 1 to 54"):
        data_informed_modes(prior, spectrum, 55)


def test_projection_is_the_best_of_its_modes(case: Case, prior: LowRankPrior, prior_snapshots: Snapshots) -> None:
    """Against least squares in either norm, 1e-9; more modes never do worse; what is in the span stays."""
    modes = data_informed_modes(prior, gaussian(case, prior).spectrum, 7)
    pressure = prior_snapshots.pressure[::40]
    fit = np.linalg.lstsq(modes, (pressure - prior.mean).T, rcond=None)[0]
    found = project_on_modes(pressure, prior.mean, modes)
    np.testing.assert_allclose(found, prior.mean + (modes @ fit).T, rtol=1e-9)
    np.testing.assert_allclose(project_on_modes(found, prior.mean, modes), found, rtol=1e-10)
    error = [
        np.linalg.norm(project_on_modes(pressure, prior.mean, modes[:, :r]) - pressure, axis=1) for r in (3, 5, 7)
    ]
    assert np.all(error[0] >= error[1])
    assert np.all(error[1] >= error[2])
    weights = area_weights(np.random.default_rng(1).uniform(0.2, 2.0, len(prior.mean)))
    root = np.sqrt(weights)
    fit = np.linalg.lstsq(modes * root[:, None], ((pressure - prior.mean) * root).T, rcond=None)[0]
    weighted = project_on_modes(pressure, prior.mean, modes, weights)
    np.testing.assert_allclose(weighted, prior.mean + (modes @ fit).T, rtol=1e-9)


@pytest.mark.parametrize("gamma", [1e-6, 1.0, 10**0.5])
def test_variance_is_that_of_the_error(gamma: float, case: Case, prior: LowRankPrior) -> None:
    """diag of F [T C T' + (I - T A)(I - T A)'] F', formed by the book, 1e-6; chunks make no difference."""
    solved = gaussian(case, prior, gamma)
    noise = prior.factor @ solved.strain_gain * case.noise_std
    left = prior.factor - (prior.factor @ solved.strain_gain) @ solved.state_operator
    expected = np.sum(noise**2, axis=1) + np.sum(left**2, axis=1)
    found = field_variance(prior, solved)
    np.testing.assert_allclose(found.posterior, expected, rtol=1e-6)
    np.testing.assert_allclose(found.prior, np.sum(prior.factor**2, axis=1), rtol=1e-12)
    chunked = field_variance(prior, solved, nodes_at_once=7)
    np.testing.assert_allclose(chunked.posterior, found.posterior, rtol=1e-12)
    assert np.all(found.posterior > 0.0)
    if gamma == 1.0:
        assert np.all((found.fraction_removed >= 0.0) & (found.fraction_removed <= 1.0))
        assert found.fraction_removed.max() > 0.9


def test_a_node_without_prior_variance_was_not_measured() -> None:
    factor = np.array([[1.0, 0.0], [0.0, 0.0], [0.5, 2.0]])
    prior = LowRankPrior(np.zeros(3), factor)
    found = field_variance(prior, gaussian_map(np.array([[1.0, 0.0]]), np.zeros(1), np.array([[0.1]])))
    np.testing.assert_allclose(found.fraction_removed[:2], [1.0 / 1.1, 0.0])


def test_samples_have_the_stated_mean_and_variance(case: Case, prior: LowRankPrior) -> None:
    """4,000 samples: mean and variance within 4.5 errors (sqrt(2/n)) at every node; seeds repeat."""
    solved = gaussian(case, prior)
    strain = solved.mean_strain + case.noise_std
    samples = posterior_samples(prior, solved, strain, 4000, seed=5)
    variance = field_variance(prior, solved).posterior
    mean_error = samples.mean(axis=0) - estimated_field(prior, solved, strain)
    assert np.all(np.abs(mean_error) < 4.5 * np.sqrt(variance / 4000))
    np.testing.assert_allclose(samples.var(axis=0, ddof=1) / variance, 1.0, atol=4.5 * np.sqrt(2.0 / 4000))
    np.testing.assert_array_equal(posterior_samples(prior, solved, strain, 4000, 5), samples)
    assert not np.allclose(posterior_samples(prior, solved, strain, 3, 6), samples[:3])
