"""Outputs that are right at any moment, settings, and arguments that cannot be."""

import ctypes
from ctypes import byref, c_double, c_int, c_size_t
from dataclasses import replace

import numpy as np
import pytest
from agreement import Sample, assert_same, estimated
from native_case import NativeCase
from raw_fmu import ERROR, N_OUTPUTS, N_SCALARS, OK, SETTINGS, Fmu2, Fmu3, first_zero, of_filter

from strainfmu.estimator.air_inputs import LAST_INPUTS
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState

pytestmark = pytest.mark.fast


def sample_of(case: NativeCase, seed: int = 3) -> Sample:
    random = np.random.default_rng(seed)
    strain = case.inverse_map.mean_strain + case.inverse_map.noise_std * random.normal(size=case.n)
    return Sample(
        strain=strain, valid=np.ones(case.n, dtype=bool), dynamic_pressure=1.1e5, dynamic_pressure_std=np.nan
    )


def test_outputs_are_right_after_initialization_and_after_every_set(case: NativeCase) -> None:
    estimator, fmu = Estimator(case.inverse_map), Fmu2(case.uri, case.n)
    first, second = sample_of(case, 3), sample_of(case, 4)
    fmu.set_strain(first.strain)
    fmu.set_scalars(0, first.dynamic_pressure)
    fmu.start()
    assert_same(fmu.outputs(), estimated(estimator, first))
    fmu.set_strain(second.strain)
    assert_same(fmu.outputs(), estimated(estimator, second))
    without = second.valid.copy()
    without[0] = False
    fmu.set_valid(without)
    third = Sample(
        strain=second.strain, valid=without, dynamic_pressure=second.dynamic_pressure, dynamic_pressure_std=np.nan
    )
    assert_same(fmu.outputs(), estimated(estimator, third))
    assert fmu.step() == OK
    assert_same(fmu.outputs(), estimated(estimator, third))
    fmu.free()


def test_lists_in_any_order_and_in_parts(small: NativeCase) -> None:
    fmu, strain = Fmu2(small.uri, small.n).start(), sample_of(small).strain
    fmu.set_strain(strain)
    expected = fmu.outputs()
    orders = [
        np.arange(small.n)[::-1],
        np.roll(np.arange(small.n), 3),
        np.random.default_rng(1).permutation(small.n),
    ]
    for order in orders:
        fmu.set_strain(np.zeros(small.n))
        assert fmu.set_reals((N_OUTPUTS + order).tolist(), strain[order]) == OK
        assert fmu.outputs().tobytes() == expected.tobytes()
        assert np.array_equal(fmu.get_reals((N_OUTPUTS + order).tolist()), strain[order])
    fmu.set_strain(np.zeros(small.n))
    for first in range(0, small.n, 3):  # each part without a gap
        part = range(first, min(first + 3, small.n))
        assert fmu.set_reals([N_OUTPUTS + k for k in part], strain[part.start : part.stop]) == OK
    assert fmu.outputs().tobytes() == expected.tobytes()
    outputs = [4, 3, 2, 1, 0, 19, 18, 22, 21, 26]
    assert np.array_equal(fmu.get_reals(outputs), expected[outputs])
    fmu.free()


def test_run_that_leaves_the_reals(small: NativeCase) -> None:
    fmu, last = Fmu2(small.uri, small.n).start(), N_OUTPUTS + small.n - 1
    assert fmu.set_reals([last, last + 1], [1e-4, 1.0]) == ERROR  # the second is a Boolean
    assert fmu.set_reals([last + 2 * small.n, 2**32 - 1, 0], [1e-4, 1.0, 1.0]) == ERROR
    assert fmu.set_reals([2**32 - 1, 0], [1.0, 1.0]) == ERROR
    values = (c_double * 2)()
    for references in ([19, 20], [20, 21], [2**32 - 1, 0]):
        assert fmu.call("GetReal", fmu.references(references), c_size_t(2), values) == ERROR
    fmu.free()


