"""``terminalsAndIcons/``: the gauges as one connector, and the picture that tools show.

Source: Functional Mock-up Interface Specification, version 3.0.2, section 2.4.9; FMI 2.0 allows the same folder.
"""

from collections.abc import Mapping, Sequence
from importlib import resources
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from strainfmu.fmu.description.fmu_description import FmuDescription
from strainfmu.interface.fmi_variables import Variable

ICON_EXTENT = {"x1": "-100", "y1": "-100", "x2": "100", "y2": "100"}


def terminal_files(
    fmu: FmuDescription, terminals: Mapping[str, tuple[Sequence[str], str]], icon: str
) -> dict[str, bytes]:
    """Return content by name: the terminals, the icon and, where FMI 2.0 requires it, the icon once more.

    Parameters
    ----------
    terminals : arrays or scalars, and description, by name of the terminal; their variables are its members.
    icon : name of the picture in ``fmus/icons``, without ``.png``.
    """
    picture = resources.files("fmus").joinpath("icons", f"{icon}.png").read_bytes()
    files = {
        "terminalsAndIcons/icon.png": picture,
        "terminalsAndIcons/terminalsAndIcons.xml": terminals_xml(fmu.interface, terminals),
    }
    return {"model.png": picture, **files} if fmu.fmi_version == "2" else files


def terminals_xml(interface: Sequence[Variable], terminals: Mapping[str, tuple[Sequence[str], str]]) -> bytes:
    """Return ``terminalsAndIcons.xml``."""
    root = Element("fmiTerminalsAndIcons", {"fmiVersion": "3.0"})
    picture = SubElement(root, "GraphicalRepresentation")
    SubElement(picture, "CoordinateSystem", {**ICON_EXTENT, "suggestedScalingFactorTo_mm": "0.1"})
    SubElement(picture, "Icon", ICON_EXTENT)
    group = SubElement(root, "Terminals")
    for name, (members, text) in terminals.items():
        terminal = SubElement(group, "Terminal", {"name": name, "matchingRule": "plug", "description": text})
        for variable in interface:
            if (variable.array or variable.name) in members:
                member = {"variableName": variable.name, "memberName": variable.name, "variableKind": "signal"}
                SubElement(terminal, "TerminalMemberVariable", member)
    indent(root)
    return tostring(root, encoding="UTF-8", xml_declaration=True)
