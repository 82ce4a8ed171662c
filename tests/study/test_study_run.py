"""A small trade study from its file to its table: shared flows, resumption, workers, faults of a design."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest
from test_study_file import write

from builder.reporting import Silent
from builder.study.run import SCORE, TABLE, run_study
from strainfmu.cli.main import main

FAST = """
[set]
"aerodynamics.engine" = "newtonian"
"truth.engine" = "newtonian"
"map.estimator" = "linear"
"map.alarm_levels" = "nominal"
"conditions.mach_number" = [5.0, 6.0, 7.0]
"resolution.map.surface_stations" = 40
"resolution.map.surface_roll_angles" = 24
"resolution.map.harmonics" = 10
"resolution.map.element_length_mm" = 40.0
"resolution.map.wall_layers" = 1
"resolution.truth.surface_stations" = 40
"resolution.truth.surface_roll_angles" = 24
"resolution.truth.harmonics" = 10
"resolution.truth.element_length_mm" = 40.0
"resolution.truth.wall_layers" = 1
[trial]
conditions = 20
draws = 2
"""
SWEEP = '"noise.percent_of_median_strain" = [1.0, 4.0]\n'


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("study")
    path = write(folder, SWEEP, FAST)
    run_study(path, folder / "out", Silent(), workers=1)
    return path, folder / "out"


def rows(folder: Path, load: str) -> list[dict[str, str]]:
    with (folder / TABLE).open(newline="") as file:
        return [row for row in csv.DictReader(file) if row["load"] == load]


def test_more_noise_errs_more(done: tuple[Path, Path]) -> None:
    for name in ("C_N", "C_Y", "M_P", "M_Y"):
        quiet, noisy = rows(done[1], name)
        assert [row["noise.percent_of_median_strain"] for row in (quiet, noisy)] == ["1", "4"]
        assert float(noisy["sigma"]) > float(quiet["sigma"]) > 0.0
        assert min(float(row["covered_percent"]) for row in (quiet, noisy)) > 95.0
    assert (quiet["samples"], quiet["vehicles"], quiet["flights"]) == ("40", "40", "20")


def test_flows_are_solved_once(done: tuple[Path, Path]) -> None:
    folders = sorted(one.name for one in done[1].iterdir() if one.is_dir())
    assert folders == ["design_0001", "design_0002", "flows_0001"]
    assert not list(done[1].glob("design_*/snapshots.h5"))


def test_a_second_run_by_workers_reuses_what_is_there(done: tuple[Path, Path]) -> None:
    path, out = done
    before = {one: one.stat().st_mtime_ns for one in out.glob(f"design_*/{SCORE}")}
    assert len(before) == 2
    found = run_study(path, out, Silent(), workers=2)
    assert {one: one.stat().st_mtime_ns for one in before} == before
    assert found.faults == []
    assert list(dict.fromkeys(row["design"] for row in found.rows)) == [1, 2]


def test_a_design_that_fails_leaves_the_others(
    done: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    # The flows of the truth end at M 7.
    fast = FAST.replace('"conditions.mach_number" = [5.0, 6.0, 7.0]\n', "")
    path = write(tmp_path, '"conditions.mach_number" = [[5.0, 6.0, 7.0], [8.0, 9.0, 10.0]]\n', fast)
    with pytest.raises(SystemExit) as left:
        main(["study", str(path), "-o", str(tmp_path / "out"), "--workers", "1"])
    errors = capsys.readouterr().err.splitlines()
    assert left.value.code == 1, errors
    assert len(errors) == 1
    assert errors[0].startswith("strainfmu: design_0002 (conditions.mach_number = [8.0, 9.0, 10.0]): ")
    assert [row["design"] for row in rows(tmp_path / "out", "all")] == ["1"]
