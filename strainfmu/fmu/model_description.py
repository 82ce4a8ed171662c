"""The one generator of ``modelDescription.xml`` for FMI 2.0 co-simulation FMUs of this project.

Source: Functional Mock-up Interface for Model Exchange and Co-Simulation, version 2.0.5, section 2.2
(definitions), 2.2.8 (model structure) and 4.3 (co-simulation).
"""

from __future__ import annotations

import hashlib
import os
import re
import uuid
from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass, field
from datetime import UTC, datetime
from xml.etree.ElementTree import Element, SubElement, tostring

from strainfmu import __version__
from strainfmu.errors import InputError
from strainfmu.interface import HEALTH_ITEMS, HEALTH_TYPE, UNITS, Unit, Variable

_NAMESPACE = uuid.uuid5(uuid.NAMESPACE_DNS, "strainfmu")

LOG_CATEGORIES = {
    "logStatusWarning": "Messages with status fmi2Warning",
    "logStatusDiscard": "Messages with status fmi2Discard",
    "logStatusError": "Messages with status fmi2Error",
    "logStatusFatal": "Messages with status fmi2Fatal",
    "logAll": "All messages",
}


@dataclass(frozen=True)
class FmuDescription:
    """What an FMU says about itself besides its variables.

    Attributes
    ----------
    model_name : free text, shown by tools.
    description : one sentence on what it computes.
    interface : the variables; their place is their value reference.
    content_hash : hash of everything inside that decides the results.
    stop_time : end of the default experiment [s].
    step_size : communication step size of the default experiment [s].
    capabilities : attributes of the CoSimulation element.
    """

    model_name: str
    description: str
    interface: Sequence[Variable]
    content_hash: str
    stop_time: float
    step_size: float
    capabilities: Mapping[str, str] = field(default_factory=dict)

    @property
    def model_identifier(self) -> str:
        """The model name turned into a C name, as file names of binaries must be (section 2.2.1)."""
        return model_identifier(self.model_name)

    @property
    def guid(self) -> str:
        """A name-based UUID: equal content and interface give an equal guid, any change another one."""
        content = repr((self.model_name, self.content_hash, __version__, [astuple(v) for v in self.interface]))
        return str(uuid.uuid5(_NAMESPACE, hashlib.sha256(content.encode()).hexdigest()))


def model_identifier(model_name: str) -> str:
    """Return ``model_name`` as a C name.

    Raises
    ------
    InputError
        It holds no letter or digit to make one from.
    """
    identifier = re.sub(r"[^A-Za-z0-9]+", "_", model_name).strip("_")
    if not identifier:
        raise InputError(f"model name: '{model_name}' found, at least one letter from A to Z is needed")
    return f"m_{identifier}" if identifier[0].isdigit() else identifier


def generation_time() -> datetime:
    """Return the time to stamp: SOURCE_DATE_EPOCH if set (reproducible-builds.org), else now.

    Raises
    ------
    InputError
        SOURCE_DATE_EPOCH is no number of seconds.
    """
    epoch = os.environ.get("SOURCE_DATE_EPOCH")
    if epoch is None:
        return datetime.now(UTC)
    try:
        return datetime.fromtimestamp(int(epoch), UTC)
    except (ValueError, OverflowError, OSError) as error:
        raise InputError(f"SOURCE_DATE_EPOCH: '{epoch}' found, whole seconds since 1970 wanted") from error


def model_description(fmu: FmuDescription) -> Element:
    """Return the root element ``fmiModelDescription`` of ``fmu``."""
    root = Element(
        "fmiModelDescription",
        {
            "fmiVersion": "2.0",
            "modelName": fmu.model_name,
            "guid": f"{{{fmu.guid}}}",
            "description": fmu.description,
            "author": "strainfmu developers",
            "version": __version__,
            "copyright": "strainfmu developers; the data inside belong to their makers",
            "license": "BSD-3-Clause",
            "generationTool": f"strainfmu {__version__}",
            "generationDateAndTime": generation_time().strftime("%Y-%m-%dT%H:%M:%SZ"),
            "variableNamingConvention": "structured",
        },
    )
    SubElement(root, "CoSimulation", {"modelIdentifier": fmu.model_identifier, **fmu.capabilities})
    _add_units(root, fmu.interface)
    _add_types(root, fmu.interface)
    categories = SubElement(root, "LogCategories")
    for name, text in LOG_CATEGORIES.items():
        SubElement(categories, "Category", {"name": name, "description": text})
    SubElement(
        root,
        "DefaultExperiment",
        {
            "startTime": "0",
            "stopTime": repr(fmu.stop_time),
            "tolerance": "1e-06",
            "stepSize": repr(fmu.step_size),
        },
    )
    variables = SubElement(root, "ModelVariables")
    for value_reference, variable in enumerate(fmu.interface):
        variables.append(_scalar_variable(value_reference, variable))
    root.append(_model_structure(fmu.interface))
    return root