def test_moment_point_there_and_back(case: NativeCase) -> None:
    # Deviations are kept from step to step for one moment point and set of gauges.
    estimator, fmu, sample = Estimator(case.inverse_map), Fmu2(case.uri, case.n).start(), sample_of(case)
    fmu.set_strain(sample.strain)
    fmu.set_scalars(0, sample.dynamic_pressure)
    without = sample.valid.copy()
    without[1] = False
    for station in (0.3, -2.0, 0.3):
        estimator = estimator.with_settings(replace(estimator.settings, moment_station=station))
        assert fmu.set_scalars(SETTINGS + 4, station) == OK
        for valid in (sample.valid, without, sample.valid):
            fmu.set_valid(valid)
            assert_same(fmu.outputs(), estimated(estimator, replace(sample, valid=valid)))
    fmu.free()


def test_start_values(small: NativeCase) -> None:
    fmu, inverse_map = Fmu2(small.uri, small.n).start(), small.inverse_map
    sample = Sample(
        strain=np.zeros(small.n),
        valid=np.ones(small.n, dtype=bool),
        dynamic_pressure=inverse_map.nominal_dynamic_pressure,
        dynamic_pressure_std=0.0,
    )
    assert_same(fmu.outputs(), estimated(Estimator(inverse_map), sample))
    scalars = range(N_OUTPUTS + 2 * small.n, N_OUTPUTS + 2 * small.n + N_SCALARS)
    station = inverse_map.provenance.get("moment_station_m", 0.0)
    expected = [
        1.2e5,
        0.0,
        0.0,
        0.0,
        0.05,
        1.0,
        inverse_map.reference_area,
        inverse_map.reference_length,
        station,
    ]
    np.testing.assert_array_equal(fmu.get_reals(scalars), expected)
    fmu.free()


def test_reset_returns_to_the_start(small: NativeCase) -> None:
    fmu = Fmu2(small.uri, small.n).start()
    before = fmu.outputs()
    fmu.set_strain(np.full(small.n, 1e-4))
    fmu.set_valid(np.zeros(small.n, dtype=bool))
    fmu.set_scalars(0, 5.0, 1.0, 6.0, 2e4, 0.01, 2.0, 3.0, 4.0, 5.0)
    assert fmu.get_integers([20])[0] == HealthState.INVALID
    assert fmu.call("Reset") == OK
    assert fmu.start().outputs().tobytes() == before.tobytes()
    fmu.free()


@pytest.mark.parametrize(
    ("setting", "value", "text"),
    [
        (0, 0.0, "sensor_range: 0 found, must be between 1e-09 and 1e+09"),
        (0, 2e9, "sensor_range: 2e+09 found"),
        (1, float("nan"), "alarm_scale: nan found, must be between"),
        (2, -1.0, "reference_area: -1 found, must be between"),
        (3, float("inf"), "reference_length: inf found"),
        (4, float("inf"), "moment_station: inf found, must be between -1e+09 and 1e+09"),
    ],
)
def test_settings_that_cannot_be(small: NativeCase, setting: int, value: float, text: str) -> None:
    fmu = Fmu2(small.uri, small.n).start()
    before = fmu.outputs()
    assert fmu.set_scalars(SETTINGS + setting, value) == ERROR
    assert text in fmu.messages[-1][2]
    assert fmu.outputs().tobytes() == before.tobytes()
    fmu.free()


