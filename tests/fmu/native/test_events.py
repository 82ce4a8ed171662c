"""Events: model exchange asks for one when health changes, and holds it until then; FMI 3.0 logs and refuses."""

import ctypes
from collections.abc import Callable
from ctypes import byref, c_bool, c_double, c_int, c_size_t, c_void_p

import numpy as np
import pytest
from native_case import NativeCase
from raw_fmu import ERROR, GUID, N_OUTPUTS, OK, WHOLE_OUTPUTS, Fmu2, Fmu3, shipped_library

from strainfmu.estimator.health import HealthState
from strainfmu.fmu.native.package import CAPABILITIES, MODEL_EXCHANGE

pytestmark = pytest.mark.fast

FIRST_STRAIN = N_OUTPUTS


def exchanges(case: NativeCase) -> list[tuple[Fmu2 | Fmu3, Callable[[], list[int]], Callable[[float], None]]]:
    """An instance for model exchange per FMI version, reading its whole numbers and setting its first strain."""
    second = Fmu2(case.uri, case.n, co_simulation=False)
    third = Fmu3(str(case.resources), case.n, co_simulation=False)
    strain = case.inverse_map.mean_strain.copy()

    def set_third(value: float) -> None:
        strain[0] = value
        assert third.set("Float64", c_double, [third.STRAIN], strain.tolist()) == OK

    def whole_of_third() -> list[int]:
        return third.outputs()[WHOLE_OUTPUTS].astype(int).tolist()

    second.set_strain(strain)
    set_third(float(strain[0]))
    return [
        (
            second,
            lambda: second.get_integers(WHOLE_OUTPUTS).tolist(),
            lambda value: second.set_reals([FIRST_STRAIN], [value]) and None,
        ),
        (third, whole_of_third, set_third),
    ]


def asks_for_event(fmu: Fmu2 | Fmu3) -> bool:
    """Whether the end of a solver's step asks for an event."""
    c_flag = c_int if isinstance(fmu, Fmu2) else c_bool
    event, end = c_flag(True), c_flag(True)
    assert fmu.call("CompletedIntegratorStep", c_flag(True), byref(event), byref(end)) == OK
    assert not end.value
    return bool(event.value)


@pytest.mark.parametrize("version", [0, 1], ids=["FMI 2", "FMI 3"])
def test_a_change_of_health_asks_for_an_event(small: NativeCase, version: int) -> None:
    fmu, whole, set_strain = exchanges(small)[version]
    fmu.start()
    n = small.n
    assert fmu.call("EnterContinuousTimeMode") == OK
    assert whole() == [HealthState.OK, n, 0, 0]
    assert not asks_for_event(fmu)
    mean = float(small.inverse_map.mean_strain[0])
    set_strain(mean + 0.1 * float(small.inverse_map.noise_std[0]))
    assert not asks_for_event(fmu)
    set_strain(np.nan)
    # A discrete variable has one value between events; real outputs follow their inputs.
    assert whole() == [HealthState.OK, n, 0, 0]
    assert asks_for_event(fmu)
    assert fmu.call("EnterEventMode") == OK
    assert whole() == [HealthState.DEGRADED, n - 1, 0, 0]
    assert fmu.call("EnterContinuousTimeMode") == OK
    assert whole() == [HealthState.DEGRADED, n - 1, 0, 0]
    assert not asks_for_event(fmu)
    set_strain(mean)
    assert whole() == [HealthState.DEGRADED, n - 1, 0, 0]
    assert asks_for_event(fmu)
    assert fmu.call("EnterEventMode") == OK
    assert whole() == [HealthState.OK, n, 0, 0]
    fmu.free()


def test_a_state_holds_what_the_last_event_gave(small: NativeCase) -> None:
    fmu, whole, set_strain = exchanges(small)[0]
    assert isinstance(fmu, Fmu2)
    fmu.start()
    assert fmu.call("EnterContinuousTimeMode") == OK
    set_strain(np.nan)
    state = fmu.serialise(fmu.get_state())
    assert fmu.call("EnterEventMode") == OK
    assert fmu.call("EnterContinuousTimeMode") == OK
    assert whole()[0] == HealthState.DEGRADED
    status, restored = fmu.deserialise(state)
    assert status == OK
    assert fmu.call("SetFMUstate", restored) == OK
    assert whole()[0] == HealthState.OK
    assert asks_for_event(fmu)
    fmu.free()


def test_importers_are_told_to_ask() -> None:
    """An importer that may leave out the end of a solver's step would miss every event."""
    assert MODEL_EXCHANGE["2"].get("completedIntegratorStepNotNeeded", "false") == "false"
    assert MODEL_EXCHANGE["3"]["needsCompletedIntegratorStep"] == "true"


def test_event_mode_that_is_not_there_is_refused(small: NativeCase) -> None:
    assert CAPABILITIES["3"].get("hasEventMode", "false") == "false"
    fmu = Fmu3(str(small.resources), small.n)
    library = shipped_library()
    library.fmi3InstantiateCoSimulation.restype = c_void_p
    no, yes = c_bool(False), c_bool(True)
    for event_mode, there in ((no, True), (yes, False)):
        texts: list[str] = []
        logger = ctypes.CFUNCTYPE(None, c_void_p, c_int, ctypes.c_char_p, ctypes.c_char_p)(
            lambda _e, _s, _c, text, seen=texts: seen.append(text.decode())
        )
        instance = library.fmi3InstantiateCoSimulation(
            *(b"one", GUID.encode(), str(small.resources).encode(), no, no),
            *(event_mode, no, None, c_size_t(0), None, logger, None),
        )
        assert (instance is not None) == there
        assert texts == [] if there else ["event mode was requested, which this FMU has in model exchange only"]
        if there:
            library.fmi3FreeInstance(c_void_p(instance))
    fmu.start()
    assert fmu.call("EnterEventMode") == ERROR
    assert fmu.call("EnterStepMode") == ERROR
    fmu.free()


@pytest.mark.parametrize("category", ["logAll", "logEvents"])
def test_fmi_3_logs_the_categories_it_declares(small: NativeCase, category: str) -> None:
    fmu = Fmu3(str(small.resources), small.n).start()
    flags, reached = [c_bool(True) for _ in range(3)], c_double(0.0)

    def step(time: float, strain: float) -> None:
        values = np.append(strain, small.inverse_map.mean_strain[1:])
        assert fmu.set("Float64", c_double, [fmu.STRAIN], values.tolist()) == OK
        arguments = (c_double(time), c_double(0.1), c_bool(True), *map(byref, flags), byref(reached))
        assert fmu.call("DoStep", *arguments) == OK

    mean = float(small.inverse_map.mean_strain[0])
    names = (ctypes.c_char_p * 1)(category.encode())
    step(0.0, mean)
    step(0.1, np.nan)
    assert fmu.messages == []
    assert fmu.call("SetDebugLogging", c_bool(True), c_size_t(1), names) == OK
    step(0.2, np.nan)
    assert [message[:2] for message in fmu.messages] == [(OK, "logEvents")]
    assert fmu.messages[0][2].startswith("health DEGRADED")
    assert fmu.call("SetDebugLogging", c_bool(False), c_size_t(1), names) == OK
    step(0.3, mean)
    assert len(fmu.messages) == 1
    fmu.free()
