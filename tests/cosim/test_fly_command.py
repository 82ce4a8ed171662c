"""`strainfmu fly` and `strainfmu plant`: what they write, and what they refuse in one line."""

from collections.abc import Callable
from dataclasses import replace
from math import radians
from pathlib import Path

import fmpy
import pytest
from changed_vehicle import replaced
from slender_vehicle import SlenderFiles

from strainfmu.cosim.flight import INSTANCES
from strainfmu.cosim.models.flight_model import load_flight_model, save_flight_model
from strainfmu.cosim.systems.recording import load_recording

Run = Callable[..., tuple[int, str, str]]


def test_the_command(files: SlenderFiles, tmp_path: Path, run: Run) -> None:
    package = tmp_path / "f.ssp"
    code, out, err = run("fly", files.scenario, "-o", tmp_path / "out", "--ssp", package)
    assert (code, err) == (0, "")
    assert "tracking error, rms" in out
    assert "of that with truth" in out
    written = {path.name for path in (tmp_path / "out").iterdir()}
    assert written == {
        *(f"{name}.fmu" for name in INSTANCES),
        *(f"flight_{f}.{end}" for f in ("truth", "estimate") for end in ("h5", "csv", "png")),
    }
    assert package.is_file()
    assert (tmp_path / "f_connectors.ssp").is_file()
    recording = load_recording(tmp_path / "out" / "flight_estimate.h5")
    assert recording.time[-1] == 5.0
    # What flew can be estimated again; masks and faults of the loop are known and not read.
    for data in ("flight_estimate.h5", "flight_truth.csv"):
        code, out, err = run(
            "estimate", tmp_path / "out" / "estimator.fmu", tmp_path / "out" / data, "-o", tmp_path / "o.h5"
        )
        assert (code, err) == (0, "")
        assert "columns not used" in out


def test_a_loop_that_does_not_hold_ends_with_1(files: SlenderFiles, tmp_path: Path, run: Run) -> None:
    weak = files.folder / "weak.toml"
    weak.write_text(files.scenario.read_text() + "[autopilot]\nlargest_moment_N_m = 0.0\n")
    code, out, _ = run("fly", weak, "-o", tmp_path / "out", "--no-figures")
    assert code == 1
    assert "does not hold" in out


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("stop_time_s = 5.0", "", "stop_time_s: entry is missing"),
        ("stop_time_s = 5.0", "stop_time_s = -1", "stop_time_s: expected a number from 0.001 to 100000, got -1"),
        (
            "stop_time_s = 5.0",
            "stop_time_s = true",
            "stop_time_s: expected a number from 0.001 to 100000, got True",
        ),
        ("mach_number = 6.0", "mach_number = 6.0\nmac = 1", "flight.mac: unknown entry"),
        ("mach_number = 6.0", "mach_number = nan", "flight.mach_number: expected a number from 0 to 100, got nan"),
        (
            "mach_number = 6.0",
            "mach_number = 6.0\nnoise_seed = 1.5",
            "flight.noise_seed: expected a whole number, got 1.5",
        ),
        (
            "mach_number = 6.0",
            "mach_number = 6.0\nnoise_seed = -1",
            "noise_seed: expected a number from 0 to 2.14748e+09, got -1",
        ),
        ("time_s = 0.0", "time_s = 0.1", "command: the times of the commands must start at 0 and increase"),
        ('name = "slender vehicle"', 'feedback = "guess"', "feedback: 'guess' found, must be truth or estimate"),
        ('name = "slender vehicle"', "name = 3", "name: expected text, got 3"),
        ("[flight]", "flight = 3\n[other]", "flight: expected a table, got 3"),
        ("[[command]]", "[command", "not a TOML file"),
        ("[flight]", '[files]\nmap = "none.h5"\n[flight]', "none.h5: no such file"),
        (
            "[flight]",
            "[vehicle]\nmass_kg = 0\n[flight]",
            "vehicle.mass_kg: expected a number from 0.001 to 1e+09, got 0",
        ),
    ],
)
def test_wrong_scenarios(files: SlenderFiles, tmp_path: Path, run: Run, old: str, new: str, message: str) -> None:
    path = tmp_path / "wrong.toml"
    path.write_text(replaced(files.scenario.read_text(), (old, new)))
    code, _, err = run("fly", path, "--files", files.folder, "-o", tmp_path / "out")
    assert code == 2
    assert message in err
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ('kind = "bias"\ngauge = 1', "fault.1.value_um_per_m: entry is missing"),
        ('kind = "broken"\ngauge = 1', "fault.1.kind: 'broken' found, must be one of none, dropout, bias"),
        ('kind = "dropout"\ngauge = 99', "gauge 99 found, must be a number from 1 to 16"),
        ('kind = "dropout"\ngauge = "X"', "gauge 'X' found"),
        ('kind = "dropout"', "fault.1.gauge: expected the name of a gauge or its number from 1, got None"),
        ('kind = "dropout"\ngauge = 1\nvalue_um_per_m = 3', "fault.1.value_um_per_m: unknown entry"),
        (
            'kind = "dropout"\ngauge = 1\n[[fault]]\ntime_s=1\nkind="none"\ngauge=1',
            "times of fault_kind[1] must increase",
        ),
    ],
)
def test_wrong_faults(files: SlenderFiles, tmp_path: Path, run: Run, fault: str, message: str) -> None:
    path = tmp_path / "wrong.toml"
    path.write_text(files.scenario.read_text() + "[[fault]]\ntime_s = 1.0\n" + fault)
    code, _, err = run("fly", path, "--files", files.folder, "-o", tmp_path / "out")
    assert code == 2
    assert message in err


