"""Frames as the bus sees them, their CRC and counter, and the libraries that send and read them."""

from __future__ import annotations

import logging
from binascii import crc_hqx
from dataclasses import dataclass
from functools import cache
from typing import Any, Final

from strainfmu.errors import StrainfmuError, library


def import_can() -> Any:
    """Return the package python-can."""
    return _imported("can", "python-can")


def import_cantools() -> Any:
    """Return the package cantools."""
    return _imported("cantools", "cantools")


def import_cmac() -> tuple[Any, Any]:
    """Return the modules of CMAC and of block ciphers of the package cryptography."""
    primitives = "cryptography.hazmat.primitives"
    cmac, ciphers = (
        library(f"{primitives}.{name}", "cryptography", "auth") for name in ("cmac", "ciphers.algorithms")
    )
    return cmac, ciphers


def error_line(error: BaseException) -> str:
    """Return the text of ``error`` on one line, its type where it has no text."""
    return " ".join(str(error).split()) or type(error).__name__


def _imported(package: str, name: str) -> Any:
    """Return ``package``, which is installed by the ``name``."""
    module = library(package, name, "can")
    # Without a handler, logging writes to standard error, where each failure is to be one line of this program.
    logger = logging.getLogger(package)
    if not logger.handlers:
        logger.addHandler(logging.NullHandler())
    return module


_POLYNOMIAL_8 = 0x1D


def _crc_8_table() -> bytes:
    """Return the 256 remainders of one byte."""
    table = bytearray()
    for byte in range(256):
        for _ in range(8):
            byte = (byte << 1) ^ (_POLYNOMIAL_8 if byte & 0x80 else 0)
            byte &= 0xFF
        table.append(byte)
    return bytes(table)


_TABLE_8: Final = _crc_8_table()


@dataclass(frozen=True)
class Protection:
    """End-to-end protection of one frame.

    Attributes
    ----------
    profile : 1 or 5, the AUTOSAR E2E profile.
    data_id : 16 bit number known to both ends and not in the frame; it distinguishes frames.
    end : number of bytes that the CRC covers, itself included; None for all.
    """

    profile: int
    data_id: int
    end: int | None = None

    @property
    def counter_modulus(self) -> int:
        """Number of counter values: 15 of profile 1, 256 of profile 5."""
        return 15 if self.profile == 1 else 256


def crc_of(data: bytes | bytearray, protection: Protection, covered: bytes = b"") -> int:
    """Return the CRC of ``data`` without its CRC field, followed by ``covered``, bytes of other frames."""
    if protection.profile == 1:
        crc = _TABLE_8[protection.data_id & 0xFF]
        crc = _TABLE_8[crc ^ (protection.data_id >> 8)]
        for byte in data[1 : protection.end] + covered:
            crc = _TABLE_8[crc ^ byte]
        return crc
    crc = crc_hqx(data[2 : protection.end], 0xFFFF)
    if covered:
        crc = crc_hqx(covered, crc)
    return crc_hqx(protection.data_id.to_bytes(2, "little"), crc)


def protect(data: bytes, protection: Protection, counter: int, covered: bytes = b"") -> bytes:
    """Return ``data`` with counter (modulo its range) and CRC written into it."""
    protected = bytearray(data)
    counter %= protection.counter_modulus
    if protection.profile == 1:
        protected[1] = protected[1] & 0xF0 | counter
        protected[0] = crc_of(protected, protection, covered)
    else:
        protected[2] = counter
        protected[:2] = crc_of(protected, protection, covered).to_bytes(2, "little")
    return bytes(protected)


EXTENDED_FLAG = 1 << 31
"""Set in a key for 29 bit identifiers, as in SocketCAN's can_id and in DBC files."""

FD_LENGTHS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)
"""Possible numbers of data bytes of a CAN FD frame (ISO 11898-1)."""

LARGEST_IDENTIFIER = (1 << 29) - 1


class MalformedFrame(StrainfmuError, ValueError):
    """A message of an interface is no frame."""


