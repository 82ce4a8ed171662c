"""The study of stated uncertainties: scores by flows, one line each, bad options."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

from builder.vehicle.file import IC3X


def study(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "builder.stress.uncertainty", *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_every_flow_has_a_score_of_each_estimator(ic3x_demo: Path, tmp_path: Path) -> None:
    """Of few flights: names and figures as the file has them, and 3 sigma that hold."""
    out = tmp_path / "uncertainty.json"
    files = (str(IC3X), str(ic3x_demo / "map.h5"), str(ic3x_demo / "independent_flows.h5"))
    found = study(*files, "--conditions", "80", "--vehicles", "5", "-o", str(out))
    assert found.returncode == 0, found.stderr
    entries = json.loads(out.read_text())
    estimators = sorted({one["estimator"] for one in entries})
    assert {(one["flows"], one["estimator"]) for one in entries} == {
        (flows, estimator) for flows in ("own", "newtonian", "drawn") for estimator in estimators
    }
    assert len(found.stdout.splitlines()) == 1 + len(entries)
    for one in entries:
        assert one["samples"] == 400
        assert all(0.2 < value < 1.3 for value in one["rms_z"].values())
        assert all(value > 0.98 for value in one["coverage_3"].values())


def test_a_wrong_option_is_one_line(tmp_path: Path) -> None:
    found = study("vehicle.toml", "map.h5", "flows.h5", "--vehicles", "0")
    assert found.returncode != 0
    assert found.stderr.count("\n") == 1
    assert "--vehicles" in found.stderr


def test_help_names_the_flows() -> None:
    assert "newtonian" in study("--help").stdout
