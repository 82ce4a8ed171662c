"""``strainfmu check``: what other commands would refuse is refused, all at once; what they note is noted."""

import shutil
from collections.abc import Callable
from math import radians
from pathlib import Path

import pytest
from changed_vehicle import change
from ogive import OGIVE, copied_ogive

from builder.aero.engines.registry import make_engine
from builder.campaign.failures import extreme_conditions, flows_out_of_reach
from builder.pipeline.demonstration.flown_shape import manoeuvre_warnings
from builder.reporting import Silent
from builder.vehicle.file import IC3X, VEHICLES, load_vehicle
from builder.vehicle.flight_conditions import condition_grid
from strainfmu.cosim.models.trajectory import load_trajectory

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def vehicle(tmp_path: Path) -> Path:
    """Return a copy of the coarse vehicle that a test may spoil."""
    return copied_ogive(tmp_path / "vehicle")


@pytest.mark.fast
def test_extreme_conditions() -> None:
    grid = condition_grid([5.0, 4.0, 6.0], [0.0, -8.0, 4.0], [0.0, 3.0], 20e3)
    found = [(c.mach_number, c.angle_of_attack, c.sideslip_angle) for c in extreme_conditions(grid)]
    assert found == [
        (4.0, radians(-8.0), radians(3.0)),
        (4.0, 0.0, 0.0),
        (6.0, radians(-8.0), radians(3.0)),
        (6.0, 0.0, 0.0),
    ]


@pytest.mark.usefixtures("compiled_solver")
def test_flows_that_snapshots_would_refuse_are_refused(vehicle: Path, tmp_path: Path, run: Run) -> None:
    """Both commands name the same flow, the check without the campaign."""
    assert run("check", vehicle)[0] == 0
    change(vehicle, ("mach_number = [4.0, 4.5, 5.0]", "mach_number = [1.1, 4.5, 5.0]"))
    code, _, message = run("check", vehicle)
    assert code == 2
    assert message.count("\n") == 1
    assert message.startswith(f"strainfmu: {vehicle}: conditions: euler: ")
    assert "M 1.1, total incidence 6.7" in message
    assert "this tip needs M " in message


@pytest.mark.usefixtures("compiled_solver")
def test_flows_of_the_flight_model_too(vehicle: Path, run: Run) -> None:
    change(vehicle, ("[truth]\nmach_number = [4.0,", "[truth]\nmach_number = [1.1,"))
    code, _, message = run("check", vehicle)
    assert code == 2
    assert message.startswith(f"strainfmu: {vehicle}: truth: euler: ")


@pytest.mark.usefixtures("compiled_solver")
def test_one_failure_stands_for_more_incidence() -> None:
    """No minute is spent on a flow that fails for the same reason."""
    vehicle = load_vehicle(OGIVE)
    engine = make_engine(vehicle, None, vehicle.resolution.map)
    keys = [(1.1, 0.0), (1.1, radians(3.0)), (4.0, 0.0), (4.0, 0.0)]
    assert len(flows_out_of_reach(engine, keys, Silent(), "title")) == 1


def test_faults_of_all_checks_are_listed(vehicle: Path, run: Run) -> None:
    """Gauges, modes, section stations and manoeuvre in one go, before any flow is solved."""
    change(vehicle, ("modes = 4", "modes = 400\nsection_stations_m = [0.1, 99.0]"))
    change(vehicle.parent / "manoeuvre.csv", ("1,4.6,5,1,22", "1,4.6,9,1,22"))
    change(vehicle, ("[conditions]", "[aerodynamics]\nengine = 'table'\n[conditions]"))
    code, _, message = run("check", vehicle)
    assert code == 2
    lines = message.splitlines()
    found = ("aerodynamics.manifest: ", "map.modes: ", "map.section_stations_m: ", "total incidence: ")
    assert len(lines) == 4
    for line, words in zip(lines, found, strict=True):
        assert line.startswith(f"strainfmu: {vehicle.parent}/")
        assert words in line
    assert lines[1].startswith(f"strainfmu: {vehicle}: map.modes: ")
    named = tuple(f"strainfmu: {vehicle}: {entry}" for entry in ("aerodynamics.", "map.modes: "))
    for command in (("build",), ("compare",), ("demo", "--vehicle"), ("stress",)):
        _, _, message = run(*command, vehicle, "-o", vehicle.parent / "out")
        assert message.startswith(named), command


