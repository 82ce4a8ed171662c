"""Linear maps over time: static limit, a closed form, masks, lost samples, jumps."""

from dataclasses import replace

import numpy as np
import pytest
from scaled_maps import NOMINAL, scaled_map
from thermal_maps import REFERENCE, with_temperature

from strainfmu.errors import InputError
from strainfmu.estimator.filter.linear_filter import LinearFilter
from strainfmu.estimator.filter.settings import FilterSettings
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.linear.estimator import Estimator
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
    flight = LinearFilter(estimator, FilterSettings(time_constant=1e-9))
    strain, _ = series(estimator.inverse_map, 5, 2, 1.0)
    strain[:, :lost] = np.nan
    for row in strain:
        found = flight.step(DT, row, 0.9 * NOMINAL)
        static = estimator.step(row, 0.9 * NOMINAL)
        assert np.max(np.abs(found.loads - static.loads)) < 1e-9 * np.max(np.abs(static.loads))
        assert found.loads_std == pytest.approx(static.loads_std, rel=1e-9)
        assert found.coefficients_std == pytest.approx(static.coefficients_std, rel=1e-9)
        assert found.health == static.health


def test_a_series_agrees_with_the_recursion_of_the_whole_model() -> None:
    inverse_map = fitted(2, 3)
    flight = LinearFilter(Estimator(inverse_map), FilterSettings(time_constant=0.5))
    model = flight.model
    strain, _ = series(inverse_map, 30, 4, 0.5)
    h = np.hstack([model.scaled[:18] + model.common])
    n = h.shape[1]
    mean, cov = np.zeros(n), np.diag(model.std**2)
    noise = np.diag(model.noise) + model.own @ model.own.T + model.seen.rest_strain
    for i, row in enumerate(strain):
        decay = np.where(model.slow, np.exp(-DT / 50.0), np.exp(-DT / 0.5)) if i else np.ones(n)
        mean, cov = decay * mean, decay[:, None] * cov * decay + np.diag((1.0 - decay**2) * model.std**2)
        gain = cov @ h.T @ np.linalg.inv(h @ cov @ h.T + noise)
        mean, cov = mean + gain @ (row - inverse_map.mean_strain - h @ mean), cov - gain @ h @ cov
        flight.step(DT, row, NOMINAL)
    assert flight.law is not None
    # Errors that last are considered, not white: a little less is known.
    assert np.all(np.diagonal(flight.law.covariance) > 0.99 * np.diagonal(cov))
    apart = (flight.law.mean - mean) / np.sqrt(np.diagonal(flight.law.covariance))
    assert np.max(np.abs(apart)) < 1.0


def test_a_series_is_estimated_better_than_its_samples() -> None:
    estimator = Estimator(fitted(2, 5))
    flight = LinearFilter(estimator, FilterSettings(time_constant=1.0))
    strain, loads = series(estimator.inverse_map, 150, 6, 1.0)
    steps = []
    for row in strain:
        static = estimator.step(row, NOMINAL, dynamic_pressure_std=0.0)
        steps.append(flight.stepped(DT, static, row, NOMINAL))
    by = {
        "static": [step.static for step in steps],
        "filter": [step.estimate for step in steps],
    }
    error = {name: np.array([one.loads for one in found]) - loads for name, found in by.items()}
    std = {name: np.array([one.loads_std for one in found]) for name, found in by.items()}
    size = {name: float(np.sqrt(np.mean((value / std["static"]) ** 2))) for name, value in error.items()}
    assert size["filter"] < size["static"]
    assert np.all(std["filter"] <= std["static"] * (1.0 + 1e-9))
    assert np.mean(np.abs(error["filter"]) < 3.0 * std["filter"]) > 0.98


def test_lost_samples_and_jumps() -> None:
    estimator = Estimator(fitted(2, 1))
    flight = LinearFilter(estimator, FilterSettings(time_constant=1.0))
    strain, _ = series(estimator.inverse_map, 30, 2, 1.0)
    for row in strain:
        flight.step(DT, row, NOMINAL)
    assert flight.law is not None
    other, _ = series(estimator.inverse_map, 1, 99, 1.0)
    jumped, static = flight.step(DT, other[0], NOMINAL), estimator.step(other[0], NOMINAL)
    assert jumped.loads == pytest.approx(static.loads, rel=1e-9)
    known = np.trace(flight.law.covariance)
    for lost, health in ((other[0], HealthState.NO_COEFFICIENTS), (np.full(18, np.nan), HealthState.INVALID)):
        found = flight.step(1.0, lost, np.nan if health is HealthState.NO_COEFFICIENTS else NOMINAL)
        assert found.health is health
    assert np.trace(flight.law.covariance) > known


