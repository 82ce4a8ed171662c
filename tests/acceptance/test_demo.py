"""The main job as a user does it: the demonstration of the shipped vehicle and of a vehicle as built, and what it
leaves behind."""

import csv
import json
from collections.abc import Callable
from pathlib import Path
from time import perf_counter

import numpy as np
import pytest
from fmpy import simulate_fmu
from fmpy.validation import validate_fmu
from ogive import OGIVE
from published_run import check_published_run

from builder.calibration.ground_test.load_test_file import read_test_file
from builder.campaign.snapshots import load_snapshots
from builder.pipeline.demonstration.flight_scores import flown_estimators, score_flight
from strainfmu.cosim.systems.recording import load_recording
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, load_inverse_map
from strainfmu.linear.pressure_modes import proper_orthogonal_decomposition

Run = Callable[..., tuple[int, str, str]]

FILES = (
    *("snapshots.h5", "independent_flows.h5", "map.h5", "flight_model.h5", "estimator.fmu", "plant.fmu"),
    *("flight.h5", "flight.csv", "estimators.json", "summary.json", "overview.png"),
    *("pressure_on_body.png", "gauges.png", "coefficients.png", "vehicle.png", "vehicle.glb"),
)


def test_accuracy_of_the_flown_estimator(demo_by_grid: Path) -> None:
    """One vehicle, its hardware errors drawn: how many vehicles the sigmas hold is tested on many of them.

    As the first of the file it waits for the whole demonstration, a minute and more that many files share.
    """
    recording = load_recording(demo_by_grid / "flight.h5")
    np.testing.assert_allclose(recording.time, np.arange(2001) * 0.01, atol=1e-12)
    score = score_flight(recording)
    of_range = score["rms_error_of_range"]
    assert of_range["C_N"] < 0.015
    assert of_range["C_Y"] < 0.01
    assert max(of_range.values()) < 0.07
    assert score["healthy"] > 0.99
    truth, estimate, sigma = (
        np.column_stack([recording[f"{prefix}.{name}"] for name in COEFFICIENT_NAMES])
        for prefix in ("plant", "estimator", "estimator.sigma")
    )
    assert np.all(np.abs(estimate - truth) < 4.0 * sigma)
    # Bands that hold everything because they are huge would say nothing.
    assert np.all(np.array(list(score["mean_sigma"].values())) < [0.002, 0.0205, 0.0215, 0.0135, 0.0115])
    with (demo_by_grid / "flight.csv").open(newline="") as stream:
        rows = list(csv.reader(stream))
    assert tuple(rows[0]) == ("time", *recording.names)
    np.testing.assert_allclose(np.array(rows[1:], dtype=float)[:, 1:], recording.values, rtol=1e-12)


def test_both_estimators_are_in_one_table_and_one_figure(demo_by_grid: Path, is_quick: bool) -> None:
    """The nonlinear estimator, which flies, errs at most two thirds as much as the linear in every coefficient.

    A quick run makes the figures and does not draw them.
    """
    summary = json.loads((demo_by_grid / "summary.json").read_text(encoding="utf-8"))
    linear, flown = summary["estimators"]["linear"], summary["estimators"]["nonlinear"]
    for name in COEFFICIENT_NAMES:
        assert flown["rms_error"][name] == pytest.approx(summary["rms_error"][name])
        assert flown["rms_error"][name] < 0.67 * linear["rms_error"][name]
    for name in ("angle_of_attack", "sideslip_angle"):
        assert flown["rms_error"][name] < np.radians(0.25)
        assert flown["coverage"][name] > 0.99
    recording, made = load_recording(demo_by_grid / "flight.h5"), load_inverse_map(demo_by_grid / "map.h5")
    assert list(flown_estimators(made.without_tables(), recording)) == ["linear"]
    assert (demo_by_grid / "estimators.png").stat().st_size > (0 if is_quick else 10_000)
    readme = (demo_by_grid / "README.txt").read_text(encoding="utf-8")
    assert "Linear and nonlinear estimator on the same strains" in readme


def test_the_five_modes_hold_99_percent_of_the_energy_of_the_listed_angles(demo_by_grid: Path) -> None:
    """The paper states 99.1 % for five modes of its set P1; pressure at every roll angle needs more modes."""
    listed = proper_orthogonal_decomposition(load_snapshots(demo_by_grid / "snapshots.h5").pressure)
    assert listed.energy[4] == pytest.approx(0.991, abs=0.005)
    held = load_inverse_map(demo_by_grid / "map.h5").provenance["energy_of_modes"]
    assert held == pytest.approx(0.903, abs=0.005)


