"""Maps in form "dynamic_pressure" against the Gauss-Markov estimate with every covariance formed at that
pressure."""

from dataclasses import replace

import numpy as np
import pytest
from scaled_maps import scaled_map

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import InverseMap

pytestmark = pytest.mark.fast

NOMINAL = 130e3
LOST = ((), (3,), (0, 5, 7), (1, 2, 3, 4, 5, 6))


def reference(
    inverse_map: InverseMap, strain: FloatArray, q: float, used: BoolArray
) -> tuple[FloatArray, FloatArray, float, FloatArray]:
    """Return loads, their covariance, chi-square and z by the book, in extended precision where numpy has it.

    A free state is one with a prior of 1e10 standard deviations of its kind.
    """
    s = q / inverse_map.nominal_dynamic_pressure
    free = inverse_map.case == 1
    a, n = s * inverse_map.state_operator[used], s * inverse_map.error_strain[used]
    own = inverse_map.gauge_covariance[np.ix_(used, used)]
    gamma = own + n @ n.T
    fixed = inverse_map.fixed_strain
    f0 = inverse_map.fixed_load
    r = (strain - fixed - s * (inverse_map.mean_strain - fixed))[used]
    weight = np.linalg.inv(gamma)
    information = a.T @ weight @ a + (0.0 if free else np.eye(a.shape[1]))
    t = np.linalg.solve(information, a.T @ weight)
    m, m_n = s * inverse_map.load_per_state, s * inverse_map.error_load
    of_error = m_n @ n.T @ weight
    gain = m @ t + of_error @ (np.eye(len(r)) - a @ t)
    loads = f0 + s * (inverse_map.load_of_mean - f0) + gain @ r
    of_noise = gain @ n - m_n
    of_states = m - gain @ a
    covariance = gain @ own @ gain.T + of_noise @ of_noise.T + (0.0 if free else 1.0) * of_states @ of_states.T
    precision = weight - weight @ a @ t if free else np.linalg.inv(gamma + a @ a.T)
    z = precision @ r / np.sqrt(np.diag(precision))
    return loads, covariance, float(r @ precision @ r), z


@pytest.mark.parametrize("case", [1, 2])
def test_own_errors_are_columns_of_one_gauge_each(case: int) -> None:
    """One number a gauge gives what n columns give, with gauges lost too, to 1e-9 standard deviations."""
    plain, random = scaled_map(case, seed=case), np.random.default_rng(case)
    n = plain.n_gauges
    own = 2e-6 * random.uniform(0.0, 1.0, n)
    columns = replace(
        plain,
        error_strain=np.hstack([plain.error_strain, np.diag(own)]),
        error_load=np.pad(plain.error_load, ((0, 0), (0, n))),
    )
    q = NOMINAL * random.uniform(0.1, 5.0, 40)
    strain = (q / NOMINAL)[:, None] * (plain.mean_strain + 1e-5 * random.standard_normal((40, n)))
    strain[20:, :5] = np.nan
    found, expected = (
        Estimator(one).estimate(strain, q, with_residuals=True)
        for one in (replace(plain, own_error_strain=own), columns)
    )
    np.testing.assert_allclose(found.loads, expected.loads, rtol=0.0, atol=1e-9 * expected.loads_std.min())
    np.testing.assert_allclose(found.loads_std, expected.loads_std, rtol=1e-9)
    np.testing.assert_allclose(found.chi_square, expected.chi_square, rtol=1e-9)
    np.testing.assert_allclose(found.standardised_residual, expected.standardised_residual, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("case", [1, 2])
@pytest.mark.parametrize("lost", LOST)
@pytest.mark.parametrize("ratio", [0.1, 0.7, 1.0, 5.0, 25.0])
def test_any_pressure_and_any_gauges_lost_agree_with_the_book(
    case: int, lost: tuple[int, ...], ratio: float
) -> None:
    inverse_map = scaled_map(case, seed=case)
    q, used = ratio * NOMINAL, np.ones(inverse_map.n_gauges, dtype=bool)
    used[list(lost)] = False
    rng = np.random.default_rng(7)
    strain = ratio * inverse_map.mean_strain + 5e-6 * rng.standard_normal(inverse_map.n_gauges)
    estimate = Estimator(inverse_map).estimate(strain, q, valid=used, dynamic_pressure_std=0.0)
    loads, covariance, chi_square, z = reference(inverse_map, strain, q, used)
    sigma = np.sqrt(np.diag(covariance))
    np.testing.assert_allclose(estimate.loads / sigma, loads / sigma, rtol=0.0, atol=1e-8)
    np.testing.assert_allclose(
        estimate.load_covariance / np.outer(sigma, sigma), covariance / np.outer(sigma, sigma), atol=1e-8
    )
    assert estimate.chi_square == pytest.approx(chi_square, rel=1e-9)
    np.testing.assert_allclose(estimate.standardised_residual[used], z, atol=1e-8)
    assert np.all(estimate.standardised_residual[~used] == 0.0)


@pytest.mark.parametrize("case", [1, 2])
def test_at_the_nominal_pressure_it_is_the_absolute_map(case: int) -> None:
    inverse_map = scaled_map(case, seed=4)
    absolute = replace(inverse_map, form="absolute")
    strain = inverse_map.mean_strain + 4e-6 * np.random.default_rng(2).standard_normal((40, inverse_map.n_gauges))
    valid = np.ones(strain.shape, dtype=bool)
    valid[10:20, 4] = valid[15:30, 8] = False
    one, other = (
        Estimator(found).estimate(strain, NOMINAL, valid=valid, dynamic_pressure_std=0.0)
        for found in (inverse_map, absolute)
    )
    np.testing.assert_allclose(one.loads, other.loads, rtol=1e-9)
    np.testing.assert_allclose(one.load_covariance, other.load_covariance, rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(one.chi_square, other.chi_square, rtol=1e-9)
    np.testing.assert_allclose(one.standardised_residual, other.standardised_residual, atol=1e-9)
    np.testing.assert_array_equal(one.health, other.health)


def test_without_a_dynamic_pressure_nothing_is_known() -> None:
    inverse_map = scaled_map(1, seed=1)
    for q in (np.nan, 0.0, -1.0, 9e9, np.inf):
        estimate = Estimator(inverse_map).step(inverse_map.mean_strain, q)
        assert estimate.health == HealthState.NO_COEFFICIENTS
        assert np.all(np.isnan(estimate.loads))
        assert np.all(np.isnan(estimate.coefficients))
        assert estimate.suspects == ()
