"""``strainfmu trial``, ``stress`` and ``compare`` as a user runs them: files, second and ended runs, workers,
without scikit-learn, refusals."""

import csv
import json
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
from changed_vehicle import change
from ogive import OGIVE, copied_ogive

from builder.pipeline import trials
from builder.pipeline.trials import CASES
from builder.trial import conditions
from builder.trial.compared import REGRESSIONS
from builder.vehicle.file import VEHICLES

Run = Callable[..., tuple[int, str, str]]

SHORT = """
[trial]
conditions = 3
vehicles = 2
[[group]]
class = "beyond"
cases = [
    { error = "bias of one gauge", size = "+50 um/m", fault = { of = 1, add_um_per_m = 50.0 } },
    { error = "three gauges lost", fault = { of = 3, lost = true } },
    { error = "too fast", where = { mach = 3.0 } },
]
"""


def rows_in(folder: Path) -> dict[tuple[str, str, str], dict[str, str]]:
    """Return the rows of a table by case, estimator and load."""
    with (folder / "trial.csv").open(encoding="utf-8", newline="") as stream:
        return {(row["case"], row["estimator"], row["load"]): row for row in csv.DictReader(stream)}


def without(monkeypatch: pytest.MonkeyPatch, *packages: str) -> None:
    """Let trials run as if ``packages`` were not installed; figures cost half of a short trial."""
    monkeypatch.setattr(trials, "find_spec", lambda name: None if name in packages else find_spec(name))


def entries_in(folder: Path) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = json.loads((folder / "stress.json").read_text(encoding="utf-8"))
    return found


@pytest.mark.slow
@pytest.mark.usefixtures("compiled_solver")
def test_from_vehicle_file_to_table(tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    """The coarse test vehicle with theoretical alarm levels and few flows, to save time."""
    for name in ("MACH_KNOTS", "INCIDENCE_KNOTS"):
        monkeypatch.setattr(conditions, name, 4)
    vehicle = copied_ogive(tmp_path / "vehicle")
    change(vehicle, ("modes = 4", 'modes = 4\nalarm_levels = "nominal"'))
    folder, given, own = tmp_path / "stress", tmp_path / "given.h5", tmp_path / "own.toml"
    code, out, message = run("stress", vehicle, "-o", folder, "--conditions", 3, "--draws", 1)
    assert (code, message) == (0, "")
    assert "nothing wrong" in out
    entries = entries_in(folder)
    assert len(entries) >= 24
    for one in entries:
        assert one["class"] in ("within", "outside", "unobservable")
        assert 0.0 <= one["undetected_percent"] <= one["wrong_percent"] <= 100.0
        assert one["detected_percent"] == pytest.approx(100.0 - one["health"].get("OK", 0.0), abs=1e-3)
    errors = [row["error"] for (_, _, load), row in rows_in(folder).items() if load == "all"]
    assert errors == [one["error"] for one in entries]
    assert (folder / "trial.png").read_bytes().startswith(b"\x89PNG")
    assert not (folder / "trial_flows.h5.journal").exists()

    # A file of the user's on the same map and flows; when it was interrupted it goes on.
    without(monkeypatch, "matplotlib")
    own.write_text(SHORT)
    command = ("trial", own, vehicle, "--format", "csv", "--format", "json")

    def written(out: Path) -> list[bytes]:
        return [(out / name).read_bytes() for name in ("trial.csv", "trial.json")]

    before = set((folder / CASES).iterdir())
    code, out, _ = run(*command, "-o", folder)
    assert code == 0
    assert "too fast, : left out: mach_number:" in out
    content = written(folder)
    (set((folder / CASES).iterdir()) - before).pop().write_text("[{")  # damaged
    code, out, _ = run(*command, "-o", folder)
    assert code == 0
    assert all(f"{name}: up to date, reused" in out for name in ("snapshots.h5", "map.h5", "trial_flows.h5"))
    assert "Cases: 2 of 3" in out  # the one that is left out, too
    assert written(folder) == content

    # The map and flows as files, and two workers, give the same numbers.
    given.write_bytes((folder / "map.h5").read_bytes())
    command = (*command, "--map", given, "--flows", folder / "trial_flows.h5", "-o", tmp_path / "two")
    code, out, _ = run(*command, "--workers", 2)
    assert code == 0
    assert "snapshots.h5" not in out
    assert written(tmp_path / "two") == content
    code, out, _ = run(*command, "--only", "three gauges lost", "--estimators", "linear")
    assert code == 0
    assert "bias of one gauge" not in out
    code, out, message = run(*command, "--only", "too fast")
    assert code == 2
    assert "left out: mach_number:" in out
    assert message == f"strainfmu: {own}: expected cases that this vehicle can fly, got 1, all left out\n"
    code, _, message = run("stress", "-o", folder, "--map", given)
    assert code == 2
    assert "gauges of layout 'configuration_2': expected" in message


@pytest.mark.fast
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("stress", OGIVE, "--conditions", 0), "--conditions: expected 1 .. 1000000, got 0"),
        (("stress", OGIVE, "--map", "m.h5", "--rebuild"), "--map: expected without --rebuild"),
        (("trial", "stress", OGIVE, "--map", "m.h5", "--snapshots", "s.h5"), "expected without --snapshots"),
        (("stress", OGIVE, "--map", "m.h5"), "m.h5: no such file"),
        (("compare", OGIVE, "--training", 10), "--training: expected 1200 .. 10000000, got 10"),
        (("compare", OGIVE, "--snapshots", "none.h5"), "none.h5: no such file"),
        (("trial", "compare", OGIVE, "--map", "map.h5"), "--map: expected none, this trial makes maps"),
        (("trial", "compare", OGIVE, "--estimators", "map"), "estimators: expected linear Case 1"),
        (("trial", "ground_test", "--map", "map.h5"), "--map: expected none, this trial makes maps"),
        (("trial", "ground_test", "--estimators", "map"), "estimators: expected linear Case 1, linear Case 2"),
        (("trial", "no_name", OGIVE), "no_name: expected the path of a file, or a trial that is shipped"),
        (("trial", "none.toml", OGIVE), "none.toml: no such file"),
        (("trial", "stress", OGIVE, "--format", "xlsx"), "--format: expected csv, parquet or json, got xlsx"),
        (("trial", "manoeuvres", VEHICLES / "finned_body.toml"), "motion: expected a body of revolution, got a"),
    ],
)
def test_wrong_options_are_refused_in_one_line(
    arguments: tuple[object, ...], message: str, tmp_path: Path, run: Run
) -> None:
    code, _, found = run(*arguments, "-o", tmp_path / "none")
    assert code == 2
    assert found.count("\n") == 1
    assert message in found
    assert not (tmp_path / "none").exists()


