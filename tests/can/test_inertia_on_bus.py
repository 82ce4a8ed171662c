"""Inertial inputs from a bus: units of a user's DBC file, and a unit that falls silent."""

from __future__ import annotations

import struct
from math import nan, radians

import numpy as np
import pytest
from can_case import CYCLE
from inertia_maps import with_masses
from scaled_maps import NOMINAL, scaled_map

from strainfmu.can.dbc_files import database_of
from strainfmu.can.dbc_mapping import mapped_layout
from strainfmu.can.frame import Frame
from strainfmu.can.machine import Machine
from strainfmu.can.options import BridgeSettings
from strainfmu.can.quality import Cause
from strainfmu.cosim.estimators.source import MapStep
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import INERTIAL_NAMES
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import InverseMap

pytestmark = pytest.mark.fast
N_D, UNIT, PRESSURE = 12, 0x300, 0x301
SENT = {"specific_force_z": (2.5, "g"), "angular_rate_y": (40.0, "deg/s"), "vibration": (3.0, "um/m")}
IN_SI = {"specific_force_z": 2.5 * 9.80665, "angular_rate_y": radians(40.0), "vibration": 3e-6}


def layout_of(held: InverseMap):
    lines, floats = ['VERSION ""', "NS_ :", "BS_:", "BU_: A B"], []
    for number in range(N_D):
        lines += [f"BO_ {0x100 + number} F{number}: 8 A", ' SG_ v : 0|64@1- (1,0) [0|0] "m/m" B']
        floats.append(f"SIG_VALTYPE_ {0x100 + number} v : 2;")
    for identifier, name, unit in (
        (PRESSURE, "dynamic_pressure", "Pa"),
        *((UNIT + 2 + place, name, unit) for place, (name, (_, unit)) in enumerate(SENT.items())),
    ):
        lines += [f"BO_ {identifier} Of_{name}: 8 A", f' SG_ v : 0|64@1- (1,0) [0|0] "{unit}" B']
        floats.append(f"SIG_VALTYPE_ {identifier} v : 2;")
    strain = {f"strain[{number + 1}]": f"F{number}.v" for number in range(N_D)}
    flow = {name: {"signal": f"Of_{name}.v"} for name in ("dynamic_pressure", *SENT)}
    return mapped_layout(
        database_of("\n".join([*lines, *floats, ""]), "r"),
        {"cycle_time_ms": 1e3 * CYCLE, "strain": strain, **flow},
        gauge_names=[f"g{number}" for number in range(N_D)],
        name="r",
        flow_names=MapStep(held).other_inputs,
    )


def test_a_bridge_takes_what_the_unit_measures() -> None:
    held = with_masses(scaled_map(2, seed=4, n=N_D))
    step, found, random = MapStep(held), [], np.random.default_rng(1)
    strains = held.mean_strain + held.noise_std * random.standard_normal((40, N_D))
    assert set(INERTIAL_NAMES) < set(step.other_inputs)
    core = Machine(layout_of(held), step, BridgeSettings(), start=0.0)
    for k in range(40):
        frames = [(PRESSURE, NOMINAL)]
        if k < 5:
            frames += [(UNIT + 2 + place, value) for place, (value, _) in enumerate(SENT.values())]
        frames += [(0x100 + i, value) for i, value in enumerate(strains[k])]
        results = []
        for identifier, value in frames:
            results += core.receive(Frame(identifier=identifier, data=struct.pack("<d", value), time=k * CYCLE))
        found.append((results + core.advance((k + 0.9) * CYCLE))[-1])
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
        layout_of(scaled_map(2, seed=4, n=N_D))