def model_description_bytes(fmu: FmuDescription) -> bytes:
    """Return ``modelDescription.xml`` of ``fmu``, UTF-8, not indented (PythonFMU indents it)."""
    return tostring(model_description(fmu), encoding="UTF-8", xml_declaration=True)


def _add_units(root: Element, interface: Sequence[Variable]) -> None:
    """Declare every unit in use: tools refuse FMUs that leave one out."""
    used = {variable.unit for variable in interface}
    definitions = SubElement(root, "UnitDefinitions")
    for unit in UNITS:
        if unit.name in used:
            _add_unit(definitions, unit)


def _add_unit(definitions: Element, unit: Unit) -> None:
    element = SubElement(definitions, "Unit", {"name": unit.name})
    SubElement(element, "BaseUnit", {name: str(exponent) for name, exponent in unit.base})
    for display in unit.display_units:
        SubElement(element, "DisplayUnit", {"name": display.name, "factor": repr(display.factor)})


def _add_types(root: Element, interface: Sequence[Variable]) -> None:
    """Declare the enumeration of the health state where it is used."""
    if not any(variable.declared_type == HEALTH_TYPE for variable in interface):
        return
    simple_type = SubElement(
        SubElement(root, "TypeDefinitions"),
        "SimpleType",
        {"name": HEALTH_TYPE, "description": "How far an estimate may be believed, worst last"},
    )
    enumeration = SubElement(simple_type, "Enumeration")
    for state, text in HEALTH_ITEMS:
        SubElement(enumeration, "Item", {"name": state.name, "value": str(int(state)), "description": text})


def _scalar_variable(value_reference: int, variable: Variable) -> Element:
    """Return one ScalarVariable; outputs are calculated, inputs and parameters exact (section 2.2.7)."""
    attributes = {
        "name": variable.name,
        "valueReference": str(value_reference),
        "description": variable.description,
        "causality": variable.causality,
        "variability": variable.variability,
    }
    if variable.causality == "output":
        attributes["initial"] = "calculated"
    elif variable.causality == "parameter":
        attributes["initial"] = "exact"
    element = Element("ScalarVariable", attributes)
    values = {
        "declaredType": variable.declared_type,
        "unit": variable.unit,
        "displayUnit": variable.display_unit,
        "min": variable.minimum,
        "max": variable.maximum,
        "nominal": variable.nominal,
        "start": variable.start,
    }
    number = int if variable.fmi_type == "Integer" else float
    SubElement(
        element,
        variable.fmi_type,
        {
            name: value if isinstance(value, str) else repr(number(value))
            for name, value in values.items()
            if value is not None
        },
    )
    return element


def _model_structure(interface: Sequence[Variable]) -> Element:
    """Return ModelStructure: what each output depends on, while stepping and at the start (2.2.8)."""
    # Indices count from 1 there, unlike value references.
    index = {variable.name: place for place, variable in enumerate(interface, start=1)}
    structure = Element("ModelStructure")
    outputs = SubElement(structure, "Outputs")
    unknowns = SubElement(structure, "InitialUnknowns")
    for variable in interface:
        if variable.causality != "output":
            continue
        step_kinds = [variable.dependencies_kind] * len(variable.depends_on)
        initial_kinds = step_kinds + ["dependent"] * len(variable.initially_depends_on)
        initially = variable.depends_on + variable.initially_depends_on
        outputs.append(_unknown(index, variable.name, variable.depends_on, step_kinds))
        unknowns.append(_unknown(index, variable.name, initially, initial_kinds))
    return structure


def _unknown(index: Mapping[str, int], name: str, depends_on: Sequence[str], kinds: Sequence[str]) -> Element:
    """Return one Unknown; an empty list of dependencies says that there are none."""
    attributes = {
        "index": str(index[name]),
        "dependencies": " ".join(str(index[known]) for known in depends_on),
    }
    if depends_on:
        attributes["dependenciesKind"] = " ".join(kinds)
    return Element("Unknown", attributes)
