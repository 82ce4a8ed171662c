"""A python-can bus for the bridge: one clear line on failure, a receive buffer for bursts."""

from __future__ import annotations

import os
import socket
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from strainfmu.can.frame import error_line, import_can
from strainfmu.errors import InputError, StrainfmuError

VIRTUAL = "virtual"
VIRTUAL_TEXT = "virtual: no other process hears this bus; udp_multicast and socketcan's vcan0 connect processes"
"""Interface of python-can within one process, and what a user must know of it."""

MULTICAST_ADVICE = "ip link set lo multicast on, ip route add 224.0.0.0/4 dev lo (as root)"

RECEIVE_BUFFER = 4 << 20
"""Size of a socket's receive buffer, requested of the system [bytes]: the default holds 166 CAN FD frames."""


@dataclass(frozen=True, kw_only=True)
class BusSettings:
    """Interface, channel and options of a bus.

    Attributes
    ----------
    interface, channel : as python-can names them.
    options : further keyword arguments of the interface.
    fd : CAN FD frames can be sent and received.
    """

    interface: str
    channel: str
    options: Mapping[str, Any] = field(default_factory=dict)
    fd: bool = True

    def __str__(self) -> str:
        return f"{self.interface}:{self.channel}"


OpenBus = Callable[[], Any]
"""Returns a new, open python-can bus; raises StrainfmuError."""


def open_bus(settings: BusSettings) -> Any:
    """Open the bus.

    Raises
    ------
    InputError
        python-can knows no such interface.
    StrainfmuError
        The bus cannot be opened; the message gives the reason.
    """
    can = import_can()
    try:
        # python-can adds the options of its own configuration files that are not given here.
        bus = can.Bus(interface=settings.interface, channel=settings.channel, **_given(settings))
    except (can.CanInterfaceNotImplementedError, ModuleNotFoundError) as error:
        known = ", ".join(sorted(can.interfaces.VALID_INTERFACES))
        raise InputError(f"{settings}: {_reason(error)}; interfaces: {known}") from error
    except Exception as error:  # every interface raises its own
        raise StrainfmuError(f"{settings}: cannot be opened: {_reason(error)}{_advice(settings)}") from error
    _enlarge_receive_buffer(bus)
    return bus


def _given(settings: BusSettings) -> dict[str, Any]:
    """Return the options that were given, with the options of this program."""
    options = dict(settings.options)
    if settings.interface == "udp_multicast":
        # Frames stay on this host unless an option states otherwise.
        return {"hop_limit": 0, "fd": settings.fd, **options}
    return {"fd": True, **options} if settings.fd and settings.interface != "virtual" else options


def shut_down(bus: Any) -> None:
    """Shut ``bus`` down and ignore its errors."""
    try:
        bus.shutdown()
    except Exception:  # a bus that failed fails here again, each interface in its own way
        return


def kernel_drops(bus: Any) -> int | None:
    """Return the number of datagrams that the system dropped ahead of ``bus``; None where that is not known.

    Source: column "drops" of Linux's /proc/net/udp and udp6, found by the socket's inode.
    """
    try:
        handle = bus.fileno()
        inode = str(os.fstat(handle).st_ino) if handle >= 0 else ""
    except (OSError, NotImplementedError, AttributeError, ValueError):
        return None
    for table in (Path("/proc/net/udp"), Path("/proc/net/udp6")):
        if not inode or not table.is_file():
            continue
        for line in table.read_text().splitlines()[1:]:
            columns = line.split()
            if len(columns) > 12 and columns[9] == inode:
                return int(columns[-1])
    return None


def _enlarge_receive_buffer(bus: Any) -> None:
    """Request a larger receive buffer where the bus is a socket."""
    try:
        handle = bus.fileno()
        duplicate = socket.socket(fileno=os.dup(handle)) if handle >= 0 else None
    except (OSError, NotImplementedError, AttributeError, ValueError):
        return
    if duplicate is None:
        return
    with duplicate:
        try:
            duplicate.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
        except OSError:
            return


def _reason(error: BaseException) -> str:
    """Return an error and its causes on one line."""
    texts = [error_line(error)]
    cause = error.__cause__ or error.__context__
    while cause is not None and len(texts) < 3:
        text = " ".join(str(cause).split())
        if text and text not in texts:
            texts.append(text)
        cause = cause.__cause__ or cause.__context__
    return ": ".join(texts)


def _advice(settings: BusSettings) -> str:
    """Return the most frequent remedy."""
    return f"; without a default route: {MULTICAST_ADVICE}" if settings.interface == "udp_multicast" else ""
