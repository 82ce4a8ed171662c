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
import zlib
from abc import ABC, abstractmethod
from bisect import bisect_right
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from time import monotonic_ns
from typing import Any

from strainfmu.can.frame import EXTENDED_FLAG, FD_LENGTHS, Frame, error_line, import_can, to_message
from strainfmu.can.log_description import SIDECAR_VERSION, plain_options, sidecar
from strainfmu.can.options import BridgeOptions
from strainfmu.errors import InputError, StrainfmuError
from strainfmu.files import write_bytes_atomically


class LogFile(ABC):
    """A log that is written in pieces; a piece that cannot be written whole is not written at all.

    Raises
    ------
    OSError
        The file exists already, or cannot be written; so do all methods on a disk that fails.
    """

    def __init__(self, path: Path) -> None:
        self._file = path.open("xb", buffering=0)
        self._whole = 0

    @abstractmethod
    def add(self, frame: Frame, is_received: bool) -> None:
        """Take in a frame for the next flush.

        Raises
        ------
        struct.error, ValueError, TypeError, OverflowError
            The format cannot hold it.
        """

    @abstractmethod
    def flush(self) -> None:
        """Pass everything to the operating system, which keeps it even if this process is killed."""

    @abstractmethod
    def close(self) -> None:
        """Write the end and close the file."""

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
        left = memoryview(content)
        while left:
            left = left[self._file.write(left) :]
        self._whole += len(content)


def open_log(path: Path, start: float) -> LogFile:
    """Return a new log of the kind of the suffix of ``path``; its header says ``start`` [s since 1970]."""
    return _BlfFile(path, start) if path.suffix.lower() == ".blf" else _TextFile(path, start)


# --- text -----------------------------------------------------------------------------------------------------


class _Lines(io.StringIO):
    """Text that a writer of python-can writes into; it survives the writer's end."""

    def close(self) -> None:
        return

    def taken(self) -> bytes:
        """Return what has been written since the last call."""
        text = self.getvalue()
        self.seek(0)
        self.truncate()
        return text.encode()


class _TextFile(LogFile):
    """ASC or candump's log, by python-can's own writers."""

    def __init__(self, path: Path, start: float) -> None:
        super().__init__(path)
        import_can()
        from can.io import ASCWriter, CanutilsLogWriter

        self._lines = _Lines(newline="\n")
        is_asc = path.suffix.lower() == ".asc"
        kind: Any = ASCWriter if is_asc else CanutilsLogWriter
        self._writer = kind(self._lines)
        if is_asc:
            self._writer.log_event("strainfmu bridge", start)
        self.flush()

    def add(self, frame: Frame, is_received: bool) -> None:
        message = to_message(frame)
        message.timestamp, message.is_rx = frame.time, is_received
        self._writer.on_message_received(message)

    def flush(self) -> None:
        self._append(self._lines.taken())

    def close(self) -> None:
        self._writer.stop()
        self.flush()
        self._file.close()


# --- BLF ------------------------------------------------------------------------------------------------------

_FILE_HEADER = struct.Struct("<4sLBBBBBBBBQQLL8H8H")
_FILE_HEADER_SIZE = 144
_CONTAINER = struct.Struct("<4sHHLLH6xL4x")
_OBJECT_HEADER = struct.Struct("<4sHHLLLHH")
"""What is ahead of the time in an object, the same in all of a kind."""
_MESSAGE = struct.Struct("<QHBBL8s")
_MESSAGE_FD = struct.Struct("<QHBBLLBBB5x64s")
_ERROR = struct.Struct("<QHHLBBBxLLH2x8s")
_CONTAINER_KIND = 10
_APPLICATION = 5
_NANOSECONDS, _DEFLATED = 2, 2
_SENT, _REMOTE = 0x01, 0x80
_FD, _BITRATE_SWITCH = 0x1, 0x2
_CHANNEL = 1
_LARGEST_CONTAINER = 128 * 1024
_LENGTH_CODES = {length: code for code, length in enumerate(FD_LENGTHS)}