@pytest.mark.usefixtures("compiled_solver")
def test_a_manoeuvre_beyond_the_map_is_warned_of(vehicle: Path, run: Run) -> None:
    """Inside the flight model, outside the map: no fault, and a line per quantity."""
    change(vehicle, ("angle_of_attack_deg = [0.0, 3.0, 6.0]", "angle_of_attack_deg = [0.0, 1.0, 2.0, 3.0]"))
    change(vehicle, ("modes = 4", "modes = 4\nvalid_altitude_km = [5.0, 20.0]\ndiscrepancy_percent = 2.0"))
    code, printed, message = run("check", vehicle)
    assert (code, message) == (0, "")
    assert "inertia: not included, and nothing detects it: " in printed
    assert "sigma of a reading" in printed
    warnings = [line for line in printed.splitlines() if line.startswith("warning: ")]
    assert [line.partition(": outside")[0] for line in warnings] == [
        "warning: map.discrepancy_percent: not used, it is for estimator 'nonlinear', and the map's is 'linear'",
        "warning: the manoeuvre flies total incidence 1 to 5.099 deg, the map covers 0 to 4.242 deg",
        "warning: the manoeuvre flies altitude 22 to 22 km, the map covers 5 to 20 km",
    ]


def test_a_deflection_out_of_range_is_refused(run: Run, tmp_path: Path) -> None:
    """No health notices it, as it does other Mach numbers or incidence: value, time and range in one line."""
    for path in VEHICLES.glob("finned_body*"):
        shutil.copy(path, tmp_path)
    change(tmp_path / "finned_body.toml", ("values = [-4.0, -2.0, 0.0, 2.0, 4.0]", "values = [-2.0, 0.0, 2.0]"))
    code, printed, message = run("check", tmp_path / "finned_body.toml")
    assert (code, printed, message.count("\n")) == (2, "", 1)
    assert "finned_body_manoeuvre.csv: fin_roll_deg: expected -2 .. 2, the range of the snapshots, got " in message


