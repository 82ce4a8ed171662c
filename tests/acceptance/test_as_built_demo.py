"""``strainfmu demo --as-built``: ground test, calibration and flight of one vehicle."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from ogive import OGIVE

from builder.calibration.ground_test.load_test_file import read_test_file
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES

Run = Callable[..., tuple[int, str, str]]


@pytest.mark.slow
def test_a_tested_vehicle_flies_as_one_that_is_known(tmp_path: Path, run: Run) -> None:
    """The calibrated map errs less than the drawing's and hardly more than the exact one, and its sigma holds."""
    folder = tmp_path / "tested"
    code, said, _ = run("demo", "--vehicle", OGIVE, "--as-built", "3", "-o", folder)
    assert code == 0
    assert "before and after the ground test" in said
    for name in ("loadtest.csv", "channels.toml", "zeros.toml", "calibrated.h5", "exact.h5", "as_built.png"):
        assert (folder / name).is_file()
    # The vehicle file states no density: a baseline without load stands in for own weight.
    assert [len(case.load) for case in read_test_file(folder / "loadtest.toml").case] == [0] + [1] * 12
    states = json.loads((folder / "summary.json").read_text(encoding="utf-8"))["as_built"]
    assert list(states) == ["before", "after", "exact"]
    ratio = {name: states["after"]["rms"][name] / states["exact"]["rms"][name] for name in COEFFICIENT_NAMES}
    assert max(ratio.values()) < 1.5
    assert min(states["after"]["coverage_percent"].values()) > 99.0
    gain = [states["before"]["rms"][name] / states["after"]["rms"][name] for name in COEFFICIENT_NAMES]
    assert sum(one > 1.5 for one in gain) >= 2
    again = run("demo", "--vehicle", OGIVE, "--as-built", "3", "-o", folder, "--verbose")
    assert again[0] == 0
    assert "calibrated.h5: up to date, reused" in again[1]


@pytest.mark.fast
def test_a_vehicle_is_perfect_or_as_built(tmp_path: Path, run: Run) -> None:
    code, _, message = run("demo", "--perfect", "--as-built", "3", "-o", tmp_path / "demo")
    assert code == 2
    assert message.startswith("strainfmu: --as-built: expected without --perfect, got both; see")
