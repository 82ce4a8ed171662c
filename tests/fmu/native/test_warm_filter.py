"""The filter of maps with tables and temperature modes in the native library: numpy's numbers, and its state."""

from __future__ import annotations

from collections.abc import Iterator
from ctypes import byref, c_bool, c_double
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from damaged_resource import refusal, with_arrays
from flight_fmu import N_D, FlightFmu, FlightSample, check, whole_map
from further_maps import STATIONS, check_further, with_further_tables
from raw_fmu import N_OUTPUTS, OK, Fmu2, Fmu3, write_resource
from sensor_maps import with_sensors
from thermal_maps import with_temperature
from warm_flights import warm_flight

from strainfmu.estimator.filter.flight_filter import FilteredStep, FlightFilter
from strainfmu.estimator.filter.settings import FilterSettings
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.manifold.estimator import ManifoldEstimator
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.interface.estimator_variables import estimator_arrays, estimator_interface, output_values
from strainfmu.interface.filter_variables import FILTER_TIME_CONSTANT
from strainfmu.interface.input_names import FLOW_INPUTS, NAVIGATION_INPUTS
from strainfmu.interface.sensor_variables import reading_names
from strainfmu.interface.temperature_variables import temperature_names

pytestmark = pytest.mark.fast

N_T, STEP = 4, 0.01
N_FURTHER = 4 + 12 * len(STATIONS)
"""Outputs of rolling moment and section loads, the last ones."""

TOLERANCE = 1e-8
"""Relative to the largest of a group of outputs in the same sample, as without modes. Over 200 samples, T = 0.1 to
10 s, all agreed to 2e-10 but chi-square, of which little is left where the prediction is met: 6e-10."""


@pytest.fixture(scope="module")
def held() -> InverseMap:
    return with_temperature(whole_map())


