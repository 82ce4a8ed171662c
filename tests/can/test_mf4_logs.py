"""Logs of a bus in MF4, written by asammdf itself: replayed and estimated as logs of the other formats are."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from bus_run import live_run
from mf4_files import write_bus_log, write_channels
from synthetic_vehicle import SyntheticFiles

from strainfmu.can.frame import Frame
from strainfmu.can.log_frames import LogState, is_bus_log, log_frames
from strainfmu.can.recording import check_log
from strainfmu.errors import InputError

pytest.importorskip("asammdf")

Run = Callable[..., tuple[int, str, str]]
FRAMES = [
    (Frame(identifier=0x300, data=bytes(range(16)), time=1.7e9 + 1e-6, is_fd=True, bitrate_switch=True), True),
    (Frame(identifier=0x18FF0001, data=b"\x01\x02", time=1.7e9 + 0.25, is_extended=True), False),
    (Frame(identifier=0x7FF, data=b"", time=1.7e9 + 71.123457), True),
]


def test_frames_are_as_they_were(tmp_path: Path) -> None:
    log = write_bus_log(tmp_path / "run.mf4", FRAMES)
    assert is_bus_log(log)
    state = LogState()
    assert list(log_frames(log, 0.0, state=state)) == FRAMES
    assert (state.ends_early, state.backwards) == ("", 0)


def test_a_log_converted_to_mf4_gives_the_same_results(
    synthetic: SyntheticFiles, tmp_path: Path, run: Run
) -> None:
    blf = tmp_path / "run.blf"
    live_run(synthetic.estimator_1, "mf4-live", 40, record=blf)
    mf4 = write_bus_log(tmp_path / "run.mf4", list(log_frames(blf, 0.0, state=LogState())))
    (tmp_path / "run.mf4.json").write_bytes((tmp_path / "run.blf.json").read_bytes())
    written = []
    for command in (
        ["replay", blf, synthetic.estimator_1],
        ["replay", mf4, synthetic.estimator_1],
        ["estimate", synthetic.estimator_1, mf4],
    ):
        code, printed, errors = run(*command, "-o", tmp_path / "out.csv")
        assert (code, errors) == (0, "")
        assert "results VALID" in printed
        written.append((tmp_path / "out.csv").read_bytes())
    assert written[0] == written[1] == written[2]


def test_a_file_of_channels_is_no_log_and_a_log_no_file_of_channels(
    synthetic: SyntheticFiles, tmp_path: Path, run: Run
) -> None:
    time = np.arange(3.0)
    channels = write_channels(tmp_path / "c.mf4", [(time, {"G0": time})], {"G0": "um/m"})
    assert not is_bus_log(channels)
    with pytest.raises(InputError, match=r"c\.mf4: expected a log of a CAN bus, with the channel CAN_DataFrame"):
        next(log_frames(channels, 0.0, state=LogState()))
    unmarked = write_bus_log(tmp_path / "u.mf4", FRAMES, is_marked=False)
    with pytest.raises(InputError, match=r"u\.mf4: channel group 0: CAN_DataFrame is not marked as an event"):
        next(log_frames(unmarked, 0.0, state=LogState()))
    (tmp_path / "d.mf4").write_bytes(b"MDF     4.10" + bytes(100))
    for command in (["replay", tmp_path / "d.mf4", "x.fmu"], ["estimate", "x.fmu", tmp_path / "d.mf4"]):
        code, _, errors = run(*command, "-o", tmp_path / "o.csv")
        assert code == 2
        assert errors.count("\n") == 1
    with pytest.raises(InputError, match="it is on disk only at its end"):
        check_log(tmp_path / "new.mf4")
    with pytest.raises(InputError, match=r"nowhere\.mf4: no such file"):
        is_bus_log(tmp_path / "nowhere.mf4")
    assert is_bus_log(Path("x.blf"))
    assert not is_bus_log(Path("x.csv"))


def test_without_asammdf_a_line_names_the_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, run: Run) -> None:
    import sys

    log = write_bus_log(tmp_path / "run.mf4", FRAMES)
    monkeypatch.setitem(sys.modules, "asammdf", None)
    code, _, errors = run("estimate", "x.fmu", log, "-o", tmp_path / "o.csv")
    assert code == 1
    assert "asammdf is not installed: pip install 'strainfmu[mf4]'" in errors
