"""A system of FMUs as an SSP package, for other co-simulation engines.

Source: System Structure and Parameterization 1.0, Modelica Association, 2019, sections 4 and 5. Engines differ in
what they can read: OMSimulator wants identifiers for names and an annotation with its own settings, ecos and
libcosim refuse connectors of the system itself. An SSP knows no delays: an engine that steps all FMUs at once
delays every connection by a step.
"""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement, indent, register_namespace, tostring

from strainfmu.archive import write_archive
from strainfmu.cosim.systems.instance import read_description
from strainfmu.cosim.systems.system import System, check_connections, find_variable, split_signal
from strainfmu.errors import InputError

SSD = "http://ssp-standard.org/SSP1/SystemStructureDescription"
SSC = "http://ssp-standard.org/SSP1/SystemStructureCommon"
OMS = "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd"
_SCALE = 100.0


def write_ssp(
    system: System, path: Path, name: str, stop_time: float, step_size: float, system_connectors: bool = False
) -> None:
    """Write an SSP package that holds the FMUs of ``system``.

    Parameters
    ----------
    stop_time, step_size : of the default experiment [s].
    system_connectors : whether scalar outputs also become connectors of the system itself.

    Raises
    ------
    InputError
        ``path`` does not end in ``.ssp``, start values are given, a connection cannot be meant, the name of an
        instance is no identifier, or two outputs would become one connector of the system.
    StrainfmuError
        The file could not be written; ``path`` keeps its old content.
    """
    check_ssp_path(path)
    for item in system.instances:
        if item != identifier(item):
            raise InputError(f"SSP: instance '{item}': expected an identifier such as '{identifier(item)}'")
    if system.start_values:
        raise InputError("SSP: start values found; give them to the FMUs when these are exported")
    descriptions = {item: read_description(Path(fmu)) for item, fmu in system.instances.items()}
    check_connections(system, descriptions)
    root = system_structure(system, descriptions, name, stop_time, step_size, system_connectors)
    entries = {"SystemStructure.ssd": tostring(root, encoding="UTF-8", xml_declaration=True)}
    for item, fmu in system.instances.items():
        entries[f"resources/{item}.fmu"] = Path(fmu).read_bytes()
    write_archive(path, entries)


def check_ssp_path(path: Path) -> None:
    """Refuse to write a package under a name that no tool would open.

    Raises
    ------
    InputError
        The name does not end in ``.ssp``.
    """
    if path.suffix != ".ssp":
        raise InputError(f"{path}: the name of an SSP package must end in .ssp")


def system_structure(
    system: System,
    descriptions: Mapping[str, Any],
    name: str,
    stop_time: float,
    step_size: float,
    system_connectors: bool,
) -> Element:
    """Return the root element of ``SystemStructure.ssd``; ``descriptions`` are fmpy's, by name of the instance."""
    for prefix, uri in (("ssd", SSD), ("ssc", SSC), ("oms", OMS)):
        register_namespace(prefix, uri)
    root = Element(f"{{{SSD}}}SystemStructureDescription", {"version": "1.0", "name": identifier(name)})
    top = SubElement(root, f"{{{SSD}}}System", {"name": "flight"})
    outputs = _scalar_outputs(descriptions)
    if system_connectors:
        _check_distinct(outputs)
        connectors = SubElement(top, f"{{{SSD}}}Connectors")
        for signal in outputs:
            _add_connector(connectors, identifier(signal), "output", find_variable(signal, descriptions).type)
    elements = SubElement(top, f"{{{SSD}}}Elements")
    for index, instance in enumerate(system.instances):
        _add_component(elements, system, descriptions, instance, outputs, index)
    connections = SubElement(top, f"{{{SSD}}}Connections")
    for connection in system.connections:
        _add_connection(
            connections, split_signal(connection.source, descriptions), connection.target, descriptions
        )
    for signal in outputs if system_connectors else ():
        instance, variable = split_signal(signal, descriptions)
        ends = {"startElement": instance, "startConnector": variable, "endConnector": identifier(signal)}
        SubElement(connections, f"{{{SSD}}}Connection", ends)
    _add_annotation(top, step_size)
    SubElement(root, f"{{{SSD}}}DefaultExperiment", {"startTime": "0", "stopTime": repr(stop_time)})
    indent(root)
    return root