def test_it_names_every_file_and_a_second_run_reuses_them(ic3x_demo: Path, run: Run) -> None:
    """The terminal has the accuracy in about a dozen lines, README.txt stages, notes and files."""
    printed = (ic3x_demo.parent / "printed.txt").read_text(encoding="utf-8")
    readme = (ic3x_demo / "README.txt").read_text(encoding="utf-8")
    assert len([line for line in printed.splitlines() if line.strip()]) <= 15
    assert all(text in printed for text in ("overview.png", *COEFFICIENT_NAMES))
    for name in FILES:
        assert (ic3x_demo / name).stat().st_size > 0
        assert name in readme
        assert f"{name}: up to date, reused" not in readme
    assert set(json.loads((ic3x_demo / "summary.json").read_text())["coverage"]) == set(COEFFICIENT_NAMES)
    before = {name: (ic3x_demo / name).stat().st_mtime_ns for name in FILES}
    code, printed, _ = run("demo", "-o", ic3x_demo, "--verbose")
    assert code == 0
    assert all(printed.count(f"{name}: up to date, reused") == 1 for name in FILES)
    assert {name: (ic3x_demo / name).stat().st_mtime_ns for name in FILES} == before
    assert (ic3x_demo / "README.txt").read_text(encoding="utf-8") == readme


def test_fmus_are_valid_and_run_alone(ic3x_demo: Path) -> None:
    """Alone nothing sets the strains of the estimator: it has no loads, and says so. Its example does."""
    for name in ("estimator.fmu", "plant.fmu"):
        path = str(ic3x_demo / name)
        assert validate_fmu(path) == []
        assert np.isfinite(simulate_fmu(path, stop_time=1.0)["C_N"]).all() == (name == "plant.fmu")
    check_published_run(ic3x_demo / "estimator.fmu", has_air_data=True)


@pytest.mark.slow
def test_the_bench_runs_on_the_result(ic3x_demo: Path, run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without its repetitions; it trains its rivals, if on a few flights alone."""

    def time_of_one_call(call: Callable[[], object], repeats: int = 1, calls: int = 1) -> float:
        start = perf_counter()
        call()
        return perf_counter() - start

    monkeypatch.setattr("strainfmu.cli.bench.time_per_call", time_of_one_call)
    monkeypatch.setattr("strainfmu.fmu.checks.step_cost.REPEATS", 3)
    monkeypatch.setattr("builder.trial.compared.COST_TRAINING", 60)
    code, printed, _ = run("bench", ic3x_demo)
    assert code == 0
    assert "bare product" in printed


@pytest.mark.slow
def test_a_tested_vehicle_flies_as_one_that_is_known(tmp_path: Path, run: Run) -> None:
    """The calibrated map errs less than the drawing's and hardly more than the exact one, and its sigma holds."""
    folder = tmp_path / "tested"
    command = ("demo", "--vehicle", OGIVE, "--as-built", "3", "-o", folder)
    code, said, _ = run(*command)
    assert code == 0
    assert "before and after the ground test" in said
    # The vehicle file states no density: a baseline without load stands in for own weight.
    assert [len(case.load) for case in read_test_file(folder / "loadtest.toml").case] == [0] + [1] * 12
    states = json.loads((folder / "summary.json").read_text(encoding="utf-8"))["as_built"]
    assert list(states) == ["before", "after", "exact"]
    before, after, exact = (np.array(list(score["rms_error"].values())[:5]) for score in states.values())
    assert np.max(after / exact) < 1.5
    assert np.count_nonzero(before > 1.5 * after) >= 2
    assert min(states["after"]["coverage"].values()) > 0.99
    code, said, _ = run(*command, "--verbose")
    assert code == 0
    files = "loadtest.csv", "channels.toml", "calibrated_zeros.toml", "calibrated.h5", "exact.h5", "as_built.png"
    assert all((folder / name).is_file() for name in files)
    assert "calibrated.h5: up to date, reused" in said


@pytest.mark.fast
def test_a_vehicle_is_perfect_or_as_built(tmp_path: Path, run: Run) -> None:
    code, _, message = run("demo", "--perfect", "--as-built", "3", "-o", tmp_path / "demo")
    assert code == 2
    assert message.startswith("strainfmu: --as-built: expected without --perfect, got both; see")