@pytest.fixture
def without_flows(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave out the flows, which take longest."""
    monkeypatch.setattr("builder.pipeline.vehicle_check._out_of_reach", lambda *parts: ())


@pytest.mark.usefixtures("without_flows")
@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("ic3x", ""),
        ("launcher", "expected a body that is held, got 'free_flight'"),
        ("blunt_cone", ""),
        ("elliptic_cone", "shape: expected a profile, which this needs, got sections"),
        ("finned_body", "shape: expected a profile, which this needs, got surface"),
    ],
)
def test_commands_that_cannot_use_a_vehicle_are_named(name: str, why: str, tmp_path: Path, run: Run) -> None:
    """A ground test can be planned and calibrated of each."""
    path = VEHICLES / f"{name}.toml"
    code, printed, _ = run("check", path)
    assert code == 0
    if name == "ic3x":
        assert all(text in printed for text in ("54 gauges", "90 conditions, 85 distinct flows"))
    said = [line for line in printed.splitlines() if line.startswith("not for this vehicle: ")]
    if not why:
        assert said == []
        return
    (line,) = said
    assert line.startswith("not for this vehicle: demo --as-built, trial ground_test: ")
    assert line.endswith(why)
    assert run("loadtest", path, "--template", "-o", tmp_path / "loadtest.toml")[0] == 0


@pytest.mark.usefixtures("without_flows")
def test_a_structure_of_another_code_has_no_demonstration(vehicle: Path, run: Run) -> None:
    change(vehicle, ("internal_pressure_Pa = 3000.0", 'internal_pressure_Pa = 3000.0\ninfluence = "strains.csv"'))
    said = [line for line in run("check", vehicle)[1].splitlines() if line.startswith("not for this vehicle: ")]
    assert [line.split(": ")[1] for line in said] == ["demo", "place, review"]


@pytest.mark.usefixtures("without_flows")
def test_the_range_of_altitude_is_the_stated_one(vehicle: Path, run: Run) -> None:
    """The snapshots are of 22 km."""
    change(vehicle, ("modes = 4", "modes = 4\nvalid_altitude_km = [5.0, 25.0]"))
    _, printed, _ = run("check", vehicle)
    assert any("valid over altitude" in line and " 5 to 25 km " in line for line in printed.splitlines())


@pytest.mark.usefixtures("without_flows")
def test_gauges_at_changes_of_slope_and_thickness_are_questioned(tmp_path: Path, run: Run) -> None:
    """Within 10 mm, the length of an element, of the slope break at 1.75 m and the end of a region at 2.5 m."""
    text = IC3X.read_text(encoding="utf-8").replace('"ic3x_manoeuvre.csv"', f'"{VEHICLES}/ic3x_manoeuvre.csv"')
    vehicle = tmp_path / "vehicle.toml"
    vehicle.write_text(text, encoding="utf-8")
    rows = "{ roll_angle_deg = 0.0, directions = ['axial'], x_m = [0.35, 1.7401, 1.755, 1.77, 2.4905, 2.52, 3.0] }"
    change(vehicle, ("[conditions]", f"[gauges.layouts.near]\nrows = [{rows}]\n\n[conditions]"))
    thicker = "[{ x_m = 2.5, thickness_mm = 4.0 }, { x_m = 2.501, thickness_mm = 5.0 }]"
    change(vehicle, ('layout = "configuration_2"', 'layout = "near"'))
    change(vehicle, ("[structure]", f"[structure]\nwall_thickness_at = {thicker}"))
    said = [line for line in run("check", vehicle)[1].splitlines() if "within one element" in line]
    assert [line.split(": ", 2)[2].partition(", where")[0] for line in said] == [
        "axial_0deg_2, axial_0deg_3: within one element (10 mm) of the change of slope at 1.75 m",
        "axial_0deg_5: within one element (10 mm) of the change of thickness, material or frames at 2.5 m",
    ]


@pytest.mark.fast
def test_what_a_map_covers_depends_on_its_form_and_symmetry(vehicle: Path) -> None:
    """The disc of incidence where flows are rolled, the listed angles elsewhere; altitudes by the form."""

    def quantities(of_revolution: bool) -> list[str]:
        loaded = load_vehicle(vehicle)
        trajectory = load_trajectory(loaded.beside(loaded.truth.manoeuvre))
        found = manoeuvre_warnings(loaded, trajectory, loaded.flight_conditions(), of_revolution)
        return [
            name for line in found for name in ("angle of attack", "sideslip", "altitude") if f" {name} " in line
        ]

    assert quantities(of_revolution=True) == quantities(of_revolution=False) == []
    text = (vehicle.parent / "manoeuvre.csv").read_text(encoding="utf-8")
    (vehicle.parent / "manoeuvre.csv").write_text(text.replace("4.6,5,1,22", "4.6,-5,1,21"), encoding="utf-8")
    assert quantities(of_revolution=True) == []
    assert quantities(of_revolution=False) == ["angle of attack"]
    change(vehicle, ("modes = 4", 'modes = 4\nsymmetry = "listed"\nform = "absolute"'))
    assert quantities(of_revolution=True) == ["angle of attack", "altitude"]


@pytest.mark.fast
def test_the_shipped_manoeuvre_stays_inside() -> None:
    vehicle = load_vehicle(IC3X)
    trajectory = load_trajectory(vehicle.beside(vehicle.truth.manoeuvre))
    assert manoeuvre_warnings(vehicle, trajectory, vehicle.flight_conditions(), of_revolution=False) == []
