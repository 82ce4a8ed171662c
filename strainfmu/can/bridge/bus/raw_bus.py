"""The socket under python-can's own interface: waiting datagrams in one go, with the times of the kernel.

python-can takes three calls of the system and an object of its own per frame. Where its bus is a plain socket with
known contents, udp_multicast and socketcan, the bridge reads and writes the same bytes itself. The bus stays
python-can's: it opens, configures and closes the socket.
"""

from __future__ import annotations

import os
import select
import socket
import struct
from abc import ABC, abstractmethod
from importlib import import_module
from typing import Any

from strainfmu.can.bridge.bus.datagram_shapes import DatagramShapes
from strainfmu.can.bridge.bus.datagrams import ANCILLARY, Waited, waiting_datagrams
from strainfmu.can.wire.frame import FD_LENGTHS, Frame, MalformedFrame, from_message
from strainfmu.can.wire.libraries import import_can

_LONGEST_FD = FD_LENGTHS[-1]
_FD_LENGTHS = frozenset(FD_LENGTHS)
_EXTENDED, _REMOTE, _ERROR = 0x80000000, 0x40000000, 0x20000000
_BITRATE_SWITCH = 0x01
_HEADER = struct.Struct("=IBB2x")
_REMEMBERED = 1000
"""Sent datagrams that may still come back: as many as the socket's buffer holds, about."""
_CLASSIC_SIZE, _FD_SIZE = 16, 72
"""Source: struct can_frame and canfd_frame of Linux's include/uapi/linux/can.h."""


class RawBus(ABC):
    """The socket of an open bus. The bus must not be shut down before :meth:`close`."""

    def __init__(self, bus: Any) -> None:
        self._number_of_file = bus.fileno
        self._socket = socket.socket(fileno=os.dup(bus.fileno()))
        self._waiting = waiting_datagrams(self._socket)

    @property
    def is_open(self) -> bool:
        """The bus has not been shut down meanwhile."""
        try:
            return bool(self._number_of_file() >= 0)
        except (OSError, ValueError):
            return False

    @property
    def is_stamped(self) -> bool:
        """All datagrams of the last reading had a time of the kernel."""
        return self._waiting.is_stamped

    def wait(self, timeout: float) -> None:
        """Wait for a datagram, up to ``timeout`` [s]."""
        select.select([self._socket], [], [], timeout)

    def read(self, limit: int) -> tuple[list[Waited], bool]:
        """Return up to ``limit`` datagrams, each with how long it has waited [s], and whether none is left.

        Raises
        ------
        OSError
            The interface is down, or the socket failed.
        """
        return self._waiting.read(limit)

    def close(self) -> None:
        """Close this end of the socket; the bus keeps its own."""
        self._waiting.close()
        self._socket.close()

    def returned(self, datagram: bytes) -> Frame | None:
        """Return the frame that was sent as ``datagram``, each once; None of a bus that returns none."""
        return None

    @abstractmethod
    def frame(self, datagram: bytes, received: float) -> Frame:
        """Return the frame of a datagram that was received at the time ``received`` [s] of the bridge's clock.

        Raises
        ------
        MalformedFrame
            The datagram is no frame.
        """

    @abstractmethod
    def send(self, frame: Frame) -> None:
        """Send ``frame`` at once.

        Raises
        ------
        OSError
            It cannot be sent now.
        """


