"""One step of the estimator: the stated formulas, and what it says when an input is missing."""

from __future__ import annotations

import numpy as np
import pytest
from runtime_map import N_GAUGES, random_map

from strainfmu.errors import InputError
from strainfmu.estimator import Estimator, LoadEstimate
from strainfmu.health import HealthState

Q = 1.2e5


def test_step_is_the_stated_formula() -> None:
    """f = (G C V)(T d + k) + G C p_mean; coefficients over q S and q S L; written out here, to 1e-10."""
    inverse_map = random_map()
    strain = inverse_map.mean_strain + 1e-7 * np.random.default_rng(3).normal(size=N_GAUGES)
    found = Estimator(inverse_map).estimate(strain, Q)
    state = inverse_map.strain_gain @ strain + inverse_map.state_offset
    loads = inverse_map.load_per_state @ state + inverse_map.load_of_mean
    scale = np.array([Q * 0.2] * 3 + [Q * 0.2 * 0.5] * 2)
    std = np.sqrt(np.diag(inverse_map.load_covariance))
    np.testing.assert_allclose(found.loads, loads, rtol=0.0, atol=1e-10 * np.abs(loads).max())
    np.testing.assert_allclose(found.coefficients, found.loads / scale, rtol=1e-14)
    np.testing.assert_allclose(found.loads_std, std, rtol=1e-14)
    np.testing.assert_allclose(found.coefficients_std, std / scale, rtol=1e-14)
    residual = inverse_map.residual_whitening @ (strain - inverse_map.mean_strain)
    assert found.chi_square == pytest.approx(float(np.sum(residual**2)), rel=1e-12)
    assert found.health is HealthState.OK


def test_strain_of_the_mean_gives_the_loads_of_the_mean() -> None:
    inverse_map = random_map()
    found = Estimator(inverse_map).estimate(inverse_map.mean_strain, Q)
    scale = np.abs(inverse_map.load_of_mean).max()
    np.testing.assert_allclose(found.loads, inverse_map.load_of_mean, rtol=0.0, atol=1e-8 * scale)
    assert found.chi_square == 0.0


def test_gauge_that_is_off_raises_the_alarm() -> None:
    """50 sigma on one gauge is beyond the level; the level itself is still in order."""
    inverse_map = random_map()
    estimator = Estimator(inverse_map)
    strain = inverse_map.mean_strain.copy()
    strain[2] += 50.0 * inverse_map.noise_std[2]
    off = estimator.estimate(strain, Q)
    assert off.health is HealthState.INCONSISTENT
    assert np.all(np.isfinite(off.coefficients))
    share = estimator.chi_square_limit / off.chi_square
    for factor, health in ((0.999, HealthState.OK), (1.001, HealthState.INCONSISTENT)):
        step = factor * np.sqrt(share) * (strain - inverse_map.mean_strain)
        assert estimator.estimate(inverse_map.mean_strain + step, Q).health is health


def test_false_alarms_are_as_rare_as_stated() -> None:
    """20,000 noisy strains at 1e-4: 2 expected, 10 or more has probability 5e-5; their mean is n_d - r."""
    inverse_map = random_map()
    estimator = Estimator(inverse_map)
    noise = np.random.default_rng(7).normal(size=(20_000, N_GAUGES)) * inverse_map.noise_std
    chi_square = np.sum((noise @ inverse_map.residual_whitening.T) ** 2, axis=1)
    assert np.sum(chi_square > estimator.chi_square_limit) < 10
    assert chi_square.mean() == pytest.approx(5.0, abs=3.0 * np.sqrt(10.0 / 20_000))


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_strain_that_is_not_finite_is_invalid(bad: float) -> None:
    inverse_map = random_map()
    strain = inverse_map.mean_strain.copy()
    strain[3] = bad
    found = Estimator(inverse_map).estimate(strain, Q)
    assert found.health is HealthState.INVALID
    for values in (found.loads, found.loads_std, found.coefficients, found.coefficients_std, found.chi_square):
        assert np.all(np.isnan(values))


@pytest.mark.parametrize("dynamic_pressure", [0.0, -1.0, np.nan, np.inf])
def test_loads_do_not_need_dynamic_pressure(dynamic_pressure: float) -> None:
    inverse_map = random_map()
    estimator = Estimator(inverse_map)
    found = estimator.estimate(inverse_map.mean_strain, dynamic_pressure)
    assert found.health is HealthState.NO_COEFFICIENTS
    np.testing.assert_array_equal(found.loads, estimator.estimate(inverse_map.mean_strain, Q).loads)
    assert np.all(np.isfinite(found.loads_std))
    assert np.all(np.isnan(found.coefficients))
    assert np.all(np.isnan(found.coefficients_std))
    assert np.isfinite(found.chi_square)


@pytest.mark.parametrize("shape", [(7,), (9,), (8, 1), ()])
def test_strain_of_the_wrong_shape_is_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(InputError, match="8 values wanted"):
        Estimator(random_map()).estimate(np.zeros(shape), Q)


def test_lists_and_single_precision_are_taken() -> None:
    inverse_map = random_map()
    estimator = Estimator(inverse_map)
    exact = estimator.estimate(inverse_map.mean_strain, Q)
    as_list = estimator.estimate(inverse_map.mean_strain.tolist(), Q)
    assert isinstance(as_list, LoadEstimate)
    np.testing.assert_array_equal(as_list.loads, exact.loads)


def test_repeat_is_bit_identical_and_leaves_the_strain_alone() -> None:
    inverse_map = random_map()
    estimator = Estimator(inverse_map)
    strain = inverse_map.mean_strain + 1e-6
    before = strain.copy()
    first, second = estimator.estimate(strain, Q), estimator.estimate(strain, Q)
    np.testing.assert_array_equal(first.coefficients, second.coefficients)
    np.testing.assert_array_equal(strain, before)


def test_a_standard_deviation_handed_out_cannot_be_changed() -> None:
    estimator = Estimator(random_map())
    estimate = estimator.estimate(np.zeros(estimator.inverse_map.n_gauges), 9e4)
    with pytest.raises(ValueError, match="read-only"):
        estimate.loads_std[0] = 0.0


@pytest.mark.parametrize(
    ("strain", "pressure", "health"),
    [(1e308, 9e4, HealthState.INVALID), (0.0, 5e-324, HealthState.NO_COEFFICIENTS)],
)
def test_overflow_is_never_a_silent_number(strain: float, pressure: float, health: HealthState) -> None:
    estimator = Estimator(random_map())
    estimate = estimator.estimate(np.full(estimator.inverse_map.n_gauges, strain), pressure)
    assert estimate.health is health
    assert np.all(np.isnan(estimate.coefficients))