def _scalar_outputs(descriptions: Mapping[str, Any]) -> list[str]:
    """Return the outputs that are no elements of an array."""
    return [
        f"{instance}.{variable.name}"
        for instance, description in descriptions.items()
        for variable in description.modelVariables
        if variable.causality == "output" and not variable.name.endswith("]")
    ]


def identifier(name: str) -> str:
    """Return ``name`` as a C name.

    OMSimulator takes no other for a model or an instance. It splits what it reads at dots: a connector ``a_b.c``
    of the system would be ``c`` of an instance ``a_b``, of another causality.
    """
    made = re.sub(r"[^A-Za-z0-9_]+", "_", name).strip("_")
    return made if made and not made[0].isdigit() else f"m_{made}"


def _check_distinct(outputs: Sequence[str]) -> None:
    """Refuse outputs that would become one connector of the system."""
    known: dict[str, str] = {}
    for signal in outputs:
        name = identifier(signal)
        if name in known:
            raise InputError(f"SSP: outputs '{known[name]}' and '{signal}' would both become connector '{name}'")
        known[name] = signal


def _add_component(
    elements: Element,
    system: System,
    descriptions: Mapping[str, Any],
    instance: str,
    outputs: list[str],
    index: int,
) -> None:
    """Add one FMU with its scalar outputs and what is connected: FMPy sets every input that has a connector."""
    component = SubElement(
        elements,
        f"{{{SSD}}}Component",
        {"name": instance, "type": "application/x-fmu-sharedlibrary", "source": f"resources/{instance}.fmu"},
    )
    used = {c.source for c in system.connections} | {c.target for c in system.connections} | set(outputs)
    connectors = SubElement(component, f"{{{SSD}}}Connectors")
    for variable in descriptions[instance].modelVariables:
        if f"{instance}.{variable.name}" in used:
            _add_connector(connectors, variable.name, variable.causality, variable.type)
    x = 2.0 * _SCALE * index
    box = {"x1": x, "y1": 0.0, "x2": x + _SCALE, "y2": _SCALE}
    SubElement(component, f"{{{SSD}}}ElementGeometry", {key: f"{value:g}" for key, value in box.items()})


def _add_connector(connectors: Element, name: str, kind: str, fmi_type: str) -> None:
    connector = SubElement(connectors, f"{{{SSD}}}Connector", {"name": name, "kind": kind})
    # An Enumeration needs its items declared once more; its numbers are all that is passed on.
    SubElement(connector, f"{{{SSC}}}{'Integer' if fmi_type == 'Enumeration' else fmi_type}")


def _add_connection(
    connections: Element, source: tuple[str, str], target_signal: str, descriptions: Mapping[str, Any]
) -> None:
    target = split_signal(target_signal, descriptions)
    ends = dict(
        zip(("startElement", "startConnector", "endElement", "endConnector"), (*source, *target), strict=True)
    )
    SubElement(connections, f"{{{SSD}}}Connection", ends)


def _add_annotation(top: Element, step_size: float) -> None:
    """Add what OMSimulator's command line needs to run a system; others skip it."""
    annotations = SubElement(top, f"{{{SSD}}}Annotations")
    annotation = SubElement(annotations, f"{{{SSC}}}Annotation", {"type": "org.openmodelica"})
    information = SubElement(SubElement(annotation, f"{{{OMS}}}Annotations"), f"{{{OMS}}}SimulationInformation")
    settings = {
        "description": "oms-ma",
        "stepSize": repr(step_size),
        "absoluteTolerance": "1e-4",
        "relativeTolerance": "1e-4",
    }
    SubElement(information, f"{{{OMS}}}FixedStepMaster", settings)
