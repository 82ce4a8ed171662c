"""The plain form of estimates: few columns, angles in degrees, health in words, the same numbers."""

import csv
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from recorded_case import write_flight
from synthetic_vehicle import SyntheticFiles

from strainfmu.estimator.air_inputs import AIR_DATA_NAMES, AIR_DATA_UNITS
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES
from strainfmu.interface.estimator_variables import LOADS
from strainfmu.recorded.outputs import health_words, plain_columns

pytestmark = pytest.mark.fast

Run = Callable[..., tuple[int, str, str]]


def table(path: Path) -> dict[str, list[str]]:
    with path.open(newline="", encoding="utf-8") as stream:
        rows = list(csv.reader(stream))
    return dict(zip(rows[0], map(list, zip(*rows[1:], strict=True)), strict=True))


def test_a_table_of_the_command_is_plain_and_all_columns_are_an_option(
    synthetic: SyntheticFiles, tmp_path: Path, run: Run
) -> None:
    data = write_flight(tmp_path / "d.csv")
    for name, options in (("p.csv", ()), ("a.csv", ("--columns", "all")), ("h.h5", ())):
        code, _, errors = run("estimate", synthetic.map_1, data, "-o", tmp_path / name, *options)
        assert (code, errors) == (0, "")
    plain, whole = table(tmp_path / "p.csv"), table(tmp_path / "a.csv")
    loads = [f"{of}{name}" for of in ("", "sigma.") for name in LOADS]
    names = [*COEFFICIENT_NAMES, *(f"sigma.{name}" for name in COEFFICIENT_NAMES)]
    headings = [f"{name} [{'N' if 'force' in name else 'N m'}]" for name in loads]
    assert list(plain) == ["time [s]", *headings, *(f"{name} [1]" for name in names), "health"]
    assert all(plain[name] == whole[name] for name in plain if name != "health")
    assert plain["health"] == [HealthState(int(float(one))).name for one in whole["health.state [1]"]]
    with h5py.File(tmp_path / "h.h5") as file:
        assert len(file) == len(whole), "HDF5 has all columns"
    code, _, errors = run("estimate", synthetic.map_1, data, "-o", tmp_path / "p.csv", "--residuals")
    assert (code, len(table(tmp_path / "p.csv"))) == (0, len(plain) + 7), "what is asked for is written"


def test_angles_are_in_degrees_and_refused_samples_have_no_health() -> None:
    air = [
        (f"{of}air_data.{name}", unit)
        for of in ("", "sigma.")
        for name, unit in zip(AIR_DATA_NAMES, AIR_DATA_UNITS, strict=True)
    ]
    names = [("time", "s"), ("C_A", "1"), ("health.state", "1"), *air, ("M_R", "1"), ("section.normal[1]", "N")]
    plain = plain_columns(names)
    shown = ["time", "C_A", "angle_of_attack", "sideslip_angle", "sigma.angle_of_attack", "sigma.sideslip_angle"]
    assert [name for name, _ in plain.values()] == [*shown, "M_R", "section.normal[1]"]
    assert plain["sigma.air_data.sideslip_angle"] == ("sigma.sideslip_angle", "deg")
    assert health_words(np.array([2.0, np.nan])) == [HealthState(2).name, ""]
