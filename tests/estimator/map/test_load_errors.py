"""The covariance of loads in sums of positive terms against the difference it stands for, and against draws."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from random_map import GaussianModel, map_of, missing, random_model

from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.innovation import inverse_cholesky
from strainfmu.estimator.map.load_errors import LoadErrorModel, load_error_covariance, load_error_model, load_gain

pytestmark = pytest.mark.fast

N_GAUGES = 27


def error_model(model: GaussianModel) -> LoadErrorModel:
    own, error_strain, error_load = model.columns()
    return load_error_model(
        gauge_covariance=own,
        error_strain=error_strain,
        error_load=error_load,
        state_operator=model.a,
        load_per_state=model.load_per_state,
        known_prior=model.gamma > 0.0,
    )


def gain_of(model: GaussianModel) -> np.ndarray:
    """(5, n_d) G of the function under test."""
    return load_gain(
        load_per_state=model.load_per_state,
        strain_gain=model.gain(),
        state_operator=model.a,
        noise_whitening=inverse_cholesky(model.noise_covariance),
        strain_load_covariance=model.strain_load_covariance,
    )


def assert_equal_to(expected: np.ndarray, found: np.ndarray, tolerance: float) -> None:
    """Equal to ``tolerance`` of the largest entry per load."""
    size = np.abs(expected).max(axis=1, keepdims=True)
    np.testing.assert_allclose(found / size, expected / size, rtol=0.0, atol=tolerance)


@pytest.mark.parametrize("gamma", [0.1, 1.0, 10.0])
def test_gain_is_the_conditional_mean_under_a_prior(gamma: float) -> None:
    """cov(f, d) cov(d)^-1 of the joint Gaussian with q ~ N(0, I / gamma) (Anderson 2003, theorem 2.5.1): 1e-8."""
    model = random_model(gamma)
    std = np.sqrt(np.diag(model.noise_covariance))
    covariance = model.noise_covariance + model.a @ model.a.T / gamma
    cross = model.load_per_state @ model.a.T / gamma + model.strain_load_covariance.T
    expected = np.linalg.solve(covariance / np.outer(std, std), (cross / std).T).T / std
    assert_equal_to(expected, gain_of(model), 1e-8)


def test_gain_is_universal_kriging_without_a_prior() -> None:
    """The least variance of G e - g under G A = M, by its Lagrange equations (Cressie 1993, 3.4.5): 1e-8."""
    model = random_model()
    std, size = np.sqrt(np.diag(model.noise_covariance)), np.linalg.norm(model.a, axis=0)
    a = model.a / std[:, None] / size
    equations = np.block([[model.noise_covariance / np.outer(std, std), a], [a.T, np.zeros((5, 5))]])
    wanted = np.vstack([model.strain_load_covariance / std[:, None], (model.load_per_state / size).T])
    expected = np.linalg.solve(equations, wanted)[:N_GAUGES].T / std
    assert_equal_to(expected, gain_of(model), 1e-8)


@pytest.mark.parametrize("gamma", [0.0, 1.0])
def test_no_other_gain_has_a_smaller_covariance(gamma: float) -> None:
    """20 other gains, in Case 1 unbiased ones: their covariance less the stated one is positive semi-definite."""
    model, random = random_model(gamma), np.random.default_rng(7)
    errors, best = error_model(model), gain_of(model)
    stated = load_error_covariance(errors, best)
    size = np.sqrt(np.diag(stated))
    whitening = np.linalg.inv(np.linalg.cholesky(model.noise_covariance))
    blind = np.eye(N_GAUGES)
    if gamma == 0.0:
        q = np.linalg.qr(whitening @ model.a)[0]
        blind -= q @ q.T
    for _ in range(20):
        other = best + 0.3 * size[:, None] * random.normal(size=(5, N_GAUGES)) @ blind @ whitening
        growth = (load_error_covariance(errors, other) - stated) / np.outer(size, size)
        assert np.linalg.eigvalsh(growth)[0] > -1e-9
        assert np.trace(growth) > 0.1


@pytest.mark.parametrize("gamma", [0.0, 1.0, 10.0**0.5])
@pytest.mark.parametrize("lost", [(), (4, 11, 20)])
def test_every_part_of_the_gain_is_needed(gamma: float, lost: tuple[int, ...]) -> None:
    """4,000 draws, gauges lost too: rms errors are the sigmas stated to 5 %, and larger without one of the parts.

    Parts: what the residual tells of load outside the states, and that the states' strain is taken off first.
    """
    model = random_model(gamma)
    strain, loads = model.draw(4000, 12)
    keep = ~missing(N_GAUGES, *lost)
    rest = model.without(~keep)
    of_residual = np.linalg.solve(rest.noise_covariance, rest.strain_load_covariance).T
    of_states = rest.load_per_state @ rest.gain()
    found = Estimator(map_of(model)).estimate(strain, 1.2e5, keep)

    def rms(estimated: np.ndarray) -> np.ndarray:
        return np.asarray(np.sqrt(np.mean((estimated - loads) ** 2, axis=0)) / found.loads_std[0])

    def by(gain: np.ndarray) -> np.ndarray:
        return np.asarray((strain - model.m)[:, keep] @ gain.T + model.load_of_mean)

    np.testing.assert_allclose(rms(found.loads), 1.0, atol=0.05)
    assert np.all(rms(by(of_states)) > 1.05)
    assert np.all(rms(by(of_states + of_residual)) > 1.05)


@pytest.mark.parametrize("gamma", [0.0, 1.0, 10.0])
def test_no_part_of_the_covariance_is_idle(gamma: float) -> None:
    """Noise, what it tells of load outside the states, the rest of that load, prior: each changes all sigmas."""
    model = random_model(gamma)
    errors, gain = error_model(model), gain_of(model)
    stated = np.diag(load_error_covariance(errors, gain))
    nothing = np.zeros_like
    without = [
        replace(errors, noise_root=nothing(errors.noise_root)),
        replace(errors, regression=nothing(errors.regression)),
        replace(errors, remainder=nothing(errors.remainder)),
    ]
    if gamma > 0.0:
        without.append(replace(errors, known_prior=False))
    for changed in without:
        difference = np.diag(load_error_covariance(changed, gain)) - stated
        assert np.all(np.abs(difference) > 1e-6 * stated)


@pytest.mark.parametrize("gamma", [0.0, 1.0])
def test_residual_statistics_do_not_know_of_loads(gamma: float) -> None:
    """With and without load outside the states: chi-square, z and suspects are equal to the last bit."""
    model = random_model(gamma)
    one = map_of(model)
    other = replace(one, error_load=0.0 * one.error_load)
    strain = model.draw(1, 13)[0][0]
    strain[6] += 3e-5
    found, expected = (Estimator(held).estimate(strain, 1.2e5) for held in (one, other))
    assert found.chi_square == expected.chi_square
    np.testing.assert_array_equal(found.standardised_residual, expected.standardised_residual)
    assert found.suspects == expected.suspects
    assert found.health is expected.health
    assert not np.allclose(found.loads, expected.loads, rtol=1e-6)


def test_without_weight_on_the_prior_the_residual_is_all_that_tells() -> None:
    """gamma -> infinity: states stay at their mean, and the gain goes to X' Gamma^-1; without X it goes to 0."""
    model = random_model(1e12)
    expected = np.linalg.solve(model.noise_covariance, model.strain_load_covariance).T
    assert_equal_to(expected, gain_of(model), 1e-4)
    alone = replace(model, strain_load_covariance=0.0 * model.strain_load_covariance)
    assert np.abs(gain_of(alone)).max() < 1e-4 * np.abs(expected).max()


