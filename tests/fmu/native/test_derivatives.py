"""Directional and adjoint derivatives against differences of the outputs."""

import ctypes

import numpy as np
import pytest
from native_case import NativeCase
from raw_fmu import ERROR, N_OUTPUTS, N_SCALARS, OK, SETTINGS, VALUES, Fmu2, Fmu3

from strainfmu.estimator.reference import update
from strainfmu.estimator.reference.linear import models

pytestmark = pytest.mark.fast


def scalars(case: NativeCase) -> range:
    return range(N_OUTPUTS + 2 * case.n, N_OUTPUTS + 2 * case.n + N_SCALARS)


def knowns(case: NativeCase) -> list[int]:
    """Strains, then pressures and settings."""
    return [*range(N_OUTPUTS, N_OUTPUTS + case.n), *scalars(case)]


def prepare(case: NativeCase, mask: bool, deviation: float) -> Fmu2:
    """An instance away from its start values; ``mask`` leaves out a gauge by flag and another by its strain."""
    fmu, random = Fmu2(case.uri, case.n).start(), np.random.default_rng(5)
    strain = case.inverse_map.mean_strain + 5.0 * case.inverse_map.noise_std * random.normal(size=case.n)
    valid = np.ones(case.n, dtype=bool)
    if mask:
        valid[1], strain[3] = False, np.nan
    fmu.set_strain(strain)
    fmu.set_valid(valid)
    assert fmu.set_scalars(0, 1.1e5, deviation, 6.0, 2e4, 0.05, 1.3, 0.25, 0.6, 0.4) == OK
    return fmu


def test_gain_is_that_of_the_reference(case: NativeCase) -> None:
    fmu = prepare(case, mask=False, deviation=0.0)
    fmu.set_scalars(SETTINGS + 4, case.inverse_map.provenance.get("moment_station_m", 0.0))
    is_scaled = case.inverse_map.form == "dynamic_pressure"
    ratio = 1.1e5 / case.inverse_map.nominal_dynamic_pressure if is_scaled else 1.0
    prepared = update.prepare(models(case.inverse_map)[0], np.ones(case.n, dtype=bool))
    gain = update.condition(prepared, case.inverse_map.mean_strain[None], np.array([ratio])).gain[0]
    for gauge in range(case.n):
        column = fmu.derivative(range(10, 15), [N_OUTPUTS + gauge], [1.0])
        expected = gain[:, gauge]
        assert np.linalg.norm(column - expected) <= 1e-9 * np.linalg.norm(expected)
    fmu.free()


def test_where_there_is_no_estimate(small: NativeCase) -> None:
    fmu = prepare(small, mask=False, deviation=0.0)
    fmu.set_scalars(0, 0.0)
    derivative = fmu.derivative(VALUES, [N_OUTPUTS], [1.0])
    assert np.isnan(derivative[:5]).all()
    assert np.isfinite(derivative[5:]).all()
    fmu.set_valid(np.zeros(small.n, dtype=bool))
    assert np.isnan(fmu.derivative(VALUES, [N_OUTPUTS], [1.0])).all()
    fmu.free()


def test_variables_without_derivative(small: NativeCase) -> None:
    fmu = Fmu2(small.uri, small.n).start()
    for unknown, known in (
        *((k, N_OUTPUTS) for k in (5, 15, 20, 21, 26, N_OUTPUTS, 999)),
        (0, 0),
        (0, N_OUTPUTS + small.n),
    ):
        with pytest.raises(AssertionError):
            fmu.derivative([unknown], [known], [1.0])
        assert "GetDirectionalDerivative: derivatives are those of values" in fmu.messages[-1][2]
    fmu.free()


def test_fmi_3_directional_and_adjoint(case: NativeCase) -> None:
    second, third = prepare(case, mask=True, deviation=4e3), Fmu3(str(case.resources), case.n).start()
    # The state of the inputs by way of their values.
    values = second.get_reals(knowns(case))
    valid = [True] * case.n
    valid[1] = False
    references = [third.STRAIN, *third.SCALARS]
    assert third.set("Float64", ctypes.c_double, references, values) == OK
    assert third.set("Boolean", ctypes.c_bool, [third.VALID], valid) == OK
    floats, random = [0, 2, 3], np.random.default_rng(7)
    direction, weight = random.normal(size=len(values)), random.normal(size=10)
    status, forward = third.differentiate("Directional", floats, references, direction, 10)
    assert status == OK
    assert forward.tobytes() == second.derivative(VALUES, knowns(case), direction).tobytes()
    status, backward = third.differentiate("Adjoint", floats, references, weight, len(values))
    assert status == OK
    # <weight, J direction> = <J' weight, direction>; sums of 60 x 10 terms, each a difference.
    terms = np.abs(backward * direction).sum()
    assert abs(weight @ forward - backward @ direction) <= 1e-6 * terms
    for wrong in (
        ([1], references),
        ([6], references),
        ([13], references),
        (floats, [14]),
        (floats, [0]),
        (floats, [24]),
    ):
        assert third.differentiate("Directional", *wrong, direction, 10)[0] == ERROR
        assert third.differentiate("Adjoint", *wrong, weight, len(values))[0] == ERROR
    assert third.differentiate("Directional", floats, references, direction[:-1], 10)[0] == ERROR
    second.free()
    third.free()
