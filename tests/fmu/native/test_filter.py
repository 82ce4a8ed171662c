"""The filter over time of the native library: its state, what turns it off; its numbers: tests/golden."""

import zlib
from collections.abc import Iterator
from ctypes import c_double
from dataclasses import replace

import numpy as np
import pytest
from agreement import assert_same, tracked
from flight_fmu import FILTER, FlightFmu, FlightSample, random_flight
from linear_fmu import LinearFmu, LinearSample, linear_flight
from raw_fmu import ERROR, N_OUTPUTS, OK, VALUES, first_zero, write_resource
from scaled_maps import whole_scaled_map

from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import InverseMap

pytestmark = pytest.mark.fast
STEP, N = 0.01, 18
"""[s], and gauges of the linear map."""

Filtered = tuple[FlightFmu | LinearFmu, InverseMap]


@pytest.fixture(scope="module")
def linear_map() -> InverseMap:
    return whole_scaled_map(1, seed=1)


@pytest.fixture(scope="module")
def location(linear_map: InverseMap, tmp_path_factory: pytest.TempPathFactory) -> str:
    return write_resource(linear_map, tmp_path_factory.mktemp("linear")).as_uri()


@pytest.fixture
def linear(location: str) -> Iterator[LinearFmu]:
    one = LinearFmu(location, N)
    one.start()
    yield one
    one.free()


@pytest.fixture(params=["linear", "nonlinear"])
def filtered(request: pytest.FixtureRequest) -> Filtered:
    """An instance of each estimator with its map."""
    if request.param == "linear":
        return request.getfixturevalue("linear"), request.getfixturevalue("linear_map")
    return request.getfixturevalue("fmu"), request.getfixturevalue("inverse_map")


def flight(inverse_map: InverseMap, steps: int, seed: int) -> list[FlightSample] | list[LinearSample]:
    """A flight of a map of either estimator."""
    return (linear_flight if inverse_map.manifold is None else random_flight)(inverse_map, steps, seed)


@pytest.mark.parametrize("seconds", [0.0, 1.0])
def test_outputs_follow_what_is_set_without_a_step(filtered: Filtered, seconds: float) -> None:
    """A sample is that at the start of a step, however often inputs are set and read before it is taken."""
    fmu, inverse_map = filtered
    samples, estimator = flight(inverse_map, 8, seed=17), Estimator(inverse_map).filter(seconds)
    assert fmu.filter(seconds) == OK
    for k, sample in enumerate(samples):
        fmu.give(samples[0])
        fmu.all_outputs()
        fmu.give(sample)
        before = fmu.all_outputs()
        assert fmu.step(k / 64.0, 1.0 / 64.0) == OK
        assert fmu.all_outputs().tobytes() == before.tobytes()
        assert_same(before, tracked(estimator, sample, k / 64.0))


@pytest.mark.parametrize(("seconds", "value"), [(0.0, 0.5), (1.0, np.inf)])
def test_a_state_with_a_track_that_cannot_be(filtered: Filtered, seconds: float, value: float) -> None:
    fmu, inverse_map = filtered
    if seconds == 0.0 and inverse_map.manifold is None:
        pytest.skip("without its filter a linear map keeps nothing")
    assert fmu.filter(seconds) == OK
    fmu.advance(flight(inverse_map, 1, seed=22)[0], 0.0, STEP)
    content = bytearray(fmu.serialise(fmu.get_state()))
    content[-8:] = np.float64(value).tobytes()
    content[12:16] = zlib.crc32(content[16:]).to_bytes(4, "little")
    assert fmu.deserialise(bytes(content))[0] == ERROR
    kept = "samples of the filter" if inverse_map.manifold is None else "flight state"
    assert f"{kept} that cannot be" in fmu.messages[-1][2]


@pytest.mark.parametrize("value", [-1.0, 1e-10, 2e6, np.nan, np.inf])
def test_time_constants_that_cannot_be(filtered: Filtered, value: float) -> None:
    assert filtered[0].filter(value) == ERROR
    assert "filter_time_constant" in filtered[0].messages[-1][2]


def test_without_the_filter_nothing_is_remembered(fmu: FlightFmu, inverse_map: InverseMap) -> None:
    """Off at first, on, off again by the parameter; begun again by a zero that is no longer known exactly."""
    samples, estimator = random_flight(inverse_map, 12, seed=23), Estimator(inverse_map)
    for k, sample in enumerate(samples):
        on = k in (4, 5, 6)
        assert fmu.filter(1.0 if on else 0.0) == OK
        estimator = estimator.filter(1.0 if on else 0.0)
        assert_same(fmu.advance(sample, k * STEP, STEP), tracked(estimator, sample, k * STEP))
    assert fmu.filter(1.0) == OK
    for k in range(8):
        with_filter = fmu.advance(samples[0], 1.0 + 0.01 * k, STEP)
    assert fmu.set_reals([FILTER - 2], [1e-12]) == OK
    steps = 0
    while True:  # until the matrices for it are made
        steps, without = steps + 1, fmu.advance(samples[0], 1.08 + 0.01 * steps, STEP)
        if without[20] == HealthState.OK:
            break
        assert without[20] == HealthState.DEGRADED
        assert steps < 24
    assert np.all(with_filter[5:10] < without[5:10])
    assert fmu.filter(0.0) == OK
    assert fmu.advance(samples[0], 1.5, STEP)[5:10] == pytest.approx(without[5:10], rel=1e-3)
    assert steps > 1


