"""The filter of a linear map in the native library: equal to numpy over flights, its state, what turns it off."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from ctypes import byref, c_bool, c_double
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from damaged_resource import put, refusal, with_arrays
from linear_fmu import LinearFmu, LinearReference, LinearSample, differences, largest, linear_flight
from raw_fmu import ERROR, N_OUTPUTS, OK, VALUES, Fmu3, first_zero, write_resource
from scaled_maps import scaled_map, whole_scaled_map
from sensor_maps import with_sensors
from thermal_maps import REFERENCE, with_temperature

from strainfmu.estimator.estimates.load_estimate import LoadEstimate
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.linear.estimator import Estimator
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.interface.estimator_variables import estimator_interface
from strainfmu.interface.filter_variables import FILTER_TIME_CONSTANT

pytestmark = pytest.mark.fast
N, N_T = 18, 4
STEP = 0.01

TOLERANCE = 1e-10
"""Relative to the largest of a group of outputs in the same sample; 5e-11 is the largest that was found, of z."""


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


def compare(
    fmu: LinearFmu, reference: LinearReference, samples: list[LinearSample], sizes: np.ndarray
) -> tuple[list[LoadEstimate], list[LoadEstimate]]:
    """Assert that all steps, of ``sizes`` [s], are those of numpy; those, and each sample alone."""
    time, found, alone, apart = 3.0, [], [], []
    for sample, size in zip(samples, sizes.tolist(), strict=True):
        native = fmu.advance(sample, time, size)
        both = reference.advance(sample, time)
        apart.append(differences(native, both[0]))
        found.append(both[0])
        alone.append(both[1])
        time += size
    assert max(largest(apart).values()) < TOLERANCE, largest(apart)
    return found, alone


def n_filtered(found: list[LoadEstimate], alone: list[LoadEstimate]) -> int:
    """How many estimates are not those of their samples alone."""
    return sum(not np.array_equal(a.loads, b.loads, equal_nan=True) for a, b in zip(found, alone, strict=True))


@pytest.mark.parametrize("case", [1, 2])
@pytest.mark.parametrize("time_constant", [1e-9, 0.02, 1.0, 10.0])
def test_a_flight_is_that_of_numpy(tmp_path: Path, case: int, time_constant: float) -> None:
    """Variable steps, up to 5 s, lost gauges, lost samples, q_inf that changes or is not known."""
    inverse_map, steps = whole_scaled_map(case, seed=case), 300 if time_constant == 1.0 else 60
    fmu = started(write_resource(inverse_map, tmp_path).as_uri(), N)
    sizes = np.random.default_rng(1).uniform(0.002, 0.05, steps)
    sizes[25::50] = 5.0
    assert fmu.filter(time_constant) == OK
    reference = LinearReference(Estimator(inverse_map), time_constant)
    found, alone = compare(fmu, reference, linear_flight(inverse_map, steps, seed=2), sizes)
    fmu.free()
    seen = {HealthState(one.health) for one in found}
    assert {HealthState.INVALID, HealthState.NO_COEFFICIENTS, HealthState.DEGRADED} <= seen
    if time_constant >= 1.0:
        assert n_filtered(found, alone) > 0.8 * steps
        narrower = [np.all(a.loads_std <= b.loads_std) for a, b in zip(found, alone, strict=True)]
        assert np.mean(narrower) > 0.7


@pytest.mark.parametrize(
    "change", [{"moment_station": 0.3, "reference_area": 0.2, "reference_length": 0.9}, {"alarm_scale": 0.2}]
)
def test_settings(fmu: LinearFmu, inverse_map: InverseMap, change: dict[str, float]) -> None:
    """The moment point and the references of the user; an alarm level at which many samples begin again."""
    assert fmu.filter(1.0) == OK
    estimator = Estimator(inverse_map)
    reference = LinearReference(estimator.with_settings(replace(estimator.settings, **change)), 1.0)
    at = {"alarm_scale": 5, "reference_area": 6, "reference_length": 7, "moment_station": 8}
    for name, value in change.items():
        assert fmu.set_scalars(at[name], value) == OK
    compare(fmu, reference, linear_flight(inverse_map, 40, seed=8), np.full(40, STEP))


def test_jumps_and_samples_that_do_not_fit(fmu: LinearFmu, inverse_map: InverseMap) -> None:
    """The filter begins again after a jump, and only predicts where strain does not fit the map."""
    samples = linear_flight(inverse_map, 12, seed=3, poor=False) + linear_flight(inverse_map, 12, 99, poor=False)
    bent = samples[6].strain + 1e-3 * np.sin(np.arange(N) ** 2)
    samples[6] = replace(samples[6], strain=bent)
    assert fmu.filter(10.0) == OK
    found, alone = compare(fmu, LinearReference(Estimator(inverse_map), 10.0), samples, np.full(24, STEP))
    assert found[6].health is HealthState.INCONSISTENT
    begun = [k for k in range(24) if np.array_equal(found[k].loads, alone[k].loads)]
    assert begun == [0, 6, 12]


OTHERS = {
    "nothing at the current strain": scaled_map(2, seed=4),
    "more states than gauges": scaled_map(2, seed=4, n=5, n_states=6),
    "further sensors": with_sensors(scaled_map(2, seed=4)),
}


@pytest.mark.parametrize("held", OTHERS.values(), ids=OTHERS)
def test_other_maps(tmp_path: Path, held: InverseMap) -> None:
    fmu = started(write_resource(held, tmp_path).as_uri(), held.n_gauges)
    names = [one.name for one in estimator_interface(held)]
    assert fmu.set_reals([names.index(FILTER_TIME_CONSTANT)], [1.0]) == OK
    scale = np.ones(held.n_gauges) if held.sensors is None else held.sensors.scale
    samples = [replace(one, strain=one.strain * scale) for one in linear_flight(held, 40, seed=5)]
    found, alone = compare(fmu, LinearReference(Estimator(held), 1.0), samples, np.full(40, STEP))
    assert n_filtered(found, alone) > 25
    fmu.free()


@pytest.mark.parametrize("time_constant", [1e-9, 1.0])
def test_temperatures(tmp_path: Path, time_constant: float) -> None:
    """Modes are states; sensors come and go, one by one and all."""
    cold, random = whole_scaled_map(2, seed=3), np.random.default_rng(7)
    held = with_temperature(cold, n_t=N_T)
    assert held.thermal is not None
    fmu = LinearFmu(write_resource(held, tmp_path).as_uri(), N)
    fmu.n_t = N_T
    fmu.start()
    assert fmu.filter(time_constant) == OK
    known, samples = np.ones(N_T, dtype=bool), []
    rise = 0.2 * held.thermal.prior_std * random.standard_normal(len(held.thermal.prior_std))
    for k, sample in enumerate(linear_flight(cold, 60, seed=9)):
        known = random.random(N_T) < random.choice([0.0, 0.5, 1.0]) if k % 4 == 0 else known
        now = rise * np.exp(-0.02 * k)
        theta = REFERENCE + held.thermal.sensor_operator @ now + held.thermal.sensor_std * random.normal(size=N_T)
        strain = sample.strain + held.thermal.linear_strain @ now
        samples.append(replace(sample, strain=strain, temperature=np.where(known, theta, np.nan)))
    sizes = random.uniform(0.005, 0.1, 60)
    found, alone = compare(fmu, LinearReference(Estimator(held), time_constant), samples, sizes)
    assert n_filtered(found, alone) >= (0 if time_constant < 1.0 else 40)
    state = fmu.get_state()
    after = [fmu.advance(one, 10.0 + k * STEP, STEP).tobytes() for k, one in enumerate(samples[:8])]
    assert fmu.call("SetFMUstate", state) == OK
    assert [fmu.advance(one, 10.0 + k * STEP, STEP).tobytes() for k, one in enumerate(samples[:8])] == after
    fmu.free()


def test_outputs_follow_what_is_set_without_a_step(fmu: LinearFmu, inverse_map: InverseMap) -> None:
    """A sample is that at the start of a step, however often inputs are set and read before it is taken."""
    samples, reference = linear_flight(inverse_map, 8, seed=17), LinearReference(Estimator(inverse_map), 1.0)
    assert fmu.filter(1.0) == OK
    for k, sample in enumerate(samples):
        fmu.give(samples[0])
        fmu.outputs()
        fmu.give(sample)
        before = fmu.outputs()
        assert fmu.step(k / 64.0, 1.0 / 64.0) == OK
        assert fmu.outputs().tobytes() == before.tobytes()
        assert max(differences(before, reference.advance(sample, k / 64.0)[0]).values()) < TOLERANCE


def test_state_holds_the_law(fmu: LinearFmu, inverse_map: InverseMap, location: str) -> None:
    samples = linear_flight(inverse_map, 24, seed=19)
    assert fmu.filter(1.0) == OK
    for k, sample in enumerate(samples[:14]):
        fmu.advance(sample, k * STEP, STEP)
    at, state = fmu.outputs(), fmu.get_state()
    content = fmu.serialise(state)
    later = [(sample, 0.14 + k * STEP, STEP) for k, sample in enumerate(samples[14:])]
    after = [fmu.advance(*one).tobytes() for one in later]
    assert fmu.call("SetFMUstate", state) == OK
    assert fmu.outputs().tobytes() == at.tobytes()
    assert [fmu.advance(*one).tobytes() for one in later] == after
    other = LinearFmu(location, N)
    status, moved = other.deserialise(content)
    assert status == OK
    assert other.call("SetFMUstate", moved) == OK
    assert [other.advance(*one).tobytes() for one in later] == after
    other.free()
    assert fmu.call("Reset") == OK
    fmu.start()
    assert [fmu.advance(*one).tobytes() for one in later] != after


def test_a_state_with_a_law_that_cannot_be(fmu: LinearFmu, inverse_map: InverseMap) -> None:
    assert fmu.filter(1.0) == OK
    fmu.advance(linear_flight(inverse_map, 1, seed=22)[0], 0.0, STEP)
    content = bytearray(fmu.serialise(fmu.get_state()))
    content[-8:] = np.float64(np.inf).tobytes()
    content[12:16] = zlib.crc32(content[16:]).to_bytes(4, "little")
    assert fmu.deserialise(bytes(content))[0] == ERROR
    assert "law of the filter that cannot be" in fmu.messages[-1][2]


def test_without_the_filter_nothing_is_remembered(fmu: LinearFmu, inverse_map: InverseMap) -> None:
    """Off at first, on, off again by the parameter and by a zero that is not known exactly."""
    samples, estimator = linear_flight(inverse_map, 12, seed=23, poor=False), Estimator(inverse_map)
    reference = LinearReference(estimator, 1.0)
    for k, sample in enumerate(samples):
        on = k in (4, 5, 6, 9)
        assert fmu.filter(1.0 if on else 0.0) == OK
        native = fmu.advance(sample, k * STEP, STEP)
        reference.switched.time_constant = 1.0 if on else 0.0
        found, alone = reference.advance(sample, k * STEP)
        assert max(differences(native, found).values()) < TOLERANCE
        assert np.array_equal(found.loads, alone.loads) == (k not in (5, 6))
    assert fmu.filter(1.0) == OK
    fmu.advance(samples[0], 0.9, STEP)
    filtered = fmu.advance(samples[1], 0.91, STEP)
    assert fmu.set_reals([first_zero(N) + N], [1e-12]) == OK
    without = fmu.advance(samples[1], 0.92, STEP)
    assert fmu.filter(0.0) == OK
    assert fmu.advance(samples[1], 0.93, STEP).tobytes() == without.tobytes()
    assert filtered[10:15].tobytes() != without[10:15].tobytes()


def test_derivatives_with_the_filter_on_are_those_of_the_step(fmu: LinearFmu, inverse_map: InverseMap) -> None:
    """What the steps before left is held."""
    samples = linear_flight(inverse_map, 3, seed=4, poor=False)
    assert fmu.filter(1.0) == OK
    for k, sample in enumerate(samples):
        fmu.advance(sample, k * STEP, STEP)
    state, strains = fmu.get_state(), range(N_OUTPUTS, N_OUTPUTS + N)
    fmu.give(samples[0])
    held, bits = fmu.serialise(fmu.get_state()), fmu.outputs().tobytes()
    direction = inverse_map.noise_std * np.random.default_rng(3).normal(size=N)
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


def advance_3(fmu: Fmu3, sample: LinearSample, time: float) -> np.ndarray:
    """All outputs of FMI 3.0 after a step."""
    assert fmu.set("Float64", c_double, [Fmu3.STRAIN], sample.strain) == OK
    assert fmu.set("Boolean", c_bool, [Fmu3.VALID], sample.valid.tolist()) == OK
    flow = [sample.pressure, sample.deviation]
    assert fmu.set("Float64", c_double, [Fmu3.FIRST_SCALAR, Fmu3.FIRST_SCALAR + 1], flow) == OK
    flags, reached = [c_bool() for _ in range(3)], c_double()
    pointers = [*map(byref, flags), byref(reached)]
    assert fmu.call("DoStep", c_double(time), c_double(STEP), c_bool(True), *pointers) == OK
    return fmu.outputs()


def test_fmi_3_gives_the_same_bits(fmu: LinearFmu, inverse_map: InverseMap, location: str) -> None:
    third = Fmu3(location, N)
    third.start()
    assert third.set("Float64", c_double, [Fmu3.TARE], [1.0]) == OK
    assert fmu.filter(1.0) == OK
    for k, sample in enumerate(linear_flight(inverse_map, 8, seed=9)):
        expected = fmu.advance(sample, k * STEP, STEP)
        assert advance_3(third, sample, k * STEP).tobytes() == expected.tobytes()
    third.free()


@pytest.mark.parametrize("value", [-1.0, 1e-10, 2e6, np.nan, np.inf])
def test_time_constants_that_cannot_be(fmu: LinearFmu, value: float) -> None:
    assert fmu.filter(value) == ERROR
    assert "filter_time_constant" in fmu.messages[-1][2]


@pytest.mark.parametrize(
    ("name", "change", "expected"),
    [
        ("scaled", lambda old: old[:0], "expected 1 to 4096 values along axis 0, found 0"),
        ("load", lambda old: old[:-1], "expected "),
        ("n_modes", np.int32(5000), "expected a whole number from 0 to "),
        ("slow", np.float64(0.0), "expected numbers above zero, found 0"),
        ("largest_time", np.float64(1e-12), "expected a number above the smallest time"),
        ("std", put(0, -1.0), "expected numbers above zero, found -1"),
        ("rest_cross", put((-1, -1), np.nan), "holds a value that is not finite"),
    ],
)
def test_what_cannot_be_is_refused(
    inverse_map: InverseMap, tmp_path: Path, name: str, change: Any, expected: str
) -> None:
    fmu = LinearFmu(with_arrays(inverse_map, tmp_path, {f"linear_filter.{name}": change}), N)
    assert f"'linear_filter.{name}': {expected}" in refusal(fmu)
