"""The filter of the nonlinear estimator with temperature modes: static limit, series, a sensor that is lost."""

from __future__ import annotations

import numpy as np
import pytest
from flight_fmu import random_flight, whole_map
from thermal_maps import REFERENCE, with_temperature
from warm_flights import warm_flight

from strainfmu.estimator.filter.flight_filter import FlightFilter
from strainfmu.estimator.filter.settings import FilterSettings
from strainfmu.estimator.manifold.estimator import ManifoldEstimator
from strainfmu.estimator.map.inverse_map import InverseMap

pytestmark = pytest.mark.fast

DT, N_T = 0.01, 4
LINEAR = {"apparent_strain": np.zeros(0), "gauge_factor_slope": 0.0, "modulus_slope": 0.0}
"""Modes that add strain and change nothing else."""


def held_map(**changes: object) -> InverseMap:
    return with_temperature(whole_map(), **changes)


def test_without_memory_it_is_the_static_estimator() -> None:
    """From the same flight state, while sensors come and go, one by one and all."""
    estimator, random = ManifoldEstimator(held_map()), np.random.default_rng(3)
    flight = FlightFilter(estimator, FilterSettings(time_constant=1e-9))
    for k, sample in enumerate(random_flight(whole_map(), 6, seed=4)):
        warm = np.where(random.random(N_T) < 0.5, REFERENCE + 3.0 * random.standard_normal(N_T), np.nan)
        temperature = None if k == 2 else np.full(N_T, np.nan) if k == 4 else warm
        found = flight.recorded(DT, sample.strain, sample.flow, temperature=temperature).estimate[0]
        state = flight.track.state
        assert state is not None
        # Iterated to the end from there: the static estimate does not depend on where it begins.
        for _ in range(12):
            again = flight.recorded(DT, sample.strain, sample.flow, temperature=temperature).estimate[0]
        static = estimator.step(sample.strain, temperature=temperature, **sample.flow)
        assert found.health == static.health
        assert again.coefficients == pytest.approx(static.coefficients, abs=0.02 * np.min(static.coefficients_std))
        assert again.coefficients_std == pytest.approx(static.coefficients_std, rel=5e-3)


@pytest.mark.parametrize("read", [0, N_T])
def test_a_warm_series_is_estimated_better_than_its_samples(read: int) -> None:
    """Against the filter of a cold flight by the map without modes; one sensor is lost half way."""
    held, cold = ManifoldEstimator(held_map(**LINEAR)), ManifoldEstimator(whole_map())
    flight, reference = (FlightFilter(one, FilterSettings(time_constant=1.0)) for one in (held, cold))
    samples = warm_flight(held.inverse_map, 40, seed=5, time_step=DT)
    temperature = np.array([one.temperature for one in samples])
    temperature[:, read:] = np.nan
    temperature[20:, 1] = np.nan
    apart, alone = [], []
    for sample, same, warm in zip(samples, random_flight(whole_map(), 40, seed=5), temperature, strict=True):
        found = flight.recorded(DT, sample.strain, sample.flow, temperature=warm).estimate[0]
        static = held.step(sample.strain, temperature=warm, **sample.flow)
        known = reference.recorded(DT, same.strain, same.flow).estimate[0]
        apart.append((found.loads - known.loads) / found.loads_std)
        alone.append(found.loads_std / static.loads_std)
    assert np.max(np.abs(apart)) < 3.0
    assert np.max(alone[5:]) < 1.01
    assert np.mean(alone[20:]) < 0.95


@pytest.mark.parametrize("changes", [LINEAR, {}], ids=["strain alone", "modulus and gauge factor, too"])
def test_lost_sensors_cost_no_memory(changes: dict[str, object]) -> None:
    estimator = ManifoldEstimator(held_map(**changes))
    samples = warm_flight(estimator.inverse_map, 30, seed=6, time_step=DT)
    temperature = np.array([one.temperature for one in samples])
    temperature[20:] = np.nan
    flight, steps = FlightFilter(estimator, FilterSettings(time_constant=10.0)), []
    for sample, warm in zip(samples, temperature, strict=True):
        steps.append(flight.recorded(DT, sample.strain, sample.flow, temperature=warm))
    assert all(one.continues for one in steps[1:])
    before, after = steps[19].estimate[0], steps[20].estimate[0]
    assert np.all(after.loads_std < 1.05 * before.loads_std)
