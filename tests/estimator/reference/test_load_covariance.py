"""The covariance of loads in sums of positive terms against the difference it stands for, and against draws."""

from dataclasses import replace

import numpy as np
import pytest
from random_map import GaussianModel, map_of, missing, random_model

from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.reference.gain import load_covariance, nominal, state_model
from strainfmu.estimator.reference.linear import models
from strainfmu.estimator.reference.update import Model, joseph, model_of

pytestmark = pytest.mark.fast

N_GAUGES = 27


def truth(model: GaussianModel) -> Model:
    """The model of states and errors, these as columns of strain and load."""
    return models(map_of(model))[1]


def correlated(model: GaussianModel) -> Model:
    """The same with the errors as noise of strain and load, which are correlated."""
    prior = {"columns": model.a, "output_columns": model.load_per_state}
    noise = {"noise": model.noise_covariance, "output_noise": model.load_noise_covariance}
    cross = model.strain_load_covariance
    return model_of(N_GAUGES, 5, **noise, cross=cross, **(prior if model.gamma > 0.0 else {}))


def by(errors: Model, gain: np.ndarray) -> np.ndarray:
    """(5, 5) covariance of the loads by ``gain`` (5, n_d)."""
    return joseph(errors, gain[None], np.ones(1))[0]


def gain_of(model: GaussianModel) -> np.ndarray:
    """(5, n_d) G of the function under test."""
    loads = model.load_per_state, model.strain_load_covariance
    return nominal(state_model(model.a, model.noise_covariance, model.gamma, *loads)).gain


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
    errors, best = truth(model), gain_of(model)
    stated = by(errors, best)
    size = np.sqrt(np.diag(stated))
    whitening = np.linalg.inv(np.linalg.cholesky(model.noise_covariance))
    blind = np.eye(N_GAUGES)
    if gamma == 0.0:
        q = np.linalg.qr(whitening @ model.a)[0]
        blind -= q @ q.T
    for _ in range(20):
        other = best + 0.3 * size[:, None] * random.normal(size=(5, N_GAUGES)) @ blind @ whitening
        growth = (by(errors, other) - stated) / np.outer(size, size)
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
    found = Estimator(map_of(model)).estimate(strain, 1.2e5, valid=keep)

    def rms(of: np.ndarray) -> np.ndarray:
        return np.asarray(np.sqrt(np.mean((of - loads) ** 2, axis=0)) / found.loads_std[0])

    def estimated(gain: np.ndarray) -> np.ndarray:
        return np.asarray((strain - model.m)[:, keep] @ gain.T + model.load_of_mean)

    np.testing.assert_allclose(rms(found.loads), 1.0, atol=0.05)
    assert np.all(rms(estimated(of_states)) > 1.05)
    assert np.all(rms(estimated(of_states + of_residual)) > 1.05)


@pytest.mark.parametrize("gamma", [0.0, 1.0, 10.0])
def test_no_part_of_the_covariance_is_idle(gamma: float) -> None:
    """Noise, its correlation with load outside the states, that load, prior: each changes all sigmas."""
    model = random_model(gamma)
    errors, gain = correlated(model), gain_of(model)
    stated = np.diag(by(errors, gain))
    without = [
        replace(errors, noise=1.01 * errors.noise),
        replace(errors, cross=0.0 * errors.cross),
        replace(errors, output_noise=0.0 * errors.output_noise),
    ]
    if gamma > 0.0:
        without.append(replace(errors, columns=errors.columns[:, :0], output_columns=errors.output_columns[:, :0]))
    for changed in without:
        difference = np.diag(by(changed, gain)) - stated
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
    for errors in (truth(model), correlated(model)):
        found = by(errors, model.load_gain())
        np.testing.assert_allclose(found, model.load_covariance(), rtol=0.0, atol=1e-12 * np.abs(found).max())


@pytest.mark.parametrize("gamma", [1.0, 10.0])
def test_any_gain_has_the_covariance_of_draws(gamma: float) -> None:
    """A gain 20 % off the best one, 20,000 draws: e' C^-1 e has mean 5 to 3 errors."""
    model, n = random_model(gamma), 20_000
    gain = 0.8 * model.load_gain()
    covariance = by(truth(model), gain)
    strain, loads = model.draw(n, 3)
    errors = (strain - model.m) @ gain.T + model.load_of_mean - loads
    distance = np.sum(errors * np.linalg.solve(covariance, errors.T).T, axis=1)
    assert distance.mean() == pytest.approx(5.0, abs=3.0 * np.sqrt(10.0 / n))


def test_a_variance_stays_positive_where_the_difference_would_not() -> None:
    """Load that follows its strain to 1e-9 of its size: the difference of the two variances is round-off."""
    random = np.random.default_rng(1)
    of_strain = random.normal(size=(5, 27)) * 1e9
    strain = 1e-6 * random.normal(size=(27, 27))
    load = np.hstack([of_strain @ strain, 1e-6 * np.eye(5)])
    columns = np.hstack([strain, np.zeros((27, 5))])
    errors = model_of(N_GAUGES, 5, noise=1e-24 * np.eye(27), columns=columns, output_columns=load)
    assert np.all(np.diag(by(errors, of_strain)) > 0.0)


@pytest.mark.parametrize("gamma", [0.0, 1.0])
def test_load_without_strain_adds_all_of_its_variance(gamma: float) -> None:
    model = random_model(gamma, full=False)
    whole = map_of(model)
    without = load_covariance(replace(whole, error_load=0.0 * whole.error_load))
    np.testing.assert_allclose(
        load_covariance(whole) - without, model.load_noise_covariance, rtol=0.0, atol=1e-12 * np.abs(without).max()
    )
