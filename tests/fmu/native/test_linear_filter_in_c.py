"""The filter of a linear map in the native library: its state, what turns it off; its numbers: tests/golden."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from ctypes import c_double
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from agreement import assert_same
from linear_fmu import LinearFmu, LinearSample, linear_flight
from raw_fmu import ERROR, N_OUTPUTS, OK, VALUES, first_zero, write_resource
from scaled_maps import whole_scaled_map

from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import InverseMap

pytestmark = pytest.mark.fast
N, N_T = 18, 4
STEP = 0.01


@pytest.fixture(scope="module")
def inverse_map() -> InverseMap:
    return whole_scaled_map(1, seed=1)


@pytest.fixture(scope="module")
def location(inverse_map: InverseMap, tmp_path_factory: pytest.TempPathFactory) -> str:
    return write_resource(inverse_map, tmp_path_factory.mktemp("linear")).as_uri()


@pytest.fixture
def fmu(location: str) -> Iterator[LinearFmu]:
    one = started(location, N)
    yield one
    one.free()


def started(location: str, n: int) -> LinearFmu:
    """An instance past its initialization."""
    one = LinearFmu(location, n)
    one.start()
    return one


def tracked(estimator: Estimator, sample: LinearSample, time: float = 0.0, **known: Any) -> Estimate:
    """The same step in Python."""
    deviation = sample.deviation if sample.deviation > 0.0 else np.nan
    return estimator.track(
        sample.strain, sample.pressure, valid=sample.valid, dynamic_pressure_std=deviation, time=time, **known
    )


def test_outputs_follow_what_is_set_without_a_step(fmu: LinearFmu, inverse_map: InverseMap) -> None:
    """A sample is that at the start of a step, however often inputs are set and read before it is taken."""
    samples, estimator = linear_flight(inverse_map, 8, seed=17), Estimator(inverse_map).filter(1.0)
    assert fmu.filter(1.0) == OK
    for k, sample in enumerate(samples):
        fmu.give(samples[0])
        fmu.outputs()
        fmu.give(sample)
        before = fmu.outputs()
        assert fmu.step(k / 64.0, 1.0 / 64.0) == OK
        assert fmu.outputs().tobytes() == before.tobytes()
        assert_same(before, tracked(estimator, sample, k / 64.0))


def steady_flight(inverse_map: InverseMap, steps: int, seed: int) -> list[LinearSample]:
    """One sample again and again, each with noise of its own."""
    random, one = np.random.default_rng(seed), linear_flight(inverse_map, 1, seed, poor=False)[0]
    noise = 0.5 * inverse_map.noise_std * random.standard_normal((steps, N))
    return [replace(one, strain=one.strain + own) for own in noise]


def test_a_state_with_samples_that_cannot_be(fmu: LinearFmu, inverse_map: InverseMap) -> None:
    assert fmu.filter(1.0) == OK
    fmu.advance(linear_flight(inverse_map, 1, seed=22)[0], 0.0, STEP)
    content = bytearray(fmu.serialise(fmu.get_state()))
    content[-8:] = np.float64(np.inf).tobytes()
    content[12:16] = zlib.crc32(content[16:]).to_bytes(4, "little")
    assert fmu.deserialise(bytes(content))[0] == ERROR
    assert "samples of the filter that cannot be" in fmu.messages[-1][2]


def test_without_the_filter_nothing_is_remembered(fmu: LinearFmu, inverse_map: InverseMap) -> None:
    """Off at first, on, off again by the parameter; begun again by a zero that is no longer known exactly."""
    samples, alone = steady_flight(inverse_map, 16, seed=23), Estimator(inverse_map)
    estimator = Estimator(inverse_map)
    for k, sample in enumerate(samples):
        on = k in (4, 5, 6, 7, 8, 11, 12)
        assert fmu.filter(1.0 if on else 0.0) == OK
        estimator = estimator.filter(1.0 if on else 0.0)
        found = tracked(estimator, sample, k * STEP)
        assert_same(fmu.advance(sample, k * STEP, STEP), found)
        # An average takes four samples: half of the longest window that agrees.
        assert np.array_equal(found.loads, tracked(alone, sample).loads) == (k not in (7, 8))
    assert fmu.filter(1.0) == OK
    for k, sample in enumerate(samples[2:]):
        fmu.advance(sample, 0.5 + 0.01 * k, STEP)
    filtered = fmu.advance(samples[1], 0.91, STEP)
    assert fmu.set_reals([first_zero(N) + N], [1e-12]) == OK
    steps = [fmu.advance(samples[1], 0.92 + 0.01 * k, STEP) for k in range(24)]
    health = [one[20] for one in steps]
    begun = health.count(HealthState.DEGRADED)  # in the step in which the matrices for it are made
    assert begun > 1
    assert health == [HealthState.DEGRADED] * begun + [HealthState.OK] * (24 - begun)
    without = steps[begun]
    assert fmu.filter(0.0) == OK
    assert fmu.advance(samples[1], 1.5, STEP).tobytes() == without.tobytes()
    assert filtered[10:15].tobytes() != without[10:15].tobytes()


def test_derivatives_with_the_filter_on_are_those_of_the_step(fmu: LinearFmu, inverse_map: InverseMap) -> None:
    """What the steps before left is held."""
    samples = steady_flight(inverse_map, 8, seed=4)
    assert fmu.filter(1.0) == OK
    for k, sample in enumerate(samples):
        fmu.advance(sample, k * STEP, STEP)
    state, strains = fmu.get_state(), range(N_OUTPUTS, N_OUTPUTS + N)
    fmu.give(samples[0])
    held, bits = fmu.serialise(fmu.get_state()), fmu.outputs().tobytes()
    direction = 1e-3 * inverse_map.noise_std * np.random.default_rng(3).normal(size=N)
    found, sides = fmu.derivative(VALUES, strains, direction), []
    assert fmu.serialise(fmu.get_state()) == held
    assert fmu.outputs().tobytes() == bits
    for sign in (1.0, -1.0):
        assert fmu.call("SetFMUstate", state) == OK
        fmu.give(replace(samples[0], strain=samples[0].strain + sign * direction))
        sides.append(fmu.get_reals(VALUES))
    for group in (slice(0, 5), slice(5, 8), slice(8, 10)):
        expected = 0.5 * (sides[0] - sides[1])[group]
        np.testing.assert_allclose(found[group], expected, rtol=0.0, atol=1e-6 * np.abs(expected).max())


def test_model_exchange_filters_nothing(inverse_map: InverseMap, location: str) -> None:
    """The solver's steps are no samples."""
    fmu = LinearFmu(location, N, co_simulation=False)
    fmu.start()
    assert fmu.filter(1.0) == OK
    assert fmu.call("EnterContinuousTimeMode") == OK
    estimator = Estimator(inverse_map)
    for k, sample in enumerate(linear_flight(inverse_map, 5, seed=6)):
        assert fmu.call("SetTime", c_double(k * STEP)) == OK
        fmu.set_strain(sample.strain)
        native = fmu.get_reals(range(10, 20))
        alone = estimator.step(sample.strain, inverse_map.nominal_dynamic_pressure, dynamic_pressure_std=np.nan)
        assert native == pytest.approx([*alone.loads, *alone.loads_std], rel=1e-9)
    fmu.free()


@pytest.mark.parametrize("value", [-1.0, 1e-10, 2e6, np.nan, np.inf])
def test_time_constants_that_cannot_be(fmu: LinearFmu, value: float) -> None:
    assert fmu.filter(value) == ERROR
    assert "filter_time_constant" in fmu.messages[-1][2]
