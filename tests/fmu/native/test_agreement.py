"""The native run-time gives the numbers of the estimator in Python, by FMI 2.0 and 3.0, for random inputs."""

from __future__ import annotations

import ctypes

import numpy as np
import pytest
from agreement import assert_same, estimated, random_samples
from native_case import NativeCase
from raw_fmu import OK, SETTINGS, Fmu2, Fmu3

from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.reference.gain import residual_precision
from strainfmu.estimator.settings import EstimatorSettings
from strainfmu.interface.estimator_variables import PARAMETERS

pytestmark = pytest.mark.fast


def drawn_settings(random: np.random.Generator) -> EstimatorSettings:
    """Settings that are not those of the map."""
    return EstimatorSettings(
        sensor_range=float(random.choice([0.05, 1e-4, 1e9])),
        alarm_scale=float(random.choice([1.0, 1e-3, 100.0])),
        reference_area=float(random.choice([0.2, 3.0])),
        reference_length=float(random.choice([0.5, 2.0])),
        moment_station=float(random.choice([0.0, 1.5, -20.0])),
    )


def test_random_inputs_and_settings(case: NativeCase) -> None:
    """Masks, outliers, broken gauges, broken air data; every 20 samples other settings."""
    second, third = Fmu2(case.uri, case.n).start(), Fmu3(str(case.resources), case.n).start()
    estimator, random, seen = Estimator(case.inverse_map), np.random.default_rng(2), set()
    for k, sample in enumerate(random_samples(case.inverse_map, 120, seed=2)):
        if k >= 60 and k % 20 == 0:
            estimator = estimator.with_settings(drawn_settings(random))
            values = [getattr(estimator.settings, name) for name in PARAMETERS]
            assert second.set_scalars(SETTINGS, *values) == OK
            assert third.set("Float64", ctypes.c_double, third.SCALARS[SETTINGS:], values) == OK
        second.set_strain(sample.strain)
        second.set_valid(sample.valid)
        assert second.set_scalars(0, *sample.flow) == OK
        references = [third.STRAIN, *third.SCALARS[:4]]
        assert third.set("Float64", ctypes.c_double, references, [*sample.strain, *sample.flow]) == OK
        assert third.set("Boolean", ctypes.c_bool, [third.VALID], sample.valid.tolist()) == OK
        outputs = second.outputs()
        assert third.outputs().tobytes() == outputs.tobytes()
        assert_same(outputs, estimated(estimator, sample))
        seen.add(HealthState(int(outputs[20])))
    assert {HealthState.INCONSISTENT, HealthState.NO_COEFFICIENTS} <= seen
    second.free()
    third.free()


def test_a_suspect_of_the_fmu_is_that_of_the_estimator(small: NativeCase) -> None:
    """One gauge off by 4 to 6 deviations of what the others predict for it, each in turn."""
    fmu, m = Fmu2(small.uri, small.n).start(), small.inverse_map
    estimator, precision, seen = Estimator(m), np.diag(residual_precision(m)), set()
    assert fmu.set_scalars(0, m.nominal_dynamic_pressure) == OK
    for gauge in range(small.n):
        for bias in (4.0, 4.5, 5.0, 5.5, 6.0):
            strain = m.mean_strain + bias / np.sqrt(precision[gauge]) * (np.arange(small.n) == gauge)
            fmu.set_strain(strain)
            outputs = fmu.outputs()
            assert_same(outputs, estimator.step(strain, m.nominal_dynamic_pressure))
            seen.add(HealthState(int(outputs[20])))
    assert HealthState.SUSPECT in seen
    fmu.free()
