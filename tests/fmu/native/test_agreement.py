"""The native run-time against the numpy estimator: random inputs, masks, faults and settings."""

from __future__ import annotations

import ctypes
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from agreement import Reference, Sample, random_samples, strain_at
from hypothesis import given, settings
from hypothesis import strategies as st
from native_case import NativeCase
from raw_fmu import OK, SETTINGS, Fmu2, Fmu3, write_resource

from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import load_inverse_map


def apply(fmu: Fmu2, sample: Sample) -> None:
    """Set all inputs."""
    fmu.set_strain(sample.strain)
    fmu.set_valid(sample.valid)
    assert fmu.set_scalars(0, *sample.flow) == OK


def test_ten_thousand_inputs(case: NativeCase) -> None:
    # 1250 for each of the eight maps.
    reference, fmu = Reference(case.inverse_map), Fmu2(case.uri, case.n).start()
    seen = set()
    for k, sample in enumerate(random_samples(case.inverse_map, 1250, seed=1)):
        apply(fmu, sample)
        assert fmu.step(0.01 * k) == OK
        outputs = fmu.outputs()
        reference.check(sample, outputs)
        seen.add(HealthState(int(outputs[20])))
    assert {
        HealthState.INCONSISTENT,
        HealthState.NO_COEFFICIENTS,
        HealthState.DEGRADED,
        HealthState.OUTSIDE,
    } <= seen
    assert (HealthState.UNIDENTIFIED in seen) == (case.inverse_map.case == 1)
    fmu.free()


@pytest.mark.fast
def test_no_gauge_at_all(case: NativeCase) -> None:
    reference, fmu = Reference(case.inverse_map), Fmu2(case.uri, case.n).start()
    sample = Sample(
        strain=np.full(case.n, np.nan),
        valid=np.ones(case.n, dtype=bool),
        dynamic_pressure=1e5,
        dynamic_pressure_std=0.0,
    )
    apply(fmu, sample)
    reference.check(sample, fmu.outputs())
    assert fmu.get_integers([20])[0] == HealthState.INVALID
    fmu.free()


@pytest.mark.fast
def test_suspect_and_those_it_cannot_be_told_from(case: NativeCase) -> None:
    reference, fmu = Reference(case.inverse_map), Fmu2(case.uri, case.n).start()
    seen = set()
    # One gauge off by 4 to 12 deviations of what the others predict for it.
    precision = np.sum(case.inverse_map.residual_whitening**2, axis=0)
    for gauge in range(case.n):
        for bias in np.linspace(4.0, 12.0, 17):
            strain = case.inverse_map.mean_strain.copy()
            strain[gauge] += bias / np.sqrt(precision[gauge])
            sample = Sample(
                strain=strain,
                valid=np.ones(case.n, dtype=bool),
                dynamic_pressure=case.inverse_map.nominal_dynamic_pressure,
                dynamic_pressure_std=0.0,
            )
            apply(fmu, sample)
            outputs = fmu.outputs()
            reference.check(sample, outputs)
            seen.add(int(outputs[20]))
    assert HealthState.SUSPECT in seen
    fmu.free()


@st.composite
def random_inputs(draw: st.DrawFn, n_gauges: int) -> Any:
    """Size of strain, faults, mask, pressure and settings; hypothesis shrinks what fails."""
    broken = st.sampled_from([np.nan, np.inf, -np.inf, 0.05, -0.05, 0.0500001, 1e99, 1e-300, 0.0])
    return {
        "seed": draw(st.integers(0, 2**32 - 1)),
        "size": draw(st.sampled_from([0.0, 1e-3, 1.0, 10.0])),
        "faults": draw(st.dictionaries(st.integers(0, n_gauges - 1), broken, max_size=5)),
        "missing": draw(st.sets(st.integers(0, n_gauges - 1), max_size=n_gauges)),
        "pressure": draw(st.sampled_from([1e5, 4e5, 1e-6, 1e-7, 1e7, 1.01e7, 1e12, 0.0, -1.0, np.inf, np.nan])),
        "deviation": draw(st.sampled_from([0.0, 1.0, 1e4, -1.0, np.inf, np.nan])),
        "mach_number": draw(st.sampled_from([np.nan, 5.0, 6.0, 6.9, 8.0, 0.0, -1.0, np.inf])),
        "altitude": draw(st.sampled_from([np.nan, 12e3, 21e3, 30e3, 71e3, 8e4, 0.0, -1.0, np.inf])),
        "settings": {
            "sensor_range": draw(st.sampled_from([0.05, 1e-5, 1e-4, 1e9])),
            "alarm_scale": draw(st.sampled_from([1.0, 1e-3, 4.0, 100.0])),
            "reference_area": draw(st.sampled_from([0.2, 3.0])),
            "reference_length": draw(st.sampled_from([0.5, 2.0])),
            "moment_station": draw(st.sampled_from([0.0, 1.5, -20.0])),
        },
    }


@settings(max_examples=40, deadline=None)
@given(data=st.data())
@pytest.mark.parametrize(
    "name", ["few gauges", "case 1", "case 2", "envelope", "scaled, few gauges", "scaled, case 2"]
)
def test_settings_and_faults(cases: dict[str, NativeCase], name: str, data: st.DataObject) -> None:
    case = cases[name]
    drawn = data.draw(random_inputs(case.n))
    random, inverse_map = np.random.default_rng(drawn["seed"]), case.inverse_map
    strain = strain_at(inverse_map, drawn["pressure"]) + drawn["size"] * (
        inverse_map.state_operator @ random.normal(size=inverse_map.state_operator.shape[1])
        + inverse_map.noise_std * random.normal(size=case.n)
    )
    for gauge, value in drawn["faults"].items():
        strain[gauge] = value
    valid = np.ones(case.n, dtype=bool)
    valid[list(drawn["missing"])] = False
    sample = Sample(
        strain=strain,
        valid=valid,
        dynamic_pressure=drawn["pressure"],
        dynamic_pressure_std=drawn["deviation"],
        mach_number=drawn["mach_number"],
        altitude=drawn["altitude"],
    )
    reference, fmu = Reference(inverse_map), Fmu2(case.uri, case.n).start()
    reference.set(replace(reference.settings, **drawn["settings"]))
    assert fmu.set_scalars(SETTINGS, *drawn["settings"].values()) == OK
    apply(fmu, sample)
    reference.check(sample, fmu.outputs())
    fmu.free()


@pytest.mark.fast
def test_fmi_3_is_the_same_to_the_bit(case: NativeCase) -> None:
    second, third = Fmu2(case.uri, case.n).start(), Fmu3(str(case.resources), case.n).start()
    for sample in random_samples(case.inverse_map, 200, seed=2):
        apply(second, sample)
        references = [third.STRAIN, *third.SCALARS[:4]]
        assert third.set("Float64", ctypes.c_double, references, [*sample.strain, *sample.flow]) == OK
        assert third.set("Boolean", ctypes.c_bool, [third.VALID], sample.valid.tolist()) == OK
        assert third.outputs().tobytes() == second.outputs().tobytes()
    second.free()
    third.free()


@pytest.mark.slow
def test_map_of_a_vehicle(ogive_demo: Path, tmp_path: Path) -> None:
    inverse_map = load_inverse_map(ogive_demo / "map.h5")
    resources = write_resource(inverse_map, tmp_path)
    reference, fmu = Reference(inverse_map), Fmu2(resources.as_uri(), inverse_map.n_gauges).start()
    for sample in random_samples(inverse_map, 2500, seed=3):
        apply(fmu, sample)
        reference.check(sample, fmu.outputs())
    fmu.free()
