"""Zeros of the gauges in the native library: the numbers of Python while they change, and what is refused."""

import numpy as np
import pytest
from agreement import assert_same, estimated, random_samples
from native_case import NativeCase
from raw_fmu import ERROR, OK, Fmu2, Fmu3, first_zero

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
