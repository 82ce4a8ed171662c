"""Linear maps over time: static limit, averages, lost samples, jumps, zero offsets, temperature."""

from dataclasses import replace

import numpy as np
import pytest
from scaled_maps import NOMINAL, scaled_map
from thermal_maps import REFERENCE, with_temperature

from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.gauge_zeros import GaugeZeros
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import InverseMap

pytestmark = pytest.mark.fast
DT = 0.01


def series(inverse_map: InverseMap, k: int, seed: int, time_constant: float) -> tuple[np.ndarray, np.ndarray]:
    """Return strains (k, n_d) and loads (k, 5) of the map's own model at its nominal dynamic pressure."""
    rng = np.random.default_rng(seed)
    own, errors, load_of_errors = inverse_map.gauge_covariance, inverse_map.error_strain, inverse_map.error_load
    strain = np.hstack([inverse_map.state_operator, errors])
    load = np.hstack([inverse_map.load_per_state, load_of_errors])
    decay = np.exp(-DT / time_constant)
    states = rng.standard_normal((k, strain.shape[1]))
    for i in range(1, k):
        states[i] = decay * states[i - 1] + np.sqrt(1.0 - decay**2) * states[i]
    noise = rng.standard_normal((k, len(own))) @ np.linalg.cholesky(own).T
    return inverse_map.mean_strain + states @ strain.T + noise, inverse_map.load_of_mean + states @ load.T


def fitted(case: int, seed: int) -> InverseMap:
    """Return a map whose noise is that of its gauges."""
    found = scaled_map(case, seed)
    own = found.gauge_covariance
    return replace(found, noise_std=np.sqrt(np.diagonal(own)))


@pytest.mark.parametrize("case", [1, 2])
@pytest.mark.parametrize("lost", [0, 3])
def test_without_memory_it_is_the_static_estimator(case: int, lost: int) -> None:
    estimator = Estimator(fitted(case, 1))
    strain, _ = series(estimator.inverse_map, 5, 2, 1.0)
    strain[:, :lost] = np.nan
    static = estimator.estimate(strain, 0.9 * NOMINAL)
    assert_equal(estimator.filter(1e-9).track(strain, 0.9 * NOMINAL, time=times(5)), static, 1e-9)


def times(k: int) -> np.ndarray:
    """Return the times (k,) of samples [s]."""
    return DT * np.arange(k)


def assert_equal(found: Estimate, static: Estimate, tolerance: float) -> None:
    """Loads and deviations are equal to ``tolerance`` of the largest load of each sample, and health is."""
    size = np.max(np.abs(static.loads), axis=1, keepdims=True)
    assert np.max(np.abs(found.loads - static.loads) / size) < tolerance
    np.testing.assert_allclose(found.loads_std, static.loads_std, rtol=tolerance)
    np.testing.assert_allclose(found.coefficients_std, static.coefficients_std, rtol=tolerance)
    np.testing.assert_array_equal(found.health, static.health)


def noisy(inverse_map: InverseMap, k: int, seed: int) -> np.ndarray:
    """Return strains (k, n_d) of the mean pressure with the noise that samples do not share."""
    std = inverse_map.noise_std
    part = float(np.linalg.eigvalsh(inverse_map.gauge_covariance / np.outer(std, std))[0])
    noise = np.sqrt(part) * std * np.random.default_rng(seed).standard_normal((k, len(std)))
    return np.asarray(inverse_map.mean_strain + noise)


def test_a_steady_flight_is_averaged() -> None:
    estimator, k = Estimator(fitted(2, 5)), 200
    strain, steady = noisy(estimator.inverse_map, k, 6), estimator.inverse_map.mean_strain
    exact = estimator.estimate(steady, NOMINAL, dynamic_pressure_std=0.0).loads
    static = estimator.estimate(strain, NOMINAL, dynamic_pressure_std=0.0)
    found = estimator.filter(1.0).track(strain, NOMINAL, dynamic_pressure_std=0.0, time=times(k))
    size = [np.sqrt(np.mean((one.loads[50:] - exact) ** 2, axis=0)) for one in (found, static)]
    assert np.all(size[0] < 0.5 * size[1])
    assert np.all(found.loads_std <= static.loads_std * (1.0 + 1e-12))
    # What lasts stays: no average is more certain than it.
    assert np.all(static.loads_std**2 - found.loads_std**2 < 1.2 * size[1] ** 2)


