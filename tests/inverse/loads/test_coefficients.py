"""The stated covariance against draws, and against flights that are not among the snapshots.

Data and map share one discretisation here: these are tests of the statistics, not of the model's accuracy.
"""

import numpy as np
import pytest
from inverse_case import Case, cross_covariance, gaussian, least_squares, noise_model
from state_estimates import load_gain_of, precision_of

from builder.campaign.snapshots import Snapshots
from builder.inverse.noise.model import NoiseModel, gauge_noise
from builder.inverse.solution import prior_of_modes
from builder.reports.findings.coefficient_sources import load_covariance_by_terms
from strainfmu.linear.pressure_modes import LowRankPrior
from strainfmu.linear.state_map import gaussian_map, least_squares_map

N_MODES = 5
N_DRAWS = 20_000


def covariance_of(case: Case) -> np.ndarray:
    """Case 1 with the default noise."""
    per_state, noise = case.loads @ case.modes.modes[:, :N_MODES], noise_model(case, N_MODES)
    return load_covariance_by_terms(least_squares(case, N_MODES), per_state, noise, cross_covariance(noise))


def gain_of(case: Case) -> np.ndarray:
    """(5, n_d) loads per strain of Case 1 with the default noise."""
    per_state, noise = case.loads @ case.modes.modes[:, :N_MODES], noise_model(case, N_MODES)
    solved = least_squares(case, N_MODES)
    return load_gain_of(solved, per_state, cross_covariance(noise))


def load_errors(case: Case, gain: np.ndarray, held_out: Snapshots, repeats: int = 100) -> np.ndarray:
    """(conditions, repeats, 5) error of the loads by ``gain`` (5, n_d) over flights held out, fresh noise."""
    net = held_out.pressure - case.internal_pressure
    mean = case.modes.mean - case.internal_pressure
    noise = np.random.default_rng(8).normal(size=(len(net), repeats, len(case.noise_std))) * case.noise_std
    strain = ((net - mean) @ case.strain_operator.T)[:, None] + noise
    estimate = strain @ gain.T
    return estimate - ((net - mean) @ case.loads.T)[:, None]


def test_three_sigma_cover_flights_never_seen(case: Case, held_out: Snapshots) -> None:
    """At least 99 % of each load, nominal 99.7 %; and not because sigma is far too wide."""
    std = np.sqrt(np.diag(covariance_of(case)))
    errors = load_errors(case, gain_of(case), held_out)
    assert np.all((np.abs(errors) < 3.0 * std).mean(axis=(0, 1)) >= 0.99)
    assert np.all(np.sqrt((errors**2).mean(axis=(0, 1))) > 0.3 * std)


def test_gauge_noise_alone_does_not_cover(case: Case, held_out: Snapshots) -> None:
    """The paper's bound, (Z' C^-1 Z)^-1 of gauge noise: truncated modes alias, 3 sigma holds less than 70 %."""
    z = case.strain_operator @ case.modes.modes[:, :N_MODES]
    gain = case.loads @ case.modes.modes[:, :N_MODES] @ np.linalg.pinv(z)
    std = np.linalg.norm(gain * case.noise_std, axis=1)
    errors = load_errors(case, gain, held_out)
    assert np.all((np.abs(errors) < 3.0 * std).mean(axis=(0, 1)) < 0.70)


def test_covariance_is_that_of_draws(case: Case) -> None:
    """20,000 draws: 1 sigma holds 68.3 +- 1.5 % (4.5 errors), both chi-squares their means to 3 errors."""
    solved, covariance = least_squares(case, N_MODES), covariance_of(case)
    random = np.random.default_rng(9)
    spread = case.modes.coefficient_std
    states = random.normal(size=(N_DRAWS, len(spread))) * spread
    noise = random.normal(size=(N_DRAWS, len(case.noise_std))) * case.noise_std
    strain = states @ (case.strain_operator @ case.modes.modes).T + noise
    of_modes = case.loads @ case.modes.modes
    errors = strain @ gain_of(case).T - states @ of_modes.T
    inside = (np.abs(errors) < np.sqrt(np.diag(covariance))).mean(axis=0)
    np.testing.assert_allclose(inside, 0.683, atol=0.015)

    distance = np.sum(errors * np.linalg.solve(covariance, errors.T).T, axis=1)
    assert abs(distance.mean() - 5.0) < 3.0 * np.sqrt(2.0 * 5.0 / N_DRAWS)
    chi_square = np.sum((strain @ precision_of(solved)) * strain, axis=1)
    freedom = len(case.noise_std) - N_MODES
    assert abs(chi_square.mean() - freedom) < 3.0 * np.sqrt(2.0 * freedom / N_DRAWS)


def test_covariance_is_symmetric_and_positive(case: Case) -> None:
    covariance = covariance_of(case)
    np.testing.assert_allclose(covariance, covariance.T, rtol=1e-12)
    scale = np.sqrt(np.diag(covariance))
    assert np.linalg.eigvalsh(covariance / np.outer(scale, scale)).min() > 1e-8


