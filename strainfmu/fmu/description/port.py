"""What an FMU of FMI 3.0 states of its ports to a CAN bus: variables, terminal and manifest of FMI-LS-BUS 1.0.

Source: FMI-LS-BUS 1.0.0, sections 2 (manifest), 5.3 (variables) and 5.4 (terminals).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np

from strainfmu.resource_file import with_header

FIRST_PORT = 2_000_000
"""Value reference of the data that the first port receives, as ``fmus/native/fmi3/fmi3.h`` has it."""

_REFERENCES, _FIRST_COUNTER = 32, 16
_RX_DATA, _TX_DATA, _RX_CLOCK, _TX_CLOCK = range(4)
"""Value references of a port, and of its variables from there on."""

MOST_PORTS = 8
"""Ports of an FMU, as ``fmus/native/core/ports.h`` has it."""

MOST_BYTES = 8192
"""Operations of one tick, as ``fmus/native/core/ports.h`` has it."""

COUNTERS = {
    "received": "Frames received",
    "used": "Frames of the input that were used",
    "sent": "Result and status frames sent",
    "confirmed": "Frames that the bus has confirmed",
    "format_errors": "Operations received that are none",
    "lost": "Results and operations that were lost for want of room",
}
"""Outputs of a port, in the order of ``core/ports.h``, and their descriptions."""

_LARGEST_COUNT = str(2**53 - 1)
"""VDMCheck refuses the largest number of 64 bits, which its float64 rounds up."""

TX_CLOCKS = ("countdown", "triggered")
"""Kinds of the transmit clock: the FMU states when it is to tick, or says that it has ticked."""

_NAME = "org.fmi-standard.fmi-ls-bus"
_MIME_TYPE = 'application/org.fmi-standard.fmi-ls-bus.can; version="1.0.0"'
_MANIFEST_NAMESPACE = "http://fmi-standard.org/fmi-ls-manifest"
_DESCRIPTION = (
    "Layered Standard for the simulation of bus communication on a Physical Signal Abstraction or Network "
    "Abstraction based level."
)
"""The text that the schema of the standard fixes."""


@dataclass(frozen=True)
class Port:
    """A port: ``network`` is the name of its terminal, ``tx_clock`` one of :data:`TX_CLOCKS`."""

    network: str
    tx_clock: str


_HEADER = 32
_SETUP = np.dtype(
    [
        ("guid", "S96"),
        *((name, "i4") for name in ("n_ports", "is_triggered", "can_rate", "fd_rate")),
        ("tables", [("place", "i8"), ("count", "i8")], 5),
    ]
)
"""``NodeSetup`` of ``core/ports.h``."""


@dataclass(frozen=True, eq=False, kw_only=True)
class BusPart:
    """What puts an FMU on a bus.

    Attributes
    ----------
    ports : its ports.
    resource : name of a file of ``resources/``.
    tables : what that file holds, in the order of the kind of node in ``fmus/native``.
    can_rate, fd_rate : bit rates [bit/s], 0 for none.
    dbc : DBC file of the frames, None for none.
    lines : what its page states of the bus, as HTML.
    is_bus : it is the bus itself.
    """

    ports: tuple[Port, ...]
    resource: str
    tables: tuple[np.ndarray[Any, Any], ...] = ()
    can_rate: int = 0
    fd_rate: int = 0
    dbc: bytes | None = None
    lines: tuple[str, ...] = ()
    is_bus: bool = False

    def content(self, guid: str) -> bytes:
        """Return the file for the FMU with ``guid``."""
        setup, parts = np.zeros((), dtype=_SETUP), list[bytes]()
        setup["guid"], setup["n_ports"] = guid.encode(), len(self.ports)
        setup["is_triggered"] = self.ports[0].tx_clock == "triggered"
        setup["can_rate"], setup["fd_rate"] = self.can_rate, self.fd_rate
        for place, table in zip(setup["tables"], self.tables, strict=False):
            place["place"], place["count"] = _HEADER + _SETUP.itemsize + sum(map(len, parts)), len(table)
            parts += [table.tobytes(), bytes(-table.nbytes % 8)]
        return with_header(b"SFMUNOD", 1, setup.tobytes() + b"".join(parts))

    def files(self, guid: str) -> Mapping[str, bytes]:
        """Return content by name: the file of the node with ``guid``, terminal, manifest, DBC file."""
        root = Element(
            "fmiLayeredStandardManifest",
            {
                "xmlns:fmi-ls": _MANIFEST_NAMESPACE,
                "fmi-ls:fmi-ls-name": _NAME,
                "fmi-ls:fmi-ls-version": "1.0.0",
                "fmi-ls:fmi-ls-description": _DESCRIPTION,
                "isBusSimulationFMU": str(self.is_bus).lower(),
            },
        )
        folder = f"extra/{_NAME}"
        return {
            f"resources/{self.resource}": self.content(guid),
            "terminalsAndIcons/terminalsAndIcons.xml": _terminals(self.ports),
            f"{folder}/fmi-ls-manifest.xml": tostring(root, encoding="UTF-8", xml_declaration=True),
            **({} if self.dbc is None else {f"{folder}/{self.ports[0].network}.dbc": self.dbc}),
        }


def add_port(variables: Element, structure: Element, port: Port, number: int) -> None:
    """Add the variables of ``port``, counted from 0, and their dependencies to a model description."""
    data = {"variability": "discrete", "mimeType": _MIME_TYPE, "maxSize": str(MOST_BYTES)}
    first = FIRST_PORT + number * _REFERENCES
    rx_clock, tx_data, tx_clock = first + _RX_CLOCK, first + _TX_DATA, first + _TX_CLOCK
    names = {"Rx_Data": first + _RX_DATA, "Tx_Data": tx_data, "Rx_Clock": rx_clock, "Tx_Clock": tx_clock}
    is_triggered = port.tx_clock == "triggered"
    parts = {
        "Rx_Data": ("Binary", {"causality": "input", "clocks": str(rx_clock), **data}),
        "Tx_Data": ("Binary", {"causality": "output", "initial": "calculated", "clocks": str(tx_clock), **data}),
        "Rx_Clock": ("Clock", {"causality": "input", "intervalVariability": "triggered"}),
        "Tx_Clock": (
            "Clock",
            {"causality": "output" if is_triggered else "input", "intervalVariability": port.tx_clock},
        ),
    }
    texts = {"Rx_Data": "Operations received", "Tx_Data": "Operations to send"}
    for member, (tag, attributes) in parts.items():
        named = {"name": f"{port.network}.{member}", "valueReference": str(names[member])}
        text = texts.get(member, f"Clock of {port.network}.{member.replace('Clock', 'Data')}")
        element = SubElement(variables, tag, {**named, "description": text, **attributes})
        if member == "Rx_Data":
            SubElement(element, "Start", {"value": ""})
    counters = [first + _FIRST_COUNTER + count for count in range(len(COUNTERS))]
    for reference, (name, text) in zip(counters, COUNTERS.items(), strict=True):
        counted = {"name": f"{port.network}.{name}", "valueReference": str(reference)}
        kind = {"causality": "output", "variability": "discrete", "initial": "calculated", "max": _LARGEST_COUNT}
        SubElement(variables, "UInt64", {**counted, "description": text, **kind})
    clocked = {tx_data: "", tx_clock: ""} if is_triggered else {tx_data: str(tx_clock)}
    outputs = clocked | dict.fromkeys(counters, "")
    place = sum(element.tag == "Output" for element in structure)
    for offset, (reference, known) in enumerate(outputs.items()):
        output = Element("Output", {"valueReference": str(reference), "dependencies": known})
        structure.insert(place + offset, output)
    for reference in counters:
        SubElement(structure, "InitialUnknown", {"valueReference": str(reference), "dependencies": ""})


def _terminals(ports: Sequence[Port]) -> bytes:
    """Return ``terminalsAndIcons.xml`` with the terminals of ``ports``."""
    root = Element("fmiTerminalsAndIcons", {"fmiVersion": "3.0"})
    group = SubElement(root, "Terminals")
    kind = {"terminalKind": "org.fmi-ls-bus.network-terminal", "matchingRule": "org.fmi-ls-bus.transceiver"}
    for port in ports:
        terminal = SubElement(group, "Terminal", {"name": port.network, **kind})
        for member in ("Tx_Data", "Rx_Data", "Tx_Clock", "Rx_Clock"):
            variable = {"variableName": f"{port.network}.{member}", "memberName": member, "variableKind": "signal"}
            SubElement(terminal, "TerminalMemberVariable", variable)
    indent(root)
    return tostring(root, encoding="UTF-8", xml_declaration=True)
