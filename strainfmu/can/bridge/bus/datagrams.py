"""Datagrams that wait in a socket, with the kernel's times of reception: on Linux all of them by one call."""

from __future__ import annotations

import ctypes
import os
import socket
import struct
import sys
import time
from errno import EAGAIN, EWOULDBLOCK
from math import inf
from typing import Protocol

LARGEST_DATAGRAM = 4096
"""As python-can's own limit [bytes]."""

AT_ONCE = 64
"""Maximum number of datagrams of one call."""

Waited = tuple[bytes, float]
"""A datagram, and how long it has waited since the kernel received it [s]; 0 where that is not known."""

_TIMESPEC = struct.Struct("@ll")
_SO_TIMESTAMPNS = 35
_DONT_WAIT = int(getattr(socket, "MSG_DONTWAIT", 0))
ANCILLARY = socket.CMSG_SPACE(_TIMESPEC.size) if hasattr(socket, "CMSG_SPACE") else 0
"""Room for a time of reception [bytes]; 0 where systems have no such times."""


class Datagrams(Protocol):
    """Reads one socket.

    Attributes
    ----------
    is_stamped : all datagrams of the last reading had a time of the kernel.
    """

    is_stamped: bool

    def read(self, limit: int) -> tuple[list[Waited], bool]:
        """Return up to ``limit`` datagrams that wait, and whether none is left.

        Raises
        ------
        OSError
            The interface is down, or the socket failed.
        """
        ...

    def close(self) -> None:
        """Read no more: the socket is closed next."""
        ...


def waiting_datagrams(source: socket.socket) -> Datagrams:
    """Return what reads ``source``."""
    can_take_all = sys.platform == "linux" and ctypes.sizeof(ctypes.c_void_p) == _WORD
    return AllAtOnce(source) if can_take_all else OneByOne(source)


class OneByOne:
    """Reads a socket by a call for each datagram, and one in vain."""

    def __init__(self, source: socket.socket) -> None:
        self._socket = source
        self.is_stamped = False

    def read(self, limit: int) -> tuple[list[Waited], bool]:
        """Return as :meth:`Datagrams.read`."""
        found: list[tuple[bytes, float]] = []
        is_drained = False
        while len(found) < limit:
            try:
                data, ancillary, _, _ = self._socket.recvmsg(LARGEST_DATAGRAM, ANCILLARY, socket.MSG_DONTWAIT)
            except BlockingIOError:
                is_drained = True
                break
            except OSError:
                if not found:
                    raise
                break  # it is raised again by the next call
            found.append((data, _stamp(ancillary)))
        if found:
            self.is_stamped = all(stamp < inf for _, stamp in found)
        now = time.time()
        # A step of the system's clock must not make a datagram younger than now.
        return [(data, now - stamp if stamp < now else 0.0) for data, stamp in found], is_drained

    def close(self) -> None:
        """Do nothing: a closed socket refuses by itself."""


def _stamp(ancillary: list[tuple[int, int, bytes]]) -> float:
    """Return the time of reception in ``ancillary`` [s], infinity if there is none."""
    for level, kind, data in ancillary:
        if level == socket.SOL_SOCKET and kind == _SO_TIMESTAMPNS and len(data) >= _TIMESPEC.size:
            seconds, nanoseconds = _TIMESPEC.unpack_from(data)
            return float(seconds) + 1e-9 * float(nanoseconds)
    return inf


# --- recvmmsg -------------------------------------------------------------------------------------------------


_WORD = 8


class _Vector(ctypes.Structure):
    """struct iovec."""

    _fields_ = (("base", ctypes.c_void_p), ("length", ctypes.c_size_t))


class _Header(ctypes.Structure):
    """struct msghdr."""

    _fields_ = (
        ("name", ctypes.c_void_p),
        ("name_length", ctypes.c_uint),
        ("vectors", ctypes.c_void_p),
        ("n_vectors", ctypes.c_size_t),
        ("control", ctypes.c_void_p),
        ("control_length", ctypes.c_size_t),
        ("flags", ctypes.c_int),
    )