class RawMulticast(RawBus):
    """python-can's udp_multicast: one frame per datagram, a map of msgpack."""

    def __init__(self, bus: Any, target: tuple[str, int]) -> None:
        from can.interfaces.udp_multicast.utils import unpack_message

        msgpack = import_module("msgpack")

        super().__init__(bus)
        self._number_of_file = bus._multicast._socket.fileno  # as the bus finds it, by two calls less
        self._target = target
        self._pack, self._unpack, self._unpack_as_python_can = msgpack.packb, msgpack.unpackb, unpack_message
        self._received, self._sent = DatagramShapes(self._unpack), DatagramShapes(self._unpack)
        self._returning: dict[bytes, Frame] = {}

    def returned(self, datagram: bytes) -> Frame | None:
        """Return as :meth:`RawBus.returned`: multicast returns everything, which need not be read once more."""
        return self._returning.pop(datagram, None)

    def frame(self, datagram: bytes, received: float) -> Frame:
        """Return the frame of a datagram; one out of the ordinary is read as python-can reads it."""
        frame = self._received.frame(datagram, received)
        if frame is None:
            frame, is_ordinary = self._unpacked(datagram, received)
            if is_ordinary:
                self._received.learn(datagram, frame)
        return frame

    def _unpacked(self, datagram: bytes, received: float) -> tuple[Frame, bool]:
        """Return the frame of a datagram of any shape, and whether it is an ordinary one."""
        try:
            content = self._unpack(datagram)
            identifier, data = content["arbitration_id"], content["data"]
            is_fd, is_extended, switch = content["is_fd"], content["is_extended_id"], content["bitrate_switch"]
            is_ordinary = (
                len(content) == len(_ORDINARY)
                and type(identifier) is int
                and 0 <= identifier < (1 << 29 if is_extended is True else 1 << 11)
                and type(data) is bytes
                and content["dlc"] == len(data)
                and (len(data) in _FD_LENGTHS if is_fd is True else len(data) <= 8 and switch is False)
                and content["is_remote_frame"] is False
                and content["is_error_frame"] is False
                and content["error_state_indicator"] is False
                and type(is_fd) is type(is_extended) is type(switch) is bool
                and content.keys() == _ORDINARY
            )
        except Exception:  # whatever msgpack and foreign contents raise; python-can's own way decides
            is_ordinary = False
        if not is_ordinary:
            return self._frame_of_any(datagram, received), False
        frame = Frame(
            identifier=identifier,
            data=data,
            time=received,
            is_extended=is_extended,
            is_fd=is_fd,
            bitrate_switch=switch,
        )
        return frame, True

    def _frame_of_any(self, datagram: bytes, received: float) -> Frame:
        try:
            message = self._unpack_as_python_can(datagram, replace={"timestamp": 0.0}, check=True)
        except Exception as error:  # python-can lets through whatever msgpack raises
            raise MalformedFrame(f"no frame: {' '.join(str(error).split())[:80]}") from error
        return from_message(message, received)

    def send(self, frame: Frame) -> None:
        """Send ``frame`` as python-can packs it."""
        datagram = self._sent.datagram(frame)
        if datagram is None:
            datagram = self._packed(frame)
            self._sent.learn(datagram, frame)
        returning = self._returning
        returning[datagram] = frame
        if len(returning) > _REMEMBERED:
            del returning[next(iter(returning))]
        self._socket.sendto(datagram, socket.MSG_DONTWAIT, self._target)

    def _packed(self, frame: Frame) -> bytes:
        """Return the datagram of ``frame``."""
        content = {
            "timestamp": 0.0,
            "arbitration_id": frame.identifier,
            "is_extended_id": frame.is_extended,
            "is_remote_frame": frame.is_remote,
            "is_error_frame": frame.is_error,
            "channel": None,
            "dlc": len(frame.data),
            "data": frame.data,
            "is_fd": frame.is_fd,
            "bitrate_switch": frame.bitrate_switch,
            "error_state_indicator": False,
        }
        packed: bytes = self._pack(content)
        return packed


_ORDINARY = {
    "timestamp",
    "arbitration_id",
    "is_extended_id",
    "is_remote_frame",
    "is_error_frame",
    "channel",
    "dlc",
    "data",
    "is_fd",
    "bitrate_switch",
    "error_state_indicator",
}
"""Keys of a datagram of python-can 4."""


class RawSocketCan(RawBus):
    """Linux's SocketCAN: one struct can_frame or canfd_frame per read."""

    def frame(self, datagram: bytes, received: float) -> Frame:
        """Return the frame of a datagram."""
        if len(datagram) not in (_CLASSIC_SIZE, _FD_SIZE):
            raise MalformedFrame(f"{len(datagram)} bytes found, {_CLASSIC_SIZE} or {_FD_SIZE} allowed")
        word, length, flags = _HEADER.unpack_from(datagram)
        is_fd = len(datagram) == _FD_SIZE
        is_extended = bool(word & _EXTENDED)
        is_remote = bool(word & _REMOTE)
        if length > (_LONGEST_FD if is_fd else 8):
            raise MalformedFrame(f"frame of {length} bytes found, {_LONGEST_FD if is_fd else 8} allowed")
        return Frame(
            identifier=word & (0x1FFFFFFF if is_extended else 0x7FF),
            data=b"" if is_remote else datagram[_HEADER.size : _HEADER.size + length],
            time=received,
            is_extended=is_extended,
            is_fd=is_fd,
            bitrate_switch=is_fd and bool(flags & _BITRATE_SWITCH),
            is_error=bool(word & _ERROR),
            is_remote=is_remote,
        )

    def send(self, frame: Frame) -> None:
        """Send ``frame``."""
        self._socket.send(can_frame(frame), socket.MSG_DONTWAIT)


def can_frame(frame: Frame) -> bytes:
    """Return ``frame`` as Linux's struct can_frame or canfd_frame."""
    word = frame.identifier
    word |= (frame.is_extended and _EXTENDED) | (frame.is_remote and _REMOTE) | (frame.is_error and _ERROR)
    flags = _BITRATE_SWITCH if frame.is_fd and frame.bitrate_switch else 0
    size = _FD_SIZE if frame.is_fd else _CLASSIC_SIZE
    return (_HEADER.pack(word, len(frame.data), flags) + frame.data).ljust(size, b"\0")


def raw_bus(bus: Any) -> RawBus | None:
    """Return the socket under an open bus of python-can; None where python-can itself is to be used.

    That is so for all other interfaces, for filters in software, and where python-can is not as it is known here.
    """
    can = import_can()
    kind = f"{type(bus).__module__}.{type(bus).__name__}"
    if not ANCILLARY or getattr(bus, "filters", None):
        return None
    try:
        if kind == "can.interfaces.udp_multicast.bus.UdpMulticastBus" and bus.protocol is can.CanProtocol.CAN_FD:
            return RawMulticast(bus, (bus._multicast.group, bus._multicast.port))
        if kind == "can.interfaces.socketcan.socketcan.SocketcanBus" and bus.channel:
            return RawSocketCan(bus)
    except (AttributeError, ImportError, OSError):
        return None
    return None
