"""Gain and precision against the formulas by the book, and where the book loses its digits."""

from fractions import Fraction

import numpy as np
import pytest
from random_map import random_model

from strainfmu.arrays import inverse_root
from strainfmu.estimator.reference.gain import nominal, state_model
from strainfmu.estimator.reference.update import condition, prepare

pytestmark = pytest.mark.fast


@pytest.mark.parametrize("gamma", [0.0, 0.5, 1.0, 20.0])
def test_gain_solves_the_normal_equations(gamma: float) -> None:
    """To 1e-9 of the largest entry per state."""
    model = random_model(gamma)
    found = nominal(state_model(model.a, model.noise_covariance, gamma)).gain
    expected = model.gain()
    size = np.abs(expected).max(axis=1, keepdims=True)
    np.testing.assert_allclose(found / size, expected / size, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("n_states", [5, 27, 60])
def test_precision_with_a_prior_inverts_the_covariance(n_states: int) -> None:
    """R' P R = I to 1e-8 for A A' / gamma + Gamma = R R', with fewer, as many and more states than gauges."""
    model = random_model(1.0, n_states=n_states)
    for gamma in (1.0, 10.0):
        precision = nominal(state_model(model.a, model.noise_covariance, gamma)).precision
        root = np.linalg.cholesky(model.noise_covariance + model.a @ model.a.T / gamma)
        np.testing.assert_allclose(root.T @ precision @ root, np.eye(27), rtol=0.0, atol=1e-8)


def test_precision_without_a_prior_is_a_projection_blind_to_the_states() -> None:
    """L' P L is idempotent of trace n_d - n_q and L' P A = 0, to 1e-10 of their terms."""
    model = random_model()
    precision = nominal(state_model(model.a, model.noise_covariance, 0.0)).precision
    root = np.linalg.cholesky(model.noise_covariance)
    projection = root.T @ precision @ root
    np.testing.assert_allclose(projection @ projection, projection, atol=1e-10)
    assert np.trace(projection) == pytest.approx(22.0, rel=1e-12)
    of_states = np.abs(inverse_root(model.noise_covariance) @ model.a).max()
    assert np.abs(root.T @ precision @ model.a).max() < 1e-10 * of_states


def test_chi_square_keeps_its_digits_at_small_gamma() -> None:
    """One state of 1e6 sigma, gamma 1e-6: chi-square of a is |a|^2 / (1 + |a|^2 / gamma) exactly, to 1e-9."""
    a = np.array([[3e5], [-4e5], [1.2e6]])
    prepared = prepare(state_model(a, np.eye(3), 1e-6), np.ones(3, dtype=bool))
    square = Fraction(9 * 10**10 + 16 * 10**10 + 144 * 10**10)
    exact = square / (1 + square * 10**6)
    assert condition(prepared, a.T, np.ones(1)).chi_square[0] == pytest.approx(float(exact), rel=1e-9)


def test_gauges_of_very_unlike_noise_keep_their_digits() -> None:
    """1e-9 to 1 in one covariance: L^-1 Gamma L'^-1 = I to 1e-12."""
    std = np.geomspace(1e-9, 1.0, 6)
    correlation = 0.3 + 0.7 * np.eye(6)
    covariance = correlation * np.outer(std, std)
    w = inverse_root(covariance)
    np.testing.assert_allclose(w @ covariance @ w.T, np.eye(6), atol=1e-12)