@pytest.mark.parametrize("gamma", [0.0, 1.0, 10.0])
def test_covariance_of_the_own_gain_comes_back(gamma: float) -> None:
    model = random_model(gamma)
    found = load_error_covariance(error_model(model), model.load_gain())
    np.testing.assert_allclose(found, model.load_covariance(), rtol=0.0, atol=1e-12 * np.abs(found).max())


@pytest.mark.parametrize("gamma", [1.0, 10.0])
def test_any_gain_has_the_covariance_of_draws(gamma: float) -> None:
    """A gain 20 % off the best one, 20,000 draws: e' C^-1 e has mean 5 to 3 errors."""
    model, n = random_model(gamma), 20_000
    gain = 0.8 * model.load_gain()
    covariance = load_error_covariance(error_model(model), gain)
    strain, loads = model.draw(n, 3)
    errors = (strain - model.m) @ gain.T + model.load_of_mean - loads
    distance = np.sum(errors * np.linalg.solve(covariance, errors.T).T, axis=1)
    assert distance.mean() == pytest.approx(5.0, abs=3.0 * np.sqrt(10.0 / n))


def test_a_variance_stays_positive_where_the_difference_would_not() -> None:
    """Load that follows its strain to 1e-9 of its size: the difference of the two variances is round-off."""
    model, random = random_model(), np.random.default_rng(1)
    of_strain = random.normal(size=(5, 27)) * 1e9
    strain = 1e-6 * random.normal(size=(27, 27))
    load = np.hstack([of_strain @ strain, 1e-6 * np.eye(5)])
    found = load_error_model(
        gauge_covariance=1e-24 * np.eye(27),
        error_strain=np.hstack([strain, np.zeros((27, 5))]),
        error_load=load,
        state_operator=model.a,
        load_per_state=model.load_per_state,
        known_prior=True,
    )
    assert np.linalg.eigvalsh(found.remainder)[0] >= 0.0
    assert np.all(np.diag(load_error_covariance(found, of_strain)) > 0.0)


@pytest.mark.parametrize("gamma", [0.0, 1.0])
def test_load_without_strain_is_all_of_the_remainder(gamma: float) -> None:
    model = random_model(gamma, full=False)
    found = error_model(model)
    np.testing.assert_allclose(found.remainder, model.load_noise_covariance, rtol=0.0, atol=1e-15)
    np.testing.assert_array_equal(found.regression, 0.0)
