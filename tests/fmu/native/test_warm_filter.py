"""The filter of maps with tables and temperature modes in the native library: the numbers of Python; its state."""

from __future__ import annotations

from collections.abc import Iterator
from ctypes import byref, c_bool, c_double
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from agreement import assert_same, tracked
from flight_fmu import N_D, FlightFmu, FlightSample, whole_map
from raw_fmu import N_OUTPUTS, OK, Fmu3, write_resource
from thermal_maps import with_temperature
from warm_flights import warm_flight

from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.signal_names import FILTER_TIME_CONSTANT
from strainfmu.interface.estimator_variables import estimator_arrays, estimator_interface

pytestmark = pytest.mark.fast

N_T, STEP = 4, 0.01


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


@pytest.mark.parametrize("seconds", [0.1, 10.0])
def test_a_flight_is_that_of_the_estimator(fmu: FlightFmu, held: InverseMap, seconds: float) -> None:
    """Variable steps, up to 5 s; sensors, gauges, whole samples and navigation get lost."""
    sizes, time = np.random.default_rng(1).uniform(0.002, 0.05, 30), 3.0
    sizes[25] = 5.0
    assert fmu.filter(seconds) == OK
    estimator = Estimator(held).filter(seconds)
    for one, size in zip(poor_flight(held, 30, seed=5), sizes.tolist(), strict=True):
        assert_same(fmu.advance_over(one, time, size), tracked(estimator, one, time))
        time += size


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


def test_state_goes_on_where_another_sensor_is_lost(fmu: FlightFmu, held: InverseMap, resources: Path) -> None:
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
