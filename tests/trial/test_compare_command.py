"""``strainfmu compare`` as a user runs it: files, a second run, without scikit-learn, refusals."""

from __future__ import annotations

import csv
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import pytest
from ogive import OGIVE

from builder.pipeline import compare_trial
from builder.trial import conditions
from builder.trial.cases import trial_path
from builder.trial.regressions import REGRESSIONS
from builder.vehicle.file import VEHICLES

Run = Callable[..., tuple[int, str, str]]

PRODUCT = (
    "linear Case 1",
    "linear Case 2",
    "nonlinear",
    "nonlinear, q_inf only",
    "nonlinear, M and p_inf only",
    "Kalman filter",
)

OTHERS = [f"{name}{end}" for name in REGRESSIONS for end in ("", ", q_inf only")][1:]


def rows_in(folder: Path) -> dict[tuple[str, str, str], dict[str, str]]:
    """Return the rows of a table by case, estimator and load."""
    with (folder / "trial.csv").open(encoding="utf-8", newline="") as stream:
        return {(row["case"], row["estimator"], row["load"]): row for row in csv.DictReader(stream)}


@pytest.fixture
def few_knots(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(conditions, "MACH_KNOTS", 4)
    monkeypatch.setattr(conditions, "INCIDENCE_KNOTS", 4)


@pytest.mark.usefixtures("compiled_solver", "few_knots")
def test_table_figure_and_second_run(tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    """One regression stands for all: the others differ by what scikit-learn fits."""
    pytest.importorskip("sklearn")
    text = trial_path("compare").read_text(encoding="utf-8").replace("12_000", "1500")
    lines = [line for line in text.splitlines() if line.strip(' ",') not in OTHERS]
    file, folder = tmp_path / "fewer.toml", tmp_path / "compare"
    file.write_text("\n".join(lines), encoding="utf-8")
    command = ("trial", file, OGIVE, "-o", folder, "--conditions", 6, "--draws", 2)
    code, out, message = run(*command)
    assert (code, message) == (0, "")
    rows, drawn = rows_in(folder), "installation errors, drawn at their stated sizes"
    for case in ("gauge noise", "gauge noise, at the corner", drawn):
        found = [estimator for of, estimator, load in rows if (of, load) == (case, "all")]
        assert found == [*PRODUCT, "regression tree"]
        samples = {row["samples"] for (of, _, load), row in rows.items() if (of, load) == (case, "all")}
        assert samples == {"6" if "corner" in case else "12"}
        for estimator in found:  # the body is not vented: its field is known without p_inf
            assert ((case, estimator, "pressure field") in rows) == (estimator in PRODUCT[:-1])
    for load in ("C_A", "C_N", "C_Y", "M_P", "M_Y"):
        nonlinear, linear = (rows["gauge noise", name, load] for name in ("nonlinear", "linear Case 1"))
        assert float(nonlinear["rms"]) < float(linear["rms"])
        assert float(nonlinear["covered_percent"]) > 95.0
    field = {name: float(rows["gauge noise", name, "pressure field"]["median"]) for name in PRODUCT[:3]}
    assert field["nonlinear"] < 0.5 * field["linear Case 1"]
    assert float(rows["gauge noise", "nonlinear, M and p_inf only", "dynamic_pressure"]["p95"]) < 0.06
    assert "pressure field" in out
    assert (folder / "trial.png").read_bytes().startswith(b"\x89PNG")
    before = (folder / "trial.csv").read_bytes()

    code, out, _ = run(*command)
    assert code == 0
    for name in ("snapshots.h5", "trial_flows.h5"):
        assert f"{name}: up to date, reused" in out
    assert (folder / "trial.csv").read_bytes() == before

    # Without scikit-learn the same command leaves its estimators out and says so.
    with monkeypatch.context() as patched:
        patched.setattr(compare_trial, "find_spec", lambda name: None if name == "sklearn" else find_spec(name))
        code, out, _ = run(*command, "--only", "gauge noise")
    assert code == 0
    assert "left out, they need strainfmu[rivals]: regression tree" in out
    assert {estimator for _, estimator, _ in rows_in(folder)} == set(PRODUCT)


@pytest.mark.fast
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("compare", OGIVE, "--conditions", 0), "--conditions: expected 1 .. 1000000, got 0"),
        (("compare", OGIVE, "--training", 10), "--training: expected 1200 .. 10000000, got 10"),
        (("compare", OGIVE, "--snapshots", "none.h5"), "none.h5: no such file"),
        (("trial", "compare", OGIVE, "--map", "map.h5"), "--map: expected none, this trial makes maps"),
        (("trial", "compare", OGIVE, "--estimators", "map"), "estimators: expected linear Case 1"),
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


@pytest.mark.fast
@pytest.mark.parametrize(
    ("text", "changed", "line"),
    [
        ('checked_by = "finned_body_check.vtu"\n', "", "structure.checked_by: entry is missing"),
        ("finned_body_check.vtu", "finned_body.vtu", "structure.checked_by: expected another mesh"),
    ],
)
def test_a_mesh_does_not_check_itself(text: str, changed: str, line: str, tmp_path: Path, run: Run) -> None:
    """Its error would be 0."""
    path = tmp_path / "finned_body.toml"
    path.write_text(
        (VEHICLES / "finned_body.toml").read_text(encoding="utf-8").replace(text, changed), encoding="utf-8"
    )
    code, _, message = run("compare", path, "-o", tmp_path / "out")
    assert (code, message.count("\n")) == (2, 1)
    assert message.startswith(f"strainfmu: {path}: {line}")
    assert not (tmp_path / "out" / "structure.h5").exists()


@pytest.mark.slow
def test_the_finned_body_from_file_to_table(tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compare_trial, "find_spec", lambda name: None)
    code, _, _ = run("compare", VEHICLES / "finned_body.toml", "-o", tmp_path, "--conditions", 20, "--draws", 2)
    assert code == 0
    rows, case = rows_in(tmp_path), "installation errors, drawn at their stated sizes"
    nonlinear = {
        load: row for (of, estimator, load), row in rows.items() if (of, estimator) == (case, "nonlinear")
    }
    assert float(nonlinear["M_R"]["covered_percent"]) >= 97.5
    assert float(nonlinear["C_A"]["rms"]) < 0.5 * float(rows[case, "linear Case 2", "C_A"]["rms"])
    assert float(nonlinear["pressure field"]["median"]) < 0.015


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


@pytest.mark.slow
@pytest.mark.usefixtures("compiled_solver")
def test_aims_on_the_shipped_vehicle(tmp_path: Path, run: Run) -> None:
    pytest.importorskip("sklearn")
    code, _, _ = run("compare", "-o", tmp_path, "--conditions", 150, "--draws", 4, "--training", 6000)
    assert code == 0
    rows, drawn = rows_in(tmp_path), "installation errors, drawn at their stated sizes"
    for load, (column, limit) in AIMS.items():
        assert float(rows["gauge noise", "nonlinear", load][column]) <= limit, load
    assert float(rows["gauge noise, at the corner", "nonlinear", "pressure field"]["p95"]) <= 0.03
    assert float(rows["gauge noise", "nonlinear, M and p_inf only", "dynamic_pressure"]["p95"]) <= 0.05
    of_loads = {key: row for key, row in rows.items() if row["rms_z"]}
    for (_, estimator, _), row in of_loads.items():
        assert float(row["covered_percent"]) >= 99.0 or not estimator.startswith("nonlinear")
    for case, worst in (("gauge noise", 1.0), (drawn, 1.4)):
        for load in ("C_A", "C_N", "C_Y", "M_P", "M_Y"):
            rms = {name: float(of_loads[case, name, load]["rms"]) for name in (*PRODUCT, *REGRESSIONS)}
            assert all(rms["nonlinear"] < worst * rms[rival] for rival in REGRESSIONS)
            near = {"C_N": 0.8, "C_Y": 0.8}.get(load, 0.5)
            assert rms["nonlinear"] < near * min(rms["linear Case 1"], rms["linear Case 2"])
    # A filter that takes lasting errors for noise is too sure of itself.
    assert (
        min(float(rows[drawn, "Kalman filter", load]["covered_percent"]) for load in ("C_A", "C_N", "M_P")) < 95.0
    )
