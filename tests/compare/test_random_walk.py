"""The Kalman filter with a random walk: one reading without a walk is Case 2, more readings average noise out."""

from __future__ import annotations

import numpy as np
import pytest
from state_estimates import state_gain, state_offset

from builder.compare import random_walk
from builder.compare.flights import Readings
from builder.compare.random_walk import RandomWalkCandidate
from strainfmu.estimator.map.inverse_map import InverseMap


def readings_of(inverse_map: InverseMap, cycles: int, noise: float = 1.0) -> tuple[Readings, np.ndarray]:
    """Return readings of three states of the map at its nominal q_inf, and the states' coefficients."""
    random = np.random.default_rng(2)
    state = random.standard_normal((3, inverse_map.state_operator.shape[1]))
    strain = inverse_map.mean_strain + state @ inverse_map.state_operator.T
    q = np.full(3, inverse_map.nominal_dynamic_pressure)
    area, length = inverse_map.reference_area, inverse_map.reference_length
    loads = inverse_map.load_of_mean + state @ inverse_map.load_per_state.T
    read = Readings(
        strain=strain + noise * inverse_map.noise_std * random.standard_normal((cycles, *strain.shape)),
        dynamic_pressure=q,
        dynamic_pressure_std=0.0,
        mach_number=q,
        static_pressure=q,
    )
    return read, loads / (q[:, None] * area * np.array([1.0, 1.0, 1.0, length, length]))


def test_one_reading_without_a_walk_is_case_2(gaussian: InverseMap, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(random_walk, "STEP_STD", 0.0)
    filter_ = RandomWalkCandidate(gaussian)
    read, _ = readings_of(gaussian, cycles=1)
    found = filter_.after(filter_.start(3), read.last, np.ones(3))
    expected = read.last @ state_gain(gaussian).T + state_offset(gaussian)
    np.testing.assert_allclose(found.mean, expected, atol=1e-6 * np.abs(expected).max())


def test_more_readings_are_better_and_inside_the_band(gaussian: InverseMap) -> None:
    filter_ = RandomWalkCandidate(gaussian)
    one, coefficients = readings_of(gaussian, cycles=1)
    many, _ = readings_of(gaussian, cycles=20)
    first, last = (filter_.answer(read, "given") for read in (one, many))
    assert np.all(last.std < first.std)
    assert np.all(np.abs(last.coefficients - coefficients) <= 4.0 * last.std)
    assert filter_.answer(many, "q_inf only") is last
    assert last.field is None
    assert last.air_data is None
    assert 0.0 < filter_.step_microseconds(many, "given") < 1e6
