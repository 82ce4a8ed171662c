"""The Kalman filter with a random walk: one reading without a walk is Case 2, more readings average noise out."""

from __future__ import annotations

import numpy as np
import pytest
from state_estimates import state_gain, state_offset

from builder.trial import random_walk
from builder.trial.random_walk import after_reading, before_readings, of_random_walk
from builder.trial.readings import Readings
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.other_loads import FIVE_LOADS


def readings_of(inverse_map: InverseMap, count: int) -> Readings:
    """Return ``count`` readings of each of three states of the map at its nominal q_inf."""
    random = np.random.default_rng(2)
    state = random.standard_normal((3, inverse_map.state_operator.shape[1]))
    strain = inverse_map.mean_strain + state @ inverse_map.state_operator.T
    q = np.full(3, inverse_map.nominal_dynamic_pressure)
    loads = (inverse_map.load_of_mean + state @ inverse_map.load_per_state.T)[:, FIVE_LOADS]
    noise = inverse_map.noise_std * random.standard_normal((count, *strain.shape))
    return Readings(
        strain=np.swapaxes(strain + noise, 0, 1),
        known={DYNAMIC_PRESSURE: q},
        truth=loads / (q[:, None] * inverse_map.references[FIVE_LOADS]),
        vehicle=np.arange(3),
        flight=np.arange(3),
    )


def test_one_reading_without_a_walk_is_case_2(noise_map: InverseMap, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(random_walk, "STEP_STD", 0.0)
    read = readings_of(noise_map, 1)
    mean, _ = after_reading(noise_map, before_readings(noise_map, 3), read.last, np.ones(3))
    expected = read.last @ state_gain(noise_map).T + state_offset(noise_map)
    np.testing.assert_allclose(mean, expected, atol=1e-6 * np.abs(expected).max())


def test_more_readings_are_better_and_inside_the_band(noise_map: InverseMap) -> None:
    many = readings_of(noise_map, 20)
    first, last = (of_random_walk(noise_map)(read) for read in (readings_of(noise_map, 1), many))
    assert np.all(last.std < first.std)
    assert np.all(np.abs(last.value - many.truth) <= 4.0 * last.std)
    assert last.health is None
