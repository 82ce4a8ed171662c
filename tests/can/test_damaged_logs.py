"""Logs that are damaged, foreign, or have long gaps: each ends soon, in one line, with few rows."""

import os
import re
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import can
import numpy as np
import pytest
from bus_run import CYCLE, flight
from can_case import OWN
from fault_injection import FaultySender
from mutations import ends_in_one_line, limited, mutated
from recorded_case import NAMES, read_csv
from synthetic_vehicle import SyntheticFiles

from strainfmu.can.dbc_files import database_of
from strainfmu.can.frame import to_message
from strainfmu.can.profiles import Identifiers, profile_layout
from strainfmu.can.quality import Cause, Quality
from strainfmu.errors import InputError
from strainfmu.first_look import limited_memory, read_apart, reads_well

Run = Callable[..., tuple[int, str, str]]

START = 1_700_000_000.0


def write_log(
    path: Path, n_cycles: int = 40, gaps: dict[int, float] | None = None, identifier: int = 0x300
) -> Path:
    """Write a flight as fd64 in an uncompressed BLF; ahead of the cycles in ``gaps`` these seconds are missing."""
    layout = profile_layout("fd64", NAMES, cycle_time=CYCLE, identifiers=Identifiers(identifier))
    sender, late = FaultySender(layout, [], OWN), 0.0
    with can.BLFWriter(str(path), compression_level=0) as log:
        for k, sample in enumerate(flight(n_cycles)):
            late += (gaps or {}).get(k, 0.0)
            for frame in sender.cycle(k, k * CYCLE + late, sample.strain, sample.dynamic_pressure):
                message = to_message(frame)
                message.timestamp = START + frame.time
                log.on_message_received(message)
    return path


def replayed(run: Run, log: Path, fmu: Path) -> tuple[int, str, dict[str, np.ndarray]]:
    """Return exit code, all that is printed, and the columns of the estimates of a log."""
    out = log.with_suffix(".csv")
    code, printed, errors = run(
        "replay", log, fmu, "-o", out, "--profile", "fd64", "--set", f"input.cycle_time_ms={1e3 * CYCLE:g}"
    )
    return code, printed + errors, read_csv(out)


@pytest.mark.parametrize("hours", [1, 24])
def test_a_long_gap_is_one_row_with_its_length(
    hours: int, synthetic: SyntheticFiles, tmp_path: Path, run: Run
) -> None:
    """The bridge would say every cycle that nothing came: 360,000 times in an hour."""
    log = write_log(tmp_path / "run.blf", 80, gaps={40: 3600.0 * hours})
    code, printed, found = replayed(run, log, synthetic.map_1)
    assert code == 0
    time, usable, gap = found["time [s]"], np.isfinite(found["C_N [1]"]), found["gap [s]"]
    assert len(time) <= 81
    assert gap[np.isfinite(gap)] == pytest.approx([3600.0 * hours + CYCLE], abs=2e-3)
    row = int(np.flatnonzero(np.isfinite(gap))[0])
    assert found["quality [1]"][row] == Quality.INVALID
    assert int(found["causes [1]"][row]) & Cause.SILENT
    assert time[-1] - time[0] == pytest.approx(3600.0 * hours + 80 * CYCLE, abs=3 * CYCLE)
    assert usable[:39].sum() > 30
    assert usable[-20:].all()
    assert not usable[row]
    assert f"{log}: 1 gaps without a frame, the longest of {3600.0 * hours + CYCLE:.6g} s, 0.39" in printed


def test_a_shorter_silence_is_answered_every_cycle(synthetic: SyntheticFiles, tmp_path: Path, run: Run) -> None:
    """As by a live bridge, which a replay repeats bit by bit."""
    log = write_log(tmp_path / "run.blf", 80, gaps={40: 500 * CYCLE})
    code, printed, found = replayed(run, log, synthetic.map_1)
    assert code == 0
    assert 570 < len(found["time [s]"]) < 590
    assert "gaps" not in printed


def test_a_foreign_log_ends_with_exit_code_1(synthetic: SyntheticFiles, tmp_path: Path, run: Run) -> None:
    log = write_log(tmp_path / "run.blf", 30, identifier=0x500)
    for command in ("estimate", "replay"):
        arguments = (synthetic.map_1, log) if command == "estimate" else (log, synthetic.map_1)
        code, _, errors = run(command, *arguments, "-o", tmp_path / "o.csv")
        assert code == 1
        assert errors.startswith(f"strainfmu: {log}: none of ")
        assert "results has coefficients, 0 of " in errors
        assert errors.count("\n") == 1


@pytest.mark.parametrize(
    ("name", "content"), [("run.blf", b"no log" * 99), ("run.log", b"(x) can0 1#0\n")], ids=["blf", "log"]
)
def test_a_file_without_a_whole_frame_is_no_log(
    name: str, content: bytes, synthetic: SyntheticFiles, tmp_path: Path, run: Run
) -> None:
    log = tmp_path / name
    log.write_bytes(content)
    code, _, errors = run("replay", log, synthetic.map_1, "-o", tmp_path / "o.csv")
    assert (code, errors) == (2, f"strainfmu: {log}: damaged, or no log of this format\n")


