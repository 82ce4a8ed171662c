"""Temperature sensors of the native library: the numbers of Python while sensors come and go; what is refused."""

from __future__ import annotations

from ctypes import byref, c_double
from dataclasses import replace

import numpy as np
import pytest
from agreement import assert_same, estimated, random_samples
from native_case import NativeCase
from raw_fmu import OK, VALUES, Fmu2, Fmu3, first_zero, write_resource
from scaled_maps import whole_scaled_map
from thermal_maps import REFERENCE, with_temperature

from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.gauge_zeros import GaugeZeros, no_zeros
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.sensors import ThermalMap

pytestmark = pytest.mark.fast

N_T = 8


def warm(inverse_map: InverseMap) -> InverseMap:
    """``inverse_map`` with 12 modes and eight sensors, thermal strain of the size of its gauges' noise."""
    noise = float(np.sqrt(np.median(np.diag(inverse_map.gauge_covariance))))
    random, n = np.random.default_rng(3), inverse_map.n_gauges
    sheet = noise * np.array([2e-2, -1e-4])
    strain = 0.1 * noise * random.normal(size=(n, 12))
    return with_temperature(inverse_map, k=12, n_t=N_T, mode_strain=strain, apparent_strain=sheet)


@pytest.fixture(scope="module", params=["case 1", "case 2"])
def hot(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> NativeCase:
    one = {
        "case 1": lambda: whole_scaled_map(1, seed=4, n=30, n_states=5),
        "case 2": lambda: whole_scaled_map(2, seed=4, n=27, n_states=40),
    }[request.param]()
    held = warm(one)
    return NativeCase(held, write_resource(held, tmp_path_factory.mktemp("warm")))


def first_temperature(n_gauges: int) -> int:
    return first_zero(n_gauges) + 2 * n_gauges + 1


def drawn_temperature(thermal: ThermalMap, k: int, random: np.random.Generator) -> np.ndarray:
    """Readings of modes at random, sensors that are off or broken among them."""
    amplitude = thermal.prior_std * random.normal(size=len(thermal.prior_std))
    temperature = REFERENCE + thermal.sensor_operator @ amplitude + thermal.sensor_std * random.normal(size=N_T)
    if k % 5 == 1:
        broken = [0.0, -1.0, np.nan, np.inf, 1e5, REFERENCE + 2001.0]
        temperature[random.choice(N_T, 3, replace=False)] = random.choice(broken, 3)
    if k % 17 == 3:
        temperature[:] = 0.0
    return temperature


def give_temperature(fmu: Fmu2, temperature: np.ndarray, n: int) -> None:
    first = first_temperature(n)
    assert fmu.set_reals(range(first, first + N_T), temperature) == OK


def test_as_in_python_while_sensors_and_zeros_change(hot: NativeCase) -> None:
    random, fmu, estimator = np.random.default_rng(1), Fmu2(hot.uri, hot.n).start(), Estimator(hot.inverse_map)
    plain = Fmu2(hot.uri, hot.n).start()
    thermal = hot.inverse_map.thermal
    zeros, noise = no_zeros(hot.n), float(np.sqrt(np.median(np.diag(thermal.isothermal_covariance))))
    for k, sample in enumerate(random_samples(hot.inverse_map, 30, seed=5)):
        if k % 20 == 10:
            zeros = GaugeZeros(
                value=1e-4 * random.normal(size=hot.n),
                std=noise * random.uniform(0.0, 2.0, hot.n),
                common_std=noise,
            )
            values = [*zeros.value, *zeros.std, zeros.common_std]
            assert fmu.set_reals(range(first_zero(hot.n), first_temperature(hot.n)), values) == OK
            estimator = estimator.with_zeros(zeros)
        temperature = drawn_temperature(thermal, k, random)
        moved = replace(sample, strain=sample.strain + zeros.value)
        give_temperature(fmu, temperature, hot.n)
        fmu.set_strain(moved.strain)
        fmu.set_valid(moved.valid)
        assert fmu.set_scalars(0, *moved.flow) == OK
        assert_same(fmu.outputs(), estimated(estimator, moved, temperature=temperature))
    give_temperature(fmu, np.zeros(N_T), hot.n)
    assert fmu.set_reals(range(first_zero(hot.n), first_temperature(hot.n)), np.zeros(2 * hot.n + 1)) == OK
    for one in (fmu, plain):
        one.set_strain(sample.strain)
        one.set_valid(sample.valid)
        assert one.set_scalars(0, *sample.flow) == OK
    assert fmu.outputs().tobytes() == plain.outputs().tobytes()


def test_array_of_fmi_3(hot: NativeCase) -> None:
    thermal, n = hot.inverse_map.thermal, hot.n
    temperature = drawn_temperature(thermal, 0, np.random.default_rng(4))
    two, three = Fmu2(hot.uri, n).start(), Fmu3(str(hot.resources), n).start()
    give_temperature(two, temperature, n)
    assert three.set("Float64", c_double, [Fmu3.TARE], temperature) == OK
    assert three.get("Float64", c_double, [Fmu3.TARE], N_T)[1].tolist() == temperature.tolist()
    assert three.get("Float64", c_double, [Fmu3.TIME + 2], 1)[0] == OK  # the time, behind the filter
    strain = hot.inverse_map.mean_strain
    two.set_strain(strain)
    assert three.set("Float64", c_double, [Fmu3.STRAIN], strain) == OK
    assert two.outputs().tobytes() == three.outputs().tobytes()


def test_state_brings_temperatures_back(hot: NativeCase) -> None:
    random, thermal = np.random.default_rng(6), hot.inverse_map.thermal
    fmu = Fmu2(hot.uri, hot.n).start()
    cold = fmu.get_reals(range(first_temperature(hot.n), first_temperature(hot.n) + N_T))
    assert cold.tolist() == [0.0] * N_T
    fmu.set_strain(hot.inverse_map.mean_strain)
    give_temperature(fmu, drawn_temperature(thermal, 1, random), hot.n)
    expected = fmu.outputs()
    status, state = fmu.deserialise(fmu.serialise(fmu.get_state()))
    assert status == OK
    give_temperature(fmu, drawn_temperature(thermal, 0, random), hot.n)
    assert fmu.outputs().tobytes() != expected.tobytes()
    assert fmu.call("SetFMUstate", state) == OK
    assert fmu.outputs().tobytes() == expected.tobytes()
    assert fmu.call("Reset") == OK
    assert fmu.get_reals(range(first_temperature(hot.n), first_temperature(hot.n) + N_T)).tolist() == [0.0] * N_T
    fmu.call("FreeFMUstate", byref(state))


def test_derivatives_are_those_of_differences(hot: NativeCase) -> None:
    """By temperatures and strains at once, against central differences."""
    random, thermal, n = np.random.default_rng(7), hot.inverse_map.thermal, hot.n
    fmu, temperature = Fmu2(hot.uri, n).start(), drawn_temperature(thermal, 0, random)
    temperature[2] = 0.0
    strain = hot.inverse_map.mean_strain + hot.inverse_map.noise_std
    inputs = [*range(27, 27 + n), *range(first_temperature(n), first_temperature(n) + N_T)]
    at, direction = np.concatenate([strain, temperature]), np.concatenate([0.01 * strain, random.normal(size=N_T)])
    direction[n + 2] = 5.0  # of the sensor that is off
    assert fmu.set_reals(inputs, at) == OK
    ours = fmu.derivative(VALUES, inputs, direction)
    step = np.where(np.arange(n + N_T) == n + 2, 0.0, 1e-3 * direction)
    ends = []
    for sign in (1.0, -1.0):
        assert fmu.set_reals(inputs, at + sign * step) == OK
        ends.append(fmu.get_reals(VALUES))
    size = np.abs(ends[0]) + np.abs(ends[1])
    np.testing.assert_allclose((ends[0] - ends[1]) / 2e-3, ours, rtol=1e-5, atol=1e-8 * size.max())
