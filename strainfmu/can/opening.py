"""A python-can bus for the bridge: one clear line on failure, a receive buffer for bursts."""

import inspect
import os
import re
import socket
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any

from strainfmu.can.frame import error_line, import_can
from strainfmu.errors import InputError, StrainfmuError

VIRTUAL = "virtual"
VIRTUAL_TEXT = "virtual: no other process hears this bus; udp_multicast and socketcan's vcan0 connect processes"
"""Interface of python-can within one process, and what a user must know of it."""

MULTICAST_ADVICE = "ip link set lo multicast on, ip route add 224.0.0.0/4 dev lo (as root)"

_QUOTED = re.compile(r"""(["'])(\w+)\1""")
_OF_PYTHON = ("builtins", "abc")

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


def bus_settings(interface: str, channel: str, options: Iterable[str]) -> BusSettings:
    """Return a bus whose ``options`` are "key=value"; values that are numbers become numbers.

    Raises
    ------
    InputError
        An option has no such form, or nothing of the interface reads it: python-can would ignore it silently.
    """
    chosen: dict[str, object] = {}
    for item in options:
        key, equals, text = item.partition("=")
        if not equals or not key.strip():
            raise InputError(f"--bus-option: expected KEY=VALUE, got '{item}'")
        words = {"true": True, "false": False}
        try:
            chosen[key.strip()] = words[text.lower()] if text.lower() in words else int(text, 0)
        except ValueError:
            chosen[key.strip()] = text
    stated, other_options = known_bus_options(interface) if chosen else (None, set())
    for name in chosen:
        if stated is not None and name not in stated | other_options:
            known = ", ".join(sorted(stated))
            raise InputError(f"--bus-option: expected an option of {interface} ({known}), got '{name}'")
    return BusSettings(interface=interface, channel=channel, options=chosen)


def known_bus_options(interface: str) -> tuple[set[str] | None, set[str]]:
    """Return the options that an interface of python-can names, and others that it may read; None if not known.

    Some read further options out of their keyword arguments: these stand in quotes in their source. A bit timing's
    parameters may always be stated one by one. Interfaces of others, and what does not load here, cannot be known.
    """
    can = import_can()
    module, name = can.interfaces.BACKENDS.get(interface, ("", ""))
    try:
        classes = [
            base for base in getattr(import_module(module), name).__mro__ if base.__module__ not in _OF_PYTHON
        ]
        sources = [inspect.getsource(import_module(base.__module__)) for base in classes]
    except Exception:  # each vendor's driver is missing in its own way; opening it reports why
        return None, set()
    if not all(base.__module__.startswith("can.") for base in classes):
        return None, set()
    kinds = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
    parameters = [entry for base in classes for entry in inspect.signature(base).parameters.values()]
    other_options = {"config_context", "ignore_config"} | {
        match[2] for text in sources for match in _QUOTED.finditer(text)
    }
    for timing in (can.BitTiming, can.BitTimingFd):
        other_options |= set(inspect.signature(timing).parameters)
    return {entry.name for entry in parameters if entry.kind in kinds} - {"channel"}, other_options


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
