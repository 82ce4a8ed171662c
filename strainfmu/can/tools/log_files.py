"""Log files being written: BLF, ASC and candump's log, whole after every flush, and after a failure too.

BLF is written here and not by python-can, whose writer takes longer for a frame than the bridge takes for a cycle,
cannot end a container early and leaves half of one behind on a full disk. Source of the format: python-can's
``can.io.blf``, which reads these files.
"""

from __future__ import annotations

import io
import struct
import zlib
from abc import ABC, abstractmethod
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from strainfmu.can.wire.frame import EXTENDED_FLAG, FD_LENGTHS, Frame, to_message
from strainfmu.can.wire.libraries import import_can


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
