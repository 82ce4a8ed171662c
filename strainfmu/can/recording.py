"""The recorder of a bus: BLF, ASC or candump's log, written by a thread of its own, on disk within a second.

Beside the log lies LOG.json, with which a replay repeats the run.
"""

import hashlib
import io
import json
import struct
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from time import monotonic_ns
from typing import Any

import numpy as np

from strainfmu.can.frame import FD_LENGTHS, error_line, import_can, to_message
from strainfmu.can.frame_queue import IS_ERROR, IS_FAST, IS_FD, IS_REMOTE, FrameQueue, frame_in
from strainfmu.can.log_description import SIDECAR_VERSION, plain_options, sidecar
from strainfmu.can.options import BridgeOptions
from strainfmu.errors import InputError, StrainfmuError
from strainfmu.files import write_bytes_atomically

_FD_OBJECT = np.dtype(
    [
        *(("signature", "S4"), ("head", "<u2"), ("version", "<u2"), ("length", "<u4"), ("kind", "<u4")),
        *(("unit", "<u4"), ("client", "<u2"), ("of_object", "<u2"), ("time", "<u8"), ("channel", "<u2")),
        *(("is_sent", "u1"), ("code", "u1"), ("key", "<u4"), ("duration", "<u4"), ("bits", "u1")),
        *(("format", "u1"), ("n", "u1"), ("padding", "V5"), ("data", "u1", 64)),
    ]
)
"""A CAN FD frame in BLF: unit of the time, which is in ns, and code of the length; the rest by its name."""

_FD_CODES = np.searchsorted(FD_LENGTHS, np.arange(FD_LENGTHS[-1] + 1)).astype(np.uint8)


class _Pieces(io.BytesIO):
    """What a writer of python-can has written; it survives the writer's end."""

    def close(self) -> None:
        return

    def taken(self) -> bytes:
        """Return what has been written since the last call."""
        content = self.getvalue()
        self.seek(0)
        self.truncate()
        return content


