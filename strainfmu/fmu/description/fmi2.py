"""``modelDescription.xml`` of FMI 2.0 FMUs, for co-simulation and model exchange.

Source: Functional Mock-up Interface for Model Exchange and Co-Simulation, version 2.0.5, section 2.2
(definitions), 2.2.8 (model structure), 3.3 (model exchange) and 4.3 (co-simulation).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from strainfmu.fmu.description.fmu_description import (
    LOG_CATEGORIES,
    FmuDescription,
    default_experiment,
    number_text,
    root_attributes,
)
from strainfmu.interface.enumerations import used_enumerations
from strainfmu.interface.fmi_variables import UNITS, Unit, Variable

INITIAL = {"output": "calculated", "local": "calculated", "parameter": "exact"}
"""Attribute ``initial`` by causality; inputs have its default, exact."""


def model_description(fmu: FmuDescription) -> Element:
    """Return the root element ``fmiModelDescription`` of ``fmu``."""
    root = Element("fmiModelDescription", {"fmiVersion": "2.0", "guid": fmu.guid, **root_attributes(fmu)})
    kinds = {"ModelExchange": fmu.model_exchange, "CoSimulation": fmu.capabilities}
    for kind, attributes in kinds.items():
        if attributes is not None:
            element = SubElement(root, kind, {"modelIdentifier": fmu.model_identifier, **attributes})
            _add_sources(element, fmu.source_files)
    add_units(root, fmu.interface)
    _add_types(root, fmu.interface)
    categories = SubElement(root, "LogCategories")
    for name, text in LOG_CATEGORIES.items():
        SubElement(categories, "Category", {"name": name, "description": text})
    SubElement(root, "DefaultExperiment", default_experiment(fmu))
    variables = SubElement(root, "ModelVariables")
    for variable in fmu.interface:
        variables.append(_scalar_variable(fmu.references[variable.name], variable))
    root.append(_model_structure(fmu.interface))
    return root


def _add_sources(kind: Element, names: Sequence[str]) -> None:
    """List the files to compile; headers lie next to them unlisted."""
    if names:
        files = SubElement(kind, "SourceFiles")
        for name in names:
            SubElement(files, "File", {"name": name})


def model_description_bytes(fmu: FmuDescription) -> bytes:
    """Return ``modelDescription.xml`` of ``fmu``, UTF-8."""
    root = model_description(fmu)
    indent(root)
    return tostring(root, encoding="UTF-8", xml_declaration=True)


def add_units(root: Element, interface: Sequence[Variable]) -> None:
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
    """Declare the enumerations in use."""
    used = used_enumerations({variable.declared_type for variable in interface})
    definitions = SubElement(root, "TypeDefinitions") if used else None
    for name, (text, items) in used.items():
        assert definitions is not None
        simple_type = SubElement(definitions, "SimpleType", {"name": name, "description": text})
        enumeration = SubElement(simple_type, "Enumeration")
        for state, meaning in items:
            item = {"name": state.name, "value": str(int(state)), "description": meaning}
            SubElement(enumeration, "Item", item)


def _scalar_variable(value_reference: int, variable: Variable) -> Element:
    """Return one ScalarVariable; outputs are calculated, inputs and parameters exact (section 2.2.7)."""
    attributes = {
        "name": variable.name,
        "valueReference": str(value_reference),
        "description": variable.description,
        "causality": variable.causality,
        "variability": variable.variability,
    }
    if variable.causality in INITIAL:
        attributes["initial"] = INITIAL[variable.causality]
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
    SubElement(
        element,
        variable.fmi_type,
        {
            name: value if isinstance(value, str) else number_text(value)
            for name, value in values.items()
            if value is not None and not isinstance(value, tuple)
        },
    )
    return element


def _model_structure(interface: Sequence[Variable]) -> Element:
    """Return ModelStructure: what each output depends on, while stepping and at the start (2.2.8)."""
    # Places in the list, from 1 on, unlike value references.
    index = {variable.name: k for k, variable in enumerate(interface, start=1)}
    structure = Element("ModelStructure")
    outputs = SubElement(structure, "Outputs")
    unknowns = SubElement(structure, "InitialUnknowns")
    for variable in interface:
        if variable.causality != "output":
            continue
        step_kinds = [variable.dependencies_kind] * len(variable.depends_on)
        initial_kinds = step_kinds + ["dependent"] * len(variable.initially_depends_on)
        initially = variable.depends_on + variable.initially_depends_on
        outputs.append(_unknown(index, variable.name, depends_on=variable.depends_on, kinds=step_kinds))
        unknowns.append(_unknown(index, variable.name, depends_on=initially, kinds=initial_kinds))
    return structure


def _unknown(index: Mapping[str, int], name: str, *, depends_on: Sequence[str], kinds: Sequence[str]) -> Element:
    """Return one Unknown; an empty list of dependencies states that there are none."""
    attributes = {
        "index": str(index[name]),
        "dependencies": " ".join(str(index[known]) for known in depends_on),
    }
    if depends_on:
        attributes["dependenciesKind"] = " ".join(kinds)
    return Element("Unknown", attributes)
