"""The main job as a user does it: the demonstration of the shipped vehicle and of a vehicle as built, and what it
leaves behind."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from time import perf_counter

import numpy as np
import pytest
from fmpy import simulate_fmu
from fmpy.validation import validate_fmu
from ogive import OGIVE
from published_run import check_published_run

import strainfmu
from builder.calibration.ground_test.load_test_file import read_test_file
from builder.campaign.snapshots import load_snapshots
from builder.pipeline.demonstration.flight_scores import score_flight
from strainfmu.cosim.systems.recording import load_recording
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, load_inverse_map
from strainfmu.linear.pressure_modes import proper_orthogonal_decomposition

Run = Callable[..., tuple[int, str, str]]

FILES = (
    *("snapshots.h5", "independent_flows.h5", "map.h5", "flight_model.h5", "estimator.fmu", "plant.fmu"),
    *("flight.h5", "flight.csv", "estimators.json", "summary.json", "overview.png"),
    *("pressure_on_body.png", "gauges.png", "coefficients.png", "vehicle.png", "vehicle.glb"),
)


def test_accuracy_of_the_flown_estimator(ic3x_demo: Path) -> None:
    """One vehicle, its hardware errors drawn: how many vehicles the sigmas hold is tested on many of them.

    As the first of the file it waits for the whole demonstration, a minute and more that many files share.
    """
    recording = load_recording(ic3x_demo / "flight.h5")
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
    with (ic3x_demo / "flight.csv").open(newline="") as stream:
        rows = list(csv.reader(stream))
    assert tuple(rows[0]) == ("time", *recording.names)
    np.testing.assert_allclose(np.array(rows[1:], dtype=float)[:, 1:], recording.values, rtol=1e-12)


def test_both_estimators_are_in_one_table_and_one_figure(ic3x_demo: Path) -> None:
    """The nonlinear one, which flies, errs at most two thirds as much as the linear one in every coefficient."""
    summary = json.loads((ic3x_demo / "summary.json").read_text(encoding="utf-8"))
    linear, flown = summary["estimators"]["linear"], summary["estimators"]["nonlinear"]
    for name in COEFFICIENT_NAMES:
        assert flown["rms_error"][name] == pytest.approx(summary["rms_error"][name])
        assert flown["rms_error"][name] < 0.67 * linear["rms_error"][name]
    for name in ("angle_of_attack", "sideslip_angle"):
        assert flown["rms_error"][name] < np.radians(0.25)
        assert flown["coverage"][name] > 0.99
    assert (ic3x_demo / "estimators.png").stat().st_size > 10_000
    readme = (ic3x_demo / "README.txt").read_text(encoding="utf-8")
    assert "Linear and nonlinear estimator on the same strains" in readme


def test_the_five_modes_hold_99_percent_of_the_energy_of_the_listed_angles(ic3x_demo: Path) -> None:
    """The paper states 99.1 % for five modes of its set P1; pressure at every roll angle needs more modes."""
    listed = proper_orthogonal_decomposition(load_snapshots(ic3x_demo / "snapshots.h5").pressure)
    assert listed.energy[4] == pytest.approx(0.991, abs=0.005)
    held = load_inverse_map(ic3x_demo / "map.h5").provenance["energy_of_modes"]
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


@pytest.mark.parametrize("name", ["estimator.fmu", "plant.fmu"])
def test_fmus_are_valid_and_run_alone(ic3x_demo: Path, tmp_path: Path, name: str) -> None:
    path, output = str(ic3x_demo / name), str(tmp_path / "result.csv")
    assert validate_fmu(path) == []
    called = [sys.executable, "-m", "fmpy", "simulate", path, "--stop-time", "1", "--output-file", output]
    finished = subprocess.run(called, capture_output=True, text=True, check=False)
    assert finished.returncode == 0, finished.stdout + finished.stderr
    with Path(output).open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    # Alone nothing sets the strains of the estimator: it has no loads, and says so.
    assert all(np.isfinite(float(row["C_N"])) == (name == "plant.fmu") for row in rows)


@pytest.mark.parametrize("demo", ["ic3x_demo", "ogive_demo"])
def test_the_example_inside_the_fmu_shows_the_estimator_at_work(demo: str, request: pytest.FixtureRequest) -> None:
    """Nonlinear, and linear: health, errors and text of what the FMU publishes.

    The second waits for the demonstration of the coarse vehicle, which many files share.
    """
    check_published_run(request.getfixturevalue(demo) / "estimator.fmu", has_air_data=True)


def test_two_vehicles_in_one_process_give_their_own_results(ic3x_demo: Path, ogive_demo: Path) -> None:
    random, how = np.random.default_rng(3), {"stop_time": 0.1, "step_size": 0.1, "output_interval": 0.1}
    for folder in (ic3x_demo, ogive_demo, ic3x_demo):
        estimator = strainfmu.load(folder / "map.h5")
        inverse_map = estimator.inverse_map
        # At every roll angle the mean load is axial: the others come from what is added.
        strain = 0.7 * inverse_map.mean_strain + 1e-6 * random.normal(size=inverse_map.n_gauges)
        start = {f"strain[{i + 1}]": float(value) for i, value in enumerate(strain)}
        start["dynamic_pressure"] = inverse_map.nominal_dynamic_pressure
        result = simulate_fmu(str(folder / "estimator.fmu"), start_values=start, **how)
        expected = estimator.estimate(strain, inverse_map.nominal_dynamic_pressure).coefficients
        found = [result[name][-1] for name in COEFFICIENT_NAMES]
        # Steps of the nonlinear estimator begin where the last one ended.
        np.testing.assert_allclose(found, expected, rtol=1e-12 if inverse_map.manifold is None else 1e-6)


def time_of_one_call(call: Callable[[], object], repeats: int = 1, calls: int = 1) -> float:
    """The clock of ``strainfmu bench`` without its repetitions, which tests/cli/test_time_per_call.py counts."""
    start = perf_counter()
    call()
    return perf_counter() - start


@pytest.mark.slow
def test_the_bench_runs_on_the_result(ic3x_demo: Path, run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    """It takes seconds, as ``bench`` trains its rivals, if on a few flights alone."""
    monkeypatch.setattr("strainfmu.cli.bench.time_per_call", time_of_one_call)
    monkeypatch.setattr("strainfmu.fmu.checks.step_cost.REPEATS", 3)
    monkeypatch.setattr("builder.trial.compared.COST_TRAINING", 60)
    code, printed, _ = run("bench", ic3x_demo)
    assert code == 0
    assert "bare product" in printed


@pytest.mark.slow
def test_a_tested_vehicle_flies_as_one_that_is_known(tmp_path: Path, run: Run) -> None:
    """The calibrated map errs less than the drawing's and hardly more than the exact one, and its sigma holds."""
    folder, command = (
        tmp_path / "tested",
        ("demo", "--vehicle", OGIVE, "--as-built", "3", "-o", tmp_path / "tested"),
    )
    code, said, _ = run(*command)
    assert code == 0
    assert "before and after the ground test" in said
    files = "loadtest.csv", "channels.toml", "calibrated_zeros.toml", "calibrated.h5", "exact.h5", "as_built.png"
    assert all((folder / name).is_file() for name in files)
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
    assert "calibrated.h5: up to date, reused" in said


@pytest.mark.fast
def test_a_vehicle_is_perfect_or_as_built(tmp_path: Path, run: Run) -> None:
    code, _, message = run("demo", "--perfect", "--as-built", "3", "-o", tmp_path / "demo")
    assert code == 2
    assert message.startswith("strainfmu: --as-built: expected without --perfect, got both; see")