def test_an_object_without_a_size_ends_the_log(synthetic: SyntheticFiles, tmp_path: Path, run: Run) -> None:
    """Of an unknown version besides: python-can would read it for ever."""
    log = write_log(tmp_path / "run.blf", 40)
    content = bytearray(log.read_bytes())
    place = content.index(b"LOBJ", len(content) // 2)
    content[place + 6 : place + 12] = b"\x07\x00\x00\x00\x00\x00"  # header version, size of the object
    log.write_bytes(content)
    assert ends_in_one_line(run, "replay", log, synthetic.map_1, "-o", tmp_path / "o.csv") == 0
    assert np.isfinite(read_csv(tmp_path / "o.csv")["C_N [1]"]).sum() > 10


@pytest.mark.parametrize("stamp", ["9.45e90", "1e11"])
def test_a_time_stamp_that_is_none_ends_the_log(
    stamp: str, synthetic: SyntheticFiles, tmp_path: Path, run: Run
) -> None:
    """A cycle more is no later than such a time: a replay would never reach it."""
    log = tmp_path / "run.log"
    with can.BLFReader(str(write_log(tmp_path / "run.blf", 40))) as sound, can.CanutilsLogWriter(str(log)) as text:
        for message in sound:
            text.on_message_received(message)
    lines = log.read_text().splitlines()
    lines[60] = re.sub(r"\([\d.]+\)", f"({stamp})", lines[60])
    log.write_text("\n".join(lines) + "\n")
    code, printed, columns = replayed(run, log, synthetic.map_1)
    assert (code, "after 60 whole ones" in " ".join(printed.split())) == (0, True)
    assert 0 < len(columns["C_N [1]"]) < 50


HUNG = (7, 9, 13, 23, 29, 60, 62, 75, 76, 84, 91, 92)
"""Seeds of damages by which a log was replayed for hours: most are in the time of a frame."""


@pytest.mark.parametrize("seed", HUNG)
def test_a_damaged_log_ends_soon(seed: int, synthetic: SyntheticFiles, tmp_path: Path, run: Run) -> None:
    check_damaged(seed, synthetic, tmp_path, run)


@pytest.mark.slow
def test_damaged_logs_end_soon(synthetic: SyntheticFiles, tmp_path: Path, run: Run) -> None:
    for seed in range(400):
        check_damaged(seed, synthetic, tmp_path, run)


def check_damaged(seed: int, synthetic: SyntheticFiles, folder: Path, run: Run) -> None:
    """Replay a log with the damages of ``seed``: one line at most, rows of its cycles and some of silence."""
    log = write_log(folder / "run.blf", 40)
    log.write_bytes(mutated(log.read_bytes(), seed))
    out = folder / "o.csv"
    out.unlink(missing_ok=True)
    code = ends_in_one_line(
        run,
        "replay",
        log,
        synthetic.map_1,
        "-o",
        out,
        "--profile",
        "fd64",
        "--set",
        f"input.cycle_time_ms={1e3 * CYCLE:g}",
    )
    assert out.exists() == (code < 2)
    if out.exists():
        assert len(out.read_text().splitlines()) < 3000


def test_a_file_that_ends_its_reader_is_damaged(tmp_path: Path) -> None:
    """A crash, a loop or a full memory of the parser stays in the child process that looks first."""
    path = tmp_path / "file"
    path.write_bytes(b"x")
    assert reads_well(path, lambda: None)
    assert not reads_well(path, lambda: os.kill(os.getpid(), signal.SIGKILL))
    assert not reads_well(path, lambda: [None for _ in iter(int, 1)], patience=0.3)
    assert not reads_well(path, lambda: bytearray(3 << 30))
    assert not reads_well(path, lambda: path.joinpath("none").read_bytes())


def test_a_file_whose_reader_gets_no_processor_time_is_not_damaged(tmp_path: Path) -> None:
    """As on a busy host; the limit is one of processor time."""
    path = tmp_path / "file"
    path.write_bytes(b"x")
    assert reads_well(path, lambda: time.sleep(0.5), patience=0.1)
    assert list(read_apart(path, lambda: [time.sleep(0.5)], patience=0.1)) == [None]


def test_memory_is_limited_behind_a_first_look_too(tmp_path: Path) -> None:
    """As a parser that goes on without what it was refused would be given it then."""
    path = tmp_path / "file"
    path.write_bytes(b"x")
    with limited_memory(path), pytest.raises(MemoryError):
        np.empty(3 << 30, np.uint8)
    assert np.empty(3 << 29, np.uint8).nbytes == 3 << 29


def test_items_come_from_a_process_apart_until_it_fails(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"x")
    assert list(read_apart(path, lambda: range(1000))) == list(range(1000))

    def crashing() -> Iterator[int]:
        yield from range(600)
        os.kill(os.getpid(), signal.SIGKILL)

    got = []
    with pytest.raises(ValueError, match="did not reach the end"):
        got.extend(read_apart(path, crashing))
    assert got == list(range(512)), "whole batches"
    with pytest.raises(ValueError, match="did not reach the end"):
        list(read_apart(path, lambda: (item for item in iter(int, 1) if item), patience=0.3))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("R: 8 A", "R: 65536 A", "message R: expected at most 1,785 bytes, got 65536"),
        ("0|16@1-", "0|4294967296@1-", "signal S: expected at most 14,280 bits, got 4294967296"),
        ("0|16@1-", "99999999|16@1-", "signal S: expected at most 14,280 bits, got 99999999"),
        ("BU_:", "BU_:" + " A" * 2_600_000, "expected at most 5 MB, got 5.2 MB: keep the messages"),
    ],
)
def test_an_absurd_dbc_file_is_refused_before_it_is_read(old: str, new: str, message: str) -> None:
    """cantools lists every bit: of a signal of 4e9 of them, for ever."""
    text = 'VERSION ""\nBU_: A B\nBO_ 1 R: 8 A\n SG_ S : 0|16@1- (1,0) [0|0] "um/m" B\n'
    assert database_of(text, "a.dbc").messages[0].length == 8
    with limited(), pytest.raises(InputError, match=f"^a.dbc: {message}"):
        database_of(text.replace(old, new), "a.dbc")
