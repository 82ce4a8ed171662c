"""What an FMU of FMI 3.0 states of its port to a CAN bus: variables, terminal and manifest of FMI-LS-BUS 1.0.

Source: FMI-LS-BUS 1.0.0, sections 2 (manifest), 5.3 (variables) and 5.4 (terminals).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from xml.etree.ElementTree import Element, SubElement, indent, tostring

FIRST_PORT = 2_000_000
"""Value reference of received data, as ``fmus/native/fmi3/fmi3.h`` has it; then data to send and their clocks."""

_FIRST_COUNTER = FIRST_PORT + 16
_RX_DATA, _TX_DATA, _RX_CLOCK, _TX_CLOCK = range(FIRST_PORT, FIRST_PORT + 4)

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


@dataclass(frozen=True, kw_only=True)
class BusPart:
    """What makes an FMU of an estimator one on a bus.

    Attributes
    ----------
    port : its port.
    resource : returns ``resources/bus.bin`` for a guid.
    dbc : DBC file of the frames.
    lines : what its page states of the bus, as HTML.
    """

    port: Port
    resource: Callable[[str], bytes]
    dbc: bytes
    lines: tuple[str, ...] = field(default_factory=tuple)


def add_port(variables: Element, structure: Element, port: Port) -> None:
    """Add the variables of ``port`` and their dependencies to a model description."""
    data = {"variability": "discrete", "mimeType": _MIME_TYPE, "maxSize": str(MOST_BYTES)}
    names = {"Rx_Data": _RX_DATA, "Tx_Data": _TX_DATA, "Rx_Clock": _RX_CLOCK, "Tx_Clock": _TX_CLOCK}
    is_triggered = port.tx_clock == "triggered"
    own = {
        "Rx_Data": ("Binary", {"causality": "input", "clocks": str(_RX_CLOCK), **data}),
        "Tx_Data": ("Binary", {"causality": "output", "initial": "calculated", "clocks": str(_TX_CLOCK), **data}),
        "Rx_Clock": ("Clock", {"causality": "input", "intervalVariability": "triggered"}),
        "Tx_Clock": (
            "Clock",
            {"causality": "output" if is_triggered else "input", "intervalVariability": port.tx_clock},
        ),
    }
    texts = {"Rx_Data": "Operations received", "Tx_Data": "Operations to send"}
    for member, (tag, attributes) in own.items():
        named = {"name": f"{port.network}.{member}", "valueReference": str(names[member])}
        text = texts.get(member, f"Clock of {port.network}.{member.replace('Clock', 'Data')}")
        element = SubElement(variables, tag, {**named, "description": text, **attributes})
        if member == "Rx_Data":
            SubElement(element, "Start", {"value": ""})
    for number, (name, text) in enumerate(COUNTERS.items()):
        counted = {"name": f"{port.network}.{name}", "valueReference": str(_FIRST_COUNTER + number)}
        kind = {"causality": "output", "variability": "discrete", "initial": "calculated"}
        SubElement(variables, "UInt64", {**counted, "description": text, **kind})
    counters = [_FIRST_COUNTER + number for number in range(len(COUNTERS))]
    clocked = {_TX_DATA: "", _TX_CLOCK: ""} if is_triggered else {_TX_DATA: str(_TX_CLOCK)}
    outputs = clocked | dict.fromkeys(counters, "")
    place = sum(one.tag == "Output" for one in structure)
    for number, (reference, known) in enumerate(outputs.items()):
        output = Element("Output", {"valueReference": str(reference), "dependencies": known})
        structure.insert(place + number, output)
    for reference in counters:
        SubElement(structure, "InitialUnknown", {"valueReference": str(reference), "dependencies": ""})


def port_files(part: BusPart) -> Mapping[str, bytes]:
    """Return content by name: terminal, manifest and DBC file."""
    root = Element(
        "fmiLayeredStandardManifest",
        {
            "xmlns:fmi-ls": _MANIFEST_NAMESPACE,
            "fmi-ls:fmi-ls-name": _NAME,
            "fmi-ls:fmi-ls-version": "1.0.0",
            "fmi-ls:fmi-ls-description": _DESCRIPTION,
            "isBusSimulationFMU": "false",
        },
    )
    folder = f"extra/{_NAME}"
    return {
        "terminalsAndIcons/terminalsAndIcons.xml": _terminal(part.port),
        f"{folder}/fmi-ls-manifest.xml": tostring(root, encoding="UTF-8", xml_declaration=True),
        f"{folder}/{part.port.network}.dbc": part.dbc,
    }


def _terminal(port: Port) -> bytes:
    """Return ``terminalsAndIcons.xml`` with the terminal of ``port``."""
    root = Element("fmiTerminalsAndIcons", {"fmiVersion": "3.0"})
    terminal = SubElement(
        SubElement(root, "Terminals"),
        "Terminal",
        {
            "name": port.network,
            "terminalKind": "org.fmi-ls-bus.network-terminal",
            "matchingRule": "org.fmi-ls-bus.transceiver",
        },
    )
    for member in ("Tx_Data", "Rx_Data", "Tx_Clock", "Rx_Clock"):
        variable = {"variableName": f"{port.network}.{member}", "memberName": member, "variableKind": "signal"}
        SubElement(terminal, "TerminalMemberVariable", variable)
    indent(root)
    return tostring(root, encoding="UTF-8", xml_declaration=True)
