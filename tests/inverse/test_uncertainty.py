"""The stated covariance against draws, and against flights that are not among the snapshots.

Data and map share one discretisation here: these are tests of the statistics, not of the model's accuracy.
"""

from __future__ import annotations

import numpy as np
from inverse_case import Case

from builder.inversion import least_squares_map
from builder.snapshots import Snapshots
from builder.uncertainty import load_covariance

N_MODES = 5
N_DRAWS = 20_000


def load_errors(case: Case, gain: np.ndarray, held_out: Snapshots, repeats: int = 100) -> np.ndarray:
    """(conditions, repeats, 5) error of the loads over held-out flights with fresh gauge noise."""
    net = held_out.pressure - case.internal_pressure
    mean = case.modes.mean - case.internal_pressure
    noise = np.random.default_rng(8).normal(size=(len(net), repeats, len(case.noise_std))) * case.noise_std
    strain = ((net - mean) @ case.strain_operator.T)[:, None] + noise
    estimate = strain @ gain.T @ (case.loads @ case.modes.modes[:, :N_MODES]).T
    return estimate - ((net - mean) @ case.loads.T)[:, None]


def test_three_sigma_cover_flights_never_seen(case: Case, held_out: Snapshots) -> None:
    """At least 99 % of each load, nominal 99.7 %; and not because sigma is far too wide."""
    solved = least_squares_map(case.strain_operator, case.modes, N_MODES, case.noise_std, case.internal_pressure)
    std = np.sqrt(np.diag(load_covariance(solved, case.modes, case.loads, case.noise_std)))
    errors = load_errors(case, solved.strain_gain, held_out)
    assert np.all((np.abs(errors) < 3.0 * std).mean(axis=(0, 1)) >= 0.99)
    assert np.all(np.sqrt((errors**2).mean(axis=(0, 1))) > 0.3 * std)


def test_gauge_noise_alone_does_not_cover(case: Case, held_out: Snapshots) -> None:
    """The paper's bound, (Z' C^-1 Z)^-1 of gauge noise: truncated modes alias, 3 sigma holds less than 70 %."""
    z = case.strain_operator @ case.modes.modes[:, :N_MODES]
    gain = np.linalg.pinv(z)
    of_load = case.loads @ case.modes.modes[:, :N_MODES] @ gain * case.noise_std
    std = np.linalg.norm(of_load, axis=1)
    errors = load_errors(case, gain, held_out)
    assert np.all((np.abs(errors) < 3.0 * std).mean(axis=(0, 1)) < 0.70)


def test_covariance_is_that_of_draws(case: Case) -> None:
    """20,000 draws: 1 sigma holds 68.3 +- 1.5 % (4.5 errors), both chi-squares their means to 3 errors."""
    solved = least_squares_map(case.strain_operator, case.modes, N_MODES, case.noise_std, case.internal_pressure)
    covariance = load_covariance(solved, case.modes, case.loads, case.noise_std)
    random = np.random.default_rng(9)
    spread = case.modes.coefficient_std()
    states = random.normal(size=(N_DRAWS, len(spread))) * spread
    noise = random.normal(size=(N_DRAWS, len(case.noise_std))) * case.noise_std
    strain = states @ (case.strain_operator @ case.modes.modes).T + noise
    of_modes = case.loads @ case.modes.modes
    errors = strain @ solved.strain_gain.T @ of_modes[:, :N_MODES].T - states @ of_modes.T
    inside = (np.abs(errors) < np.sqrt(np.diag(covariance))).mean(axis=0)
    np.testing.assert_allclose(inside, 0.683, atol=0.015)

    distance = np.sum(errors * np.linalg.solve(covariance, errors.T).T, axis=1)
    assert abs(distance.mean() - 5.0) < 3.0 * np.sqrt(2.0 * 5.0 / N_DRAWS)
    residual = strain @ solved.residual_whitening.T
    freedom = len(case.noise_std) - N_MODES
    assert abs((residual**2).sum(axis=1).mean() - freedom) < 3.0 * np.sqrt(2.0 * freedom / N_DRAWS)


def test_covariance_is_symmetric_and_positive(case: Case) -> None:
    solved = least_squares_map(case.strain_operator, case.modes, N_MODES, case.noise_std, case.internal_pressure)
    covariance = load_covariance(solved, case.modes, case.loads, case.noise_std)
    np.testing.assert_allclose(covariance, covariance.T, rtol=1e-12)
    scale = np.sqrt(np.diag(covariance))
    assert np.linalg.eigvalsh(covariance / np.outer(scale, scale)).min() > 1e-8


def test_noise_enters_squared_where_nothing_is_truncated(case: Case) -> None:
    """With every mode of three kept, ten times the noise makes a hundred times the covariance."""
    three = type(case.modes)(
        case.modes.mean, case.modes.modes[:, :3], case.modes.singular_values[:3], case.modes.n_snapshots
    )
    found = []
    for noise_std in (case.noise_std, 10.0 * case.noise_std):
        solved = least_squares_map(case.strain_operator, three, 3, noise_std, case.internal_pressure)
        found.append(load_covariance(solved, three, case.loads, noise_std))
    np.testing.assert_allclose(found[1], 100.0 * found[0], rtol=1e-9, atol=1e-9 * np.abs(found[1]).max())
