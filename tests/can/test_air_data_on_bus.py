"""A user's mapping gives p_inf, deviations of navigation as numbers or signals, and inertial inputs."""

import struct
from collections.abc import Mapping
from dataclasses import replace
from math import isnan, nan, radians
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flight_fmu import whole_map
from flight_maps import NOISE_STD, exact_response
from float_rack import rack_cycle, rack_layout
from inertia_maps import with_masses
from scaled_maps import NOMINAL, scaled_map

from strainfmu.can.frame_layout import InputLayout
from strainfmu.can.machine import Machine, Result
from strainfmu.can.options import BridgeSettings
from strainfmu.can.quality import Cause
from strainfmu.cosim.estimators.source import MapStep, open_step
from strainfmu.cosim.estimators.step import Step, other_inputs
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import INERTIAL_NAMES, LAST_INPUTS
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import InverseMap, save_inverse_map
from strainfmu.interface.input_names import OTHER_AIR_DATA

pytestmark = pytest.mark.fast

N_D, AIR, MACH, STATIC = whole_map().n_gauges, 0x300, 6.0, 5500.0
Q = 0.7 * STATIC * MACH**2
STRAIN = exact_response(MACH, 0.03, 0.01, STATIC)[:N_D]
MAPPING: dict[str, Any] = {
    "dynamic_pressure": {"signal": "Air.q", "std": 4e3},
    "mach_number": {"signal": "Air.mach", "std": "Air.mach_std"},
    "static_pressure": {"signal": "Air.p", "std": "Air.p_std"},
}
SENT = {"q": Q, "mach": MACH, "mach_std": 0.1, "p": STATIC / 100.0, "p_std": 2.0}
"""Of the frame of air data; the static pressure in hPa."""
AIR_DATA = AIR, struct.pack("<5f", *SENT.values())


def flown_map(has_tables: bool = True) -> InverseMap:
    whole = replace(whole_map(), noise_std=np.full(N_D, NOISE_STD))
    return whole if has_tables else replace(whole, manifold=None)


def layout_of(mapping: Mapping[str, Any], flow_names: tuple[str, ...]) -> InputLayout:
    """Return frames of a float64 per gauge, and of air data."""
    lines = [f"BO_ {AIR} Air: 20 A"]
    for place, (name, unit) in enumerate(zip(SENT, ("Pa", "", "", "hPa", "hPa"), strict=True)):
        lines += [f' SG_ {name} : {32 * place}|32@1- (1,0) [0|0] "{unit}" B']
    lines += [
        'BA_DEF_ BO_ "VFrameFormat" ENUM "a","b","c","d","e","f","g","h","i","j","k","l","m","n","StandardCAN_FD";'
    ]
    lines += ['BA_DEF_DEF_ "VFrameFormat" "a";', f'BA_ "VFrameFormat" BO_ {AIR} 14;']
    lines += [f"SIG_VALTYPE_ {AIR} {name} : 1;" for name in SENT]
    return rack_layout(N_D, lines, mapping, flow_names=flow_names)


def flown(step: Step, lost: int, cycles: int) -> list[Result]:
    """Return the result of each cycle; the air data are lost from cycle ``lost`` on."""
    layout = layout_of(MAPPING, other_inputs(step))
    core = Machine(layout, step, BridgeSettings(), start=0.0)
    random, found = np.random.default_rng(4), []
    for k in range(cycles):
        strain = STRAIN + NOISE_STD * random.standard_normal(N_D)
        found.append(rack_cycle(core, strain, k, [AIR_DATA] if k < lost else []))
    return found


def test_a_bridge_estimates_as_python_does(tmp_path: Path) -> None:
    """By a map; tests/golden gives a bridge FMUs of such maps."""
    save_inverse_map(flown_map(), source := tmp_path / "map.h5")
    lost, cycles = 15, 40
    with open_step(source) as ready:
        assert set(OTHER_AIR_DATA) - set(INERTIAL_NAMES) <= set(other_inputs(ready.step))
        results = flown(ready.step, lost, cycles)
    tracker, states = Estimator(flown_map()), set()
    for result in results:
        given = {name: result.other_inputs[name] for name in OTHER_AIR_DATA if name in result.other_inputs}
        is_known = not isnan(result.dynamic_pressure)
        states.add((is_known, *(not isnan(value) for value in given.values())))
        expected = tracker.track(result.strain, result.dynamic_pressure, mach_number=result.mach_number, **given)
        np.testing.assert_allclose(result.coefficients, expected.coefficients, rtol=1e-6, atol=1e-9)
        np.testing.assert_allclose(result.coefficients_std, expected.coefficients_std, rtol=1e-5)
        if is_known:
            assert given == pytest.approx(
                {
                    "dynamic_pressure_std": 4e3,
                    "mach_number_std": 0.1,
                    "static_pressure": STATIC,
                    "static_pressure_std": 200.0,
                },
                rel=1e-6,
            )
    # Known, then lost all but the number of the mapping.
    assert states == {(True, True, True, True, True), (False, True, False, False, False)}
    assert not results[lost - 1].causes & (Cause.NAVIGATION | Cause.DYNAMIC_PRESSURE)
    assert (
        results[-1].causes & (Cause.NAVIGATION | Cause.DYNAMIC_PRESSURE)
        == Cause.NAVIGATION | Cause.DYNAMIC_PRESSURE
    )


