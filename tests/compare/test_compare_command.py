"""``strainfmu compare`` as a user runs it: files, a second run, without scikit-learn, refusals."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
from ogive import OGIVE

from builder.compare import flights
from builder.compare import run as compare_run
from builder.compare.rivals import RIVALS

Run = Callable[..., tuple[int, str, str]]

PRODUCT = ("linear Case 1", "linear Case 2", "nonlinear", "Kalman filter, random walk")


@pytest.fixture
def few_knots(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(flights, "MACH_KNOTS", 4)
    monkeypatch.setattr(flights, "INCIDENCE_KNOTS", 4)


@pytest.mark.usefixtures("compiled_solver", "few_knots")
def test_table_figure_and_second_run(tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    """One learning estimator stands for all: the others differ by what scikit-learn fits."""
    pytest.importorskip("sklearn")
    for name in list(RIVALS)[1:]:
        monkeypatch.delitem(RIVALS, name)
    folder = tmp_path / "compare"
    command = ("compare", OGIVE, "-o", folder, "--conditions", 6, "--draws", 2, "--training", 1500)
    code, out, message = run(*command)
    assert (code, message) == (0, "")
    assert "aim of the nonlinear estimator" in out
    entries = json.loads((folder / "compare.json").read_text(encoding="utf-8"))
    names = (*PRODUCT, "regression tree")
    assert [
        one["estimator"] for one in entries if one["errors"] == "hardware" and one["air_data_inputs"] == "given"
    ] == [*names]
    assert len(entries) == 2 * (2 * len(names) + 1)
    for one in entries:
        assert one["samples"] == 12
        assert one["step_microseconds"] > 0.0
        # The body is not vented: its field is known without p_inf.
        has_field = one["estimator"] in PRODUCT[:3]
        assert (one["field_median_percent"] is not None) == has_field
        has_example = has_field and one["errors"] == "gauge noise"
        assert (one["example_field_p95_percent"] is not None) == has_example
    of = {(one["estimator"], one["errors"], one["air_data_inputs"]): one for one in entries}
    nonlinear, linear = of["nonlinear", "gauge noise", "given"], of["linear Case 1", "gauge noise", "given"]
    assert all(nonlinear["rms"][name] < linear["rms"][name] for name in nonlinear["rms"])
    assert nonlinear["field_median_percent"] < 0.5 * linear["field_median_percent"]
    assert min(nonlinear["coverage_percent"].values()) > 95.0
    assert of["nonlinear", "gauge noise", "M and p_inf only"]["air_data_p95"]["dynamic_pressure_percent"] < 6.0
    with (folder / "compare.csv").open(encoding="utf-8", newline="") as stream:
        assert len(list(csv.DictReader(stream))) == len(entries)
    assert (folder / "compare.png").read_bytes().startswith(b"\x89PNG")
    assert not (folder / "compare_flows.h5.journal").exists()
    before = {path.name: path.read_bytes() for path in folder.iterdir()}

    code, out, _ = run(*command)
    assert code == 0
    for name in ("snapshots.h5", "compare_flows.h5", "compare.json", "compare.csv", "compare.png"):
        assert f"{name}: up to date, reused" in out
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before

    # Without scikit-learn the same command leaves its estimators out and says so.
    def without_rivals(trial: compare_run.Trial, reporter: object) -> list[dict[str, Any]]:
        assert not trial.has_rivals
        return [one for one in entries if one["estimator"] in PRODUCT]

    with monkeypatch.context() as patched:
        patched.setattr(compare_run, "all_entries", without_rivals)
        patched.setattr(compare_run, "find_spec", lambda name: None if name == "sklearn" else find_spec(name))
        code, out, _ = run(*command)
    assert code == 0
    assert "left out, they need strainfmu[rivals]: regression tree" in out
    left = json.loads((folder / "compare.json").read_text(encoding="utf-8"))
    assert {one["estimator"] for one in left} == set(PRODUCT)


@pytest.mark.fast
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--conditions", 0), "--conditions: expected 1 .. 10000, got 0"),
        (("--training", 10), "--training: expected 1200 .. 10000000, got 10"),
        (("--snapshots", "none.h5"), "none.h5: no such file"),
    ],
)
def test_wrong_options_are_refused_in_one_line(
    arguments: tuple[object, ...], message: str, tmp_path: Path, run: Run
) -> None:
    code, _, found = run("compare", OGIVE, "-o", tmp_path / "none", *arguments)
    assert code == 2
    assert found.count("\n") == 1
    assert message in found
    assert not (tmp_path / "none").exists()