def test_a_jump_counts_in_its_sample_and_a_lost_sample_nothing() -> None:
    estimator = Estimator(fitted(2, 1))
    strain = noisy(estimator.inverse_map, 30, 2)
    jumped = strain[-1] + estimator.inverse_map.state_operator[:, 0]
    flight = estimator.filter(1.0)
    before = flight.track(strain, NOMINAL, time=times(30))
    found = flight.track(jumped[None], NOMINAL, time=np.array([30.0 * DT]))
    np.testing.assert_array_equal(found.loads, estimator.estimate(jumped[None], NOMINAL).loads)
    flight.restart()
    flight.track(strain, NOMINAL, time=times(30))
    lost = flight.track(np.vstack([strain[-1], np.full(18, np.nan)]), [np.nan, NOMINAL], time=[0.3, 0.31])
    assert lost.health.tolist() == [HealthState.NO_COEFFICIENTS, HealthState.INVALID]
    np.testing.assert_allclose(
        flight.track(strain[-1:], NOMINAL, time=[0.32]).noise_left, before.noise_left[-1], rtol=0.5
    )
    # A minute later nothing is left of the memory.
    late = flight.track(strain[-1:], NOMINAL, time=[60.0])
    np.testing.assert_array_equal(late.loads, estimator.estimate(strain[-1:], NOMINAL).loads)


def test_zeros_with_a_deviation_begin_again_where_they_change() -> None:
    estimator = Estimator(fitted(2, 1))
    strain, n = noisy(estimator.inverse_map, 20, 2), estimator.inverse_map.n_gauges
    zeros = GaugeZeros(value=np.zeros(n), std=np.full(n, 1e-7), common_std=0.0)
    flight = estimator.with_zeros(zeros).filter(1.0)
    assert flight.track(strain, NOMINAL, time=times(20)).noise_left[-1] < 0.3
    changed = flight.with_zeros(replace(zeros, value=np.full(n, 1e-9)))
    assert changed.track(strain[-1:], NOMINAL, time=[0.2]).noise_left == 1.0
    same = flight.with_zeros(zeros)
    assert same.track(strain[-1:], NOMINAL, time=[0.2]).noise_left < 0.3


def test_a_deviation_beyond_numbers_leaves_nothing_behind() -> None:
    """Its sample has no finite deviation; the next goes on as if it had been any other."""
    estimator = Estimator(fitted(2, 1))
    strain, _ = series(estimator.inverse_map, 12, 2, 1.0)
    std = np.zeros((2, 12))
    std[1, 8] = 1e308
    plain, found = (
        estimator.filter(1.0).track(strain, NOMINAL, dynamic_pressure_std=one, time=times(12)) for one in std
    )
    assert not np.any(np.isfinite(found.coefficients_std[8]))
    np.testing.assert_allclose(found.loads[9:], plain.loads[9:], rtol=1e-9)
    np.testing.assert_allclose(found.loads_std[9:], plain.loads_std[9:], rtol=1e-9)


@pytest.mark.parametrize("case", [1, 2])
def test_many_steps_keep_deviations_positive(case: int) -> None:
    """Of samples close to one another, which all say the same."""
    inverse_map = fitted(case, 3)
    k = 4000
    strain = np.tile(inverse_map.mean_strain, (k, 1))
    found = Estimator(inverse_map).filter(100.0).track(strain, NOMINAL, time=1e-4 * np.arange(k))
    assert np.all(np.linalg.eigvalsh(found.load_covariance)[:, 0] > 0.0)
    assert np.all(found.loads_std[-1] < found.loads_std[0])


@pytest.mark.parametrize("case", [1, 2])
def test_without_memory_it_is_the_static_estimator_at_any_temperature(case: int) -> None:
    """Sensors come and go, one by one and all."""
    estimator, rng = Estimator(with_temperature(fitted(case, 1))), np.random.default_rng(3)
    strain, _ = series(fitted(case, 1), 8, 2, 1.0)
    warm = np.where(rng.random((8, 4)) < 0.5, REFERENCE + 10.0 * rng.standard_normal((8, 4)), np.nan)
    warm[[3, 5]] = np.nan
    static = estimator.estimate(strain, 0.9 * NOMINAL, temperature=warm)
    assert_equal(
        estimator.filter(1e-9).track(strain, 0.9 * NOMINAL, temperature=warm, time=times(8)), static, 1e-8
    )