def test_the_linear_estimator_takes_the_deviation_of_the_dynamic_pressure_alone(tmp_path: Path) -> None:
    save_inverse_map(flown_map(has_tables=False), tmp_path / "map.h5")
    with open_step(tmp_path / "map.h5") as ready:
        taken = tuple(name for name in other_inputs(ready.step) if name in OTHER_AIR_DATA)
        assert taken == ("dynamic_pressure_std", *LAST_INPUTS)
        taken = taken[:1]
        core = Machine(
            layout_of({"dynamic_pressure": MAPPING["dynamic_pressure"]}, taken),
            ready.step,
            BridgeSettings(),
            start=0.0,
        )
        result = rack_cycle(core, STRAIN, 0, [AIR_DATA])
    expected = Estimator(flown_map(has_tables=False)).step(
        STRAIN, result.dynamic_pressure, dynamic_pressure_std=4e3
    )
    np.testing.assert_allclose(result.coefficients_std, expected.coefficients_std, rtol=1e-12)
    for name in ("static_pressure", "mach_number"):
        with pytest.raises(InputError, match=f"{name}: .*expected none, the estimator does not take it"):
            layout_of({name: MAPPING[name]}, taken)


@pytest.mark.parametrize("value", [-1.0, nan, True, [3.0]])
def test_a_wrong_deviation_gets_one_line(value: object) -> None:
    mapping = {"static_pressure": {"signal": "Air.p", "std": value}}
    with pytest.raises(
        InputError, match=r"r: static_pressure: std: expected 'Message.Signal' or a number from 0 on"
    ):
        layout_of(mapping, OTHER_AIR_DATA)


# --- inertial inputs: units of a user's DBC file, and a unit that falls silent -----------------------------------

N_INERTIAL, UNIT, PRESSURE = 12, 0x300, 0x301
MEASURED = {"specific_force_z": (2.5, "g"), "angular_rate_y": (40.0, "deg/s"), "vibration": (3.0, "um/m")}
IN_SI = {"specific_force_z": 2.5 * 9.80665, "angular_rate_y": radians(40.0), "vibration": 3e-6}
SENDERS = {"dynamic_pressure": (PRESSURE, "Pa")} | {
    name: (UNIT + 2 + place, unit) for place, (name, (_, unit)) in enumerate(MEASURED.items())
}


def inertial_layout(held: InverseMap) -> InputLayout:
    lines = []
    for name, (identifier, unit) in SENDERS.items():
        lines += [f"BO_ {identifier} Of_{name}: 8 A", f' SG_ v : 0|64@1- (1,0) [0|0] "{unit}" B']
        lines += [f"SIG_VALTYPE_ {identifier} v : 2;"]
    flow = {name: {"signal": f"Of_{name}.v"} for name in SENDERS}
    return rack_layout(N_INERTIAL, lines, flow, flow_names=MapStep(held).other_inputs)


def test_a_bridge_takes_what_an_inertial_unit_measures() -> None:
    held = with_masses(scaled_map(2, seed=4, n=N_INERTIAL))
    step, found, random = MapStep(held), [], np.random.default_rng(1)
    strains = held.mean_strain + held.noise_std * random.standard_normal((40, N_INERTIAL))
    assert set(INERTIAL_NAMES) < set(step.other_inputs)
    core = Machine(inertial_layout(held), step, BridgeSettings(), start=0.0)
    for k, strain in enumerate(strains):
        sent = {"dynamic_pressure": NOMINAL}
        sent |= {name: value for name, (value, _) in MEASURED.items()} if k < 5 else {}
        others = [(SENDERS[name][0], struct.pack("<d", value)) for name, value in sent.items()]
        found.append(rack_cycle(core, strain, k, others))
    estimator = Estimator(held)
    with_unit = estimator.estimate(strains[3], NOMINAL, **IN_SI)
    without = estimator.estimate(strains[-1], NOMINAL, specific_force_z=nan)
    np.testing.assert_allclose(found[3].coefficients, with_unit.coefficients, rtol=1e-9)
    np.testing.assert_allclose(found[3].coefficients_std, with_unit.coefficients_std, rtol=1e-9)
    np.testing.assert_allclose(found[-1].coefficients, without.coefficients, rtol=1e-9)
    assert Cause.NAVIGATION in found[-1].causes
    np.testing.assert_allclose(found[-1].coefficients_std, without.coefficients_std, rtol=1e-9)


def test_a_map_without_masses_refuses_the_entry() -> None:
    with pytest.raises(InputError, match="expected none, the estimator does not take it"):
        inertial_layout(scaled_map(2, seed=4, n=N_INERTIAL))
