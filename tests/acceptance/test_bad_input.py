"""Everything a user can get wrong: one line, the right exit code, nothing half-written left behind."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import h5py
import pytest
from changed_vehicle import change
from ogive import copied_ogive
from sweeps import sweep

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def vehicle(tmp_path: Path) -> Path:
    """Return a copy of the coarse vehicle that a test may spoil."""
    return copied_ogive(tmp_path / "vehicle")


def refused(outcome: tuple[int, str, str], *words: str, code: int = 2) -> None:
    """Check the exit code and that standard error is one line that holds ``words``."""
    found, _, message = outcome
    assert found == code
    assert message.count("\n") == 1
    assert message.startswith("strainfmu: ")
    for word in words:
        assert word in message


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("wall_thickness_mm = 3.0", "wall_thicknes_mm = 3.0", ("structure.wall_thicknes_mm", "wall_thickness_mm")),
        (
            "wall_thickness_mm = 3.0",
            "wall_thickness_in = 0.1",
            ("wall_thickness_in", "wrong unit", "thickness_mm"),
        ),
        (
            "wall_thickness_mm = 3.0",
            'wall_thickness_mm = "3 mm"',
            ("expected a number, 0.01 .. 1000", "got '3 mm'"),
        ),
        ("wall_thickness_mm = 3.0", "wall_thickness_mm = -3.0", ("expected 0.01 .. 1000, got -3.0",)),
        ("wall_thickness_mm = 3.0", "wall_thickness_mm = nan", ("expected 0.01 .. 1000, got nan",)),
        ("wall_thickness_mm = 3.0", "", ("structure.wall_thickness_mm", "missing")),
        ("wall_thickness_mm = 3.0", "wall_thickness_mm = 400.0", ("structure: ", "wall of 400 mm")),
        ("end_x_m = 2.5", "end_x_m = 0.5", ("profile segment 2", "aft of 1")),
        ("poisson_ratio = 0.33", "poisson_ratio = 0.5", ("poisson_ratio", "expected 0 .. 0.499, got 0.5")),
        ("modes = 4", "modes = 40", ("map.modes: 40 found", "at most")),
        ('file = "gauges.csv"', 'file = "none.csv"', ("none.csv", "no such file")),
        ('manoeuvre = "manoeuvre.csv"', 'manoeuvre = "none.csv"', ("none.csv", "no such file")),
        ('name = "ogive test body"', "name = ", ("not a TOML file",)),
        ('name = "ogive test body"', 'name = "two\\nlines"', ("name", "printable text on one line")),
    ],
)
def test_vehicle_entries(
    vehicle: Path, tmp_path: Path, run: Run, old: str, new: str, words: tuple[str, ...]
) -> None:
    change(vehicle, (old, new))
    outcome = run("demo", "--vehicle", vehicle, "-o", tmp_path / "out")
    refused(outcome, *words)
    assert not (tmp_path / "out").exists()  # refused before the long work


def test_missing_vehicle_file(tmp_path: Path, run: Run) -> None:
    refused(run("demo", "--vehicle", tmp_path / "none.toml"), "none.toml", "no such file")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("axial_0_1,1.2,0.000000,0.", "axial_0_1,1.2,0.001000,0.", ()),
        ("axial_90_1,1.2,0.", "axial_90_1,1.2,0.9", ("axial_90_1", "outside the inner surface")),
        ("axial_0_1,1.2,", "axial_0_1,0.05,", ("axial_0_1", "0.05")),
        ("axial_0_1,1.2,", "axial_0_1,9.0,", ("axial_0_1", "9")),
        (",1,0,0\n", ",0,0,0\n", ("axial_0_1", "direction")),
        ("axial_0_2", "axial_0_1", ("axial_0_1", "twice")),
        ("axial_0_2", "axial\x01", ("printable text",)),
        ("axial_0_1,1.2,", "axial_0_1,nan,", ("gauges.csv", "line 2", "x_m", "finite")),
        ("direction_z", "dz", ("gauges.csv", "columns", "direction_z")),
    ],
)
def test_gauges(vehicle: Path, run: Run, old: str, new: str, words: tuple[str, ...]) -> None:
    change(vehicle.parent / "gauges.csv", (old, new))
    outcome = run("check", vehicle)
    if words:
        refused(outcome, *words)
    else:
        assert outcome[0] == 0  # 1 mm along the surface is no distance from it


def test_gauge_one_millimetre_off_the_surface(vehicle: Path, run: Run) -> None:
    table = vehicle.parent / "gauges.csv"
    z = float(table.read_text().splitlines()[1].split(",")[3])
    change(table, (f"{z:.6f}", f"{z - 0.001:.6f}"))
    refused(run("check", vehicle), "axial_0_1", "1.00 mm inside", "0.5 mm is allowed")


@pytest.mark.usefixtures("compiled_solver")
@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        # Too slow for supersonic flow over the tip.
        (
            "mach_number = [4.0, 4.5, 5.0]\nangle_of_attack_deg = [0.0, 3.0, 6.0]",
            "mach_number = [1.1]\nangle_of_attack_deg = [0.0]",
            ("x = 0 m (tip)", "M 1.1"),
        ),
        # A steep corner far from the tip.
        (
            "half_angle_deg = 0.0\nend_x_m = 2.5",
            "half_angle_deg = 0.0\nend_x_m = 2.4\n\n"
            '[[profile]]\nkind = "cone"\nhalf_angle_deg = 40.0\nend_x_m = 2.5',
            ("x = 2.4", "M "),
        ),
    ],
)
def test_condition_outside_the_solvers_reach(
    vehicle: Path, tmp_path: Path, run: Run, old: str, new: str, words: tuple[str, ...]
) -> None:
    change(vehicle, (old, new), ("modes = 4", "modes = 1"), ("radial_cells = 12", "radial_cells = 8"))
    outcome = run("build", vehicle, "-o", tmp_path / "out")
    refused(outcome, "axial Mach number falls to 1", "total incidence", *words)
    # What was solved beside it is kept, and nothing else.
    assert {path.name for path in (tmp_path / "out").iterdir()} <= {"snapshots.h5.journal"}


@pytest.mark.slow
def test_a_build_goes_on_without_conditions_out_of_reach(vehicle: Path, tmp_path: Path, run: Run) -> None:
    """The map is made from the others, and each flow that is missing is named."""
    change(vehicle, ("mach_number = [4.0, 4.5, 5.0]", "mach_number = [1.1, 4.5, 5.0]"))
    code, printed, message = run("build", vehicle, "-o", tmp_path / "out")
    assert (code, message) == (0, "")
    words = " ".join(printed.split())
    assert "6 of 18 conditions are not in the result" in words
    assert "not solved: M 1.1, alpha 0 deg, beta 0 deg, 22 km: euler: the axial Mach number falls to 1" in words
    assert "the map is made without 6 of 18 conditions" in words
    assert (tmp_path / "out" / "map.h5").exists()
    change(vehicle, ("mach_number = [1.1, 4.5, 5.0]", "mach_number = [1.1, 1.15, 4.5]"))
    # As listed: at every roll angle the six have more modes.
    change(vehicle, ("modes = 4", 'modes = 6\nsymmetry = "listed"'))
    refused(run("build", vehicle, "-o", tmp_path / "few"), "map.modes: 6 found, at most 5", "6 snapshots")


def test_manoeuvre_outside_the_flight_model(vehicle: Path, tmp_path: Path, run: Run) -> None:
    change(vehicle.parent / "manoeuvre.csv", ("1,4.6,5,1,22", "1,4.6,9,1,22"))
    outcome = run("demo", "--vehicle", vehicle, "-o", tmp_path / "out")
    refused(outcome, "manoeuvre.csv", "total incidence", "0 to 7 deg allowed")
    assert not (tmp_path / "out").exists()  # refused before the long work


def test_damaged_and_older_maps(ogive_demo: Path, tmp_path: Path, run: Run) -> None:
    original = (ogive_demo / "map.h5").read_bytes()
    path, fmu = tmp_path / "map.h5", tmp_path / "x.fmu"
    refused(run("export", path, "-o", fmu), "map.h5", "no such file")
    path.write_bytes(original[: len(original) // 2])
    refused(run("export", path, "-o", fmu), "map.h5", "damaged")
    path.write_bytes(b"not a map")
    refused(run("inspect", path), "map.h5", "not an HDF5 file")
    path.write_bytes(original)
    with h5py.File(path, "r+") as file:
        file["state_operator"][0, 0] *= 1.0 + 1e-9
    refused(run("export", path, "-o", fmu), "damaged or altered")
    refused(run("inspect", path), "damaged or altered")
    assert b"strainfmu.inverse_map 10 " in original
    path.write_bytes(original.replace(b"strainfmu.inverse_map 10 ", b"strainfmu.inverse_map 9 ", 1))
    refused(run("export", path, "-o", fmu), "expected schema version 10, got 9")
    refused(run("export", ogive_demo / "snapshots.h5", "-o", fmu), "strainfmu.snapshots")
    assert not fmu.exists()


def test_output_that_cannot_be_written(ogive_demo: Path, tmp_path: Path, run: Run) -> None:
    (tmp_path / "file").write_text("in the way")
    refused(run("demo", "-o", tmp_path / "file"), "is a file")
    refused(run("export", ogive_demo / "map.h5", "-o", tmp_path / "file" / "x.fmu"), "--output", "file")
    refused(run("export", ogive_demo / "map.h5", "-o", tmp_path / "x.zip"), "x.zip", ".fmu")


def test_wrong_options(run: Run) -> None:
    refused(run("sail"), "No such command 'sail'")
    refused(run("demo", "--speed", "9"), "--speed")
    refused(run("check"), "Missing argument")


FILL_THE_DISK = """
import resource, signal, sys
from builder.aero.euler.bodies.solver import MarchingGrid, solve_flow
from builder.vehicle.shape.geometry import chain_segments
from strainfmu.cli.main import main

