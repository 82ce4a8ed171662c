"""``strainfmu loadtest``: what it proposes, and one line for each wrong option."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import pytest
from changed_vehicle import change
from ogive import OGIVE, copied_ogive

from builder.calibration.ground_test.load_entries import PushEntry, WeightEntry
from builder.calibration.ground_test.load_test_file import load_test_file

Run = Callable[..., tuple[int, str, str]]


def with_density(folder: Path) -> Path:
    """Write the coarse vehicle with a density."""
    path = copied_ogive(folder / "vehicle")
    change(path, ("[material]", "[material]\ndensity_kg_per_m3 = 2700.0"))
    return path


@pytest.mark.slow
def test_proposal_lowers_sigmas_case_by_case_and_reads_back(tmp_path: Path, run: Run) -> None:
    vehicle, output = with_density(tmp_path), tmp_path / "proposed" / "loadtest.toml"
    output.parent.mkdir()
    code, said, _ = run("loadtest", vehicle, "--cases", "3", "--roll-angles", "0,90,180", "-o", output)
    assert code == 0
    file = load_test_file(output)
    assert file.vehicle == "../vehicle/ogive.toml"
    weights, pads = file.case[:4], file.case[4:]
    assert [type(case.load[0]) for case in weights] == [WeightEntry] * 4
    assert [[type(load) for load in case.load] for case in pads] == [[WeightEntry, PushEntry]] * 3
    rows = [[float(one) for one in line.split("│")[3:8]] for line in said.splitlines() if line.count("│") == 8]
    assert len(rows) == 5
    for before, after in pairwise(rows):
        assert all(b >= a >= 1.0 for b, a in zip(before, after, strict=True))
    assert rows[-1][1] - 1.0 < 0.2 * (rows[1][1] - 1.0)
    assert output.with_suffix(".png").stat().st_size > 10_000


@pytest.mark.fast
@pytest.mark.parametrize("has_density", [True, False])
def test_a_template_reads_back_with_one_case_of_each_usual_kind(
    has_density: bool, tmp_path: Path, run: Run
) -> None:
    vehicle, output = with_density(tmp_path) if has_density else OGIVE, tmp_path / "loadtest.toml"
    code, said, _ = run("loadtest", vehicle, "--template", "-o", output)
    assert (code, f"strainfmu calibrate map.h5 {output}" in said) == (0, True)
    file = load_test_file(output)
    kinds = [load.kind for case in file.case for load in case.load if load.kind != "weight"]
    assert kinds == ["push", "point", "section", "internal_pressure"]
    weights = [load.kind for case in file.case for load in case.load].count("weight")
    assert weights == (6 if has_density else 0)
    text = output.read_text(encoding="utf-8")
    assert text.count("# window_s = ") == len(file.case) == 6
    assert "# recording = " in text


@pytest.mark.fast
@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--template", "--force", "3"), "--template: expected without --force, got both"),
        (("--stations", "a,b"), "--stations: expected numbers with commas, got 'a,b'"),
        (("--directions", "up"), "--directions: expected some of in, out, axial, around, got 'up'"),
        (("--cases", "0"), "--cases: expected 1 .. 200"),
        (("--roll-angles", "0,inf"), "--roll-angles: expected finite numbers, got '0,inf'"),
    ],
)
def test_wrong_options_are_one_line(options: tuple[str, ...], words: str, tmp_path: Path, run: Run) -> None:
    code, _, message = run("loadtest", OGIVE, *options, "-o", tmp_path / "loadtest.toml")
    assert code == 2
    assert message.count("\n") == 1
    assert words in message
    assert not (tmp_path / "loadtest.toml").exists()
