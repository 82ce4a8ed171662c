"""The recorder of a bus: BLF, ASC or candump's log, written by a thread of its own, on disk within a second.

Beside the log lies LOG.json, with which a replay repeats the run.
"""

from __future__ import annotations

import hashlib
import io
import json
import struct
import threading
import time
from bisect import bisect_left, bisect_right
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from time import monotonic_ns
from typing import Any

from strainfmu.can.frame import FD_LENGTHS, Frame, error_line, import_can, to_message
from strainfmu.can.log_description import SIDECAR_VERSION, plain_options, sidecar
from strainfmu.can.options import BridgeOptions
from strainfmu.errors import InputError, StrainfmuError
from strainfmu.files import write_bytes_atomically

_FD_OBJECT = struct.Struct("<4sHHLLLHHQHBBLLBBB5x64s")
"""A CAN FD frame in BLF: signature, length of header, version, length, kind; unit of the time, 0, 0, time [ns];
channel, direction, code of the length, identifier, 0, 0, format, length, data."""


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

    def add(self, frame: Frame, is_received: bool) -> None:
        """Take in a frame for the next flush.

        Raises
        ------
        struct.error, ValueError, TypeError, OverflowError
            The format cannot hold it.
        """
        if self._is_blf and frame.is_fd and not (frame.is_error or frame.is_remote):
            self._add_fd(frame, is_received)
            return
        message = to_message(frame)
        message.timestamp, message.is_rx = frame.time, is_received
        self._writer.on_message_received(message)

    def _add_fd(self, frame: Frame, is_received: bool) -> None:
        """Take in a CAN FD frame for BLF: the bytes of python-can's writer, in a third of its time."""
        writer, data, size = self._writer, frame.data, _FD_OBJECT.size
        length, since = bisect_left(FD_LENGTHS, len(data)), int(1e9 * (frame.time - writer.start_timestamp))
        head = b"LOBJ", 32, 1, size, 100, 2, 0, 0, max(since, 0), 1, not is_received, length
        content = _FD_OBJECT.pack(*head, frame.key, 0, 0, 3 if frame.bitrate_switch else 1, len(data), data)
        writer._buffer.append(content)
        writer._buffer_size += size
        writer.object_count += 1
        writer.stop_timestamp = frame.time
        if writer._buffer_size >= writer.max_container_size:
            writer._flush()

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

AT_A_TIME = 50
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
    """Writes frames to a log until it is closed; neither a slow disk nor a full one holds up the bridge.

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
        self.recorded = self.lost = 0
        self.failure = ""
        self._unflushed = 0
        self._waiting: deque[tuple[Frame, bool]] = deque()
        self._room = WAITING_FRAMES  # 0 after a failure
        self._held: list[tuple[Frame, bool]] = []
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

    def sent(self, frame: Frame) -> None:
        """Record a frame that was sent at its time."""
        self.received(frame, False)

    def received(self, frame: Frame, is_received: bool = True) -> None:
        """Record a frame that was received at its time."""
        if len(self._waiting) < self._room:
            self._waiting.append((frame, is_received))
        else:
            self.lost += 1

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
            self._room = 0
            self.failure = " ".join(str(getattr(error, "strerror", None) or error).split()) or type(error).__name__
            self._log.give_up()
            self.lost += len(self._waiting) + len(self._held) + self._unflushed
            self.recorded -= self._unflushed
            self._waiting.clear()
            self._held.clear()

    def _drain(self, held_back: float) -> None:
        """Write the waiting frames in the order of their times, but for frames of the last ``held_back`` [s]."""
        self._held += [self._waiting.popleft() for _ in range(len(self._waiting))]
        self._held.sort(key=_time_of)
        end = len(self._held)
        if held_back and end:
            end = bisect_right(self._held, self._held[-1][0].time - held_back, key=_time_of)
        ready, self._held = self._held[:end], self._held[end:]
        self._unflushed = 0
        for number, (frame, is_received) in enumerate(ready):
            try:
                self._log.add(frame, is_received)
            except (struct.error, ValueError, TypeError, OverflowError):  # the format cannot hold this frame
                self.lost += 1
            else:
                self.recorded += 1
                self._unflushed += 1
            if number % AT_A_TIME == 0:
                time.sleep(0.0)
        self._log.flush()
        self._unflushed = 0

    def _write_sidecar(self) -> None:
        write_bytes_atomically(sidecar(self.path), json.dumps(self._description, indent=1).encode())


def _time_of(entry: tuple[Frame, bool]) -> float:
    return entry[0].time


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