def test_noise_enters_squared_where_nothing_is_truncated(case: Case) -> None:
    """With gauge noise alone in Case 1, ten times the noise makes a hundred times the covariance."""
    z = case.strain_operator @ case.modes.modes[:, :3]
    found = []
    for factor in (1.0, 10.0):
        noise = NoiseModel((gauge_noise(np.diag((factor * case.noise_std) ** 2)),))
        solved = least_squares_map(z, np.zeros(len(z)), noise.covariance, case.modes.coefficient_std[:3])
        found.append(load_covariance_by_terms(solved, case.loads @ case.modes.modes[:, :3], noise))
    np.testing.assert_allclose(found[1], 100.0 * found[0], rtol=1e-9, atol=1e-9 * np.abs(found[1]).max())


def assert_coverage(error: np.ndarray, covariance: np.ndarray) -> None:
    """1 sigma holds 68.3 +- 1.5 % (4 errors), 3 sigma 99.73 % (+0.2, -0.4), of 4,000 errors (4000, 5).

    The errors are whitened first: were one of the 15 entries of the covariance wrong, they would not be standard.
    """
    standard = np.abs(np.linalg.solve(np.linalg.cholesky(covariance), error.T))
    assert abs((standard < 1.0).mean() - 0.683) < 0.015
    assert -0.004 < (standard < 3.0).mean() - 0.9973 < 0.002
    assert np.max(np.abs((standard < 1.0).mean(axis=1) - 0.683)) < 0.030


@pytest.mark.parametrize("gamma", [1e-2, 1.0, 10**0.5])
def test_case_2_covariance_is_that_of_draws(gamma: float, case: Case, prior: LowRankPrior) -> None:
    """4,000 draws of state and noise, for any gamma."""
    solved, noise = gaussian(case, prior, gamma), noise_model(case, 0, with_truncated=False)
    per_state = case.loads @ prior.factor
    random = np.random.default_rng(4)
    states = random.normal(size=(4000, prior.n_states))
    strain = states @ solved.state_operator.T + random.normal(size=(4000, len(case.noise_std))) * case.noise_std
    error = (strain @ solved.strain_gain.T - states) @ per_state.T
    assert_coverage(error, load_covariance_by_terms(solved, per_state, noise))


def test_case_2_with_a_cut_prior_counts_what_is_cut(case: Case) -> None:
    """12 of 89 POD modes as states, the others as noise: 4,000 draws of all of them."""
    prior, noise = prior_of_modes(case.modes, 12), noise_model(case, 12)
    mean_strain = case.strain_operator @ (prior.mean - case.internal_pressure)
    solved = gaussian_map(case.strain_operator @ prior.factor, mean_strain, noise.covariance)
    per_state, x = case.loads @ prior.factor, cross_covariance(noise)
    covariance = load_covariance_by_terms(solved, per_state, noise, x)
    random = np.random.default_rng(21)
    states = random.normal(size=(4000, case.modes.modes.shape[1])) * case.modes.coefficient_std
    measured = states @ (case.strain_operator @ case.modes.modes).T
    measured += random.normal(size=measured.shape) * case.noise_std
    estimate = measured @ load_gain_of(solved, per_state, x).T
    assert_coverage(estimate - states @ (case.loads @ case.modes.modes).T, covariance)


def test_case_2_covers_flights_never_seen(case: Case, prior: LowRankPrior, held_out_of_prior: Snapshots) -> None:
    """3 sigma hold at least 99 % of each load over conditions that the prior was not made of."""
    solved, noise = gaussian(case, prior), noise_model(case, 0, with_truncated=False)
    std = np.sqrt(np.diag(load_covariance_by_terms(solved, case.loads @ prior.factor, noise)))
    deviation = held_out_of_prior.pressure - prior.mean
    draws = np.random.default_rng(8).normal(size=(len(deviation), 100, len(case.noise_std))) * case.noise_std
    strain = (deviation @ case.strain_operator.T)[:, None] + draws
    error = strain @ (case.loads @ prior.factor @ solved.strain_gain).T - (deviation @ case.loads.T)[:, None]
    assert np.all((np.abs(error) < 3.0 * std).mean(axis=(0, 1)) >= 0.99)


def test_case_2_covariance_stays_positive_where_gamma_is_small(case: Case, prior: LowRankPrior) -> None:
    """gamma = 1e-6: symmetric and positive definite."""
    noise = noise_model(case, 0, with_truncated=False)
    covariance = load_covariance_by_terms(gaussian(case, prior, 1e-6), case.loads @ prior.factor, noise)
    np.testing.assert_array_equal(covariance, covariance.T)
    scale = np.sqrt(np.diag(covariance))
    assert np.linalg.eigvalsh(covariance / np.outer(scale, scale)).min() > 0.0