class _BlfFile(LogFile):
    """Vector's binary log; every flush ends a container and brings the header up to date."""

    def __init__(self, path: Path, start: float) -> None:
        super().__init__(path)
        self._start = self._last = start
        self._start_microseconds = round(1e6 * start)
        self._objects: list[bytes] = []
        self._n_objects, self._plain_size = 0, _FILE_HEADER_SIZE
        self._append(self._header())

    def add(self, frame: Frame, is_received: bool) -> None:
        time = max(round(1e6 * frame.time) - self._start_microseconds, 0) * 1000
        data, length = frame.data, len(frame.data)
        word = frame.identifier | EXTENDED_FLAG if frame.is_extended else frame.identifier
        flags = (_REMOTE if frame.is_remote else 0) | (0 if is_received else _SENT)
        if frame.is_error:
            of_error = _ERROR.pack(time, _CHANNEL, 0, 0, 0, 0, _length_code(length), 0, word, 0, data)
            self._objects.append(_ERROR_HEAD + of_error)
        elif frame.is_fd:
            fd = _FD | _BITRATE_SWITCH if frame.bitrate_switch else _FD
            code = _length_code(length)
            of_message = _MESSAGE_FD.pack(time, _CHANNEL, flags, code, word, 0, 0, fd, length, data)
            self._objects.append(_MESSAGE_FD_HEAD + of_message)
        else:
            self._objects.append(_MESSAGE_HEAD + _MESSAGE.pack(time, _CHANNEL, flags, length, word, data))
        self._last = frame.time

    def flush(self) -> None:
        if not self._objects:
            return
        containers, n_objects = [], len(self._objects)
        plain_size = self._plain_size
        for plain in _joined(self._objects, _LARGEST_CONTAINER):
            packed = zlib.compress(plain, 1)
            size = _CONTAINER.size + len(packed)
            head = (b"LOBJ", 16, 1, size, _CONTAINER_KIND, _DEFLATED, len(plain))
            # Padding as python-can writes and reads it.
            containers.append(_CONTAINER.pack(*head) + packed + bytes(size % 4))
            plain_size += _CONTAINER.size + len(plain)
        # One write, so that a kill leaves a container whole or absent.
        self._append(b"".join(containers))
        self._objects = []
        self._n_objects, self._plain_size = self._n_objects + n_objects, plain_size
        self._file.seek(0)
        self._file.write(self._header())

    def close(self) -> None:
        self.flush()
        self._file.close()

    def _header(self) -> bytes:
        version = (_APPLICATION, 0, 0, 0, 2, 6, 8, 1)
        size = max(self._whole, _FILE_HEADER_SIZE)
        counts = (size, self._plain_size, self._n_objects, 0)
        times = (*_system_time(self._start), *_system_time(self._last))
        return _FILE_HEADER.pack(b"LOGG", _FILE_HEADER_SIZE, *version, *counts, *times).ljust(
            _FILE_HEADER_SIZE, b"\0"
        )


def _object_head(kind: struct.Struct, number: int) -> bytes:
    """Return what is ahead of the time [ns] from the start of the log in an object of the kind ``number``."""
    to_time = _OBJECT_HEADER.size
    return _OBJECT_HEADER.pack(b"LOBJ", to_time + _TIME_SIZE, 1, to_time + kind.size, number, _NANOSECONDS, 0, 0)


_TIME_SIZE = 8
_MESSAGE_HEAD = _object_head(_MESSAGE, 1)
_ERROR_HEAD = _object_head(_ERROR, 73)
_MESSAGE_FD_HEAD = _object_head(_MESSAGE_FD, 100)


def _length_code(length: int) -> int:
    """Return the data length code of so many bytes; of a number that no frame has, the code of the next one."""
    code = _LENGTH_CODES.get(length)
    return next(c for c, own in enumerate(FD_LENGTHS) if own >= length) if code is None else code


def _joined(objects: list[bytes], largest: int) -> list[bytes]:
    """Return ``objects`` joined to pieces of at most ``largest`` bytes."""
    pieces: list[list[bytes]] = [[]]
    size = 0
    for one in objects:
        if size + len(one) > largest:
            pieces.append([])
            size = 0
        pieces[-1].append(one)
        size += len(one)
    return [b"".join(piece) for piece in pieces]


def _system_time(time: float) -> tuple[int, ...]:
    """Return the eight numbers of Windows' SYSTEMTIME of ``time`` [s since 1970], zeros of one that is none."""
    if time < 631152000:  # 1990: not a time of day
        return (0,) * 8
    t = datetime.fromtimestamp(round(time, 3), tz=UTC)
    return t.year, t.month, t.isoweekday() % 7, t.day, t.hour, t.minute, t.second, t.microsecond // 1000


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
            self._log = open_log(path, clock.start)
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

    def received(self, frame: Frame) -> None:
        """Record a frame that was received at its time."""
        self._wait(frame, True)

    def sent(self, frame: Frame) -> None:
        """Record a frame that was sent at its time."""
        self._wait(frame, False)

    def _wait(self, frame: Frame, is_received: bool) -> None:
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
