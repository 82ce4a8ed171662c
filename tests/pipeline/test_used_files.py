"""Chains of commands: files of ``snapshots`` and ``structure`` reach the map whatever their options."""

import shutil
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from changed_vehicle import write_changed
from ogive import OGIVE, copied_ogive

import builder
from builder.campaign.snapshot_fit import as_flown, option_misfits
from builder.campaign.snapshots import load_snapshots, save_snapshots
from builder.pipeline.load_test_proposal import flows_for_design
from builder.pipeline.map_files import cached_snapshots, make_map
from builder.pipeline.measured_levels import alarm_levels_wanted
from builder.pipeline.pipeline import FilesGiven, open_pipeline
from builder.reporting import Silent
from builder.vehicle.file import load_vehicle
from builder.workspace import SHARED_VARIABLE
from strainfmu.errors import InputError
from strainfmu.estimator.map.inverse_map import load_inverse_map

Run = Callable[..., tuple[int, str, str]]

SET = (
    "mach_number,angle_of_attack_deg,sideslip_angle_deg,altitude_km\n"
    "4,0,0,22\n4,3,1,22\n4.5,0,3,22\n4.5,6,0,22\n5,2,2,22\n5,6,3,22\n5,0,0,22\n"
)


def write_vehicle(folder: Path, *changes: tuple[str, str]) -> Path:
    """Write the coarse vehicle with texts replaced once each, its tables beside it."""
    if not folder.exists():
        copied_ogive(folder)
    # Alarm levels from the independent model take longer than all else.
    return write_changed(folder, *changes, ("[map]", '[map]\nalarm_levels = "nominal"'), source=OGIVE)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory, compiled_solver: None) -> Path:
    """Files made by commands with options: by the newtonian engine at a set, euler on the coarse grid, a solid."""
    from strainfmu.cli.main import main

    folder = tmp_path_factory.mktemp("made")
    vehicle = write_vehicle(folder / "vehicle")
    (folder / "set.csv").write_text(SET, encoding="utf-8")
    for command in (
        ("snapshots", vehicle, "-o", folder / "set.h5", "--engine", "newtonian", "--set", folder / "set.csv"),
        ("snapshots", vehicle, "-o", folder / "newtonian.h5", "--engine", "newtonian"),
        ("structure", vehicle, "-o", folder / "structure.h5", "--resolution", "coarse"),
    ):
        with pytest.raises(SystemExit) as ended:
            main([str(word) for word in command])
        assert not ended.value.code
    return folder


def provenance(folder: Path) -> dict[str, Any]:
    return load_inverse_map(folder / "map.h5").provenance


def build_map(vehicle: Path, folder: Path, given: FilesGiven | None = None) -> None:
    """Build without the report, which takes longer than the map."""
    pipeline, _ = open_pipeline(load_vehicle(vehicle), folder, Silent(), given or FilesGiven())
    make_map(pipeline)


