"""Names of a model description that the standards want to be unique, and names that it refers to.

Sources: FMI 2.0.5, the documentation inside its schemas (fmi2Unit, fmi2Type, fmi2ScalarVariable, fmi2Annotation,
fmi2ModelDescription); FMI 3.0.2, sections 2.4.2 to 2.4.9 and 2.6. Schemas do not check them.
"""

import zipfile
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from xml.etree.ElementTree import Element, fromstring

import pytest
from flight_fmu import whole_map
from other_load_maps import with_further_tables
from parameter_maps import with_parameter_tables
from sensor_maps import with_sensors
from slender_vehicle import slender_flight_model
from synthetic_vehicle import synthetic_flight_model, synthetic_inverse_map
from thermal_maps import with_temperature

from strainfmu.cosim.models.autopilot import AutopilotSettings, autopilot_interface
from strainfmu.cosim.models.schedule import ScheduledSignal, schedule_interface
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.fmu.description.fmu_description import FmuDescription
from strainfmu.fmu.description.model_description import model_description
from strainfmu.interface.estimator_variables import estimator_arrays, estimator_interface
from strainfmu.interface.fmi_variables import Variable
from strainfmu.interface.plant_variables import FlightStart, Motion, native_plant_interface, plant_interface
from strainfmu.interface.sensor_variables import sensor_names

pytestmark = pytest.mark.fast

START = FlightStart(mach_number=6.0, altitude=20e3, angle_of_attack=0.05)


def everything() -> tuple[Variable, ...]:
    """Variables of a map that has all that a map can have."""
    return estimator_interface(
        with_temperature(with_sensors(with_parameter_tables(with_further_tables(whole_map()))))
    )


def with_names_alike() -> InverseMap:
    """Sensors whose names become one, and whose second name is taken as well."""
    held = with_sensors(whole_map())
    n, names = held.n_strain_gauges, list(held.gauge_names)
    names[n : n + 4] = ["port 1", f"port_1_{n + 3}", "port_1", "port-1"]
    return replace(held, gauge_names=tuple(names))


INTERFACES: dict[str, Callable[[], Sequence[Variable]]] = {
    "estimator of form absolute": lambda: estimator_interface(synthetic_inverse_map()),
    "estimator with everything": everything,
    "arrays with everything": lambda: estimator_arrays(everything()),
    "plant of kind python": lambda: plant_interface(synthetic_flight_model()),
    **{
        f"plant, {motion.name}": lambda motion=motion: native_plant_interface(
            slender_flight_model(), motion, START
        )
        for motion in Motion
    },
    "sensors with names that are alike": lambda: estimator_interface(with_names_alike()),
    "schedule": lambda: schedule_interface(
        [
            ScheduledSignal(Variable(name=name, description=name, causality="output", unit="s"), (0.0,), (0.0,))
            for name in ("one", "two")
        ]
    ),
    "autopilot": lambda: autopilot_interface(slender_flight_model(), START, AutopilotSettings()),
}


def repeated(what: str, names: Iterable[str | None]) -> Iterator[str]:
    yield from (f"{what} '{name}' stands {n} times" for name, n in Counter(names).items() if n > 1)


def unknown(what: str, names: Iterable[str | None], known: Iterable[str | None]) -> Iterator[str]:
    yield from (f"{what} '{name}' is not declared" for name in {*names} - {*known} - {None})


def names_of(elements: Iterable[Element]) -> list[str | None]:
    return [one.get("name") for one in elements]


def faults(root: Element) -> list[str]:
    """What is wrong with the names in ``modelDescription.xml`` of either version."""
    second = root.get("fmiVersion") == "2.0"
    variables, units = root.findall("ModelVariables/*"), root.findall("UnitDefinitions/Unit")
    types = root.findall("TypeDefinitions/*")
    # In FMI 2.0 unit and type stand on an element inside the variable.
    typed = [one[0] for one in variables] if second else variables
    found = [
        *repeated("unit", names_of(units)),
        *repeated("type", names_of(types)),
        *repeated("category", names_of(root.findall("LogCategories/Category"))),
        *repeated("annotation", names_of(root.findall("VendorAnnotations/Tool"))),
        *repeated("annotation", [one.get("type") for one in root.findall("Annotations/Annotation")]),
        *repeated("variable", names_of([*variables, *root.findall("ModelVariables/*/Alias")])),
        *repeated("type or variable", [*{*names_of(types)}, *{*names_of(variables)}]),
        *repeated("value reference", [one.get("valueReference") for one in variables]),
        *unknown("unit", [one.get("unit") for one in typed], names_of(units)),
        *unknown("type", [one.get("declaredType") for one in typed], names_of(types)),
    ]
    displays = {unit.get("name"): names_of(unit.findall("DisplayUnit")) for unit in units}
    for unit, shown in displays.items():
        found += repeated(f"unit '{unit}': display unit", shown)
    for one in typed:
        if one.get("displayUnit"):
            found += unknown(
                f"unit '{one.get('unit')}': display unit", [one.get("displayUnit")], displays[one.get("unit")]
            )
    for one in types:
        items = one.findall(".//Item")
        for attribute in ("name", "value"):
            found += repeated(f"type '{one.get('name')}': item", [item.get(attribute) for item in items])
    for files in root.findall("*/SourceFiles"):
        found += repeated("source file", names_of(files))
    return [*found, *structure_faults(root, second, variables)]


