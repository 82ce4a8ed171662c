"""``modelDescription.xml`` of FMUs, for co-simulation and model exchange.

FMI 3.0 has arrays or, for tools that take none, scalars alone. Sources: Functional Mock-up Interface for Model
Exchange and Co-Simulation, version 2.0.5, sections 2.2 (definitions, model structure), 3.3 (model exchange), 4.3
(co-simulation); Functional Mock-up Interface Specification, version 3.0.2, sections 2.4 and 4.3.
"""

from collections.abc import Mapping, Sequence
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from strainfmu.fmu.description.fmu_description import (
    LOG_CATEGORIES,
    FmuDescription,
    default_experiment,
    number_text,
    root_attributes,
)
from strainfmu.fmu.description.port import add_port
from strainfmu.interface.enumerations import used_enumerations
from strainfmu.interface.fmi_variables import UNITS, Variable

INITIAL = {"output": "calculated", "local": "calculated", "parameter": "exact"}
"""Attribute ``initial`` by causality; inputs have its default, exact (2.0: section 2.2.7, 3.0: 2.4.7.4)."""

TIME = Variable(
    name="time", description="Simulation time", causality="independent", variability="continuous", unit="s"
)
"""FMI 3.0 requires time among the variables; it comes last, so that no other reference depends on it."""

FIRST_SCALAR = 1_000_000
"""Value reference of the first variable of an interface of scalars, as ``fmus/native/fmi3/fmi3.h`` has it."""

_TYPES = {"Real": "Float64", "Integer": "Int32", "Boolean": "Boolean", "Enumeration": "Enumeration"}
"""What FMI 3.0 calls the types of FMI 2.0."""

_Values = dict[str, str | float | tuple[float, ...] | None]


def model_description(fmu: FmuDescription) -> Element:
    """Return the root element ``fmiModelDescription`` of ``fmu``, in its version of FMI."""
    is_second = fmu.fmi_version == "2"
    version, token = ("2.0", "guid") if is_second else ("3.0", "instantiationToken")
    root = Element("fmiModelDescription", {"fmiVersion": version, token: fmu.guid, **root_attributes(fmu)})
    for kind, attributes in {"ModelExchange": fmu.model_exchange, "CoSimulation": fmu.capabilities}.items():
        if attributes is not None:
            element = SubElement(root, kind, {"modelIdentifier": fmu.model_identifier, **attributes})
            if is_second and fmu.source_files:  # 3.0 has them in sources/buildDescription.xml
                files = SubElement(element, "SourceFiles")
                for name in fmu.source_files:  # to compile; headers lie next to them unlisted
                    SubElement(files, "File", {"name": name})
    interface = fmu.interface if is_second else (*fmu.interface, TIME)
    references = fmu.references if is_second else _references(fmu)
    _add_units(root, interface)
    _add_types(root, interface, is_second)
    categories = SubElement(root, "LogCategories")
    for name, text in LOG_CATEGORIES.items():
        SubElement(categories, "Category", {"name": name, "description": text})
    SubElement(root, "DefaultExperiment", default_experiment(fmu))
    variables = SubElement(root, "ModelVariables")
    for variable in interface:
        variables.append(_variable(references[variable.name], variable, is_second))
    root.append(structure := _model_structure(fmu.interface, references, is_second))
    for number, port in enumerate(fmu.ports):
        add_port(variables, structure, port, number)
    return root


def model_description_bytes(fmu: FmuDescription) -> bytes:
    """Return ``modelDescription.xml`` of ``fmu``, UTF-8."""
    root = model_description(fmu)
    indent(root)
    return tostring(root, encoding="UTF-8", xml_declaration=True)


def _references(fmu: FmuDescription) -> dict[str, int]:
    """Return the value references of FMI 3.0 by name.

    Arrays count from 0, scalars instead of arrays from :data:`FIRST_SCALAR`. Time has the one behind all arrays,
    listed or not.
    """
    first, n_arrays = (0, len(fmu.references)) if fmu.n_arrays is None else (FIRST_SCALAR, fmu.n_arrays)
    return {**{name: first + number for name, number in fmu.references.items()}, TIME.name: n_arrays}