@dataclass(slots=True, kw_only=True)  # not frozen: one is made for every frame, and that costs thrice
class Frame:
    """One frame; it is not changed once it is made.

    Attributes
    ----------
    identifier : 11 or 29 bit.
    data : 0 to 8 bytes, up to 64 of CAN FD.
    time : of its reception, local monotonic clock [s].
    is_extended : 29 bit identifier.
    is_fd, bitrate_switch : CAN FD format, and its faster data phase.
    is_error, is_remote : an error report of the interface; a request without data.
    key : identifier and its width in one number.
    """

    identifier: int
    data: bytes
    time: float = 0.0
    is_extended: bool = False
    is_fd: bool = False
    bitrate_switch: bool = False
    is_error: bool = False
    is_remote: bool = False

    @property
    def key(self) -> int:
        return self.identifier | EXTENDED_FLAG if self.is_extended else self.identifier

    def with_data(self, data: bytes, time: float = 0.0) -> Frame:
        """Return a frame of the same identifier and format with other ``data`` and ``time`` [s].

        It takes a fifth of the time of making one by all its fields.
        """
        frame = _without_fields(Frame)
        frame.identifier, frame.data, frame.time = self.identifier, data, time
        frame.is_extended, frame.is_fd, frame.bitrate_switch = self.is_extended, self.is_fd, self.bitrate_switch
        frame.is_error, frame.is_remote = self.is_error, self.is_remote
        return frame


_without_fields = object.__new__


def from_message(message: Any, time: float) -> Frame:
    """Return python-can's ``message``, received at ``time`` on the local monotonic clock [s].

    The message's own time stamp is not used: its epoch differs between interfaces.

    Raises
    ------
    MalformedFrame
        A field is of another type, or no frame can hold it; python-can does not check the types of fields that
        come in a datagram.
    """
    identifier, data = message.arbitration_id, message.data
    if not isinstance(identifier, int) or not 0 <= identifier <= LARGEST_IDENTIFIER:
        raise MalformedFrame(f"identifier {identifier!r} found, 0 to 0x{LARGEST_IDENTIFIER:X} allowed")
    if not isinstance(data, bytes | bytearray) or len(data) > FD_LENGTHS[-1]:
        raise MalformedFrame(
            f"frame 0x{identifier:X}: expected up to {FD_LENGTHS[-1]} bytes, got {str(data)[:40]}"
        )
    is_extended, is_fd, bitrate_switch = message.is_extended_id, message.is_fd, message.bitrate_switch
    is_error, is_remote = message.is_error_frame, message.is_remote_frame
    for flag in (is_extended, is_fd, bitrate_switch, is_error, is_remote):
        if flag is not True and flag is not False and not isinstance(flag, int):
            raise MalformedFrame(f"frame 0x{identifier:X}: flag: expected true or false, got {str(flag)[:40]}")
    frame = _without_fields(Frame)
    frame.identifier, frame.data, frame.time = int(identifier), bytes(data), time
    frame.is_extended, frame.is_fd, frame.bitrate_switch = is_extended, is_fd, bitrate_switch
    frame.is_error, frame.is_remote = is_error, is_remote
    return frame


@cache
def _message_class() -> Any:
    """Return python-can's class of messages; an import in every call takes as long as a message."""
    return import_can().Message


def to_message(frame: Frame) -> Any:
    """Return ``frame`` as a message of python-can, in a third of the time of its own constructor."""
    message, data = _without_fields(_message_class()), b"" if frame.is_remote else frame.data
    message.arbitration_id, message.data, message.dlc = frame.identifier, bytearray(data), len(data)
    message.is_extended_id, message.is_fd, message.bitrate_switch = (
        frame.is_extended,
        frame.is_fd,
        frame.bitrate_switch,
    )
    message.is_error_frame, message.is_remote_frame = frame.is_error, frame.is_remote
    message.timestamp, message.channel, message.is_rx, message.error_state_indicator = 0.0, None, True, False
    return message
