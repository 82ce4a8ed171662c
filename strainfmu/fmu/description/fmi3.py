"""``modelDescription.xml`` of FMI 3.0 FMUs, with arrays or, for tools that take none, with scalars alone.

Source: Functional Mock-up Interface Specification, version 3.0.2, section 2.4 (definitions, variables, model
structure) and 4.3 (co-simulation).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from strainfmu.fmu.description.fmi2 import INITIAL, add_units
from strainfmu.fmu.description.fmu_description import (
    LOG_CATEGORIES,
    FmuDescription,
    default_experiment,
    number_text,
    root_attributes,
)
from strainfmu.fmu.description.port import add_port
from strainfmu.interface.enumerations import used_enumerations
from strainfmu.interface.fmi_variables import Variable

TIME = Variable(
    name="time", description="Simulation time", causality="independent", variability="continuous", unit="s"
)
"""FMI 3.0 requires time among the variables; it comes last, so that no other reference depends on it."""

FIRST_SCALAR = 1_000_000
"""Value reference of the first variable of an interface of scalars, as ``fmus/native/fmi3/fmi3.h`` has it."""

_TYPES = {"Real": "Float64", "Integer": "Int32", "Boolean": "Boolean", "Enumeration": "Enumeration"}


def model_description_3(fmu: FmuDescription) -> Element:
    """Return the root element ``fmiModelDescription`` of ``fmu``."""
    root = Element(
        "fmiModelDescription", {"fmiVersion": "3.0", "instantiationToken": fmu.guid, **root_attributes(fmu)}
    )
    kinds = {"ModelExchange": fmu.model_exchange, "CoSimulation": fmu.capabilities}
    for kind, attributes in kinds.items():
        if attributes is not None:
            SubElement(root, kind, {"modelIdentifier": fmu.model_identifier, **attributes})
    interface, references = (*fmu.interface, TIME), _references(fmu)
    add_units(root, interface)
    _add_types(root, interface)
    categories = SubElement(root, "LogCategories")
    for name, text in LOG_CATEGORIES.items():
        SubElement(categories, "Category", {"name": name, "description": text})
    SubElement(root, "DefaultExperiment", default_experiment(fmu))
    variables = SubElement(root, "ModelVariables")
    for variable in interface:
        variables.append(_variable(references[variable.name], variable))
    root.append(structure := _model_structure(fmu.interface, references))
    for number, port in enumerate(fmu.ports):
        add_port(variables, structure, port, number)
    return root


def _references(fmu: FmuDescription) -> dict[str, int]:
    """Return value references by name: arrays count from 0, scalars instead of arrays from :data:`FIRST_SCALAR`.

    Time has the one behind all arrays, listed or not.
    """
    first, n_arrays = (0, len(fmu.references)) if fmu.n_arrays is None else (FIRST_SCALAR, fmu.n_arrays)
    return {**{name: first + number for name, number in fmu.references.items()}, TIME.name: n_arrays}


def model_description_3_bytes(fmu: FmuDescription) -> bytes:
    """Return ``modelDescription.xml`` of ``fmu``, UTF-8."""
    root = model_description_3(fmu)
    indent(root)
    return tostring(root, encoding="UTF-8", xml_declaration=True)


def _add_types(root: Element, interface: Sequence[Variable]) -> None:
    """Declare the enumerations in use, without descriptions, which FMPy 0.3.20 refuses."""
    used = used_enumerations({variable.declared_type for variable in interface})
    definitions = SubElement(root, "TypeDefinitions") if used else None
    for name, (_, items) in used.items():
        assert definitions is not None
        enumeration = SubElement(definitions, "EnumerationType", {"name": name})
        for state, meaning in items:
            item = {"name": state.name, "value": str(int(state)), "description": meaning}
            SubElement(enumeration, "Item", item)


def _variable(value_reference: int, variable: Variable) -> Element:
    """Return one variable; ``initial`` of inputs is left to its default, exact (section 2.4.7.4)."""
    start = variable.start
    values = {
        "name": variable.name,
        "valueReference": str(value_reference),
        "description": variable.description,
        "causality": variable.causality,
        "variability": variable.variability,
        "initial": INITIAL.get(variable.causality),
        "declaredType": variable.declared_type,
        "unit": variable.unit,
        "displayUnit": variable.display_unit,
        "min": variable.minimum,
        "max": variable.maximum,
        "nominal": variable.nominal,
        "start": " ".join(number_text(value) for value in start) if isinstance(start, tuple) else start,
    }
    element = Element(
        _TYPES[variable.fmi_type],
        {
            name: value if isinstance(value, str) else number_text(value)
            for name, value in values.items()
            if value is not None
        },
    )
    if variable.dimension is not None:
        SubElement(element, "Dimension", {"start": str(variable.dimension)})
    return element


def _model_structure(interface: Sequence[Variable], references: Mapping[str, int]) -> Element:
    """Return ModelStructure: what each output depends on, while stepping and at the start (section 2.4.8)."""
    structure = Element("ModelStructure")
    outputs = [variable for variable in interface if variable.causality == "output"]
    for variable in outputs:
        kinds = [variable.dependencies_kind] * len(variable.depends_on)
        structure.append(
            _unknown("Output", references, name=variable.name, depends_on=variable.depends_on, kinds=kinds)
        )
    for variable in outputs:
        known = variable.depends_on + variable.initially_depends_on
        kinds = [variable.dependencies_kind] * len(variable.depends_on)
        kinds += ["dependent"] * len(variable.initially_depends_on)
        structure.append(_unknown("InitialUnknown", references, name=variable.name, depends_on=known, kinds=kinds))
    return structure


def _unknown(
    tag: str, references: Mapping[str, int], *, name: str, depends_on: Sequence[str], kinds: Sequence[str]
) -> Element:
    """Return one unknown; an empty list of dependencies states that there are none."""
    attributes = {
        "valueReference": str(references[name]),
        "dependencies": " ".join(str(references[known]) for known in depends_on),
    }
    if depends_on:
        attributes["dependenciesKind"] = " ".join(kinds)
    return Element(tag, attributes)