class _Message(ctypes.Structure):
    """struct mmsghdr."""

    _fields_ = (("header", _Header), ("length", ctypes.c_uint))


# What the kernel writes into a message: the lengths of its ancillary data and of the datagram.
_HELD = _Header.control_length.offset
_WRITTEN = struct.Struct(f"@{_HELD}xN{_Message.length.offset - _HELD - _WORD}xI4x")
_STAMP = struct.Struct("@16sll")
"""struct cmsghdr with a struct timespec behind it."""


class AllAtOnce:
    """Reads a socket by Linux's recvmmsg, which takes all datagrams that wait (recvmmsg(2))."""

    def __init__(self, source: socket.socket) -> None:
        # It never blocks, so it keeps Python to itself: to let it go and get it back costs more.
        library = ctypes.PyDLL(None, use_errno=True)
        self._receive = library.recvmmsg
        self._receive.argtypes = (ctypes.c_int, ctypes.c_void_p, ctypes.c_uint, ctypes.c_int, ctypes.c_void_p)
        self._handle, self.is_stamped = source.fileno(), False
        self._data = memoryview(bytearray(AT_ONCE * LARGEST_DATAGRAM))
        self._control = memoryview(bytearray(AT_ONCE * _STAMP.size))
        data, control = _address(self._data), _address(self._control)
        self._vectors = (_Vector * AT_ONCE)(
            *[_Vector(data + number * LARGEST_DATAGRAM, LARGEST_DATAGRAM) for number in range(AT_ONCE)]
        )
        vectors = ctypes.addressof(self._vectors)
        messages = (_Message * AT_ONCE)(
            *[
                _Message(
                    _Header(
                        vectors=vectors + number * ctypes.sizeof(_Vector),
                        n_vectors=1,
                        control=control + number * _STAMP.size,
                        control_length=_STAMP.size,
                    )
                )
                for number in range(AT_ONCE)
            ]
        )
        self._head = struct.pack("@Nii", _STAMP.size, socket.SOL_SOCKET, _SO_TIMESTAMPNS)
        self._fresh = bytes(messages)
        self._messages = memoryview(bytearray(self._fresh))
        self._address = _address(self._messages)

    def read(self, limit: int) -> tuple[list[Waited], bool]:
        """Return as :meth:`Datagrams.read`."""
        limit = min(limit, AT_ONCE)
        count = self._receive(self._handle, self._address, limit, _DONT_WAIT, None)
        found: list[Waited] = []
        if count < 0:
            code = ctypes.get_errno()
            if code not in (EAGAIN, EWOULDBLOCK):
                raise OSError(code, os.strerror(code))
            return found, True
        now, size, head, data, begin = time.time(), _STAMP.size, self._head, self._data, 0
        self.is_stamped = True
        written = _WRITTEN.iter_unpack(self._messages[: count * _WRITTEN.size])
        stamps = _STAMP.iter_unpack(self._control[: count * size])
        for (held, length), (kind, seconds, nanoseconds) in zip(written, stamps, strict=True):
            waited = now - (seconds + 1e-9 * nanoseconds)
            if held != size or kind != head:
                waited, self.is_stamped = 0.0, False
            # A step of the system's clock must not make a datagram younger than now.
            found.append((data[begin : begin + length].tobytes(), waited if waited > 0.0 else 0.0))
            begin += LARGEST_DATAGRAM
        if not self.is_stamped:
            # Where there were no ancillary data the kernel has taken the room for them away.
            self._messages[:] = self._fresh
        return found, count < limit

    def close(self) -> None:
        """Forget the socket: its number may soon be another file's."""
        self._handle = -1


def _address(buffer: memoryview) -> int:
    return ctypes.addressof(ctypes.c_char.from_buffer(buffer))
