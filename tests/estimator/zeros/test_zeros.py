"""Zeros of the gauges: taken off the readings, their errors in the covariance, in both kinds of estimator."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from flight_maps import NOISE_STD, exact_response, flight_map
from random_map import GaussianModel, map_of, random_model
from scaled_maps import NOMINAL, scaled_map, whole_scaled_map

from strainfmu.errors import InputError
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.gauge_zeros import GaugeZeros, no_zeros
from strainfmu.estimator.map.inverse_map import InverseMap

pytestmark = pytest.mark.fast

Q = 1.2e5


def zeros_of(n: int, seed: int = 1, size: float = 1e-6) -> GaugeZeros:
    """Zeros of 200 um/m, known to about ``size``."""
    random = np.random.default_rng(seed)
    std = size * random.uniform(0.0, 2.0, n)
    return GaugeZeros(value=2e-4 * random.normal(size=n), std=std, common_std=size)


@pytest.mark.parametrize("gamma", [0.0, 1.0, 1e-3])
def test_absolute_map_is_that_of_the_larger_noise(gamma: float) -> None:
    """By the book: the same vehicle whose gauges have the errors of the zeros besides."""
    model = random_model(gamma=gamma, n_gauges=14, n_states=3)
    zeros = zeros_of(14)
    larger: GaussianModel = replace(model, noise_covariance=model.noise_covariance + zeros.covariance)
    ours, theirs = Estimator(map_of(model)).with_zeros(zeros), Estimator(map_of(larger))
    strain = model.draw(20, seed=3)[0]
    for valid in (np.ones(14, dtype=bool), np.arange(14) != 5):
        a = ours.estimate(strain + zeros.value, Q, valid=valid)
        b = theirs.estimate(strain, Q, valid=valid)
        np.testing.assert_allclose(a.loads, b.loads, rtol=1e-9)
        np.testing.assert_allclose(a.load_covariance, b.load_covariance, rtol=1e-7, atol=1e-9)
        np.testing.assert_allclose(a.chi_square, b.chi_square, rtol=1e-8)
        np.testing.assert_allclose(a.standardised_residual, b.standardised_residual, rtol=1e-6, atol=1e-8)


@pytest.mark.parametrize("case", [1, 2])
def test_scaled_map_is_that_of_the_larger_noise(case: int) -> None:
    plain = scaled_map(case, seed=4)
    zeros = zeros_of(18)
    # The last two columns of errors that do not scale, at two pressures: only gauge noise of that size has them.
    ours = Estimator(plain).with_zeros(zeros)
    own, error, load = plain.gauge_covariance, plain.error_strain, plain.error_load
    for q in (0.3 * NOMINAL, NOMINAL, 4.0 * NOMINAL):
        s = q / NOMINAL
        a, n = s * plain.state_operator, s * error
        gamma = own + zeros.covariance + n @ n.T
        weight = np.linalg.inv(gamma)
        prior = np.zeros((4, 4)) if case == 1 else np.eye(4)
        t = np.linalg.solve(a.T @ weight @ a + prior, a.T @ weight)
        m, m_n = s * plain.load_per_state, s * load
        gain = m @ t + m_n @ n.T @ weight @ (np.eye(18) - a @ t)
        of_noise, of_states = gain @ n - m_n, (m - gain @ a) * float(case == 2)
        covariance = gain @ (own + zeros.covariance) @ gain.T + of_noise @ of_noise.T + of_states @ of_states.T
        strain = s * plain.mean_strain + 1e-5 * np.random.default_rng(5).normal(size=18)
        found = ours.step(strain + zeros.value, q)
        expected = s * plain.load_of_mean + gain @ (strain - s * plain.mean_strain)
        np.testing.assert_allclose(found.loads, expected, rtol=1e-8)
        np.testing.assert_allclose(found.load_covariance, covariance, rtol=1e-6, atol=1e-8)


@cache
def flights() -> InverseMap:
    return replace(scaled_map(2, 1, 48), manifold=flight_map(discrepancy=1e-2))


def test_nonlinear_estimator_takes_them_off_and_counts_their_errors() -> None:
    """Of strain without noise but for drawn zeros: 3 sigma hold them, and without them they do not."""
    estimator, random = Estimator(flights()), np.random.default_rng(7)
    std, k = 2e-6, 24
    draws = std * random.normal(size=(k, 48)) + 1e-6 * random.normal(size=(k, 1))
    zeros = GaugeZeros(value=1e-4 * random.normal(size=48), std=np.full(48, std), common_std=1e-6)
    truth = exact_response(6.0, 0.05, 0.03, 6e3)
    flow = {"mach_number": 6.0, "static_pressure": 6e3}
    reading = truth[:48] + draws + NOISE_STD * random.normal(size=(k, 48)) + zeros.value
    found = estimator.with_zeros(zeros).estimate(reading, **flow)
    apart = (found.loads - truth[48:]) / found.loads_std
    assert np.mean(np.abs(apart) < 3.0) > 0.98
    assert 0.4 < np.sqrt(np.mean(apart**2)) < 1.3
    assert np.mean(found.chi_square) < found.chi_square_limit[0]
    exactly = estimator.with_zeros(replace(zeros, std=np.zeros(48), common_std=0.0)).estimate(reading, **flow)
    assert np.mean(exactly.chi_square > exactly.chi_square_limit) > 0.9


@pytest.mark.parametrize("is_nonlinear", [False, True])
def test_zeros_of_nothing_change_no_bit(is_nonlinear: bool) -> None:
    held = flights() if is_nonlinear else flights().without_tables()
    strain = exact_response(6.0, 0.05, 0.03, 6e3)[:48]
    q = 0.7 * 36.0 * 6e3
    plain, same = Estimator(held), Estimator(held).with_zeros(zeros_of(48)).with_zeros(no_zeros(48))
    assert plain.is_nonlinear == is_nonlinear
    assert np.array_equal(plain.estimate(strain, q).loads, same.estimate(strain, q).loads)
    assert same.inverse_map is held


def test_the_range_of_a_sensor_is_that_of_its_reading() -> None:
    held = whole_scaled_map(1, seed=3)
    zeros = replace(no_zeros(18), value=np.full(18, 0.02))
    estimator = Estimator(held).with_zeros(zeros)
    reading = held.mean_strain + 0.02
    reading[4] = 0.051
    assert estimator.step(reading, NOMINAL).valid.tolist() == [i != 4 for i in range(18)]


def test_settings_and_zeros_keep_each_other() -> None:
    estimator = Estimator(flights(), zeros=replace(no_zeros(48), value=np.full(48, 1e-4)))
    other = estimator.with_settings(replace(estimator.settings, alarm_scale=4.0))
    assert other.zeros is estimator.zeros
    assert other.linear.zeros is estimator.zeros
    assert other.linear.settings == other.settings
    assert other.with_zeros(no_zeros(48)).settings.alarm_scale == 4.0


def test_filter_takes_them_off_too() -> None:
    held = scaled_map(2, seed=4)
    zeros, strain = zeros_of(18), held.mean_strain
    ours = Estimator(held).with_zeros(zeros).filter(1.0)
    theirs = Estimator(held).with_zeros(replace(zeros, value=np.zeros(18))).filter(1.0)
    time = 0.01 * np.arange(4)
    a = ours.track(np.tile(strain + zeros.value, (4, 1)), NOMINAL, time=time)
    b = theirs.track(np.tile(strain, (4, 1)), NOMINAL, time=time)
    np.testing.assert_allclose(a.loads, b.loads, rtol=1e-9)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"value": np.array([0.0, np.nan])}, "zero: expected -0.05 to 0.05 m/m, got nan"),
        ({"std": np.array([0.0, -1e-6])}, "zero_std: expected 0 to 0.05 m/m, got -1e-06"),
        ({"common_std": 0.1}, "zero_common_std: expected 0 to 0.05 m/m, got 0.1"),
        ({"std": np.zeros(3)}, r"zeros: expected value and std of shape \(n_d,\), got \(2,\) and \(3,\)"),
    ],
)
def test_bad_zeros_are_refused(change: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        replace(no_zeros(2), **change)


def test_zeros_of_another_number_of_gauges_are_refused() -> None:
    with pytest.raises(InputError, match="zeros: expected 18 values, got 17"):
        Estimator(scaled_map(1, seed=1)).with_zeros(no_zeros(17))