def test_the_plant_alone(files: SlenderFiles, tmp_path: Path, run: Run) -> None:
    path, model = tmp_path / "p.fmu", files.folder / "flight_model.h5"
    assert run("plant", model, "-o", path, "--mach-number", 5.5, "--angle-of-attack", 3.0)[::2] == (0, "")
    found = fmpy.simulate_fmu(str(path), stop_time=0.02, output=["C_N", "dynamic_pressure"])
    # C_N = c1 a without sideslip.
    assert found["C_N"][0] == pytest.approx(3.0 * radians(3.0), rel=1e-12)
    for arguments, message in (
        (["--motion", "loop"], "--motion: expected one of inputs, trajectory, short_period, got 'loop'"),
        (["--motion", "trajectory"], "a trajectory is needed"),
        (["--trajectory", "none.csv"], "only for that"),
        (["--motion", "trajectory", "--trajectory", "t.csv", "--altitude", 3], "--altitude: not with --motion"),
        (["--angle-of-attack", "nan"], "--angle-of-attack: expected -60 .. 60 deg, got nan"),
        (["--altitude", "inf"], "--altitude: expected 0 .. 71 km, got inf"),
        (["--mach-number", 60], "--mach-number: expected 1.01 .. 30, got 60"),
        (["--mach-number", 20], "start: mach_number: 20 found"),
        (["--motion", "short_period", "--angle-of-attack", 50], "start: total incidence: 50 deg found"),
        (["--altitude", 1000], "--altitude: expected 0 .. 71 km, got 1000"),
    ):
        code, _, err = run("plant", model, "-o", tmp_path / "q.fmu", *arguments)
        assert code == 2
        assert message in err


def test_the_plant_begins_where_its_vehicle_flies(files: SlenderFiles, tmp_path: Path, run: Run) -> None:
    """No option: the middle of the flight model's Mach numbers, which of a launcher are 2.5 to 4."""
    model = load_flight_model(files.folder / "flight_model.h5")
    slow = replace(model, mach_knots=model.mach_knots - model.mach_knots[0] + 2.5)
    save_flight_model(slow, tmp_path / "slow.h5")
    assert run("plant", tmp_path / "slow.h5", "-o", tmp_path / "p.fmu")[::2] == (0, "")
    (start,) = (
        float(one.start)
        for one in fmpy.read_model_description(str(tmp_path / "p.fmu")).modelVariables
        if one.name == "mach_number"
    )
    assert start == pytest.approx(0.5 * (slow.mach_knots[0] + slow.mach_knots[-1]))


def test_scenario_that_is_not_there(tmp_path: Path, run: Run) -> None:
    code, _, err = run("fly", tmp_path / "none.toml", "-o", tmp_path / "out")
    assert (code, err) == (2, f"strainfmu: {tmp_path / 'none.toml'}: no such file\n")