def test_options_of_both_commands_reach_the_map(
    run: Run, made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Engine, set of conditions, three-dimensional model and its resolution; the files are left as they were."""
    monkeypatch.setattr("builder.pipeline.map_files._report", lambda *_: None)  # takes longer than the map
    folder = tmp_path / "results"
    folder.mkdir()
    shutil.copy(made / "set.h5", folder / "snapshots.h5")
    shutil.copy(made / "structure.h5", folder / "structure.h5")
    before = {name: (folder / name).read_bytes() for name in ("snapshots.h5", "structure.h5")}
    vehicle = made / "vehicle" / "vehicle.toml"
    code, printed, message = run("build", vehicle, "-o", folder)
    assert (code, message) == (0, "")
    found = provenance(folder)
    assert found["snapshots"] == 7
    assert found["flow"]["engine"] == "newtonian"
    assert found["flow"]["sets"] == [f"{made / 'set.csv'} (7)"]
    assert found["flow"]["options"] == {"engine": "newtonian", "set": [str(made / "set.csv")]}
    assert found["structure"]["model"] == "swept_hexahedra"
    assert found["structure"]["resolution"] == "coarse"
    assert found["structural_model"].startswith("swept_hexahedra")
    assert {name: (folder / name).read_bytes() for name in before} == before
    assert "snapshots.h5: used as it is: newtonian engine, 7 conditions" in printed
    assert "structure.h5: used as it is: swept hexahedra (coarse)" in printed
    assert "the vehicle file: fourier model" in printed
    code, printed, _ = run("build", vehicle, "-o", folder)
    assert code == 0
    assert "map.h5: up to date, reused" in printed
    code, printed, _ = run("inspect", folder / "map.h5")
    assert code == 0
    assert "engine newtonian" in " ".join(printed.split())


@pytest.mark.slow
def test_grid_level_reaches_the_map(run: Run, tmp_path: Path, compiled_solver: None) -> None:
    """A map on 16 x 24 cells where the vehicle file has 12 x 18; the vehicle file's Fourier model is kept."""
    vehicle, folder = write_vehicle(tmp_path / "vehicle"), tmp_path / "results"
    code, _, _ = run("snapshots", vehicle, "-o", folder / "snapshots.h5", "--grid", "coarse", "--workers", "0")
    assert code == 0
    build_map(vehicle, folder)
    found = provenance(folder)
    grid = found["flow"]["marching_grid"]
    assert (found["flow"]["engine"], grid["n_radial"], grid["n_circumferential"]) == ("euler", 16, 24)
    assert found["structure"] == {"model": "fourier", "harmonics": 8, "element_length_mm": 20.0, "wall_layers": 1}
    assert "resolution" not in found  # the vehicle file's cells are not those of the map


@pytest.mark.slow
def test_files_from_anywhere(run: Run, made: Path, tmp_path: Path) -> None:
    """Given by option they are used where they lie; a build without them does not replace their map unasked."""
    vehicle, folder = made / "vehicle" / "vehicle.toml", tmp_path / "results"
    build_map(vehicle, folder, FilesGiven(snapshots=made / "newtonian.h5", structure=made / "structure.h5"))
    assert not (folder / "snapshots.h5").exists()
    assert provenance(folder)["flow"]["engine"] == "newtonian"
    assert provenance(folder)["structure"]["model"] == "swept_hexahedra"
    before = (folder / "map.h5").read_bytes()
    for command in (("build", vehicle, "-o", folder), ("demo", "--vehicle", vehicle, "-o", folder)):
        code, _, message = run(*command)
        assert code == 2
        assert message.count("\n") == 1
        assert f"map.h5: made with --snapshots {made / 'newtonian.h5'} --structure" in message
        assert (folder / "map.h5").read_bytes() == before
    build_map(vehicle, folder, FilesGiven(rebuild=True))
    assert provenance(folder)["flow"]["engine"] == "euler"
    assert provenance(folder)["structure"]["model"] == "fourier"


def test_rebuild_replaces_what_options_made(made: Path, tmp_path: Path) -> None:
    folder = tmp_path / "results"
    folder.mkdir()
    shutil.copy(made / "newtonian.h5", folder / "snapshots.h5")
    build_map(made / "vehicle" / "vehicle.toml", folder, FilesGiven(rebuild=True))
    assert provenance(folder)["flow"]["engine"] == "euler"
    build_map(made / "vehicle" / "vehicle.toml", folder)  # now its own
    assert provenance(folder)["flow"]["engine"] == "euler"


@pytest.mark.parametrize(
    ("name", "old", "new", "words"),
    [
        (
            "structure",
            "wall_thickness_mm = 3.0",
            "wall_thickness_mm = 4.0",
            "structure.wall_thickness_mm: expected 4, got 3",
        ),
        (
            "structure",
            "poisson_ratio = 0.33",
            "poisson_ratio = 0.3",
            "material.poisson_ratio: expected 0.3, got 0.33",
        ),
        (
            "structure",
            "youngs_modulus_GPa = 70.0",
            "youngs_modulus_GPa = 71.0",
            "material.youngs_modulus_GPa: expected 71, got 70",
        ),
        ("structure", "end_x_m = 2.5", "end_x_m = 2.6", "profile.2.end_x_m: expected 2.6, got 2.5"),
        (
            "structure",
            "layouts.table]",
            "layouts.other]",
            "gauges: expected layout 'other', got the layouts table",
        ),
        ("snapshots", "end_x_m = 2.5", "end_x_m = 2.6", "profile.2.end_x_m: expected 2.6, got 2.5"),
        (
            "snapshots",
            "start_half_angle_deg = 16.0",
            "start_half_angle_deg = 15.0",
            "profile.1.start_half_angle_deg: expected 15, got 16",
        ),
        ("snapshots", "[4.0, 4.5, 5.0]", "[4.0, 5.0]", "conditions: expected 12, got 18"),
        ("snapshots", "altitude_km = 22.0", "altitude_km = 21.0", "condition 1: expected M 4"),
    ],
)
def test_what_does_not_fit_is_named(
    name: str, old: str, new: str, words: str, made: Path, tmp_path: Path, run: Run
) -> None:
    """In one line: entry, expected, found; nothing is written over."""
    change = [(old, new)]
    if "other" in new:
        change.append(('layout = "table"', 'layout = "other"'))
    vehicle, folder = write_vehicle(tmp_path / "vehicle", *change), tmp_path / "results"
    folder.mkdir()
    file = folder / f"{name}.h5"
    shutil.copy(made / ("newtonian.h5" if name == "snapshots" else "structure.h5"), file)
    before = file.read_bytes()
    code, _, message = run("build", vehicle, "-o", folder)
    assert code == 2
    assert f"{file}: " in message
    assert words in message
    assert "--rebuild" in message
    assert message.count("\n") == 1
    assert file.read_bytes() == before
    with pytest.raises(InputError, match="--rebuild"):
        open_pipeline(load_vehicle(vehicle), folder, Silent(), FilesGiven())


def test_gauges_moved_since_are_named(made: Path, tmp_path: Path) -> None:
    vehicle = write_vehicle(tmp_path / "vehicle")
    table = vehicle.with_name("gauges.csv")
    lines = table.read_text(encoding="utf-8").splitlines()
    table.write_text("\n".join(lines[:-1]) + "\n", encoding="utf-8")
    given = FilesGiven(structure=made / "structure.h5")
    with pytest.raises(InputError, match=r"gauges of layout 'table': expected 29, got 30$"):
        open_pipeline(load_vehicle(vehicle), tmp_path / "results", Silent(), given)


def test_given_snapshots_need_the_body_alone(run: Run, made: Path, tmp_path: Path) -> None:
    """Other conditions, walls and internal pressures are no misfit of a file given by option."""
    vehicle = write_vehicle(
        tmp_path / "vehicle",
        ("[4.0, 4.5, 5.0]", "[4.0, 4.7]"),
        ("wall_thickness_mm = 3.0", "wall_thickness_mm = 4.0"),
    )
    given = FilesGiven(snapshots=made / "newtonian.h5")
    pipeline, conditions = open_pipeline(load_vehicle(vehicle), tmp_path / "results", Silent(), given)
    assert conditions == 18
    assert pipeline.path("snapshots.h5") == made / "newtonian.h5"
    other = write_vehicle(tmp_path / "other", ("end_x_m = 2.5", "end_x_m = 2.6"))
    for command in (("build", other), ("demo", "--vehicle", other)):
        code, _, message = run(*command, "-o", tmp_path / "results", "--snapshots", made / "newtonian.h5")
        assert code == 2
        assert message.endswith("newtonian.h5: profile.2.end_x_m: expected 2.6, got 2.5\n")


def test_a_file_of_another_kind_is_not_written_over(made: Path, tmp_path: Path) -> None:
    folder = tmp_path / "results"
    folder.mkdir()
    shutil.copy(made / "structure.h5", folder / "snapshots.h5")
    vehicle = load_vehicle(made / "vehicle" / "vehicle.toml")
    for rebuild in (False, True):
        with pytest.raises(
            InputError, match=r"snapshots.h5: expected a file of schema 'strainfmu.snapshots', found"
        ):
            open_pipeline(vehicle, folder, Silent(), FilesGiven(rebuild=rebuild))


def test_a_damaged_file_of_the_build_is_made_again_and_a_users_is_not(made: Path, tmp_path: Path) -> None:
    folder = tmp_path / "results"
    folder.mkdir()
    vehicle = load_vehicle(made / "vehicle" / "vehicle.toml")
    content = bytearray((made / "newtonian.h5").read_bytes())
    content[-100] ^= 0xFF
    (folder / "snapshots.h5").write_bytes(content)
    with pytest.raises(InputError, match=r"snapshots.h5: damaged"):
        open_pipeline(vehicle, folder, Silent(), FilesGiven())
    (folder / "manifest.json").write_text('{"snapshots.h5": {"made_from": "", "sha256": ""}}')
    pipeline, _ = open_pipeline(vehicle, folder, Silent(), FilesGiven())
    assert pipeline.elsewhere == {}


def test_conditions_out_of_reach_are_no_misfit(made: Path, tmp_path: Path) -> None:
    """A campaign that went on without some of the vehicle file's conditions is used, with a warning."""
    whole = load_snapshots(made / "newtonian.h5")
    kept = np.arange(len(whole.condition)) != 4
    values = {one.name: getattr(whole, one.name) for one in fields(whole)}
    of_conditions = {
        name: value[kept]
        for name, value in values.items()
        if isinstance(value, np.ndarray) and name != "point" and len(value) == len(kept)
    }
    entry = {"number": 4, "condition": whole.condition[4].tolist(), "cause": "no attached shock"}
    part = replace(whole, **of_conditions, settings={**whole.settings, "failed": [entry]})
    vehicle = load_vehicle(made / "vehicle" / "vehicle.toml")
    assert option_misfits(part, vehicle) == []
    assert [str(one) for one in option_misfits(replace(part, settings=whole.settings), vehicle)] == [
        "conditions: expected 18, got 17"
    ]
    save_snapshots(part, tmp_path / "snapshots.h5")
    notes: list[str] = []

    class Listening(Silent):
        def note(self, text: str) -> None:
            notes.append(text)

    _, conditions = open_pipeline(vehicle, tmp_path, Listening(), FilesGiven())
    assert conditions == 17
    assert any("1 of 18 conditions not solved; the first: no attached shock" in note for note in notes)


def test_commands_say_what_they_replace(run: Run, made: Path, tmp_path: Path) -> None:
    """A file made with other options is named before it is replaced; one that is extended is not."""
    vehicle, output = made / "vehicle" / "vehicle.toml", tmp_path / "snapshots.h5"
    shutil.copy(made / "set.h5", output)
    code, printed, _ = run("snapshots", vehicle, "-o", output, "--engine", "newtonian")
    assert code == 0
    assert f"{output}: held newtonian engine, 7 conditions, of {made / 'set.csv'}; replaced" in printed
    code, printed, _ = run("snapshots", vehicle, "-o", output, "--engine", "newtonian")
    assert "held" not in printed


@pytest.mark.slow
def test_demo_flies_a_map_of_files_made_before(run: Run, made: Path, tmp_path: Path) -> None:
    """Figures and FMUs are of the snapshots and the structure that were there; a second run reuses all."""
    vehicle, folder = made / "vehicle" / "vehicle.toml", tmp_path / "demo"
    folder.mkdir()
    shutil.copy(made / "newtonian.h5", folder / "snapshots.h5")
    shutil.copy(made / "structure.h5", folder / "structure.h5")
    code, _, message = run("demo", "--vehicle", vehicle, "-o", folder)
    assert (code, message) == (0, "")
    found = provenance(folder)
    assert (found["flow"]["engine"], found["structure"]["resolution"]) == ("newtonian", "coarse")
    assert (folder / "snapshots.h5").read_bytes() == (made / "newtonian.h5").read_bytes()
    code, printed, _ = run("demo", "--vehicle", vehicle, "-o", folder, "--verbose")
    assert code == 0
    for name in ("map.h5", "estimator.fmu", "flight.h5", "overview.png"):
        assert f"{name}: up to date, reused" in printed


def test_alarm_levels_are_of_the_snapshots_used(made: Path) -> None:
    """Measured at their conditions; not at all against another engine or out of their Mach numbers."""
    vehicle = load_vehicle(OGIVE)
    whole, part = load_snapshots(made / "newtonian.h5"), load_snapshots(made / "set.h5")
    assert as_flown(vehicle, replace(whole, engine="euler")) is vehicle
    assert not alarm_levels_wanted(as_flown(vehicle, part), Silent())  # newtonian against the euler engine's flows
    euler = replace(part, engine="euler")
    flown = as_flown(vehicle, euler)
    assert alarm_levels_wanted(flown, Silent())
    assert flown.conditions.mach_number == [4.0, 4.5, 5.0]
    reach = max(one.total_incidence for one in flown.flight_conditions())
    assert reach == pytest.approx(float(part.total_incidence.max()), rel=1e-12)
    faster = replace(euler, condition=euler.condition + np.array([2.0, 0.0, 0.0, 0.0]))
    assert not alarm_levels_wanted(as_flown(vehicle, faster), Silent())
    # Axial flow alone, with angles that only rounding distinguishes: a valid vehicle all the same.
    condition = part.condition * [1.0, 0.0, 0.0, 1.0]
    condition[:, 1] = 1e-17 * np.arange(len(condition))
    axial = as_flown(vehicle, replace(euler, condition=condition))
    assert axial.conditions.angle_of_attack_deg == [0.0]


def test_commands_in_other_folders_find_flows_and_map(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What a build left is a stress test's, a proposal's and another build's; other entries make their own."""
    monkeypatch.delenv(SHARED_VARIABLE)
    vehicle = write_vehicle(tmp_path / "vehicle", ("[noise]", '[aerodynamics]\nengine = "newtonian"\n\n[noise]'))
    build_map(vehicle, tmp_path / "first")
    made_again: list[str] = []

    class Said(Silent):
        def note(self, line: str) -> None:
            made_again.append(line)

    pipeline, _ = open_pipeline(load_vehicle(vehicle), tmp_path / "second", Said(), FilesGiven())
    make_map(pipeline)
    shared = tmp_path / "vehicle" / ".strainfmu"
    assert [line for line in made_again if "reused" in line] == [
        f"{name}: from {shared}, reused" for name in ("snapshots.h5", "map.h5")
    ]
    for name in ("snapshots.h5", "map.h5"):
        assert (tmp_path / "second" / name).read_bytes() == (tmp_path / "first" / name).read_bytes()
    flows = flows_for_design(load_vehicle(vehicle), None, Said())
    assert made_again[-1] == f"flows: snapshots from {shared}, reused"
    assert np.array_equal(flows.pressure, load_snapshots(tmp_path / "first" / "snapshots.h5").pressure)
    again = builder.snapshots(vehicle, tmp_path / "third.h5", progress=Said())
    assert f"{tmp_path / 'third.h5'}: from {shared}, reused" in made_again
    assert again.up_to_date
    shutil.copy(tmp_path / "first" / "map.h5", tmp_path / "map.h5")
    builder.loadtest_template(vehicle, tmp_path / "loadtest.toml")
    with pytest.raises(InputError) as unread:  # the map alone: its flows are the cache's, readings there are none
        builder.calibrate(tmp_path / "map.h5", tmp_path / "loadtest.toml", vehicle=vehicle, progress=Said())
    assert "loadtest" in str(unread.value)
    assert made_again[-1] == f"snapshots.h5: from {shared}, reused"
    copied, structures = tmp_path / "third.h5", [tmp_path / "one.h5", tmp_path / "two.h5"]
    assert builder.snapshots(vehicle, copied, progress=Said()).up_to_date
    assert f"{copied}: from {shared}, reused" in made_again
    solved, taken = (
        builder.run_structure(vehicle, path, resolution="coarse", progress=Said()) for path in structures
    )
    assert (solved.up_to_date, taken.up_to_date) == (False, True)
    assert f"{structures[1]}: from {shared}, reused" in made_again
    assert structures[0].read_bytes() == structures[1].read_bytes()
    other = load_vehicle(vehicle, {"conditions.mach_number": [4.0, 4.5, 4.9]})
    assert cached_snapshots(other) is None
