"""``strainfmu loadtest``: what it proposes, and one line for each wrong option."""

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import pytest
from changed_vehicle import change
from ogive import OGIVE, copied_ogive

from builder.calibration.ground_test.load_entries import PushEntry, WeightEntry
from builder.calibration.ground_test.load_test_file import read_test_file

Run = Callable[..., tuple[int, str, str]]


NOISE = ("--noise", "0.3", "--samples", "100")


def with_density(folder: Path) -> Path:
    """Write the coarse vehicle with a density."""
    path = copied_ogive(folder / "vehicle")
    change(path, ("[material]", "[material]\ndensity_kg_per_m3 = 2700.0"))
    return path


@pytest.mark.drawn
@pytest.mark.slow
def test_proposal_lowers_sigmas_case_by_case_and_reads_back(tmp_path: Path, run: Run) -> None:
    vehicle, output = with_density(tmp_path), tmp_path / "proposed" / "loadtest.toml"
    output.parent.mkdir()
    rig = ("--roll-angles", "0,90,180", "--load-cells", "4")
    code, said, _ = run("loadtest", vehicle, "--cases", "3", *rig, "-o", output, *NOISE)
    assert code == 0
    assert "4 load cells: name them in the file" in said
    file = read_test_file(output)
    assert file.vehicle == "../vehicle/ogive.toml"
    # Four attitudes, half of three pads, one of them again and two checks, zero readings between and at the end.
    weights, pads = file.case[:4], [case for case in file.case[4:] if len(case.load) > 1]
    assert [type(case.load[0]) for case in weights] == [WeightEntry] * 4
    assert [[type(load) for load in case.load] for case in pads] == [[WeightEntry, PushEntry]] * 6
    assert [case.check for case in pads] == [False] * 4 + [True] * 2
    assert pads[3].name == f"{pads[0].name} (2)"
    assert [step.load_percent for step in pads[0].step] == [0.0, 50.0, 50.0, 0.0]
    assert [k for k, case in enumerate(file.case) if k > 3 and len(case.load) == 1] == [7, 11]
    assert len({case.name for case in file.case}) == len(file.case) == 12
    text = output.read_text(encoding="utf-8")
    assert "# sigma in flight after the test: C_A " in text
    assert "as uncertain as before the test" in text
    # Ten set-ups of 15 min; four weights, two zeros, six loads with five readings each of 1 min.
    assert "time: 3.1 h for 4 attitudes, 3 load cases, 1 repeated, 2 check loads, 2 zero readings" in text
    assert "noise 0.3 um/m of a sample, 100 samples a reading" in said
    rows = [[float(one) for one in line.split("│")[3:8]] for line in said.splitlines() if line.count("│") == 8]
    assert len(rows) == 6
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
    file = read_test_file(output)
    kinds = [load.kind for case in file.case for load in case.load if load.kind != "weight"]
    assert kinds == ["push", "point", "section", "internal_pressure", "push", "push"]
    assert [case.name for case in file.case if case.check] == ["check load"]
    assert [step.load_percent for case in file.case for step in case.step] == [0.0, 50.0, 50.0, 0.0]
    weights = [load.kind for case in file.case for load in case.load].count("weight")
    assert weights == (7 if has_density else 0)
    text = output.read_text(encoding="utf-8")
    assert len(file.case) == 7
    assert text.count("# window_s = ") == 7 + 4
    assert "# recording = " in text
    assert "# tested_on = " in text
    assert [cell.name for cell in file.load_cell] == ["1"]


@pytest.mark.fast
@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--template", "--force", "3"), "--template: expected without --force, got both"),
        (("--stations", "a,b"), "--stations: expected numbers with commas, got 'a,b'"),
        (("--directions", "up"), "--directions: expected some of in, out, axial, around, got 'up'"),
        (("--cases", "0"), "--cases: expected 1 .. 200"),
        (("--noise", "0"), "--noise: expected 0.0001 .. 1000 um/m, got 0"),
        (("--steps", "0"), "--steps: expected 1 .. 20"),
        (("--roll-angles", "0,inf"), "--roll-angles: expected finite numbers, got '0,inf'"),
    ],
)
def test_wrong_options_are_one_line(options: tuple[str, ...], words: str, tmp_path: Path, run: Run) -> None:
    code, _, message = run("loadtest", OGIVE, *options, "-o", tmp_path / "loadtest.toml")
    assert code == 2
    assert message.count("\n") == 1
    assert words in message
    assert not (tmp_path / "loadtest.toml").exists()
