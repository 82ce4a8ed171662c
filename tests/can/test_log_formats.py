"""Logs of other recorders: every format, packed too, times by their header, channels with the same identifiers."""

import gzip
import itertools
from pathlib import Path

import can
import pytest

from strainfmu.can.frame import Frame
from strainfmu.can.log_frames import LogState, is_bus_log, log_frames
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast

HEADER = "date Tue May 04 09:00:00.000 am 2021\nbase hex  timestamps {}\ninternal events logged\n"
EVENTS = (
    "Start of measurement",
    "1  200             Rx   d 2 16 00",
    "1  Statistic: D 1 R 0 XD 0 XR 0 E 0 O 0 B 0.05%",
    "1  201             Rx   d 2 4C 00",
    "CANFD   1 Rx 300 0 0 2 2 00 01",
    "1  200             Rx   d 2 27 00",
)
TIMES = (0.0, 0.0001, 0.0051, 0.0103, 0.0105, 3600.02)


def frames(path: Path, kind: str, times: tuple[float, ...]) -> list[tuple[int, bytes, float]]:
    lines = [f"   {time:.6f} {event}\n" for time, event in zip(times, EVENTS, strict=True)]
    path.write_text(HEADER.format(kind) + "".join(lines), encoding="utf-8")
    return [(frame.identifier, frame.data, frame.time) for frame, _ in log_frames(path, 0.0, LogState())]


def test_relative_times_add_up_over_all_events(tmp_path: Path) -> None:
    steps = (TIMES[0], *(round(now - before, 6) for before, now in itertools.pairwise(TIMES)))
    absolute = frames(tmp_path / "a.asc", "absolute", TIMES)
    assert [time for _, _, time in absolute] == [0.0001, 0.0103, 0.0105, 3600.02]
    assert frames(tmp_path / "r.asc", "relative", steps) == absolute


def messages(fd: bool = False) -> list[can.Message]:
    """Return a frame of each kind, of two channels."""
    made = [
        can.Message(arbitration_id=0x200 + k, data=bytes([k] * 8), is_extended_id=k == 3, channel=k % 2)
        for k in range(5)
    ]
    made.append(can.Message(arbitration_id=0x123, dlc=4, is_remote_frame=True, is_extended_id=False, channel=0))
    if fd:
        made.append(can.Message(arbitration_id=0x300, data=bytes(range(48)), is_fd=True, is_extended_id=False))
    for k, message in enumerate(made):
        message.timestamp = 1_700_000_000.0 + 0.01 * k
    return made


def written(path: Path, fd: bool) -> list[Frame]:
    """Write a log by python-can, pack it if it is to be, and return the frames that are read of it."""
    plain = path.with_suffix("") if path.suffix == ".gz" else path
    with can.Logger(plain) as logger:
        for message in messages(fd):
            logger(message)
    if plain != path:
        path.write_bytes(gzip.compress(plain.read_bytes()))
    assert is_bus_log(path)
    return [frame for frame, _ in log_frames(path, 1_700_000_000.0, LogState())]


@pytest.mark.parametrize("name", ["a.asc", "a.blf", "a.log", "a.csv", "a.trc", "a.mf4", "a.asc.gz", "a.log.gz"])
def test_every_format_gives_the_same_frames(tmp_path: Path, name: str) -> None:
    kind = name.removesuffix(".gz")[1:]
    if kind == ".mf4":
        pytest.importorskip("asammdf")
    fd = kind in (".asc", ".blf", ".log", ".mf4")
    found = written(tmp_path / name, fd)
    expected = [one for one in messages(fd) if kind != ".trc" or not one.is_remote_frame]
    found = [one for one in found if kind != ".trc" or not one.is_remote]
    assert [(one.identifier, one.is_extended, one.data, one.is_fd) for one in found] == [
        (one.arbitration_id, one.is_extended_id, bytes(one.data), one.is_fd) for one in expected
    ]
    steps = [b.time - a.time for a, b in itertools.pairwise(found)]
    assert steps == pytest.approx([b.timestamp - a.timestamp for a, b in itertools.pairwise(expected)], abs=1.1e-3)


def test_a_log_of_candump_without_its_log_format(tmp_path: Path) -> None:
    log = tmp_path / "plain.log"
    log.write_text(
        " (1579884792.000000)  can0  200   [8]  16 00 27 00 32 00 36 00\n"
        " (1579884792.000100)  can0  201   [12]  4C 00 74 00 9B 00 D1 00 00 00 00 01\n"
        " (1579884792.000200)  can0  00000203   [2]  01 02\n"
        " (1579884792.000300)  can0  TX B -  204   [0]  remote request\n"
    )
    found = list(log_frames(log, 0.0, LogState()))
    assert [
        (f.identifier, len(f.data), f.is_fd, f.is_extended, f.is_remote, received) for f, received in found
    ] == [
        (0x200, 8, False, False, False, True),
        (0x201, 12, True, False, False, True),
        (0x203, 2, False, True, False, True),
        (0x204, 0, False, False, True, False),
    ]
    assert found[1][0].time - found[0][0].time == pytest.approx(1e-4, abs=1e-6)
    log.write_text("  can0  200   [8]  16 00 27 00 32 00 36 00\n")
    with pytest.raises(
        InputError, match="expected times of the frames, got none: record by candump -L, or with -ta"
    ):
        list(log_frames(log, 0.0, LogState()))


@pytest.mark.parametrize(
    ("name", "channels"), [("a.asc", ("1", "2")), ("a.blf", ("1", "2")), ("a.log", ("can0", "can1"))]
)
def test_a_mirrored_bus_asks_for_a_channel(tmp_path: Path, name: str, channels: tuple[str, str]) -> None:
    """Both channels of a gateway in one log: every frame of the input comes twice."""
    path, twice = tmp_path / name, []
    for message in messages()[:5]:
        twice += [message, can.Message(**{**vars_of(message), "channel": 1 - message.channel})]
    with can.Logger(path) as logger:
        for message in twice:
            logger(message)
    keys = frozenset(frame.key for frame, _ in log_frames(path, 0.0, LogState()))
    with pytest.raises(InputError, match=r"is on channels .* and .*: state one as bus\.log_channel"):
        list(log_frames(path, 0.0, LogState(keys=keys)))
    for channel in channels:
        assert len(list(log_frames(path, 0.0, LogState(channel=channel, keys=keys)))) == 5


def vars_of(message: can.Message) -> dict[str, object]:
    names = ("timestamp", "arbitration_id", "is_extended_id", "data", "dlc", "channel")
    return {name: getattr(message, name) for name in names}


@pytest.mark.parametrize("name", ["a.db", "a.txt", "a.xyz.gz"])
def test_other_files_are_no_logs(tmp_path: Path, name: str) -> None:
    with pytest.raises(
        InputError, match=r"expected one of \.asc, \.blf, \.csv, \.log, \.mf4, \.trc, or one of them"
    ):
        list(log_frames(tmp_path / name, 0.0, LogState()))
    (tmp_path / "data.csv").write_text("time [s],strain[1] [um/m]\n0,1\n")
    assert not is_bus_log(tmp_path / "data.csv")