def test_a_deviation_beyond_numbers_leaves_nothing_behind() -> None:
    """Its sample is the static one; the next goes on as if it had been any other."""
    estimator = Estimator(fitted(2, 1))
    strain, _ = series(estimator.inverse_map, 12, 2, 1.0)
    results = []
    for std in (0.0, 1e308):
        flight = LinearFilter(estimator, FilterSettings(time_constant=1.0))
        for k, row in enumerate(strain):
            with np.errstate(all="ignore"):
                static = estimator.step(row, NOMINAL, dynamic_pressure_std=std if k == 8 else 0.0)
                found = flight.stepped(DT, static, row, NOMINAL).estimate
            if k == 8 and std > 0.0:
                assert np.all(np.isinf(found.loads_std) | np.isnan(found.loads_std))
        results.append(found)
    assert results[1].loads == pytest.approx(results[0].loads, rel=1e-9)
    assert results[1].loads_std == pytest.approx(results[0].loads_std, rel=1e-9)


def test_an_absolute_map_and_wrong_time_steps_are_refused() -> None:
    flight = LinearFilter(Estimator(fitted(2, 1)), FilterSettings(time_constant=1.0))
    with pytest.raises(InputError, match=r"time_step: 0.0 found, must be positive"):
        flight.step(0.0, np.zeros(18), NOMINAL)
    estimator = Estimator(replace(fitted(2, 1), form="absolute"))
    with pytest.raises(InputError, match="form 'absolute' found, a filter needs form 'dynamic_pressure'"):
        LinearFilter(estimator, FilterSettings(time_constant=1.0))


LINEAR = {"apparent_strain": np.zeros(0), "gauge_factor_slope": 0.0, "modulus_slope": 0.0}
"""Changes of a thermal part: modes add strain and change nothing else."""


def warm_series(isothermal: InverseMap, k: int, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Strains (k, n_d), loads (k, 5), temperatures (k, n_t): modes decay, sensors have constant errors."""
    thermal, rng = with_temperature(isothermal, **LINEAR).thermal, np.random.default_rng(seed)
    assert thermal is not None
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
    flight = LinearFilter(estimator, FilterSettings(time_constant=1e-9))
    strain, _ = series(fitted(case, 1), 8, 2, 1.0)
    for k, row in enumerate(strain):
        warm = np.where(rng.random(4) < 0.5, REFERENCE + 10.0 * rng.standard_normal(4), np.nan)
        temperature = None if k == 3 else np.full(4, np.nan) if k == 5 else warm
        found = flight.step(DT, row, 0.9 * NOMINAL, temperature=temperature)
        static = estimator.step(row, 0.9 * NOMINAL, temperature=temperature)
        assert np.max(np.abs(found.loads - static.loads)) < 1e-8 * np.max(np.abs(static.loads))
        assert found.loads_std == pytest.approx(static.loads_std, rel=1e-8)
        assert found.coefficients_std == pytest.approx(static.coefficients_std, rel=1e-8)


@pytest.mark.parametrize("read", [0, 4])
def test_deviations_of_a_warm_series_hold(read: int) -> None:
    """With sensors, one of which is lost half way, and without. No deviation is above that of a sample alone."""
    estimator, apart, narrower = Estimator(with_temperature(fitted(2, 5), **LINEAR)), [], []
    for seed in range(4):
        flight = LinearFilter(estimator, FilterSettings(time_constant=1.0))
        strain, loads, temperature = warm_series(fitted(2, 5), 40, seed)
        temperature[:, read:] = np.nan
        temperature[20:, 1] = np.nan
        for k, (row, warm) in enumerate(zip(strain, temperature, strict=True)):
            static = estimator.step(row, NOMINAL, dynamic_pressure_std=0.0, temperature=warm)
            found = flight.stepped(DT, static, row, NOMINAL, warm).estimate
            apart.append((found.loads - loads[k]) / found.loads_std)
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
    flight, found = LinearFilter(estimator, FilterSettings(time_constant=1.0)), []
    for row, warm in zip(strain, temperature, strict=True):
        found.append(flight.step(DT, row, NOMINAL, temperature=warm, dynamic_pressure_std=0.0))
    before, after = found[39], found[40]
    alone = estimator.step(strain[40], NOMINAL, dynamic_pressure_std=0.0)
    assert np.mean(after.loads_std / alone.loads_std) < 0.95
    assert np.all(np.abs((after.loads - loads[40]) - (before.loads - loads[39])) < before.loads_std)
