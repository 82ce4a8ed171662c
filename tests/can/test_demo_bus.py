"""The end of ``strainfmu demo --can``: sender and bridge as two processes."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from bridge_table import BridgeTable, is_late
from multicast import skip_without_multicast
from synthetic_vehicle import SyntheticFiles

from builder.pipeline.demonstration.bus_flight import CYCLE_TIME, fly_over_bus
from strainfmu.errors import StrainfmuError


@pytest.fixture
def folder(synthetic: SyntheticFiles, tmp_path: Path) -> Path:
    """Return a folder as a demonstration leaves it, of synthetic files."""
    skip_without_multicast()
    for path, name in (
        (synthetic.map_1, "map.h5"),
        (synthetic.estimator_1, "estimator.fmu"),
        (synthetic.plant, "plant.fmu"),
    ):
        shutil.copy(path, tmp_path / name)
    return tmp_path


def test_sender_and_bridge_meet_by_authenticated_frames(folder: Path) -> None:
    """Frames of the other profiles, without a key, are sent by two processes in test_two_processes.py."""
    flown = fly_over_bus(folder, 1.0, is_authenticated=True)
    assert flown.score.cycles == 100
    assert "not accounted for" in flown.bridge
    answered = flown.score.answered + BridgeTable(flown.bridge).frames_lost
    assert is_late(flown.bridge, flown.sender, CYCLE_TIME) or answered > 90
    assert "100 in " in flown.sender
    assert "frames: authenticator does not fit" not in flown.bridge
    assert "no earlier run" in flown.bridge


@pytest.mark.slow
def test_a_process_that_fails_is_one_line(folder: Path) -> None:
    (folder / "plant.fmu").write_bytes(b"no FMU")
    with pytest.raises(StrainfmuError, match=r"CAN sender: ended with exit code 2: .*damaged, or not an FMU"):
        fly_over_bus(folder, 1.0)
    (folder / "estimator.fmu").unlink()
    with pytest.raises(StrainfmuError, match=r"CAN bridge: did not start: .*no such FMU"):
        fly_over_bus(folder, 1.0)


@pytest.mark.skipif(shutil.which("unshare") is None or os.geteuid() != 0, reason="needs unshare and root")
def test_without_a_route_the_demo_ends_before_the_long_work(tmp_path: Path) -> None:
    command = [
        sys.executable,
        "-c",
        "from strainfmu.cli.main import main; main()",
        "demo",
        "--can",
        "-o",
        str(tmp_path / "d"),
    ]
    finished = subprocess.run(["unshare", "-n", *command], capture_output=True, text=True, check=False)
    if "unshare" in finished.stderr:
        pytest.skip("no right to make a network namespace")
    assert finished.returncode == 1
    assert finished.stderr.count("\n") == 1
    assert "ip route add 224.0.0.0/4 dev lo" in finished.stderr
    assert not (tmp_path / "d").exists()