def _add_units(root: Element, interface: Sequence[Variable]) -> None:
    """Declare every unit in use: tools refuse FMUs that leave one out."""
    used = {variable.unit for variable in interface}
    definitions = SubElement(root, "UnitDefinitions")
    for unit in (unit for unit in UNITS if unit.name in used):
        element = SubElement(definitions, "Unit", {"name": unit.name})
        SubElement(element, "BaseUnit", {name: str(exponent) for name, exponent in unit.base})
        for display in unit.display_units:
            SubElement(element, "DisplayUnit", {"name": display.name, "factor": repr(display.factor)})


def _add_types(root: Element, interface: Sequence[Variable], is_second: bool) -> None:
    """Declare the enumerations in use; in FMI 3.0 without descriptions, which FMPy 0.3.20 refuses."""
    used = used_enumerations({variable.declared_type for variable in interface})
    definitions = SubElement(root, "TypeDefinitions") if used else None
    for name, (text, items) in used.items():
        assert definitions is not None
        if is_second:
            simple_type = SubElement(definitions, "SimpleType", {"name": name, "description": text})
            enumeration = SubElement(simple_type, "Enumeration")
        else:
            enumeration = SubElement(definitions, "EnumerationType", {"name": name})
        for state, meaning in items:
            item = {"name": state.name, "value": str(int(state)), "description": meaning}
            SubElement(enumeration, "Item", item)


def _variable(value_reference: int, variable: Variable, is_second: bool) -> Element:
    """Return one variable; its type and values are an element of their own in FMI 2.0."""
    attributes: _Values = {
        "name": variable.name,
        "valueReference": value_reference,
        "description": variable.description,
        "causality": variable.causality,
        "variability": variable.variability,
        "initial": INITIAL.get(variable.causality),
    }
    values: _Values = {
        "declaredType": variable.declared_type,
        "unit": variable.unit,
        "displayUnit": variable.display_unit,
        "min": variable.minimum,
        "max": variable.maximum,
        "nominal": variable.nominal,
        "start": variable.start,
    }
    if is_second:
        element = Element("ScalarVariable", _texts(attributes))
        SubElement(element, variable.fmi_type, _texts(values))
        return element
    element = Element(_TYPES[variable.fmi_type], _texts({**attributes, **values}))
    if variable.dimension is not None:
        SubElement(element, "Dimension", {"start": str(variable.dimension)})
    return element


def _texts(values: _Values) -> dict[str, str]:
    """Return ``values`` as XML has them, without those that are None."""
    texts = {}
    for name, value in values.items():
        if value is not None:
            numbers = value if isinstance(value, tuple) else (value,)
            texts[name] = " ".join(item if isinstance(item, str) else number_text(item) for item in numbers)
    return texts


def _model_structure(interface: Sequence[Variable], references: Mapping[str, int], is_second: bool) -> Element:
    """Return ModelStructure: what each output depends on, while stepping and at the start.

    An empty list of dependencies states that there are none. FMI 2.0 counts places in the list of variables, from
    1, unlike value references (2.0: section 2.2.8, 3.0: 2.4.8).
    """
    key, numbers = "valueReference", references
    if is_second:
        key, numbers = "index", {variable.name: k for k, variable in enumerate(interface, start=1)}
    structure = Element("ModelStructure")
    for tag, is_start in (("Output", False), ("InitialUnknown", True)):
        unknowns = SubElement(structure, f"{tag}s") if is_second else structure
        for variable in (variable for variable in interface if variable.causality == "output"):
            at_start = variable.initially_depends_on if is_start else ()
            known = (*variable.depends_on, *at_start)
            kinds = [variable.dependencies_kind] * len(variable.depends_on) + ["dependent"] * len(at_start)
            attributes = {
                key: str(numbers[variable.name]),
                "dependencies": " ".join(str(numbers[name]) for name in known),
            }
            if known:
                attributes["dependenciesKind"] = " ".join(kinds)
            SubElement(unknowns, "Unknown" if is_second else tag, attributes)
    return structure
