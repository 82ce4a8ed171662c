"""Zeros of the gauges in the native library: the numbers of Python while they change, and what is refused."""

from __future__ import annotations

from ctypes import byref, c_double
from pathlib import Path

import numpy as np
import pytest
from agreement import assert_same, estimated, random_samples, tracked
from flight_fmu import FIRST, N_D, FlightFmu, random_flight, whole_map
from native_case import NativeCase
from raw_fmu import ERROR, N_OUTPUTS, OK, VALUES, Fmu2, Fmu3, first_zero, write_resource

from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.gauge_zeros import GaugeZeros, no_zeros
from strainfmu.estimator.health import HealthState

pytestmark = pytest.mark.fast


ZEROS = [Fmu3.ZERO, Fmu3.ZERO + 1, Fmu3.ZERO + 2]


def drawn(n: int, random: np.random.Generator, size: float) -> GaugeZeros:
    std = size * random.uniform(0.0, 2.0, n)
    return GaugeZeros(value=2e-4 * random.normal(size=n), std=std, common_std=size)


def give(fmu: Fmu2, zeros: GaugeZeros, first: int) -> int:
    values = np.concatenate([zeros.value, zeros.std, [zeros.common_std]])
    return fmu.set_reals(range(first, first + len(values)), values)


def test_as_in_python_while_zeros_change(case: NativeCase) -> None:
    random, fmu = np.random.default_rng(1), Fmu2(case.uri, case.n).start()
    estimator, plain = Estimator(case.inverse_map), Fmu2(case.uri, case.n).start()
    noise = float(np.median(case.inverse_map.noise_std))
    for k, sample in enumerate(random_samples(case.inverse_map, 24, seed=5)):
        if k % 8 == 0:
            zeros = drawn(case.n, random, noise * 10.0 ** random.uniform(-1.0, 1.5))
            assert give(fmu, zeros, first_zero(case.n)) == OK
            estimator = estimator.with_zeros(zeros)
        reading = sample.strain + zeros.value
        moved = type(sample)(reading, sample.valid, *sample.flow)
        fmu.set_strain(reading)
        fmu.set_valid(moved.valid)
        assert fmu.set_scalars(0, *moved.flow) == OK
        assert_same(fmu.outputs(), estimated(estimator, moved))
    assert give(fmu, no_zeros(case.n), first_zero(case.n)) == OK
    for one in (fmu, plain):
        one.set_strain(sample.strain)
        one.set_valid(sample.valid)
        assert one.set_scalars(0, *sample.flow) == OK
    assert fmu.outputs().tobytes() == plain.outputs().tobytes()


def test_nonlinear_estimator_as_in_python(tmp_path: Path) -> None:
    held = whole_map()
    location = write_resource(held, tmp_path).as_uri()
    fmu, random = FlightFmu(location, N_D), np.random.default_rng(2)
    fmu.start()
    zeros = drawn(N_D, random, 1e-6)
    assert give(fmu, zeros, FIRST + 28) == OK
    estimator = Estimator(held).with_zeros(zeros)
    for k, sample in enumerate(random_flight(held, 8, seed=3)):
        reading = sample.strain + zeros.value + zeros.std * random.normal(size=N_D)
        if k % 4 == 3:
            reading[k] += 1e-4  # does not fit: the loads of the linear map
        moved = type(sample)(strain=reading, valid=sample.valid, flow=sample.flow)
        assert_same(fmu.advance(moved), tracked(estimator, moved))
    fmu.free()


def test_the_log_states_why_health_is_degraded(small: NativeCase) -> None:
    """While matrices for other deviations are made; what is read between the steps changes nothing."""
    fmu, other = (Fmu2(small.uri, small.n, logging=True).start() for _ in range(2))
    zeros = GaugeZeros(value=np.zeros(small.n), std=np.full(small.n, 1e-7), common_std=0.0)
    for one in (fmu, other):
        one.set_strain(small.inverse_map.mean_strain)
        assert one.set_scalars(0, 1e5) == OK
        assert one.step() == OK
        assert give(one, zeros, first_zero(small.n)) == OK
    states = []
    for _ in range(24):
        fmu.outputs()
        assert [fmu.step(), other.step()] == [OK, OK]
        states.append(int(fmu.outputs()[20]))
        assert fmu.outputs().tobytes() == other.outputs().tobytes()
    pending = states.count(HealthState.DEGRADED)
    assert 0 < pending < 24
    assert states == [HealthState.DEGRADED] * pending + [HealthState.OK] * (24 - pending)
    said = [line for _, _, line in fmu.messages if "health DEGRADED" in line]
    assert len(said) == 1
    assert said[0].endswith("; matrices for other deviations of zeros are being made")