def test_wrong_value_references(small: NativeCase) -> None:
    fmu = Fmu2(small.uri, small.n).start()
    tare = first_zero(small.n) + 2 * small.n + 1 + of_filter(small.inverse_map)
    end = tare + 2 + 2 * small.n + 1 + len(LAST_INPUTS) + 1
    value, whole, count = c_double(0.0), c_int(0), c_size_t(1)
    for name, wrong, memory in (
        ("GetReal", [20, 23, N_OUTPUTS + small.n, tare, tare + 1, end, 2**32 - 1], value),
        ("SetReal", [0, 20, 26, N_OUTPUTS + small.n, tare, tare + 2, end, 2**32 - 1], value),
        ("GetInteger", [0, 21, 26, N_OUTPUTS, tare, tare + 2, end], whole),
        ("SetInteger", [20, 23, N_OUTPUTS, tare + 1], whole),
        ("GetBoolean", [0, N_OUTPUTS, tare + 1, tare + 2, end, 2**32 - 1], whole),
        ("SetBoolean", [0, N_OUTPUTS, tare + 1, tare + 2, end, 2**32 - 1], whole),
        ("GetString", [0, end], ctypes.c_char_p()),
        ("SetString", [0, end], ctypes.c_char_p()),
    ):
        for reference in wrong:
            fmu.messages.clear()
            assert fmu.call(name, fmu.references([reference]), count, byref(memory)) == ERROR
            assert len(fmu.messages) == 1
            assert f"fmi2{name}" in fmu.messages[0][2]
    fmu.free()


def test_arguments_that_are_missing(small: NativeCase) -> None:
    fmu = Fmu2(small.uri, small.n).start()
    references, one = fmu.references([0]), c_size_t(1)
    for name in ("GetReal", "SetReal", "GetInteger", "SetInteger", "GetBoolean", "SetBoolean", "GetString"):
        assert fmu.call(name, None, one, None) == ERROR
        assert fmu.call(name, references, one, None) == ERROR
        assert fmu.call(name, None, c_size_t(0), None) == OK
    assert fmu.call("GetFMUstate", None) == ERROR
    assert fmu.call("SetFMUstate", None) == ERROR
    assert fmu.call("SetDebugLogging", c_int(1), one, None) == ERROR
    assert fmu.call("GetDirectionalDerivative", None, one, None, one, None, None) == ERROR
    fmu.free()
    fmu.instance = ctypes.c_void_p(None)
    for name in ("Terminate", "Reset", "EnterInitializationMode", "CancelStep", "EnterEventMode"):
        assert fmu.call(name) == ERROR
    assert fmu.step() == ERROR
    fmu.free()


def test_calls_in_the_wrong_mode(small: NativeCase) -> None:
    fmu = Fmu2(small.uri, small.n)
    assert fmu.step() == ERROR
    assert "fmi2DoStep is not allowed: the instance is just instantiated" in fmu.messages[-1][2]
    assert fmu.call("ExitInitializationMode") == ERROR
    assert fmu.call("Terminate") == ERROR
    fmu.start()
    assert fmu.call("EnterInitializationMode") == ERROR
    assert fmu.call("NewDiscreteStates", (ctypes.c_char * 64)()) == ERROR
    for size in (0.0, -1.0, float("nan"), float("inf")):
        assert fmu.step(0.0, size) == ERROR
    fmu.set_strain(small.inverse_map.mean_strain)
    assert fmu.call("Terminate") == OK
    assert fmu.step() == ERROR
    assert fmu.set_reals([N_OUTPUTS], [1.0]) == ERROR
    assert np.isfinite(fmu.get_reals([0])).all()
    assert fmu.call("Reset") == OK
    fmu.start().free()


