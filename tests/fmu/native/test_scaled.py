"""Maps in form "dynamic_pressure": no history, the screen of z, q_inf that is missing, the envelope."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from agreement import Sample, estimated, strain_at
from native_case import NativeCase
from random_map import nothing_of
from raw_fmu import N_OUTPUTS, OK, REAL_OUTPUTS, VALUES, WHOLE_OUTPUTS, Fmu2, write_resource
from scaled_maps import NOMINAL, errors_at_strain, scaled_map, with_envelope
from scipy.optimize import brentq

from strainfmu.estimator.estimator import Estimator
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


def test_suspects_at_the_threshold(case: NativeCase) -> None:
    # The screen in float decides as z in double does: a suspect is named from the bias on at which z is its limit.
    fmu, estimator, found = Fmu2(case.uri, case.n).start(), Estimator(case.inverse_map), 0
    for pressure, lost in ((0.4 * NOMINAL, ()), (1.3 * NOMINAL, (1,)), (3.0 * NOMINAL, (0, 2))):
        sample = fitting(case, pressure)
        sample.valid[list(lost)] = False
        for gauge in range(3, 9, 2):
            unit = np.arange(case.n) == gauge

            def excess(bias: float, sample: Sample = sample, unit: np.ndarray = unit) -> float:
                one = estimated(estimator, replace(sample, strain=sample.strain + bias * unit))
                return float(np.abs(one.standardised_residual).max() / one.residual_limit - 1.0)

            limit = brentq(excess, 0.0, 1e-2, xtol=1e-18, rtol=1e-14)
            for factor in (1e-9, 0.5, 0.98, 1.0 - 1e-9, 1.0 + 1e-9, 1.02, 2.0):
                native = outputs(fmu, replace(sample, strain=sample.strain + factor * limit * unit))
                assert (native[25] > 0.0) == (factor > 1.0)
                found += int(native[25] > 0.0)
    assert found >= 9
    fmu.free()


@pytest.mark.parametrize("pressure", [np.nan, 0.0, -1.0, 9.9e-7, 1.0001e7, 9e9, np.inf])
def test_nothing_is_known_without_a_dynamic_pressure(scaled: NativeCase, pressure: float) -> None:
    fmu = Fmu2(scaled.uri, scaled.n).start()
    found = outputs(fmu, replace(fitting(scaled), dynamic_pressure=pressure))
    assert np.isnan(found[:20]).all()
    assert np.isfinite(found[REAL_OUTPUTS][20:]).all()  # the residual has no terms
    assert found[WHOLE_OUTPUTS].tolist() == [HealthState.NO_COEFFICIENTS, scaled.n, 0, 0]
    assert np.isnan(fmu.derivative(VALUES, [N_OUTPUTS], [1.0])).all()
    assert np.isfinite(outputs(fmu, fitting(scaled))[REAL_OUTPUTS]).all()
    fmu.free()


OUTSIDE = {
    "low pressure": {"pressure": 2.9e4},
    "high pressure": {"pressure": 6.1e5},
    "Mach number": {"mach_number": 7.5},
    "altitude": {"altitude": 31e3},
    "contradiction": {"mach_number": 6.0, "altitude": 25e3},
    "coefficients": {"limit": -0.4},
}


@pytest.mark.parametrize("cause", OUTSIDE)
@pytest.mark.parametrize("scaled_form", [True, False])
def test_outside_by_each_cause(cause: str, scaled_form: bool, tmp_path: Path) -> None:
    plain = scaled_map(2, seed=2, errors=errors_at_strain(18), **with_envelope(n=9, size=5.0))
    if not scaled_form:
        plain = replace(plain, form="absolute", **nothing_of(*errors_at_strain(1)))
    given = dict(OUTSIDE[cause])
    limit, pressure = given.pop("limit", 5.0), given.pop("pressure", NOMINAL)
    inverse_map = replace(plain, envelope_limit=np.full(9, limit))
    case = NativeCase(inverse_map, write_resource(inverse_map, tmp_path))
    fmu = Fmu2(case.uri, case.n).start()
    inside = fitting(case) if limit > 0.0 else None
    for sample, state in ((inside, HealthState.OK), (fitting(case, pressure, **given), HealthState.OUTSIDE)):
        if sample is not None:
            assert outputs(fmu, sample)[20] == state
    fmu.free()
