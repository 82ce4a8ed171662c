"""Entries within their limits that are hardly meant are questioned; those of the shipped vehicles are not."""

import re
from collections.abc import Callable
from math import degrees, pi, radians
from pathlib import Path

import pytest
from changed_vehicle import load_changed, write_changed

from builder.pipeline.demonstration.flown_shape import manoeuvre_warnings
from builder.vehicle.file import VEHICLES, load_vehicle
from builder.vehicle.map_needs import doubtful_entries, is_in_radians
from strainfmu.cosim.models.trajectory import load_trajectory

Run = Callable[..., tuple[int, str, str]]
SHIPPED = sorted(path for path in VEHICLES.glob("*.toml") if not path.stem.endswith("_flight"))


def in_radians(values: list[float]) -> str:
    return str([round(radians(value), 4) for value in values])


ATTACK, TRUTH = [0.0, 2.0, 4.0, 6.0, 8.0, 10.0], "total_incidence_deg = "


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_shipped_vehicles_raise_no_question(path: Path) -> None:
    vehicle = load_vehicle(path)
    conditions = vehicle.flight_conditions()
    assert list(doubtful_entries(vehicle, conditions)) == []
    trajectory = load_trajectory(vehicle.manoeuvre(), tuple(vehicle.conditions.parameters))
    assert not [line for line in manoeuvre_warnings(vehicle, trajectory, conditions, True) if "radians" in line]


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        (
            [(str(ATTACK), in_radians(ATTACK))],
            "conditions: angle_of_attack_deg: at most 0.1745 deg; 0.1745 rad are 10 deg: is it in radians?",
        ),
        (
            [("[0.0, 5.0, 10.0]", in_radians([0.0, 5.0, 10.0]))],
            "conditions: sideslip_angle_deg: at most 0.1745 deg; 0.1745 rad are 10 deg: is it in radians?",
        ),
        (
            [(TRUTH, f"{TRUTH}{in_radians([2.0, 5.0, 8.0, 11.0, 14.2])} #")],
            "truth.total_incidence_deg: at most 0.2478 deg, the snapshots go to 14.11 deg: is it in radians?",
        ),
        (
            [(f"roll_angle_deg = {90 * k}.0", f"roll_angle_deg = {0.5 * pi * k:.4f}") for k in (2, 1, 2, 1, 0, 3)],
            "gauges.layouts.configuration_2: roll_angle_deg: 0 to 4.712 deg, all rows in one sector: is it in "
            "radians?",
        ),
        (
            [("percent_of_median_strain = 1.0", "std_um_per_m = 500.0"), ("of_layout = ", "# ")],
            "noise.std_um_per_m: 500 um/m found, gauges have 0.1 to 10 um/m: is it the noise of one reading, in "
            "um/m?",
        ),
    ],
    ids=["attack", "sideslip", "truth", "roll", "noise"],
)
def test_other_units_are_questioned(tmp_path: Path, changes: list[tuple[str, str]], line: str) -> None:
    vehicle = load_changed(tmp_path, *changes)
    assert list(doubtful_entries(vehicle, vehicle.flight_conditions())) == [line]


def test_check_asks_for_the_unit_of_a_manoeuvre(tmp_path: Path, run: Run) -> None:
    """Angles of the flight against those of the snapshots; no fault, for it may be meant."""
    header, *rows = (VEHICLES / "ic3x_manoeuvre.csv").read_text().splitlines()
    cells = [row.split(",") for row in rows]
    turned = [[*row[:2], *(str(radians(float(one))) for one in row[2:4]), *row[4:]] for row in cells]
    (tmp_path / "ic3x_manoeuvre.csv").write_text("\n".join([header, *map(",".join, turned)]) + "\n")
    newtonian = ('engine = "euler"', 'engine = "newtonian"'), ("[truth]", '[truth]\nengine = "newtonian"')
    code, printed, message = run("check", write_changed(tmp_path, *newtonian))
    assert (code, message) == (0, "")
    (line,) = [line for line in printed.splitlines() if line.endswith("in radians?")]
    assert re.fullmatch(r"warning: the manoeuvre flies 0\.1\d+ deg at most, the map covers 14\.11 deg: .*", line)


def test_small_angles_beside_small_snapshots_are_meant() -> None:
    assert not is_in_radians(0.0, 10.0)
    assert not is_in_radians(1.0, 10.0)
    assert is_in_radians(radians(8.0), 10.0)
    assert not is_in_radians(0.4, 10.0)  # 23 deg, if it were radians
    assert not is_in_radians(degrees(1.0), 3.0)