def steady_flight(inverse_map: InverseMap, steps: int, seed: int) -> list[LinearSample]:
    """One sample again and again, each with noise of its own."""
    random, one = np.random.default_rng(seed), linear_flight(inverse_map, 1, seed, poor=False)[0]
    noise = 0.5 * inverse_map.noise_std * random.standard_normal((steps, N))
    return [replace(one, strain=one.strain + own) for own in noise]


def test_without_the_filter_a_linear_map_remembers_nothing(linear: LinearFmu, linear_map: InverseMap) -> None:
    """The same of a linear map, to the bit."""
    samples, alone = steady_flight(linear_map, 16, seed=23), Estimator(linear_map)
    estimator = Estimator(linear_map)
    for k, sample in enumerate(samples):
        on = k in (4, 5, 6, 7, 8, 11, 12)
        assert linear.filter(1.0 if on else 0.0) == OK
        estimator = estimator.filter(1.0 if on else 0.0)
        found = tracked(estimator, sample, k * STEP)
        assert_same(linear.advance(sample, k * STEP, STEP), found)
        # An average takes four samples: half of the longest window that agrees.
        assert np.array_equal(found.loads, tracked(alone, sample).loads) == (k not in (7, 8))
    assert linear.filter(1.0) == OK
    for k, sample in enumerate(samples[2:]):
        linear.advance(sample, 0.5 + 0.01 * k, STEP)
    filtered = linear.advance(samples[1], 0.91, STEP)
    assert linear.set_reals([first_zero(N) + N], [1e-12]) == OK
    steps = [linear.advance(samples[1], 0.92 + 0.01 * k, STEP) for k in range(24)]
    health = [one[20] for one in steps]
    begun = health.count(HealthState.DEGRADED)  # in the step in which the matrices for it are made
    assert begun > 1
    assert health == [HealthState.DEGRADED] * begun + [HealthState.OK] * (24 - begun)
    without = steps[begun]
    assert linear.filter(0.0) == OK
    assert linear.advance(samples[1], 1.5, STEP).tobytes() == without.tobytes()
    assert filtered[10:15].tobytes() != without[10:15].tobytes()


def test_derivatives_with_the_filter_on_are_those_of_the_step(linear: LinearFmu, linear_map: InverseMap) -> None:
    """What the steps before left is held."""
    samples = steady_flight(linear_map, 8, seed=4)
    assert linear.filter(1.0) == OK
    for k, sample in enumerate(samples):
        linear.advance(sample, k * STEP, STEP)
    state, strains = linear.get_state(), range(N_OUTPUTS, N_OUTPUTS + N)
    linear.give(samples[0])
    held, bits = linear.serialise(linear.get_state()), linear.outputs().tobytes()
    direction = 1e-3 * linear_map.noise_std * np.random.default_rng(3).normal(size=N)
    found, sides = linear.derivative(VALUES, strains, direction), []
    assert linear.serialise(linear.get_state()) == held
    assert linear.outputs().tobytes() == bits
    for sign in (1.0, -1.0):
        assert linear.call("SetFMUstate", state) == OK
        linear.give(replace(samples[0], strain=samples[0].strain + sign * direction))
        sides.append(linear.get_reals(VALUES))
    for group in (slice(0, 5), slice(5, 8), slice(8, 10)):
        expected = 0.5 * (sides[0] - sides[1])[group]
        np.testing.assert_allclose(found[group], expected, rtol=0.0, atol=1e-6 * np.abs(expected).max())


def test_model_exchange_filters_nothing(linear_map: InverseMap, location: str) -> None:
    """The solver's steps are no samples."""
    fmu = LinearFmu(location, N, co_simulation=False)
    fmu.start()
    assert fmu.filter(1.0) == OK
    assert fmu.call("EnterContinuousTimeMode") == OK
    estimator = Estimator(linear_map)
    for k, sample in enumerate(linear_flight(linear_map, 5, seed=6)):
        assert fmu.call("SetTime", c_double(k * STEP)) == OK
        fmu.set_strain(sample.strain)
        native = fmu.get_reals(range(10, 20))
        alone = estimator.step(sample.strain, linear_map.nominal_dynamic_pressure, dynamic_pressure_std=np.nan)
        assert native == pytest.approx([*alone.loads, *alone.loads_std], rel=1e-9)
    fmu.free()
