"""Authenticated frames from end to end: sender, bridge, recording, replay, and the recording sent again."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from bus_run import CYCLE, live_run, paced_bridge
from can_faults import planned_faults
from synthetic_vehicle import SyntheticFiles

from strainfmu.can.authentic import load_freshness, load_key
from strainfmu.can.frame import to_message
from strainfmu.can.listener import BridgeSummary
from strainfmu.can.log_description import sidecar
from strainfmu.can.log_frames import LogState, log_frames
from strainfmu.can.options import BridgeOptions
from strainfmu.can.quality import FrameClass, Quality
from strainfmu.errors import InputError
from strainfmu.files import write_bytes_atomically

SECRET = bytes(range(16)).hex()


@pytest.fixture
def key(tmp_path: Path) -> Path:
    path = tmp_path / "bus.key"
    write_bytes_atomically(path, SECRET.encode(), is_private=True)
    return path


def send_again(fmu: Path, log: Path, key: Path, channel: str) -> BridgeSummary:
    """Start another bridge with the same key and send it what the log holds, in the pace of the live run."""
    options = BridgeOptions(
        interface="virtual", channel=channel, profile="fd64-sec", cycle_time=CYCLE, key_file=key
    )
    watched = {"record": None, "publish": None, "publish_rate": 50.0}
    with paced_bridge(fmu, options, **watched) as paced:
        last = None
        for frame, is_received in log_frames(log, 0.0, state=LogState()):
            if is_received:
                if last is not None and frame.time > last:
                    paced.sleep(frame.time - last)
                last = frame.time
                paced.send(to_message(frame))
    return paced.summary


def test_a_recording_replays_off_line_and_is_refused_on_the_bus(
    synthetic: SyntheticFiles, tmp_path: Path, key: Path, run: Callable[..., tuple[int, str, str]]
) -> None:
    log, out = tmp_path / "run.blf", tmp_path / "out.csv"
    live = live_run(synthetic.estimator_1, "auth-live", 60, record=log, profile="fd64-sec", key=key)
    assert sum(r.quality is Quality.VALID for r in live.results) > 40
    state = tmp_path / "bus.key.bridge.json"
    assert load_freshness(state, load_key(key)) == (2 << 32) + 59
    described = json.loads(sidecar(log).read_text())
    assert described["freshness"] is None
    assert described["options"]["key_file"] == str(key)
    assert SECRET not in sidecar(log).read_text()

    code, printed, errors = run("replay", log, synthetic.estimator_1, "-o", out)
    assert (code, errors) == (0, "")
    assert "frames: freshness value not new" not in printed
    rows = out.read_text().splitlines()
    assert len(rows) - 1 == len(live.results)

    again = send_again(synthetic.estimator_1, log, key, "auth-again")
    assert not any(quality.has_coefficients for quality in again.qualities)
    assert again.account.classes[FrameClass.NOT_FRESH] == again.account.received >= 120
    assert again.account.unaccounted == 0

    # The sender starts another time, with its next trip.
    further = live_run(synthetic.estimator_1, "auth-further", 60, profile="fd64-sec", key=key)
    assert sum(r.quality is Quality.VALID for r in further.results) > 40
    assert load_freshness(state, load_key(key)) == (3 << 32) + 59


def test_a_log_needs_its_key(
    synthetic: SyntheticFiles, tmp_path: Path, key: Path, run: Callable[..., tuple[int, str, str]]
) -> None:
    log, out = tmp_path / "run.blf", tmp_path / "out.csv"
    live_run(synthetic.estimator_1, "auth-key", 30, record=log, profile="fd64-sec", key=key)
    moved = key.rename(tmp_path / "other.key")
    code, _, errors = run("replay", log, synthetic.estimator_1, "-o", out)
    assert code == 2
    assert f"{key}: the key could not be read: No such file or directory" in errors
    code, printed, errors = run("replay", log, synthetic.estimator_1, "-o", out, "--set", f"input.key={moved}")
    assert (code, errors) == (0, "")
    assert "results VALID" in printed
    moved.write_text("00" * 16)
    code, printed, errors = run("replay", log, synthetic.estimator_1, "-o", out, "--set", f"input.key={moved}")
    assert code == 1
    assert "results has coefficients, 0 of " in errors
    assert "results VALID" not in printed
    assert "frames: authenticator does not fit" in printed


@pytest.mark.fast
def test_faults_that_need_a_key_are_refused_without_one() -> None:
    with pytest.raises(InputError, match="fault: 'forgery' acts on authenticated frames alone"):
        planned_faults(["forgery"], 1, seed=1, n_cycles=500)
    assert planned_faults(["forgery"], 1, seed=1, n_cycles=500, is_authenticated=True)
