"""Flow parameters in the section [conditions], and in the manoeuvre."""

import shutil
from pathlib import Path

import pytest
from changed_vehicle import refusal

from builder.vehicle.file import VEHICLES
from strainfmu.cosim.models.trajectory import load_trajectory
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast

FINNED = VEHICLES / "finned_body.toml"
VALUES = "values = [-4.0, -2.0, 0.0, 2.0, 4.0]"
SURFACE = '    { value = 4.0, file = "finned_body_roll_+4deg.stl" },\n'


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ([(VALUES, "values = [-4.0, 5.0]")], "expected -4 .. 4, the range of the surfaces, got 5"),
        ([(VALUES, "values = [1.0, 1.0]")], "expected each value once, got 1 more than once"),
        ([(VALUES, "values = []")], "conditions.parameters.fin_roll_deg.values"),
        ([(SURFACE, SURFACE.replace("4.0", "-4.0", 1))], "expected each value once, got -4 more than once"),
        ([(SURFACE, SURFACE.replace("4.0", "0.0", 1))], "expected each value once, got 0 more than once"),
        ([("fin_roll_deg]", "altitude_km]")], "other than time_s, mach_number"),
        ([("fin_roll_deg]", '"fin roll"]')], "expected names of letters, digits and _"),
        (
            [('engine = "newtonian"', 'engine = "table"\nmanifest = "m.toml"')],
            "surfaces: expected with shape",
        ),
        ([("surfaces = [", "surface = [")], "surface"),
    ],
)
def test_wrong_parameters_are_one_line(tmp_path: Path, changes: list[tuple[str, str]], message: str) -> None:
    text = refusal(tmp_path, *changes, source=FINNED)
    assert message in text
    assert "\n" not in text


def test_marching_solver_and_profiles_have_no_parameters(tmp_path: Path) -> None:
    section = "[conditions.parameters.flap_deg]\nvalues = [0.0, 1.0]\n\n[noise]\n"
    newtonian = ('engine = "euler"', 'engine = "newtonian"')
    assert "expected engine 'newtonian' or 'table', got 'euler'" in refusal(tmp_path, ("[noise]\n", section))
    assert "expected [shape] with sections or surface, got a profile" in refusal(
        tmp_path, ("[noise]\n", section), newtonian
    )


def test_newtonian_engine_needs_surfaces(tmp_path: Path) -> None:
    text = FINNED.read_text(encoding="utf-8")
    start, end = text.index("surfaces = ["), text.index("]\n", text.index("surfaces = [")) + 2
    message = refusal(tmp_path, (text[start:end], ""), source=FINNED)
    assert "fin_roll_deg.surfaces: entry is missing, the newtonian engine needs a surface at each end" in message


def test_manoeuvre_has_a_column_per_parameter(tmp_path: Path) -> None:
    path = VEHICLES / "finned_body_manoeuvre.csv"
    trajectory = load_trajectory(path, ("fin_roll_deg",))
    assert trajectory.condition_at(2.0).parameters == (3.0,)
    assert -2.5 < trajectory.condition_at(3.0).parameters[0] < 3.0
    with pytest.raises(InputError, match=r"row 1: expected the header 'time_s,.*altitude_km', got"):
        load_trajectory(path)
    changed = tmp_path / "m.csv"
    shutil.copy(path, changed)
    changed.write_text(changed.read_text(encoding="utf-8").replace(",20,0.5", ",20,fast"), encoding="utf-8")
    with pytest.raises(InputError, match="row 2, column fin_roll_deg: expected a finite number, got 'fast'"):
        load_trajectory(changed, ("fin_roll_deg",))
