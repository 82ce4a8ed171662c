"""Further parameters of the flow from a user's DBC file: known to the estimator, for health alone, or not."""

import struct
from collections.abc import Callable
from dataclasses import replace
from math import isnan, nan
from pathlib import Path

import numpy as np
import pytest
from can_case import CYCLE
from float_rack import rack_cycle, rack_strains, rack_text
from parameter_maps import with_parameters
from scaled_maps import NOMINAL, scaled_map

from strainfmu.can.dbc_files import database_of
from strainfmu.can.dbc_mapping import mapped_layout
from strainfmu.can.frame import Frame
from strainfmu.can.machine import Machine, Result
from strainfmu.can.options import BridgeOptions, BridgeSettings
from strainfmu.can.page_message import health_text
from strainfmu.can.quality import Cause, Quality
from strainfmu.can.setup import make_machine
from strainfmu.cosim.estimators.source import open_step
from strainfmu.cosim.estimators.step import StepResult, parameter_names_of
from strainfmu.errors import InputError
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import InverseMap, save_inverse_map

pytestmark = pytest.mark.fast

FINS = 0x300
PERIOD = 5
"""Cycles from one frame of the fins to the next; it is held for two of these."""


def files_of(inverse_map: InverseMap, folder: Path) -> BridgeOptions:
    """Write a DBC file with a float64 in each frame of strains, and the fins; its mapping too; return options."""
    lines = [
        f"BO_ {FINS} Fins: 8 A",
        ' SG_ fin : 0|16@1- (0.01,0) [0|0] "deg" B',
        ' SG_ power : 16|16@1+ (0.001,0) [0|0] "" B',
        'BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;',
        'BA_DEF_DEF_ "GenMsgCycleTime" 10;',
        f'BA_ "GenMsgCycleTime" BO_ {FINS} {round(1e3 * PERIOD * CYCLE)};',
    ]
    strains = [
        "[strain]",
        *(f'"{gauge}" = "{path}"' for gauge, path in rack_strains(inverse_map.n_gauges).items()),
    ]
    (folder / "r.dbc").write_text(rack_text(inverse_map.n_gauges, lines))
    mapped = '[parameter]\nfin_deg = "Fins.fin"\n"parameter.power" = "Fins.power"\n'
    (folder / "r.toml").write_text("\n".join([*strains, mapped]))
    options = BridgeOptions(interface="virtual", channel="fins", dynamic_pressure=NOMINAL)
    return replace(options, dbc=folder / "r.dbc", mapping=folder / "r.toml")


def cycle(core: Machine, strain: np.ndarray, k: int, fins: tuple[float, float] | None) -> Result:
    """Return the result of cycle ``k``; ``fins`` None for no frame of them."""
    data = b"" if fins is None else struct.pack("<hH4x", round(100.0 * fins[0]), round(1000.0 * fins[1]))
    return rack_cycle(core, strain, k, [(FINS, data)] if data else [])


def test_a_bridge_judges_as_python_does(tmp_path: Path) -> None:
    """By a map; tests/golden gives a bridge FMUs of such maps."""
    held = with_parameters(scaled_map(2, seed=4))
    save_inverse_map(held, tmp_path / "map.h5")
    options, estimator, random = files_of(held, tmp_path), Estimator(held), np.random.default_rng(1)
    seen = []
    with open_step(tmp_path / "map.h5") as ready:
        assert set(parameter_names_of(ready.step)) == {f"parameter.{name}" for name in estimator.parameters.names}
        core, *_ = make_machine(ready.step, options, gauge_names=ready.gauge_names, start=0.0)
        for k in range(60):
            strain = held.mean_strain + 1e-7 * random.normal(size=held.n_gauges)
            # In range; out of it; lost.
            fins = (-3.5, 0.25) if k < 20 else (4.5, 0.25)
            result = cycle(core, strain, k, fins if k % PERIOD == 0 and k < 35 else None)
            if k < 10:
                continue
            known = k < 30 + 2 * PERIOD
            given = dict(zip(("fin_deg", "power"), fins, strict=True)) if known else {}
            expected = estimator.step(strain, NOMINAL, parameters=given)
            assert result.health == expected.health
            np.testing.assert_allclose(result.coefficients, expected.coefficients, rtol=1e-6)
            assert bool(result.causes & Cause.NAVIGATION) == (not known)
            text = health_text(result, None)
            assert text == (
                None if expected.health is not HealthState.OUTSIDE else "fin_deg outside the map's range"
            )
            seen.append((result.health, result.quality))
    assert seen[0] == seen[-1] == (HealthState.OK, Quality.UNPROTECTED)
    assert (HealthState.OUTSIDE, Quality.SUSPECT) in seen


