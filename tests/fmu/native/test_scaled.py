"""Maps in form "dynamic_pressure": no history, the screen of z, q_inf that is missing, the envelope."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from agreement import Reference, Sample, random_samples, strain_at
from native_case import NativeCase
from raw_fmu import N_OUTPUTS, OK, REAL_OUTPUTS, VALUES, WHOLE_OUTPUTS, Fmu2, write_resource
from scaled_maps import NOMINAL, errors_at_strain, scaled_map, with_envelope

from strainfmu.estimator.health import HealthState

pytestmark = pytest.mark.fast


def outputs(fmu: Fmu2, sample: Sample) -> np.ndarray:
    """Outputs of one set of inputs."""
    fmu.set_strain(sample.strain)
    fmu.set_valid(sample.valid)
    assert fmu.set_scalars(0, *sample.flow) == OK
    return fmu.outputs()


def fitting(case: NativeCase, pressure: float = NOMINAL, **flow: float) -> Sample:
    """Strains of the mean pressure with all gauges."""
    valid, deviation = np.ones(case.n, dtype=bool), flow.pop("dynamic_pressure_std", 0.0)
    return Sample(strain_at(case.inverse_map, pressure), valid, pressure, deviation, **flow)


def test_results_do_not_depend_on_what_was_before(scaled: NativeCase) -> None:
    # Levels and masks are kept: in another order each result has the same bits.
    samples = list(random_samples(scaled.inverse_map, 300, seed=8))
    fmu = Fmu2(scaled.uri, scaled.n).start()
    first = [outputs(fmu, sample).tobytes() for sample in samples]
    backwards = [outputs(fmu, sample).tobytes() for sample in reversed(samples)]
    fmu.free()
    fmu = Fmu2(scaled.uri, scaled.n).start()
    assert [outputs(fmu, sample).tobytes() for sample in samples[::7]] == first[::7]
    assert backwards[::-1] == first
    fmu.free()


def test_pressure_over_its_whole_range(scaled: NativeCase) -> None:
    # More levels than are kept, each at its ends too: powers of 2, and those times sqrt(1/2).
    reference, fmu = Reference(scaled.inverse_map), Fmu2(scaled.uri, scaled.n).start()
    levels = NOMINAL * 2.0 ** (np.arange(-30, 12) / 2.0)
    for pressure in np.concatenate([levels, np.nextafter(levels, 0.0), np.geomspace(1e-6, 1e7, 40)]):
        sample = fitting(scaled, float(pressure))
        sample = replace(sample, strain=sample.strain + scaled.inverse_map.noise_std)
        reference.check(sample, outputs(fmu, sample))
    fmu.free()


def test_suspects_at_the_threshold(scaled: NativeCase) -> None:
    # The bias at which numpy names a gauge, found by bisection, is that at which the FMU does.
    fmu, reference, found = Fmu2(scaled.uri, scaled.n).start(), Reference(scaled.inverse_map), 0
    for pressure, lost in ((0.4 * NOMINAL, ()), (1.3 * NOMINAL, (1,)), (3.0 * NOMINAL, (0, 2))):
        sample = fitting(scaled, pressure)
        sample.valid[list(lost)] = False
        for gauge in range(3, 9, 2):
            low, high = 0.0, 1e-2
            for _ in range(45):
                bias = 0.5 * (low + high)
                strain = sample.strain.copy()
                strain[gauge] += bias
                suspect = reference.estimator.step(strain, pressure, sample.valid, 0.0).suspects
                low, high = (low, bias) if suspect else (bias, high)
            for bias in high * np.array([1e-9, 0.5, 0.98, 1.0 - 1e-9, 1.0 + 1e-9, 1.02, 2.0]):
                strain = sample.strain.copy()
                strain[gauge] += bias
                off = replace(sample, strain=strain)
                native, expected = outputs(fmu, off), reference.outputs(off)
                assert native[WHOLE_OUTPUTS].tolist() == expected[WHOLE_OUTPUTS].tolist()
                found += int(native[25] > 0.0)
    assert found >= 9
    fmu.free()


@pytest.mark.parametrize("pressure", [np.nan, 0.0, -1.0, 9.9e-7, 1.0001e7, 9e9, np.inf])
def test_nothing_is_known_without_a_dynamic_pressure(scaled: NativeCase, pressure: float) -> None:
    fmu = Fmu2(scaled.uri, scaled.n).start()
    found = outputs(fmu, replace(fitting(scaled), dynamic_pressure=pressure))
    assert np.isnan(found[REAL_OUTPUTS]).all()
    assert found[WHOLE_OUTPUTS].tolist() == [HealthState.NO_COEFFICIENTS, scaled.n, 0, 0]
    assert np.isnan(fmu.derivative(VALUES, [N_OUTPUTS], [1.0])).all()
    assert np.isfinite(outputs(fmu, fitting(scaled))[REAL_OUTPUTS]).all()
    fmu.free()


OUTSIDE = {
    "low pressure": {"pressure": 2.9e4},
    "high pressure": {"pressure": 6.1e5},
    "Mach number": {"mach_number": 7.1},
    "altitude": {"altitude": 31e3},
    "contradiction": {"mach_number": 6.0, "altitude": 25e3},
    "coefficients": {"limit": -0.4},
}


@pytest.mark.parametrize("cause", OUTSIDE)
@pytest.mark.parametrize("scaled_form", [True, False])
def test_outside_by_each_cause(cause: str, scaled_form: bool, tmp_path: Path) -> None:
    plain = scaled_map(2, seed=2, errors=errors_at_strain(18), **with_envelope(n=9, size=5.0))
    if not scaled_form:
        nothing: dict[str, Any] = dict.fromkeys(errors_at_strain(1))
        plain = replace(plain, form="absolute", **nothing)
    given = dict(OUTSIDE[cause])
    limit, pressure = given.pop("limit", 5.0), given.pop("pressure", NOMINAL)
    inverse_map = replace(plain, envelope_limit=np.full(9, limit))
    case = NativeCase(inverse_map, write_resource(inverse_map, tmp_path))
    fmu, reference = Fmu2(case.uri, case.n).start(), Reference(inverse_map)
    inside = fitting(case) if limit > 0.0 else None
    for sample, state in ((inside, HealthState.OK), (fitting(case, pressure, **given), HealthState.OUTSIDE)):
        if sample is not None:
            native = outputs(fmu, sample)
            reference.check(sample, native)
            assert native[20] == state
    fmu.free()
