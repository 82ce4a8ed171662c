"""Recording a bus: all of it, in formats that hold it, and readable after SIGKILL."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import can
import numpy as np
import pytest
from bus_run import live_run
from sweeps import sweep
from synthetic_vehicle import SyntheticFiles

from strainfmu.can.frame import Frame
from strainfmu.can.frame_queue import FrameQueue
from strainfmu.can.log_description import load_description, sidecar
from strainfmu.can.log_frames import LogState, log_frames
from strainfmu.can.recording import LOG_SUFFIXES, LogFile, MicrosecondClock, Recorder
from strainfmu.errors import InputError

FRAMES = (
    Frame(identifier=0x301, data=bytes(range(64)), is_fd=True, bitrate_switch=True),
    Frame(identifier=0x18FF0001, data=b"\x01\x02", is_extended=True),
    Frame(identifier=0x123, data=b""),
    Frame(identifier=0x124, data=bytes(8), is_remote=False),
)

RECORDER = """
import sys, time
from pathlib import Path
from strainfmu.can.frame import Frame
from strainfmu.can.recording import MicrosecondClock, Recorder
clock = MicrosecondClock()
recorder = Recorder(Path(sys.argv[1]), clock)
number = 0
print("ready", flush=True)
while True:
    data = number.to_bytes(8, "little").ljust(64, b"\\x55")
    recorder.queue.put(Frame(identifier=0x301, data=data, time=clock(), is_fd=True), True)
    number += 1
    if number % 100 == 0:
        print(number, time.monotonic(), flush=True)
    time.sleep(0.001)
