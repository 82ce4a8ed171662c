"""Entries of [truth] and [resolution]: required where a model of the vehicle uses them, and nowhere else."""

import re
from math import radians
from pathlib import Path

import numpy as np
import pytest
from changed_vehicle import TEXT, refusal, write_changed

from builder.reporting import Silent
from builder.truth.flow_table import harmonics_at, solved_flows, truth_knots
from builder.vehicle.file import VEHICLES, load_vehicle
from builder.vehicle.model_entries import Resolution
from strainfmu.errors import InputError

FINNED = VEHICLES / "finned_body.toml"
NEWTONIAN = ('engine = "euler"', 'engine = "newtonian"')


def section(name: str) -> str:
    """Return the text of a section of the shipped file, from its header to the next one or the end."""
    found = re.search(rf"^\[{re.escape(name)}\]\n.*?(?=^\[|\Z)", TEXT, flags=re.MULTILINE | re.DOTALL)
    assert found is not None
    return found.group()


def without(name: str) -> tuple[str, str]:
    """Return the change that takes a section out."""
    return section(name), ""


def test_body_with_files_for_surface_and_mesh_needs_no_numbers_of_models() -> None:
    """The shipped finned body, in Newtonian flow: no cells, no stations, no elements, no flows of a table."""
    vehicle = load_vehicle(FINNED)
    assert not vehicle.resolution.map.model_fields_set
    assert vehicle.truth.mach_number is None


@pytest.mark.parametrize("level", ["map", "truth"])
@pytest.mark.parametrize("entry", list(Resolution.model_fields))
def test_profile_in_euler_flow_needs_every_number(tmp_path: Path, level: str, entry: str) -> None:
    whole = section(f"resolution.{level}")
    line = next(line for line in whole.splitlines(keepends=True) if line.startswith(entry))
    message = refusal(tmp_path, (whole, whole.replace(line, "")))
    assert f"resolution.{level}.{entry}: entry is missing, it is required with " in message


@pytest.mark.parametrize("entry", ["mach_number", "total_incidence_deg"])
def test_alarm_levels_by_euler_need_the_flows_of_the_vehicle_that_flies(tmp_path: Path, entry: str) -> None:
    changes = [without("truth")]
    assert f"truth.{entry}: entry is missing" in refusal(tmp_path, *changes)
    nominal = ("[map]", '[map]\nalarm_levels = "nominal"')
    assert load_vehicle(write_changed(tmp_path, *changes, nominal)).truth.mach_number is None


def test_profile_in_newtonian_flow_needs_neither_cells_nor_truth(tmp_path: Path) -> None:
    cells = r"(?:radial|circumferential)_cells = \d+\n"
    levels = [section("resolution.map"), section("resolution.truth")]
    changes = [(level, re.sub(cells, "", level)) for level in levels]
    vehicle = load_vehicle(write_changed(tmp_path, NEWTONIAN, without("truth"), *changes))
    with pytest.raises(
        InputError, match=r"truth\.mach_number: entry is missing, the flows of the vehicle that flies"
    ):
        truth_knots(vehicle.truth)
    # The Euler solver flies what has a section [truth], whatever engine the map is built on.
    assert "resolution.truth.radial_cells: entry is missing" in refusal(tmp_path, NEWTONIAN, changes[1])


def test_commands_without_a_flight_run_and_the_others_name_it(tmp_path: Path, run: object) -> None:
    flight = next(line for line in section("truth").splitlines() if line.startswith("manoeuvre"))
    path = write_changed(tmp_path, (flight, 'engine = "newtonian"'), NEWTONIAN)
    assert callable(run)
    code, printed, _ = run("check", path)
    assert code == 0
    assert "manoeuvre: none; `strainfmu demo` needs truth.manoeuvre" in printed
    code, _, message = run("demo", "--vehicle", path, "-o", tmp_path / "demo")
    assert code == 2
    assert message == f"strainfmu: {path}: truth.manoeuvre: entry is missing, `strainfmu demo` flies it\n"


def test_a_tunnel_has_one_mach_number(tmp_path: Path) -> None:
    """Flows at 0.1 % below and above it; a table of two or three numbers has no spline."""
    knots = next(line for line in section("truth").splitlines() if line.startswith("mach_number"))
    truth = ("[truth]", '[truth]\nengine = "newtonian"')
    conditions = ("mach_number = [5.0, 5.5, 6.0, 6.5, 7.0]", "mach_number = [6.0]")
    vehicle = load_vehicle(write_changed(tmp_path, conditions, (knots, "mach_number = [6.0]"), truth))
    table = solved_flows(vehicle, *truth_knots(vehicle.truth), Silent())
    np.testing.assert_allclose(table.mach_knots, [5.994, 6.006])
    found = harmonics_at(table, np.array([6.0]), np.array([radians(3.0)]))
    between = harmonics_at(table, table.mach_knots, np.full(2, radians(3.0))).mean(axis=0)
    np.testing.assert_allclose(found[0], between, rtol=1e-12, atol=1e-12)
    message = refusal(tmp_path, (knots, "mach_number = [6.0, 6.5]"))
    assert "truth.mach_number: expected 1 value, or at least 4, got [6.0, 6.5]" in message
