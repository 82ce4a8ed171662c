"""A CAN frame, independent of the library that received it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from strainfmu.errors import StrainfmuError

EXTENDED_FLAG = 1 << 31
"""Set in a key for 29 bit identifiers, as in SocketCAN's can_id and in DBC files."""

FD_LENGTHS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)
"""Possible numbers of data bytes of a CAN FD frame (ISO 11898-1)."""

_LARGEST_IDENTIFIER = (1 << 29) - 1


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
    key: int = field(init=False, compare=False)

    def __post_init__(self) -> None:
        self.key = self.identifier | EXTENDED_FLAG if self.is_extended else self.identifier

    def with_data(self, data: bytes, time: float = 0.0) -> Frame:
        """Return a frame of the same identifier and format with other ``data`` and ``time`` [s].

        It takes a fifth of the time of making one by all its fields.
        """
        frame = _without_fields(Frame)
        frame.identifier, frame.key, frame.data, frame.time = self.identifier, self.key, data, time
        frame.is_extended, frame.is_fd, frame.bitrate_switch = self.is_extended, self.is_fd, self.bitrate_switch
        frame.is_error, frame.is_remote = self.is_error, self.is_remote
        return frame


_without_fields = object.__new__


def frame_key(identifier: int, is_extended: bool) -> int:
    """Return identifier and its width in one number."""
    return identifier | EXTENDED_FLAG if is_extended else identifier


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
    if not isinstance(identifier, int) or not 0 <= identifier <= _LARGEST_IDENTIFIER:
        raise MalformedFrame(f"identifier {identifier!r} found, 0 to 0x{_LARGEST_IDENTIFIER:X} allowed")
    if not isinstance(data, bytes | bytearray) or len(data) > FD_LENGTHS[-1]:
        raise MalformedFrame(
            f"frame 0x{identifier:X}: expected up to {FD_LENGTHS[-1]} bytes, got {str(data)[:40]}"
        )
    flags = {
        "is_extended": message.is_extended_id,
        "is_fd": message.is_fd,
        "bitrate_switch": message.bitrate_switch,
        "is_error": message.is_error_frame,
        "is_remote": message.is_remote_frame,
    }
    for flag in flags.values():
        if not isinstance(flag, int):  # a bool is one
            raise MalformedFrame(f"frame 0x{identifier:X}: flag: expected true or false, got {str(flag)[:40]}")
    named = {name: bool(flag) for name, flag in flags.items()}
    return Frame(identifier=int(identifier), data=bytes(data), time=time, **named)


def to_message(frame: Frame) -> Any:
    """Return ``frame`` as a message of python-can."""
    import can

    return can.Message(
        arbitration_id=frame.identifier,
        data=frame.data,
        is_extended_id=frame.is_extended,
        is_fd=frame.is_fd,
        bitrate_switch=frame.bitrate_switch,
        is_error_frame=frame.is_error,
        is_remote_frame=frame.is_remote,
    )