"""


def read(path: Path, origin: float = 0.0) -> tuple[list[tuple[Frame, bool]], LogState]:
    state = LogState()
    return list(log_frames(path, origin, state)), state


@pytest.mark.parametrize("suffix", LOG_SUFFIXES)
def test_frames_and_times_come_back_exactly(tmp_path: Path, suffix: str) -> None:
    clock = MicrosecondClock()
    path = tmp_path / f"run{suffix}"
    recorder = Recorder(path, clock)
    given = []
    for number in range(400):
        frame = FRAMES[number % len(FRAMES)]
        time.sleep(1e-5)
        stamped = Frame(
            identifier=frame.identifier,
            data=frame.data,
            time=clock(),
            is_extended=frame.is_extended,
            is_fd=frame.is_fd,
            bitrate_switch=frame.bitrate_switch,
        )
        recorder.queue.put(stamped, number % 3 != 0)
        given.append((stamped, number % 3 != 0))
    recorder.close()
    assert (recorder.recorded, recorder.lost, recorder.failure) == (400, 0, "")
    found, state = read(path, clock.start)
    assert found == given  # every bit, times included
    assert (state.ends_early, state.backwards) == ("", 0)


def test_fd_frames_of_blf_are_those_of_python_can(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    lengths = [0, 1, 8, 12, 64]
    frames = [
        Frame(identifier=number, data=bytes(range(length)), time=number - 0.7654321, is_fd=True, **flags)
        for number, length in enumerate(lengths)
        for flags in ({}, {"is_extended": True}, {"bitrate_switch": True})
    ] * 100  # more than a container
    frames += [Frame(identifier=1, data=b"ab"), *frames[:9], Frame(identifier=2, data=b"", is_remote=True)]
    queue = FrameQueue(len(frames))
    for number, frame in enumerate(frames):
        queue.put(frame, number % 3 > 0)
    waiting, content = queue.take(), []
    for is_fast in (True, False):
        if not is_fast:
            monkeypatch.setattr(LogFile, "_add_fd", LogFile._add_others)
        log = LogFile(tmp_path / f"{is_fast}.blf", 0.0)
        for part in np.array_split(waiting, 40):
            assert log.add(part) == 0
        log.close()
        content.append((tmp_path / f"{is_fast}.blf").read_bytes())
    assert content[0] == content[1]


def test_blf_keeps_error_and_remote_frames(tmp_path: Path) -> None:
    clock = MicrosecondClock()
    recorder = Recorder(tmp_path / "run.blf", clock)
    given = [
        Frame(identifier=0x40, data=bytes(8), time=clock(), is_error=True),
        Frame(identifier=0x301, data=b"", time=clock(), is_remote=True),
    ]
    for frame in given:
        recorder.queue.put(frame, True)
    recorder.close()
    assert [frame for frame, _ in read(tmp_path / "run.blf")[0]] == given


@pytest.mark.parametrize("suffix", sweep(LOG_SUFFIXES, [".blf"]))
def test_sigkill_loses_at_most_the_last_second(tmp_path: Path, suffix: str) -> None:
    """A killed process leaves a log that python-can's own reader reads, up to less than 1 s before the kill."""
    path, begin = tmp_path / f"run{suffix}", time.time()
    process = subprocess.Popen([sys.executable, "-c", RECORDER, str(path)], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    printed = [process.stdout.readline().split() for _ in range(12)]
    os.kill(process.pid, signal.SIGKILL)
    printed += [line.split() for line in process.stdout]
    process.wait()
    found, _ = read(path, 0.0)
    assert len(found) > 100
    numbers = [int.from_bytes(frame.data[:8], "little") for frame, _ in found]
    assert numbers == list(range(len(numbers)))
    # By the process's own count and clock: what it made in the last second may be missing, no more.
    *_, (_, last) = printed
    assert all(int(number) <= len(found) for number, made in printed if float(last) - float(made) >= 1.0)
    assert int(printed[-1][0]) - len(found) < 1000
    if suffix == ".blf":
        reader = can.BLFReader(str(path))
        assert reader.object_count == len(found)
        assert len(list(reader)) == len(found)
        # The clock is made before the packages of the log are imported.
        assert begin - 1e-3 <= reader.start_timestamp <= found[0][0].time


def test_a_blf_cut_anywhere_gives_what_is_whole(tmp_path: Path) -> None:
    clock = MicrosecondClock()
    recorder = Recorder(tmp_path / "run.blf", clock)
    for number in range(3000):
        recorder.queue.put(Frame(identifier=0x301, data=os.urandom(64), time=clock(), is_fd=True), True)
        if number % 1000 == 999:
            time.sleep(0.3)
    recorder.close()
    whole = (tmp_path / "run.blf").read_bytes()
    full = read(tmp_path / "run.blf")[0]
    cut = tmp_path / "cut.blf"
    for length in (len(whole) - 1, len(whole) // 2, len(whole) // 2 + 3, 150, 144):
        cut.write_bytes(whole[:length])
        found, _ = read(cut) if length > 160 else ([], None)
        assert found == full[: len(found)]
        assert length < 1000 or len(found) > 500


def test_formats_that_lose_something_are_refused(tmp_path: Path) -> None:
    for name, reason in (("x.db", "loses rows"), ("x.trc", "neither CAN FD"), ("x.mf4", "only at its end")):
        with pytest.raises(InputError, match=reason):
            Recorder(tmp_path / name, MicrosecondClock())
    with pytest.raises(InputError, match=r"expected one of .blf, .asc, .log, got '.txt'$"):
        Recorder(tmp_path / "x.txt", MicrosecondClock())


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    (tmp_path / "run.blf").write_bytes(b"precious")
    with pytest.raises(InputError, match="is there already"):
        Recorder(tmp_path / "run.blf", MicrosecondClock())
    assert (tmp_path / "run.blf").read_bytes() == b"precious"


def test_a_disk_that_fails_ends_the_recording_and_not_the_bridge(tmp_path: Path) -> None:
    """The file is closed under the recorder's hands, which fails its next write as a full disk does."""
    clock = MicrosecondClock()
    recorder = Recorder(tmp_path / "run.log", clock)
    recorder._log._file.close()
    recorder.queue.put(Frame(identifier=1, data=bytes(8), time=clock()), True)
    recorder._thread.join(60.0)
    assert "closed file" in recorder.failure
    recorder.queue.put(Frame(identifier=1, data=bytes(8), time=clock()), True)
    assert (recorder.recorded, recorder.lost) == (0, 2)
    recorder.close()


DISK_FULL = """
import resource, sys
from pathlib import Path
from bus_run import live_run
from strainfmu.cli.commands.can_bus import summary_rows
from strainfmu.can.recording import Recorder

described = Recorder.describe

def describe(self, *given, **named):
    described(self, *given, **named)
    # Neither a piece of the log nor the description can be written from now on.
    resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[3]), resource.RLIM_INFINITY))

Recorder.describe = describe
run = live_run(Path(sys.argv[1]), "full", 60, record=Path(sys.argv[2]))
for row in summary_rows(run.summary):
    print(*row, sep=": ")
print(*run.notes, sep="\\n")
"""


@pytest.mark.parametrize(("suffix", "limit"), [(".blf", 600), pytest.param(".asc", 6000, marks=pytest.mark.slow)])
def test_a_full_disk_keeps_summary_account_and_what_is_whole(
    synthetic: SyntheticFiles, tmp_path: Path, suffix: str, limit: int
) -> None:
    path = tmp_path / f"run{suffix}"
    command = [sys.executable, "-c", DISK_FULL, str(synthetic.estimator_1), str(path), str(limit)]
    support = Path(__file__).parents[2] / "support"
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(support), *sys.path])}
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False, env=environment)
    assert done.returncode == 0, done.stderr
    assert "recording ended early: File too large" in done.stdout
    assert "frames: not accounted for: 0\n" in done.stdout
    valid = re.search(r"results VALID: (\d+)", done.stdout)
    assert valid is not None
    assert int(valid[1]) >= 40
    found, state = read(path, load_description(path)["log_start"])
    assert state.ends_early == "", "cut behind its last whole piece"
    counts = re.search(r"(\d+) frames recorded, (\d+) lost", done.stdout)
    assert counts is not None
    assert len(found) == int(counts[1])
    assert int(counts[2]) > 100


def test_a_run_is_described_beside_its_log(synthetic: SyntheticFiles, tmp_path: Path) -> None:
    path = tmp_path / "run.blf"
    run = live_run(synthetic.estimator_1, "rec1", 20, record=path)
    described = load_description(path)
    assert described is not None
    assert described["options"].profile == "fd64"
    assert described["options"].cycle_time == 0.01
    assert described["end"] >= described["start"]
    frames, _ = read(path)
    received = [frame for frame, is_received in frames if is_received]
    assert len(received) == run.summary.account.received
    assert len(frames) - len(received) == run.summary.sent
    assert run.notes == [f"{path}: {len(frames)} frames recorded, 0 lost"]
    sidecar(path).write_text(json.dumps({"version": 9}))
    with pytest.raises(InputError, match="expected version 1, got 9"):
        load_description(path)
