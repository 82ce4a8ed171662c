"""The end of ``strainfmu demo --can``: sender and bridge as two processes."""

import shutil
from collections.abc import Callable
from pathlib import Path

import can
import can.interfaces.udp_multicast
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


def test_without_a_route_the_demo_ends_before_the_long_work(
    tmp_path: Path, run: Callable[..., tuple[int, str, str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The bus without one is in test_bridge.py: here it opens, and sends nothing."""

    def unreachable(bus: can.BusABC, *_: object) -> None:
        raise OSError("Network is unreachable")

    monkeypatch.setattr(can.interfaces.udp_multicast.UdpMulticastBus, "send", unreachable)
    code, _, message = run("demo", "--can", "-o", tmp_path / "d")
    assert code == 1
    assert message.count("\n") == 1
    assert "ip route add 224.0.0.0/4 dev lo" in message
    assert not (tmp_path / "d").exists()