def structure_faults(root: Element, second: bool, variables: Sequence[Element]) -> Iterator[str]:
    """What is wrong with what ``ModelStructure`` refers to: by index in FMI 2.0, by value reference in 3.0."""
    key = "index" if second else "valueReference"
    known = [str(k) for k in range(1, len(variables) + 1)] if second else [one.get(key) for one in variables]
    for tag in {one.tag for one in root.findall("ModelStructure/*")}:
        unknowns = root.findall(f"ModelStructure/{tag}/Unknown" if second else f"ModelStructure/{tag}")
        yield from repeated(f"{tag}: unknown", [one.get(key) for one in unknowns])
        yield from unknown(f"{tag}: unknown", [one.get(key) for one in unknowns], known)
        for one in unknowns:
            dependencies = (one.get("dependencies") or "").split()
            yield from repeated(f"{tag}: {one.get(key)}: dependency", dependencies)
            yield from unknown(f"{tag}: {one.get(key)}: dependency", dependencies, known)
            kinds = one.get("dependenciesKind")
            if kinds is not None and len(kinds.split()) != len(dependencies):
                yield f"{tag}: {one.get(key)}: {len(kinds.split())} kinds of {len(dependencies)} dependencies"


def described(interface: Sequence[Variable], version: str) -> Element:
    """Description of an FMU that has these variables, and source files and model exchange as well."""
    fmu = FmuDescription(
        model_name="M",
        description="d",
        interface=interface,
        content_hash="",
        stop_time=1.0,
        step_size=0.1,
        fmi_version=version,
        source_files=("a.c", "b.c"),
        model_exchange={},
    )
    return model_description(fmu)


@pytest.mark.parametrize(
    ("name", "version"), [(n, v) for n in INTERFACES for v in ("2", "3") if v == "3" or "arrays" not in n]
)
def test_names_of_every_interface_are_unique(name: str, version: str) -> None:
    root = described(INTERFACES[name](), version)
    assert len(root.findall("ModelStructure/*")) > 1
    assert faults(root) == []


def test_no_sensor_is_lost_where_names_become_one() -> None:
    held = with_names_alike()
    assert len(set(sensor_names(held))) == held.n_gauges - held.n_strain_gauges
    assert sensor_names(held)[:2] == ("sensor.port_1", f"sensor.port_1_{held.n_strain_gauges + 3}")


@pytest.mark.parametrize("kind", ["native", "native_3", "scalars", "python", "plant"])
def test_names_of_every_fmu_are_unique(fmus: dict[str, Path], kind: str) -> None:
    with zipfile.ZipFile(fmus[kind]) as archive:
        assert len(archive.namelist()) == len(set(archive.namelist()))
        assert faults(fromstring(archive.read("modelDescription.xml"))) == []
        terminals = fromstring(archive.read("terminalsAndIcons/terminalsAndIcons.xml")).findall(
            "Terminals/Terminal"
        )
        built = [n for n in archive.namelist() if n == "sources/buildDescription.xml"]
        builds = [fromstring(archive.read(n)) for n in built]
    assert terminals
    found = [*repeated("terminal", names_of(terminals))]
    for one in terminals:
        members = one.findall("TerminalMemberVariable")
        for attribute in ("memberName", "variableName"):
            found += repeated(f"terminal '{one.get('name')}': member", [m.get(attribute) for m in members])
    for build in builds:
        found += repeated("source file", names_of(build.iter("SourceFile")))
    assert found == []


@pytest.mark.parametrize(
    ("damage", "fault"),
    [
        (
            lambda root: root.find("UnitDefinitions").append(Element("Unit", {"name": "s"})),
            "unit 's' stands 2 times",
        ),
        (
            lambda root: root.find("ModelVariables")[1].set("name", "HealthState"),
            "type or variable 'HealthState' stands 2 times",
        ),
        (
            lambda root: root.find("ModelVariables")[1].set("valueReference", "0"),
            "value reference '0' stands 2 times",
        ),
        (
            lambda root: root.find("TypeDefinitions")[0][1].set("value", "0"),
            "type 'HealthState': item '0' stands 2 times",
        ),
        (lambda root: root.find("ModelVariables")[1].set("unit", "Nm"), "unit 'Nm' is not declared"),
    ],
)
def test_a_repeated_name_is_found(damage: Callable[[Element], None], fault: str) -> None:
    """The check itself, on a description that is in order."""
    root = described(INTERFACES["arrays with everything"](), "3")
    damage(root)
    assert fault in faults(root)