def test_what_cannot_be_is_not_known() -> None:
    """Of a float: no number, and a size that the estimator has for one that is not known."""
    given: list[dict[str, float]] = []

    def step(strain: np.ndarray, dynamic_pressure: float, step_size: float, **further: float) -> StepResult:
        given.append(further)
        return StepResult(np.zeros(5), np.ones(5), 0, 1.0)

    step.other_inputs = ("parameter.fin",)  # type: ignore[attr-defined]  # read by name
    text = (
        'VERSION ""\nNS_ :\nBS_:\nBU_: A B\nBO_ 256 R: 8 A\n SG_ S1 : 0|16@1- (0.25,0) [0|0] "um/m" B\n'
        ' SG_ S2 : 16|16@1- (0.25,0) [0|0] "um/m" B\nBO_ 300 Fins: 8 A\n SG_ fin : 0|64@1- (1,0) [0|0] "deg" B\n'
        "SIG_VALTYPE_ 300 fin : 2;\n"
    )
    mapping = {
        "cycle_time_ms": 10,
        "strain": {"strain[1]": "R.S1", "strain[2]": "R.S2"},
        "parameter": {"fin": "Fins.fin"},
    }
    layout = mapped_layout(
        database_of(text, "r"), mapping, gauge_names=["a", "b"], name="r", parameter_names=["parameter.fin"]
    )
    core = Machine(layout, step, BridgeSettings(), start=0.0, dynamic_pressure=NOMINAL)
    values = [1.0] * 5 + [-7.25, -1e9, nan, 1e99, 2.5]
    for k, value in enumerate(values):
        time = k * CYCLE
        core.receive(Frame(identifier=300, data=struct.pack("<d", value), time=time))
        core.receive(Frame(identifier=256, data=struct.pack("<hh4x", 100 + k, 200 + k % 3), time=time))
    found = [one["parameter.fin"] for one in given][-5:]
    assert (found[0], found[-1]) == (-7.25, 2.5)
    assert all(isnan(value) for value in found[1:-1])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda table: table.update(flap="Fins.fin"),
            r"parameter: expected a name \(fin, parameter.fin\), got 'flap'",
        ),
        (lambda table: table.update({"parameter.fin": "Fins.fin"}), "parameter: expected one signal for"),
        (lambda table: table.update(fin="R.S1"), "parameter.fin: expected a frame without strains"),
        (lambda table: table.update(fin="Fins.flap"), "flap"),
    ],
)
def test_wrong_mappings_are_refused(change: Callable[[dict[str, str]], None], message: str) -> None:
    text = (
        'VERSION ""\nNS_ :\nBS_:\nBU_: A B\nBO_ 256 R: 8 A\n SG_ S1 : 0|16@1- (0.25,0) [0|0] "um/m" B\n'
        'BO_ 300 Fins: 8 A\n SG_ fin : 0|16@1- (1,0) [0|0] "deg" B\n'
    )
    table = {"fin": "Fins.fin"}
    change(table)
    mapping = {"cycle_time_ms": 10, "strain": {"strain[1]": "R.S1"}, "parameter": table}
    with pytest.raises(InputError, match=message):
        mapped_layout(
            database_of(text, "r"), mapping, gauge_names=["a"], name="r", parameter_names=["parameter.fin"]
        )
    with pytest.raises(InputError, match=r"\(none, the estimator has no flow parameters\)"):
        mapped_layout(database_of(text, "r"), mapping, gauge_names=["a"], name="r")
