"""A CAN frame as the bridge sees it, whatever library received it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

EXTENDED_FLAG = 1 << 31
"""Set in a key for 29 bit identifiers, as in SocketCAN's can_id and in DBC files."""

FD_LENGTHS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)
"""Numbers of data bytes that a CAN FD frame can have (ISO 11898-1)."""


@dataclass(frozen=True, slots=True)
class Frame:
    """One frame.

    Attributes
    ----------
    identifier : 11 or 29 bit.
    data : 0 to 8 bytes, up to 64 of CAN FD.
    time : when it was received, local monotonic clock [s].
    is_extended : 29 bit identifier.
    is_fd, bitrate_switch : CAN FD format, and its faster data phase.
    is_error, is_remote : an error report of the interface; a request without data.
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
        """Identifier and its width in one number."""
        return frame_key(self.identifier, self.is_extended)


def frame_key(identifier: int, is_extended: bool) -> int:
    """Return identifier and its width in one number."""
    return identifier | EXTENDED_FLAG if is_extended else identifier


def from_message(message: Any, time: float) -> Frame:
    """Return python-can's ``message``, received at ``time`` on the local monotonic clock [s].

    The message's own time stamp is not used: its epoch differs between interfaces.
    """
    return Frame(
        message.arbitration_id,
        bytes(message.data),
        time,
        message.is_extended_id,
        message.is_fd,
        message.bitrate_switch,
        message.is_error_frame,
        message.is_remote_frame,
    )


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