# Compiled code is kept on disk too: it must be there before the disk is full.
grid = MarchingGrid(n_radial=8, n_circumferential=8)
solve_flow(chain_segments([(1.0, 0.1, 0.0), (2.0, 0.0, 0.0)]), 5.0, 0.1, grid)
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]),) * 2)
main(sys.argv[2:])
"""


@pytest.mark.skipif(sys.platform == "win32", reason="file size limits are a POSIX means to fill a disk")
@pytest.mark.parametrize("largest", sweep([4_000, 100_000], [4_000]))
def test_disk_full_while_writing(vehicle: Path, tmp_path: Path, largest: int) -> None:
    """The operating system refuses to let a file grow, as it does on a full disk."""
    folder = tmp_path / "out"
    finished = subprocess.run(
        [sys.executable, "-B", "-c", FILL_THE_DISK, str(largest), "build", str(vehicle), "-o", str(folder)],
        capture_output=True,
        text=True,
        check=False,
        # Coverage data could not be written either.
        env={name: value for name, value in os.environ.items() if not name.startswith("COV")},
    )
    assert finished.returncode == 1
    assert finished.stderr.count("\n") == 1
    assert "could not be written: File too large" in finished.stderr
    assert {path.name for path in folder.iterdir()} <= {"snapshots.h5.journal"}