@pytest.mark.slow
def test_the_finned_body_from_file_to_table(tmp_path: Path, run: Run) -> None:
    vehicle, how = VEHICLES / "finned_body.toml", ("-o", tmp_path, "--conditions", 20)
    assert run("stress", vehicle, *how, "--draws", 4, "--estimator", "nonlinear")[0] == 0
    of = {(one["error"], one["size"]): one for one in entries_in(tmp_path)}
    assert of["nothing wrong", "vehicle of the file"]["undetected_percent"] <= 10.0
    assert of["bias of one gauge", "+50 um/m"]["detected_percent"] == 100.0
    assert of["Mach number below its least", "-20 %"]["detected_percent"] >= 95.0


AIMS = {
    "C_A": ("rms", 4e-4),
    "C_N": ("rms", 8e-4),
    "C_Y": ("rms", 8e-4),
    "M_P": ("rms", 2.2e-3),
    "M_Y": ("rms", 2.2e-3),
    "angle_of_attack": ("p95", 0.0026),
    "sideslip_angle": ("p95", 0.0026),
    "pressure field": ("p95", 0.04),
}
"""Largest errors of the nonlinear estimator on the shipped vehicle, with gauge noise alone [1, rad]."""


PRODUCT = [
    "linear Case 1",
    "linear Case 2",
    "nonlinear",
    "nonlinear, q_inf only",
    "nonlinear, M and p_inf only",
    "Kalman filter",
]


@pytest.mark.slow
@pytest.mark.usefixtures("compiled_solver")
def test_aims_on_the_shipped_vehicle(tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("sklearn")
    command = ("compare", "-o", tmp_path, "--conditions", 150, "--draws", 4)
    code, out, _ = run(*command, "--training", 6000)
    assert code == 0
    assert "rms over" in out
    assert (tmp_path / "trial.png").read_bytes().startswith(b"\x89PNG")
    rows, drawn = rows_in(tmp_path), "installation errors, drawn at their stated sizes"
    for load, (column, limit) in AIMS.items():
        assert float(rows["gauge noise", "nonlinear", load][column]) <= limit, load
    assert float(rows["gauge noise", "nonlinear, M and p_inf only", "dynamic_pressure"]["p95"]) <= 0.05
    of_loads = {key: row for key, row in rows.items() if row["rms_z"]}
    for (_, estimator, _), row in of_loads.items():
        assert float(row["covered_percent"]) >= 99.0 or not estimator.startswith("nonlinear")
    for case, worst in (("gauge noise", 1.0), (drawn, 1.4)):
        found = [estimator for of, estimator, load in rows if (of, load) == (case, "all")]
        assert found[: len(PRODUCT)] == PRODUCT
        assert {rows[case, estimator, "all"]["samples"] for estimator in found} == {"600"}
        for load in ("C_A", "C_N", "C_Y", "M_P", "M_Y"):
            rms = {name: float(of_loads[case, name, load]["rms"]) for name in (*PRODUCT, *REGRESSIONS)}
            assert all(rms["nonlinear"] < worst * rms[rival] for rival in REGRESSIONS)
            near = {"C_N": 0.8, "C_Y": 0.8}.get(load, 0.5)
            assert rms["nonlinear"] < near * min(rms["linear Case 1"], rms["linear Case 2"])
    # A filter that takes lasting errors for noise is too sure of itself.
    assert (
        min(float(rows[drawn, "Kalman filter", load]["covered_percent"]) for load in ("C_A", "C_N", "M_P")) < 95.0
    )
    # Without scikit-learn the same command leaves its estimators out and says so.
    without(monkeypatch, "matplotlib", "sklearn")
    code, out, _ = run("trial", *command, "--only", "gauge noise")
    assert code == 0
    assert "left out, they need strainfmu[rivals]: regression tree" in out
    assert {estimator for _, estimator, _ in rows_in(tmp_path)} == set(PRODUCT)
