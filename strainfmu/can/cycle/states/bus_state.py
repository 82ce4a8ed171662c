"""The state of the bus controller, from error frames.

Source: fault confinement of ISO 11898-1 (error active, passive, bus off); contents of error frames as in Linux's
include/uapi/linux/can/error.h, which python-can's socketcan interface passes on. Error frames of other interfaces
have other contents or none: they are counted and change no state.
"""

from __future__ import annotations

from enum import IntEnum

from strainfmu.can.wire.frame import Frame

_CONTROLLER, _BUS_OFF, _RESTARTED = 0x04, 0x40, 0x100
_WARNING, _PASSIVE, _ACTIVE = 0x0C, 0x30, 0x40
"""Bits of an error frame's identifier, and of its second byte if the controller reports its state."""


class BusState(IntEnum):
    """State of the controller; the numbers go over the bus and never change."""

    ERROR_ACTIVE = 0
    ERROR_WARNING = 1
    ERROR_PASSIVE = 2
    BUS_OFF = 3
    DISCONNECTED = 4


def state_after(state: BusState, frame: Frame) -> BusState:
    """Return the state that the error frame ``frame`` leaves the controller in."""
    if frame.identifier & _BUS_OFF:
        return BusState.BUS_OFF
    if frame.identifier & _RESTARTED:
        return BusState.ERROR_ACTIVE
    if frame.identifier & _CONTROLLER and len(frame.data) > 1:
        flags = frame.data[1]
        if flags & _PASSIVE:
            return BusState.ERROR_PASSIVE
        if flags & _WARNING:
            return BusState.ERROR_WARNING
        if flags & _ACTIVE:
            return BusState.ERROR_ACTIVE
    return state
