"""The filter of the nonlinear estimator with temperature modes: static limit, series."""

import numpy as np
import pytest
from flight_fmu import FlightSample, random_flight, whole_map
from thermal_maps import REFERENCE, with_temperature
from warm_flights import warm_flight

from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import InverseMap

pytestmark = pytest.mark.fast

DT, N_T = 0.01, 4
LINEAR = {"apparent_strain": np.zeros(0), "gauge_factor_slope": 0.0, "modulus_slope": 0.0}
"""Modes that add strain and change nothing else."""


def held_map(**changes: object) -> InverseMap:
    return with_temperature(whole_map(), **changes)


def flow_of(samples: list[FlightSample]) -> dict[str, np.ndarray]:
    """Return strain, air data and times of ``samples`` by the names of the estimator's arguments."""
    flow = {name: np.array([one.flow[name] for one in samples]) for name in samples[0].flow}
    return {"strain": np.array([one.strain for one in samples]), **flow}


def times(k: int) -> np.ndarray:
    return DT * np.arange(k)


def test_without_memory_it_is_the_static_estimator() -> None:
    """From the same flight state, while sensors come and go, one by one and all."""
    estimator, random = Estimator(held_map()), np.random.default_rng(3)
    flight, now = estimator.filter(1e-9), 0
    for k, sample in enumerate(random_flight(whole_map(), 6, seed=4)):
        warm = np.where(random.random(N_T) < 0.5, REFERENCE + 3.0 * random.standard_normal(N_T), np.nan)
        temperature = None if k == 2 else np.full(N_T, np.nan) if k == 4 else warm
        # Iterated to the end: the static estimate does not depend on where it begins.
        given = flow_of([sample] * 13) | {"temperature": temperature}
        again = flight.track(**given, time=DT * np.arange(now, now + 13))
        now += 13
        static = estimator.step(sample.strain, temperature=temperature, **sample.flow)
        assert again[0].health == static.health
        again = again[-1]
        assert again.coefficients == pytest.approx(static.coefficients, abs=0.02 * np.min(static.coefficients_std))
        assert again.coefficients_std == pytest.approx(static.coefficients_std, rel=5e-3)


@pytest.mark.parametrize("read", [0, N_T])
def test_a_warm_series_is_estimated_better_than_its_samples(read: int) -> None:
    """Against the filter of a cold flight by the map without modes; one sensor is lost half way."""
    held = Estimator(held_map(**LINEAR))
    samples = warm_flight(held.inverse_map, 40, seed=5, time_step=DT)
    temperature = np.array([one.temperature for one in samples])
    temperature[:, read:] = np.nan
    temperature[20:, 1] = np.nan
    given = flow_of(samples) | {"temperature": temperature, "q_source": "independent"}
    found, static = held.filter(1.0).track(**given, time=times(40)), held.estimate(**given)
    cold = flow_of(random_flight(whole_map(), 40, seed=5)) | {"q_source": "independent"}
    known = Estimator(whole_map()).filter(1.0).track(**cold, time=times(40))
    assert np.max(np.abs(found.loads - known.loads) / found.loads_std) < 3.0
    alone = found.loads_std / static.loads_std
    assert np.max(alone[5:]) < 1.01
    assert np.mean(alone[20:]) < 0.95
