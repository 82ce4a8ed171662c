"""Linear maps over time: static limit, better loads, masks, lost samples, jumps, temperature."""

from dataclasses import replace

import numpy as np
import pytest
from scaled_maps import NOMINAL, scaled_map
from thermal_maps import REFERENCE, with_temperature

from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.estimator import Estimator
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


def test_a_series_is_estimated_better_than_its_samples() -> None:
    estimator = Estimator(fitted(2, 5))
    strain, loads = series(estimator.inverse_map, 150, 6, 1.0)
    static = estimator.estimate(strain, NOMINAL, dynamic_pressure_std=0.0)
    found = estimator.filter(1.0).track(strain, NOMINAL, dynamic_pressure_std=0.0, time=times(150))
    size = [np.sqrt(np.mean(((one.loads - loads) / static.loads_std) ** 2)) for one in (found, static)]
    assert size[0] < size[1]
    assert np.all(found.loads_std <= static.loads_std * (1.0 + 1e-9))
    assert np.mean(np.abs(found.loads - loads) < 3.0 * found.loads_std) > 0.98


def test_a_jump_begins_again_and_what_is_lost_is_forgotten() -> None:
    estimator = Estimator(fitted(2, 1))
    strain, _ = series(estimator.inverse_map, 30, 2, 1.0)
    other, _ = series(estimator.inverse_map, 1, 99, 1.0)
    flight = estimator.filter(1.0)
    before = flight.track(strain, NOMINAL, time=times(30))
    jumped = flight.track(other, NOMINAL, time=np.array([30.0 * DT]))
    np.testing.assert_allclose(jumped.loads, estimator.estimate(other, NOMINAL).loads, rtol=1e-9)
    flight.restart()
    flight.track(strain, NOMINAL, time=times(30))
    lost = flight.track(np.vstack([strain[-1], np.full(18, np.nan)]), [np.nan, NOMINAL], time=[1.3, 2.3])
    assert lost.health.tolist() == [HealthState.NO_COEFFICIENTS, HealthState.INVALID]
    after = flight.track(strain[-1:], NOMINAL, time=[2.4])
    assert np.all(after.loads_std > before.loads_std[-1])
    # A minute later nothing is left of the memory.
    late, first = (flight.track(strain[-1:], NOMINAL, time=[60.0]), before.loads_std[0])
    np.testing.assert_allclose(late.loads_std[0], first, rtol=1e-3)


def test_a_deviation_beyond_numbers_leaves_nothing_behind() -> None:
    """Its sample has no finite deviation; the next goes on as if it had been any other."""
    estimator = Estimator(fitted(2, 1))
    strain, _ = series(estimator.inverse_map, 12, 2, 1.0)
    std = np.zeros((2, 12))
    std[1, 8] = 1e308
    plain, found = (estimator.filter(1.0).track(strain, NOMINAL, None, one, time=times(12)) for one in std)
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
    assert np.all(np.diff(found.loads_std[:, 1]) < 1e-9 * found.loads_std[0, 1])


LINEAR = {"apparent_strain": np.zeros(0), "gauge_factor_slope": 0.0, "modulus_slope": 0.0}
"""Changes of a thermal part: modes add strain and change nothing else."""


def warm_series(isothermal: InverseMap, k: int, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Strains (k, n_d), loads (k, 5), temperatures (k, n_t): modes decay, sensors have constant errors."""
    thermal, rng = with_temperature(isothermal, **LINEAR).thermal, np.random.default_rng(seed)
    strain, loads = series(isothermal, k, seed, 1.0)
    start = thermal.prior_std * rng.standard_normal(len(thermal.prior_std))
    amplitude = np.exp(-DT * np.arange(k))[:, None] * start
    error = thermal.sensor_std * rng.standard_normal(thermal.n_sensors)
    temperature = thermal.reference_temperature + amplitude @ thermal.sensor_operator.T + error
    return strain + amplitude @ thermal.linear_strain.T, loads, temperature


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


@pytest.mark.parametrize("read", [0, 4])
def test_deviations_of_a_warm_series_hold(read: int) -> None:
    """With sensors, one of which is lost half way, and without. No deviation is above that of a sample alone."""
    estimator, apart, narrower = Estimator(with_temperature(fitted(2, 5), **LINEAR)), [], []
    for seed in range(4):
        strain, loads, temperature = warm_series(fitted(2, 5), 40, seed)
        temperature[:, read:] = np.nan
        temperature[20:, 1] = np.nan
        static = estimator.estimate(strain, NOMINAL, None, 0.0, temperature=temperature)
        flight = estimator.filter(1.0)
        found = flight.track(strain, NOMINAL, None, 0.0, temperature=temperature, time=times(40))
        apart.append((found.loads - loads) / found.loads_std)
        narrower.append(found.loads_std / static.loads_std)
    assert np.max(narrower) < 1.0 + 1e-9
    assert np.mean(narrower) < 0.999
    assert np.mean(np.abs(apart) < 3.0) > 0.98
    assert 0.6 < np.sqrt(np.mean(np.square(apart))) < 1.4


def test_a_sensor_that_is_lost_costs_no_memory() -> None:
    """What is known of the amplitudes goes on: deviations are below those of a filter that begins again."""
    estimator = Estimator(with_temperature(fitted(2, 5), **LINEAR))
    strain, loads, temperature = warm_series(fitted(2, 5), 42, 2)
    temperature[40:] = np.nan
    found = estimator.filter(1.0).track(strain, NOMINAL, None, 0.0, temperature=temperature, time=times(42))
    before, after = found[39], found[40]
    alone = estimator.step(strain[40], NOMINAL, dynamic_pressure_std=0.0)
    assert np.mean(after.loads_std / alone.loads_std) < 0.95
    assert np.all(np.abs((after.loads - loads[40]) - (before.loads - loads[39])) < before.loads_std)
