"""Frames that wait for the recorder in compiled memory, where the machine puts them without an object for each."""

import ctypes
import struct
from typing import Any

import numpy as np

from strainfmu.can.frame import EXTENDED_FLAG, Frame
from strainfmu.can.signals import LOGGED, QUEUE, functions, pointer

HEAD = struct.Struct("=dIBBBB")
"""``SbLogged`` without data: time [s], key, bytes, flags, whether it was received, verdict."""

IS_FD, IS_FAST, IS_ERROR, IS_REMOTE = 1, 2, 4, 8
"""Flags of a frame."""

_SIZE, _ROOM, _PUT, _TAKEN, _LOST = range(1, 6)


class FrameQueue:
    """Takes in frames of one thread, and gives them to another.

    Parameters
    ----------
    size : largest number of frames that wait; further ones are counted as lost.

    Attributes
    ----------
    record : ``SbQueue``.
    """

    def __init__(self, size: int) -> None:
        self._frames, self.record = np.zeros(size, dtype=LOGGED), np.zeros(1, dtype=QUEUE)
        self.record["frame"], self.record["size"] = self._frames.ctypes.data, size
        self._numbers = self.record.view(np.int64).data
        self._numbers[_ROOM] = size
        self._head = ctypes.create_string_buffer(LOGGED.itemsize)
        self._at, self._log = (pointer(self.record), ctypes.byref(self._head)), functions().sb_log

    def __len__(self) -> int:
        return self._numbers[_PUT] - self._numbers[_TAKEN]

    @property
    def lost(self) -> int:
        """Number of frames for which there was no room, or that no log can hold."""
        return self._numbers[_LOST]

    def put(self, frame: Frame, is_received: bool) -> None:
        """Take in a frame."""
        try:
            head = frame.time, frame.key, len(frame.data), flags_of(frame), is_received, 0
            HEAD.pack_into(self._head, 0, *head)
        except (struct.error, TypeError):  # no log can hold this frame
            self._numbers[_LOST] += 1
        else:
            self._log(*self._at, frame.data)

    def take(self) -> np.ndarray:
        """Return the ``LOGGED`` frames that wait, in the order in which they came; they wait no more."""
        numbers = self._numbers
        first, end = numbers[_TAKEN], numbers[_PUT]
        taken = self._frames.take(np.arange(first, end), mode="wrap")
        numbers[_TAKEN] = end
        return taken

    def close(self) -> None:
        """Count what waits, and what comes, as lost."""
        self._numbers[_ROOM] = 0
        self._numbers[_LOST] += len(self.take())


def flags_of(frame: Frame) -> int:
    """Return the flags of a frame."""
    flags = IS_FD if frame.is_fd else 0
    flags |= IS_FAST if frame.bitrate_switch else 0
    return flags | (IS_ERROR if frame.is_error else 0) | (IS_REMOTE if frame.is_remote else 0)


def frame_in(row: Any) -> Frame:
    """Return the frame of one ``LOGGED`` row."""
    key, flags = int(row["key"]), int(row["flags"])
    return Frame(
        identifier=key & ~EXTENDED_FLAG,
        data=row["data"][: row["n"]].tobytes(),
        time=float(row["time"]),
        is_extended=bool(key & EXTENDED_FLAG),
        is_fd=bool(flags & IS_FD),
        bitrate_switch=bool(flags & IS_FAST),
        is_error=bool(flags & IS_ERROR),
        is_remote=bool(flags & IS_REMOTE),
    )