class LogFile:
    """A log by python-can's writers, in pieces; a piece that cannot be written whole is not written at all.

    Every flush passes a piece to the operating system, which keeps it even if this process is killed, and brings
    the header of BLF up to date.

    Parameters
    ----------
    path : of the new file; its suffix is the kind.
    start : time that its header states [s since 1970].

    Raises
    ------
    OSError
        The file exists already, or cannot be written; so do all methods on a disk that fails.
    """

    def __init__(self, path: Path, start: float) -> None:
        import_can()
        from can.io import ASCWriter, BLFWriter, CanutilsLogWriter

        self._file, self._whole = path.open("xb", buffering=0), 0
        self._pieces, self._is_blf = _Pieces(), path.suffix.lower() == ".blf"
        self._writer: Any
        if self._is_blf:
            self._writer = BLFWriter(self._pieces, compression_level=1)
            self._writer.start_timestamp = self._writer.stop_timestamp = start
        else:
            text: Any = io.TextIOWrapper(self._pieces, encoding="utf-8", newline="\n", write_through=True)
            is_asc = path.suffix.lower() == ".asc"
            self._writer = (ASCWriter if is_asc else CanutilsLogWriter)(text)
            if is_asc:
                self._writer.log_event("strainfmu bridge", start)
        self.flush()

    def add(self, frames: np.ndarray) -> int:
        """Take in ``LOGGED`` frames for the next flush; return how many of them the format cannot hold."""
        if not self._is_blf:
            return self._add_others(frames)
        is_fd, refused = frames["flags"] & (IS_FD | IS_ERROR | IS_REMOTE) == IS_FD, 0
        for run in np.split(np.arange(len(frames)), np.flatnonzero(np.diff(is_fd)) + 1):
            if len(run) and is_fd[run[0]]:
                self._add_fd(frames[run])
            else:
                refused += self._add_others(frames[run])
        return refused

    def _add_others(self, frames: np.ndarray) -> int:
        refused = 0
        for row in frames:
            message = to_message(frame_in(row))
            message.timestamp, message.is_rx = float(row["time"]), bool(row["is_received"])
            try:
                self._writer.on_message_received(message)
            except (struct.error, ValueError, TypeError, OverflowError):
                refused += 1
        return refused

    def _add_fd(self, frames: np.ndarray) -> None:
        """Take in CAN FD frames for BLF: the bytes of python-can's writer, in a tenth of its time."""
        writer, content = self._writer, np.zeros(len(frames), dtype=_FD_OBJECT)
        content["signature"], content["head"], content["version"] = b"LOBJ", 32, 1
        content["length"], content["kind"], content["unit"], content["channel"] = _FD_OBJECT.itemsize, 100, 2, 1
        content["time"] = np.maximum((1e9 * (frames["time"] - writer.start_timestamp)).astype(np.int64), 0)
        content["is_sent"], content["code"] = 1 - frames["is_received"], _FD_CODES[frames["n"]]
        content["format"] = np.where(frames["flags"] & IS_FAST, 3, 1)
        for name in ("key", "n", "data"):
            content[name] = frames[name]
        size, first = _FD_OBJECT.itemsize, 0
        while first < len(content):
            room = max(-(-(writer.max_container_size - writer._buffer_size) // size), 1)
            piece = content[first : first + room].tobytes()
            writer._buffer.append(piece)
            writer._buffer_size += len(piece)
            first += room
            if writer._buffer_size >= writer.max_container_size:
                writer._flush()
        writer.object_count += len(content)
        writer.stop_timestamp = float(frames["time"][-1])

    def flush(self) -> None:
        """Write all that was added."""
        while self._is_blf and self._writer._buffer_size:
            self._writer._flush()
        self._append(self._pieces.taken())
        if self._is_blf:
            self._writer._write_header(self._whole)
            self._file.seek(0)
            self._file.write(self._pieces.taken())

    def close(self) -> None:
        """Write the end and close the file."""
        if not self._is_blf:
            self._writer.stop()
        self.flush()
        self._file.close()

    def give_up(self) -> None:
        """Cut off what was not written whole and close the file, after a failure."""
        if self._file.closed:
            return
        with suppress(OSError):  # what is left of a piece is passed over by readers
            self._file.truncate(self._whole)
        self._file.close()

    def _append(self, content: bytes) -> None:
        """Write ``content`` at the end."""
        self._file.seek(self._whole)
        remaining = memoryview(content)
        while remaining:
            remaining = remaining[self._file.write(remaining) :]
        self._whole += len(content)


LOG_SUFFIXES = (".blf", ".asc", ".log")

FLUSH_PERIOD = 0.25
"""Time between two flushes [s]: a quarter of the time that a killed process may lose."""

WAITING_FRAMES = 200_000
"""Maximum number of frames that wait for the disk; further ones are counted and dropped."""
HELD_BACK = 0.1
"""Time for which frames wait to be put in order [s]: what waited in a socket is older than what was sent."""

AT_A_TIME = 500
"""Frames after which the recorder lets the bridge's thread run: it must not wait for a whole flush."""


class MicrosecondClock:
    """A monotonic clock of whole microseconds, set to the time of day, to the millisecond, at its start.

    All log formats hold such times exactly, so that a replay sees the times that the live run saw.
    """

    def __init__(self) -> None:
        self.start = round(1e3 * time.time()) / 1e3
        # What the time since 1970 is ahead of the monotonic one [ns].
        self._ahead = 1_000_000 * round(1e3 * self.start) - monotonic_ns()

    def __call__(self) -> float:
        """Return the time since 1970 [s], without steps of the system's clock after the start."""
        return (monotonic_ns() + self._ahead) // 1000 / 1e6


def whole_microseconds(timestamp: float) -> float:
    """Return the time [s] that :class:`MicrosecondClock` gave, from the same time read from a log."""
    return round(1e6 * timestamp) / 1e6


class Recorder:
    """Writes the frames of its ``queue`` to a log until it is closed; no slow or full disk holds up the bridge.

    Raises
    ------
    InputError
        The format does not hold all frames of a bus, or the file exists already.
    StrainfmuError
        The file cannot be written, or python-can is not installed.
    """

    def __init__(self, path: Path, clock: MicrosecondClock) -> None:
        check_log(path)
        if path.exists() or sidecar(path).exists():
            raise InputError(f"{path}: is there already; a recording overwrites nothing")
        self.path, self.clock = path, clock
        self.recorded = self._refused = self._unflushed = 0
        self.failure = ""
        self.queue = FrameQueue(WAITING_FRAMES)
        self._held = self.queue.take()
        self._description: dict[str, Any] = {}
        self._stop = threading.Event()
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._log = LogFile(path, clock.start)
        except OSError as error:
            raise StrainfmuError(f"{path}: could not be written: {error.strerror or error}") from error
        self._thread = threading.Thread(target=self._run, name="CAN recorder", daemon=True)
        self._thread.start()

    def describe(
        self, fmu: Path, options: BridgeOptions, start: float, first_result: int, freshness: int | None = None
    ) -> None:
        """Write the description for a replay: FMU, options, start of the machine [s], counter of its first result,
        freshness value then."""
        self._description = {
            "version": SIDECAR_VERSION,
            "fmu": fmu.name,
            "fmu_sha256": hashlib.sha256(fmu.read_bytes()).hexdigest(),
            "options": plain_options(options),
            "log_start": self.clock.start,
            "start": start,
            "first_result": first_result,
            "freshness": freshness,
        }
        self._write_sidecar()

    @property
    def lost(self) -> int:
        """Number of frames that are not recorded."""
        return self._refused + self.queue.lost

    def close(
        self,
        end: float | None = None,
        skips: Sequence[tuple[float, float]] = (),
        unanswered: Sequence[tuple[float, float]] = (),
    ) -> None:
        """Write the waiting frames and close the log; further calls do nothing.

        Parameters
        ----------
        end : time to which the machine was advanced [s].
        skips, unanswered : stalls of the machine, skips of the bridge.
        """
        if self._stop.is_set():
            return
        self._stop.set()
        self._thread.join(60.0)
        if self._description:
            self._description |= {
                "end": end,
                "skips": list(skips),
                "unanswered": list(unanswered),
                "recorded": self.recorded,
                "lost": self.lost,
            }
            try:
                self._write_sidecar()
            except (OSError, StrainfmuError) as error:  # the first one stays, without the end of the run
                self.failure = self.failure or f"description not completed: {error_line(error)}"

    def _run(self) -> None:
        try:
            while not self._stop.wait(FLUSH_PERIOD):
                self._drain(HELD_BACK)
            self._drain(0.0)
            self._log.close()
        except Exception as error:  # a full disk, in most cases; the bridge must go on
            self.failure = " ".join(str(getattr(error, "strerror", None) or error).split()) or type(error).__name__
            self._log.give_up()
            self._refused += len(self._held) + self._unflushed
            self.recorded -= self._unflushed
            self.queue.close()

    def _drain(self, held_back: float) -> None:
        """Write the waiting frames in the order of their times, but for frames of the last ``held_back`` [s]."""
        held = np.concatenate([self._held, self.queue.take()])
        held, end = held[np.argsort(held["time"], kind="stable")], len(held)
        if held_back and end:
            end = int(np.searchsorted(held["time"], held["time"][-1] - held_back, side="right"))
        self._held, self._unflushed = held, 0
        for first in range(0, end, AT_A_TIME):
            ready = held[first : min(first + AT_A_TIME, end)]
            refused = self._log.add(ready)
            self._held = held[first + len(ready) :]
            self._refused += refused
            self.recorded += len(ready) - refused
            self._unflushed += len(ready) - refused
            time.sleep(0.0)
        self._log.flush()
        self._unflushed = 0

    def _write_sidecar(self) -> None:
        write_bytes_atomically(sidecar(self.path), json.dumps(self._description, indent=1).encode())


def check_log(path: Path) -> None:
    """Refuse a log format that loses data.

    Raises
    ------
    InputError
        It is none of LOG_SUFFIXES.
    """
    if path.suffix.lower() in LOG_SUFFIXES:
        return
    reasons = {
        ".db": "python-can loses rows of it on stop",
        ".trc": "it holds neither CAN FD nor error frames",
        ".csv": "it does not distinguish CAN FD frames from others",
        ".mf4": "it is on disk only at its end",
    }
    reason = reasons.get(path.suffix.lower())
    raise InputError(
        f"{path}: expected one of {', '.join(LOG_SUFFIXES)}, got '{path.suffix}'{f'; {reason}' if reason else ''}"
    )