@pytest.fixture(scope="module")
def resources(held: InverseMap, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_resource(held, tmp_path_factory.mktemp("warm"))


@pytest.fixture
def fmu(resources: Path) -> Iterator[FlightFmu]:
    one = instance(resources)
    one.start()
    yield one
    one.free()


def instance(resources: Path) -> FlightFmu:
    one = FlightFmu(resources.as_uri(), N_D)
    one.n_t = N_T
    return one


def poor_flight(held: InverseMap, steps: int, seed: int) -> list[FlightSample]:
    """Sensors come and go, one by one and all; gauges, whole samples and quantities of navigation get lost."""
    random, known, samples = np.random.default_rng(seed), np.ones(N_T, dtype=bool), []
    for k, one in enumerate(warm_flight(held, steps, seed, STEP)):
        known = random.random(N_T) < random.choice([0.0, 0.5, 1.0]) if k % 6 == 5 else known
        assert one.temperature is not None
        temperature = np.where(known, one.temperature, np.nan)
        valid = (random.random(N_D) > 0.1 * (k % 7)) & (k % 13 < 11)
        flow = {name: value for name, value in one.flow.items() if random.random() > 0.4}
        samples.append(replace(one, temperature=temperature, valid=valid, flow=flow))
    return samples


def compare(fmu: FlightFmu, held: InverseMap, seconds: float, samples: list[FlightSample]) -> list[FilteredStep]:
    """Assert that all steps, of different sizes, are those of numpy; the latter."""
    sizes = np.random.default_rng(1).uniform(0.002, 0.05, len(samples))
    sizes[25::50] = 5.0
    flight = FlightFilter(ManifoldEstimator(held), FilterSettings(time_constant=seconds))
    time, before, found = 3.0, STEP, []
    assert fmu.filter(seconds) == OK
    for one, size in zip(samples, sizes.tolist(), strict=True):
        step = flight.recorded(before, one.strain, one.flow, valid=one.valid, temperature=one.temperature)
        check(fmu.advance_over(one, time, size), step.estimate[0], tolerance=TOLERANCE)
        found.append(step)
        time, before = time + size, size
    return found


@pytest.mark.parametrize(("seconds", "steps"), [(1e-9, 20), (0.1, 20), (1.0, 60), (10.0, 100)])
def test_a_flight_is_that_of_numpy(fmu: FlightFmu, held: InverseMap, seconds: float, steps: int) -> None:
    """Variable steps, up to 5 s; sensors, gauges, whole samples and navigation get lost."""
    samples = poor_flight(held, steps, seed=5)
    found = compare(fmu, held, seconds, samples)
    seen = {HealthState(one.estimate.health[0]) for one in found}
    assert {HealthState.OK, HealthState.DEGRADED} <= seen
    known = np.array([np.isfinite(one.temperature) for one in samples if one.temperature is not None])
    changes = np.any(known[1:] != known[:-1], axis=1)
    assert np.sum(changes & [one.continues for one in found[1:]]) >= steps // 12


def test_with_further_sensors_and_section_loads(tmp_path: Path) -> None:
    """Rows of every kind are brought to the reference temperature; loads of sections follow from the law, too."""
    held = with_temperature(with_sensors(with_further_tables(whole_map())))
    assert held.sensors is not None
    interface = estimator_interface(held)
    at = {one.name: number for number, one in enumerate(interface)}
    outputs = [one.name for one in interface if one.causality == "output" and one.name != "tare_state"]
    flight = FlightFilter(ManifoldEstimator(held), FilterSettings(time_constant=1.0))
    fmu = Fmu2(write_resource(held, tmp_path).as_uri(), N_D).start()
    assert fmu.set_reals([at[FILTER_TIME_CONSTANT]], [1.0]) == OK
    for k, sample in enumerate(poor_flight(held, 20, seed=11)):
        readings, temperature = sample.strain * held.sensors.scale, sample.temperature
        assert temperature is not None
        flow = dict.fromkeys(FLOW_INPUTS + NAVIGATION_INPUTS, np.nan) | sample.flow
        inputs = [*reading_names(held), *flow, *temperature_names(held.thermal)]
        fmu.set_valid(sample.valid)
        assert fmu.set_reals([at[name] for name in inputs], [*readings, *flow.values(), *temperature]) == OK
        assert fmu.step(k * STEP, STEP) == OK
        step = flight.recorded(STEP, readings, sample.flow, valid=sample.valid, temperature=temperature)
        expected = dict(zip(outputs, output_values(step.estimate[0], with_further=True), strict=True))
        loads = outputs[outputs.index("force.axial") :][:5]
        found = fmu.get_reals([at[name] for name in [*loads, *outputs[-N_FURTHER:]]])
        np.testing.assert_allclose(found[:5], [expected[name] for name in loads], rtol=TOLERANCE)
        check_further(found[5:], np.array([expected[name] for name in outputs[-N_FURTHER:]]), TOLERANCE)
    assert step.continues
    assert np.isfinite(found).all()
    fmu.free()


def test_without_memory_each_sample_is_estimated_on_its_own(fmu: FlightFmu, held: InverseMap) -> None:
    """T to zero gives the static estimate at the temperature that sensors tell."""
    samples = warm_flight(held, 6, seed=4, time_step=STEP)
    random, time = np.random.default_rng(3), 0.0
    for k, one in enumerate(samples):
        assert one.temperature is not None
        known = random.random(N_T) < (0.0 if k == 4 else 0.6)
        sample = replace(one, temperature=np.where(known, one.temperature, np.nan))
        # Both begin from the state of the last step: repeated, they do not depend on where they began.
        found = []
        for seconds in (0.0, 1e-9):
            assert fmu.filter(seconds) == OK
            for _ in range(12):
                outputs = fmu.advance_over(sample, time, STEP)
                time += STEP
            found.append(outputs)
        static, filtered = found
        assert filtered[20] == static[20]
        assert filtered[:5] == pytest.approx(static[:5], abs=0.02 * np.min(static[5:10]))
        assert filtered[5:10] == pytest.approx(static[5:10], rel=5e-3)


def test_lost_sensors_cost_no_memory(fmu: FlightFmu, held: InverseMap) -> None:
    """What they told of strain, gauge factor and modulus stays known; a sample alone knows much less."""
    samples = warm_flight(held, 24, seed=6, time_step=STEP)
    lost = [replace(one, temperature=np.full(N_T, np.nan)) if k >= 20 else one for k, one in enumerate(samples)]
    assert fmu.filter(10.0) == OK
    found = [fmu.advance_over(one, k * STEP, STEP) for k, one in enumerate(lost)]
    assert np.all(found[20][15:20] < 1.05 * found[19][15:20])
    assert np.all(np.abs(found[20][10:15] - found[19][10:15]) < found[19][15:20])
    assert fmu.filter(0.0) == OK
    alone = fmu.advance_over(lost[20], 1.0, STEP)
    assert np.any(alone[15:20] > 1.2 * found[20][15:20])


def test_fmi_3_gives_the_same_bits(fmu: FlightFmu, held: InverseMap, resources: Path) -> None:
    """Strains and temperatures are arrays there."""
    names = [one.name for one in estimator_arrays(estimator_interface(held))]
    third = Fmu3(resources.as_uri(), N_D)
    third.start()
    assert third.set("Float64", c_double, [names.index(FILTER_TIME_CONSTANT)], [1.0]) == OK
    assert fmu.filter(1.0) == OK
    for k, sample in enumerate(poor_flight(held, 8, seed=9)):
        one = replace(sample, valid=np.ones(N_D, dtype=bool), flow={"mach_number": 6.0})
        expected = fmu.advance_over(one, k * STEP, STEP)[:N_OUTPUTS]
        assert third.set("Float64", c_double, [names.index("mach_number")], [6.0]) == OK
        assert third.set("Float64", c_double, [Fmu3.STRAIN], one.strain) == OK
        assert third.set("Float64", c_double, [names.index("temperature")], one.temperature) == OK
        flags, reached = [c_bool() for _ in range(3)], c_double()
        pointers = [*map(byref, flags), byref(reached)]
        assert third.call("DoStep", c_double(k * STEP), c_double(STEP), c_bool(True), *pointers) == OK
        assert third.outputs().tobytes() == expected.tobytes()
    third.free()


def test_state_holds_what_was_known_of_the_temperature(fmu: FlightFmu, held: InverseMap, resources: Path) -> None:
    """Back in time and in another instance, where another sensor is lost in the next step."""
    samples = poor_flight(held, 12, seed=19)
    samples[5:] = [replace(one, temperature=np.where([True, False] * 2, 300.0, np.nan)) for one in samples[5:]]
    assert fmu.filter(1.0) == OK
    for k, sample in enumerate(samples[:5]):
        fmu.advance_over(sample, k * STEP, STEP)
    state = fmu.get_state()
    content = fmu.serialise(state)
    later = [(sample, 0.05 + k * STEP, STEP) for k, sample in enumerate(samples[5:])]
    after = [fmu.advance_over(*one).tobytes() for one in later]
    assert fmu.call("SetFMUstate", state) == OK
    assert [fmu.advance_over(*one).tobytes() for one in later] == after
    other = instance(resources)
    status, moved = other.deserialise(content)
    assert status == OK
    assert other.call("SetFMUstate", moved) == OK
    assert [other.advance_over(*one).tobytes() for one in later] == after
    other.free()


@pytest.mark.parametrize(
    ("modes", "expected"),
    [(5, "expected that of the temperature modes"), (99, "expected a whole number from 0 to ")],
)
def test_a_filter_of_other_modes(held: InverseMap, tmp_path: Path, modes: int, expected: str) -> None:
    location = with_arrays(held, tmp_path, {"filter.n_modes": np.int32(modes)})
    assert expected in refusal(FlightFmu(location, N_D))