def test_model_exchange(small: NativeCase) -> None:
    fmu = Fmu2(small.uri, small.n, co_simulation=False).start()
    sample, flags = sample_of(small), (c_int(7), c_int(7))
    info = (ctypes.c_int * 16)(*[9] * 16)
    assert fmu.call("NewDiscreteStates", info) == OK
    assert info[:5] == [0] * 5
    assert fmu.step() == ERROR
    assert fmu.call("EnterContinuousTimeMode") == OK
    for time in (float("nan"), float("inf")):
        assert fmu.call("SetTime", c_double(time)) == ERROR
    assert fmu.call("SetTime", c_double(0.5)) == OK
    fmu.set_strain(sample.strain)
    fmu.set_scalars(0, sample.dynamic_pressure)
    assert fmu.call("CompletedIntegratorStep", c_int(1), byref(flags[0]), byref(flags[1])) == OK
    # The strains of the start gave another health: discrete outputs wait for the event that is asked for.
    assert [flag.value for flag in flags] == [1, 0]
    assert fmu.call("EnterEventMode") == OK
    assert fmu.call("GetDerivatives", None, c_size_t(0)) == OK
    assert fmu.call("GetEventIndicators", None, c_size_t(1)) == ERROR
    assert_same(fmu.outputs(), estimated(Estimator(small.inverse_map), sample))
    fmu.free()


def test_health_is_logged_when_it_changes(small: NativeCase) -> None:
    fmu = Fmu2(small.uri, small.n, logging=True).start()
    fmu.set_strain(small.inverse_map.mean_strain)
    for k in range(3):
        fmu.step(k * 0.1, 0.1)
    assert fmu.messages == []
    fmu.set_reals([N_OUTPUTS + 2], [np.nan])
    for k in range(3, 6):
        fmu.step(k * 0.1, 0.1)
    assert [message[:2] for message in fmu.messages] == [(OK, "logEvents")]
    assert fmu.messages[0][2].startswith(f"health DEGRADED at 0.4 s: {small.n - 1} gauges in use")
    assert fmu.call("SetDebugLogging", c_int(0), c_size_t(0), None) == OK
    fmu.set_reals([N_OUTPUTS + 2], [0.0])
    fmu.step(0.6, 0.1)
    assert len(fmu.messages) == 1
    fmu.free()


def test_wrong_arrays_of_fmi_3(small: NativeCase) -> None:
    fmu = Fmu3(str(small.resources), small.n).start()
    for references, size in (([0], 4), ([0], 6), ([6], 1), ([9], 1), ([14], small.n), ([25], 1), ([2**32 - 1], 1)):
        assert fmu.get("Float64", c_double, references, size)[0] == ERROR
    assert fmu.get("Int32", ctypes.c_int32, [6], 1)[0] == ERROR
    assert fmu.get("Int64", ctypes.c_int64, [9], 1)[0] == ERROR
    assert fmu.get("Boolean", ctypes.c_bool, [13], small.n)[0] == ERROR
    assert fmu.set("Float64", c_double, [fmu.STRAIN], np.zeros(small.n - 1)) == ERROR
    assert fmu.set("Float64", c_double, [fmu.TIME], [0.0]) == ERROR
    assert fmu.set("Float64", c_double, [0], np.zeros(5)) == ERROR
    assert fmu.set("Boolean", ctypes.c_bool, [15], [True]) == ERROR
    assert fmu.get("UInt8", ctypes.c_uint8, [0], 1)[0] == ERROR
    assert all(category == "logStatusError" for _, category, _ in fmu.messages)
    fmu.free()


def test_steps_of_fmi_3(small: NativeCase) -> None:
    fmu = Fmu3(str(small.resources), small.n).start()
    flags, reached = [ctypes.c_bool(True) for _ in range(3)], c_double(0.0)
    pointers = (*map(byref, flags), byref(reached))
    assert fmu.call("DoStep", c_double(1.0), c_double(0.25), ctypes.c_bool(True), *pointers) == OK
    assert [flag.value for flag in flags] == [False] * 3
    assert reached.value == 1.25
    assert fmu.get("Float64", c_double, [fmu.TIME + of_filter(small.inverse_map)], 1)[1].tolist() == [1.25]
    assert fmu.call("DoStep", c_double(1.0), c_double(0.0), ctypes.c_bool(True), *pointers) == ERROR
    assert fmu.call("EnterEventMode") == ERROR  # was not requested at instantiation
    assert fmu.call("Terminate") == OK
    fmu.free()