def test_arrays_of_fmi_3(small: NativeCase) -> None:
    zeros = drawn(small.n, np.random.default_rng(4), 1e-7)
    two, three = Fmu2(small.uri, small.n).start(), Fmu3(str(small.resources), small.n).start()
    assert give(two, zeros, first_zero(small.n)) == OK
    values = [*zeros.value, *zeros.std, zeros.common_std]
    assert three.set("Float64", c_double, ZEROS, values) == OK
    assert three.get("Float64", c_double, ZEROS, 2 * small.n + 1)[1].tolist() == values
    strain = small.inverse_map.mean_strain + zeros.value
    two.set_strain(strain)
    assert three.set("Float64", c_double, [13], strain) == OK
    assert two.outputs().tobytes() == three.outputs().tobytes()


@pytest.mark.parametrize(
    ("which", "value", "text"),
    [
        (0, 0.06, "zero[1]: expected -0.05 to 0.05 m/m, got 0.06"),
        (7, float("nan"), "zero[8]: expected -0.05 to 0.05 m/m, got nan"),
        (8, -1e-6, "zero_std[1]: expected 0 to 0.05 m/m, got -1e-06"),
        (16, 1.0, "zero_common_std: expected 0 to 0.05 m/m, got 1"),
    ],
)
def test_what_is_no_zero_is_refused(small: NativeCase, which: int, value: float, text: str) -> None:
    fmu = Fmu2(small.uri, small.n).start()
    before = fmu.outputs()
    assert fmu.set_reals([first_zero(small.n) + which], [value]) == ERROR
    assert text in fmu.messages[-1][2]
    assert np.array_equal(fmu.outputs(), before, equal_nan=True)


def test_state_brings_zeros_back(case: NativeCase) -> None:
    random = np.random.default_rng(6)
    fmu, noise = Fmu2(case.uri, case.n).start(), float(np.median(case.inverse_map.noise_std))
    fmu.set_strain(case.inverse_map.mean_strain)
    assert give(fmu, drawn(case.n, random, noise), first_zero(case.n)) == OK
    expected = fmu.outputs()
    status, state = fmu.deserialise(fmu.serialise(fmu.get_state()))
    assert status == OK
    assert give(fmu, drawn(case.n, random, 3.0 * noise), first_zero(case.n)) == OK
    assert fmu.outputs().tobytes() != expected.tobytes()
    assert fmu.call("SetFMUstate", state) == OK
    assert fmu.outputs().tobytes() == expected.tobytes()
    assert fmu.call("Reset") == OK
    assert not fmu.get_reals(range(first_zero(case.n), first_zero(case.n) + 2 * case.n + 1)).any()
    fmu.call("FreeFMUstate", byref(state))


def test_derivative_by_a_zero_is_that_of_less_strain(case: NativeCase) -> None:
    fmu = Fmu2(case.uri, case.n).start()
    fmu.set_strain(case.inverse_map.mean_strain + case.inverse_map.noise_std)
    zeros, strains = range(first_zero(case.n), first_zero(case.n) + case.n), range(N_OUTPUTS, N_OUTPUTS + case.n)
    direction = np.random.default_rng(7).normal(size=case.n)
    ours, of_strain = fmu.derivative(VALUES, zeros, direction), fmu.derivative(VALUES, strains, -direction)
    for group in (slice(0, 5), slice(5, 10)):
        np.testing.assert_allclose(
            ours[group], of_strain[group], rtol=0.0, atol=1e-7 * np.abs(of_strain[group]).max()
        )
