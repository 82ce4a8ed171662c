"""Model descriptions of the FMUs."""

import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import fromstring

import pytest
from fmpy import read_model_description
from fmpy.validation import validate_fmu
from synthetic_vehicle import N_GAUGES, SyntheticFiles, synthetic_flight_model, synthetic_inverse_map

from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import LAST_INPUTS, QSource
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.tare import TareState
from strainfmu.fmu.description.fmu_description import FmuDescription, generation_time, model_identifier
from strainfmu.fmu.description.model_description import FIRST_SCALAR, model_description
from strainfmu.fmu.export import ExportOptions, export_estimator
from strainfmu.fmu.reference_run.run import array_elements
from strainfmu.interface.enumerations import ENUMERATIONS, HEALTH_ITEMS, Q_SOURCE_ITEMS, TARE_ITEMS
from strainfmu.interface.estimator_variables import (
    FLOW_INPUTS,
    PARAMETERS,
    estimator_arrays,
    estimator_interface,
)
from strainfmu.interface.fmi_variables import UNITS, Variable, value_references
from strainfmu.interface.listed_variables import most_important_first
from strainfmu.interface.plant_variables import plant_interface
from strainfmu.interface.zero_variables import zero_in_use_names, zero_names

pytestmark = pytest.mark.fast


def variables(path: Path) -> dict[str, Any]:
    """Return fmpy's ScalarVariables by name."""
    return {v.name: v for v in read_model_description(str(path)).modelVariables}


def test_coefficients_come_first_and_all_is_there(synthetic: SyntheticFiles) -> None:
    estimator, plant = variables(synthetic.estimator_1), variables(synthetic.plant)
    assert list(estimator)[:5] == list(plant)[:5] == ["C_A", "C_N", "C_Y", "M_P", "M_Y"]
    assert len(estimator) == 27 + 2 * N_GAUGES + 4 + 5 + 2 * N_GAUGES + 1 + 1 + 2 + 2 * N_GAUGES + 1 + 6
    assert estimator["valid[1]"].type == "Boolean"
    assert estimator["valid[1]"].start == "true"
    for name in PARAMETERS:
        assert (estimator[name].causality, estimator[name].variability) == ("parameter", "tunable")
    assert {v.valueReference for v in estimator.values()} == set(range(len(estimator)))
    assert estimator["force.axial"].unit == "N"
    assert estimator["moment.yaw"].unit == "N.m"
    assert estimator["strain[1]"].displayUnit == "um/m"
    assert "G0 at x = 0.3 m, roll angle 0 deg" in estimator["strain[1]"].description
    assert float(estimator["dynamic_pressure"].start) == 95.8e3
    assert estimator["health.state"].type == "Enumeration"
    assert plant["angle_of_attack"].unit == "rad"
    assert plant["seed"].type == "Integer"
    assert float(plant["noise_std"].start) == 1e-6
    # A gauge that sees nothing has no range; its noise is the scale then, for nominal must not be 0.
    assert float(estimator[f"strain[{N_GAUGES}]"].nominal) == 1e-7


def test_units_are_declared_in_si(synthetic: SyntheticFiles) -> None:
    units = {u.name: u for u in read_model_description(str(synthetic.estimator_1)).unitDefinitions}
    pressure = units["Pa"].baseUnit
    assert (pressure.kg, pressure.m, pressure.s, pressure.factor) == (1, -1, -2, 1)
    assert units["1"].displayUnits[0].name == "um/m"
    assert float(units["1"].displayUnits[0].factor) == 1e6
    radian = {u.name: u for u in read_model_description(str(synthetic.plant)).unitDefinitions}["rad"]
    assert radian.baseUnit.rad == 1
    assert float(radian.displayUnits[0].factor) == pytest.approx(57.29577951308232)


def test_dependencies_state_what_feeds_what(synthetic: SyntheticFiles) -> None:
    description = read_model_description(str(synthetic.estimator_1))
    known = {u.variable.name: ({v.name for v in u.dependencies}, u.dependenciesKind) for u in description.outputs}
    gauges = {f"{name}[{i + 1}]" for name in ("strain", "valid") for i in range(N_GAUGES)}
    flow = {*FLOW_INPUTS, "q_source"}
    assert known["C_A"] == (gauges | flow, ["dependent"] * (2 * N_GAUGES + 5))
    assert known["force.side"] == (gauges, ["dependent"] * 2 * N_GAUGES)
    assert known["sigma.C_N"][0] == known["health.envelope_score"][0] == gauges | flow
    assert known["health.state"][0] == gauges | {*FLOW_INPUTS, *LAST_INPUTS}
    assert known["health.usable"][0] == known["health.state"][0]
    assert known["sigma.force.axial"][0] == known["health.valid_gauges"][0] == gauges
    first = {u.variable.name: {v.name for v in u.dependencies} for u in description.initialUnknowns}
    zeros = {*zero_names(N_GAUGES)}
    assert zeros <= first["moment.yaw"]
    assert not zeros & first["health.valid_gauges"]
    first = {name: names - zeros for name, names in first.items()}
    assert first["moment.yaw"] - gauges == {"sensor_range", "moment_station"}
    assert first["M_Y"] - gauges - flow == {*PARAMETERS} - {"alarm_scale"}
    assert first["health.chi_square_limit"] - gauges == {"sensor_range", "alarm_scale"}
    plant = read_model_description(str(synthetic.plant))
    first = {u.variable.name: {v.name for v in u.dependencies} for u in plant.initialUnknowns}
    assert first["strain[1]"] == {"noise_std", "seed"}
    assert first["altitude"] == set()


def test_states_are_those_of_the_enumerations(fmus: dict[str, Path]) -> None:
    assert [state for state, _ in HEALTH_ITEMS] == list(HealthState)
    assert [state for state, _ in TARE_ITEMS] == list(TareState)
    assert [source for source, _ in Q_SOURCE_ITEMS] == list(QSource)
    for kind in ("native", "native_3", "python"):
        declared = read_model_description(str(fmus[kind])).typeDefinitions
        assert [one.name for one in declared] == list(ENUMERATIONS)
        for one, states in zip(declared, (HealthState, TareState, QSource), strict=True):
            assert [(item.name, int(item.value)) for item in one.items] == [(s.name, s.value) for s in states]


FMPY_0_3_20 = {"name", "quantity", "unit", "displayUnit", "relativeQuantity", "min", "max", "nominal", "unbounded"}
"""Attributes that this reader knows of a type definition of FMI 3.0: its ``SimpleType`` takes no other, such as
``description``, and the FMU is refused."""


@pytest.mark.parametrize("kind", ["native_3", "scalars"])
def test_type_definitions_of_fmi_3_hold_what_old_readers_know(fmus: dict[str, Path], kind: str) -> None:
    with zipfile.ZipFile(fmus[kind]) as archive:
        types = fromstring(archive.read("modelDescription.xml")).findall("TypeDefinitions/*")
    assert len(types) == len(ENUMERATIONS)
    assert all(set(one.attrib) <= FMPY_0_3_20 for one in types)


def test_arrays_of_fmi_3_hold_the_scalars_of_fmi_2(fmus: dict[str, Path]) -> None:
    scalars, arrays = variables(fmus["native"]), variables(fmus["native_3"])
    expected = [
        ("coefficients", 5),
        ("force", 3),
        ("moment", 2),
        *((name, None) for name in scalars if name.startswith("health.")),
        ("strain", N_GAUGES),
        *((name, None) for name in (*FLOW_INPUTS, *LAST_INPUTS[1:])),
        ("sigma.coefficients", 5),
        ("sigma.force", 3),
        ("sigma.moment", 2),
        ("valid", N_GAUGES),
        *((name, None) for name in PARAMETERS),
        ("zero", N_GAUGES),
        ("zero_std", N_GAUGES),
        ("zero_common_std", None),
        ("filter_time_constant", None),
        ("tare", None),
        ("tare_state", None),
        ("zero_in_use", N_GAUGES),
        ("zero_in_use_std", N_GAUGES),
        ("zero_in_use_common_std", None),
        (LAST_INPUTS[0], None),
        ("time", None),
    ]
    found = [(name, int(v.dimensions[0].start) if v.dimensions else None) for name, v in arrays.items()]
    assert found == expected
    interface = estimator_interface(synthetic_inverse_map())
    numbered = {**value_references(estimator_arrays(interface)), "time": len(arrays) - 1}
    assert {name: v.valueReference for name, v in arrays.items()} == numbered
    in_order = [name for v in most_important_first(estimator_arrays(interface)) for name in array_of(v)]
    assert in_order == list(scalars)
    for name in ("dynamic_pressure", *PARAMETERS):
        assert (arrays[name].unit, arrays[name].start) == (scalars[name].unit, scalars[name].start)
    assert arrays["moment"].unit == "N.m"
    outputs = {
        u.variable.name: {v.name for v in u.dependencies}
        for u in read_model_description(str(fmus["native_3"])).outputs
    }
    assert outputs["moment"] == {"strain", "valid"}


def test_scalars_of_fmi_3_are_the_variables_of_fmi_2(fmus: dict[str, Path]) -> None:
    """Names, values and units, in their order; time comes last, with the value reference behind all arrays."""
    second, third, arrays = (variables(fmus[kind]) for kind in ("native", "scalars", "native_3"))
    assert list(third) == [*second, "time"]
    numbers = [FIRST_SCALAR + v.valueReference for v in second.values()]
    assert [v.valueReference for v in third.values()] == [*numbers, arrays["time"].valueReference]
    types = {"Real": "Float64", "Integer": "Int32"}
    for name, one in second.items():
        other = third[name]
        assert other.type == types.get(one.type, one.type)
        assert not other.dimensions
        for attribute in ("start", "unit", "displayUnit", "causality", "variability", "description", "min", "max"):
            assert getattr(one, attribute) == getattr(other, attribute), (name, attribute)
    known = {
        kind: {
            u.variable.name: {v.name for v in u.dependencies}
            for u in read_model_description(str(fmus[kind])).outputs
        }
        for kind in ("native", "scalars")
    }
    assert known["native"] == known["scalars"]


@pytest.mark.parametrize(
    "options", [ExportOptions(inputs="full"), ExportOptions(inputs="full", fmi_version="3", scalars=True)]
)
def test_scalars_without_zeros_keep_their_value_references(
    fmus: dict[str, Path], synthetic: SyntheticFiles, tmp_path: Path, options: ExportOptions
) -> None:
    path = tmp_path / "plain.fmu"
    export_estimator(synthetic.map_1, path, options)
    assert not validate_fmu(str(path))
    plain, whole = variables(path), variables(fmus["native" if options.fmi_version == "2" else "scalars"])
    hidden = {*zero_names(N_GAUGES), *zero_in_use_names(N_GAUGES)}
    assert list(plain) == [name for name in whole if name not in hidden]
    assert whole.keys() - plain.keys() == hidden
    for name, one in plain.items():
        assert one.valueReference == whole[name].valueReference
    first = {u.variable.name: {v.name for v in u.dependencies} for u in initial_unknowns(path)}
    of_whole = {u.variable.name: {v.name for v in u.dependencies} for u in initial_unknowns(fmus["native"])}
    assert first == {name: names - hidden for name, names in of_whole.items() if name not in hidden}


def initial_unknowns(path: Path) -> Any:
    return read_model_description(str(path)).initialUnknowns


def array_of(variable: Variable) -> tuple[str, ...]:
    return (variable.name,) if variable.dimension is None else array_elements(variable)


@pytest.mark.parametrize(
    "interface", [estimator_interface(synthetic_inverse_map()), plant_interface(synthetic_flight_model())]
)
def test_the_interface_uses_declared_units_only(interface: Any) -> None:
    known = {unit.name: {d.name for d in unit.display_units} for unit in UNITS}
    for variable in interface:
        if variable.fmi_type == "Real":
            assert variable.unit in known
            assert variable.display_unit is None or variable.display_unit in known[variable.unit]
        assert (variable.start is None) == (variable.causality in ("output", "local"))


def test_the_guid_follows_the_content() -> None:
    base = FmuDescription(
        model_name="M",
        description="d",
        interface=estimator_interface(synthetic_inverse_map()),
        content_hash="hash",
        stop_time=1.0,
        step_size=0.1,
    )
    assert base.guid == replace(base).guid
    changed = [
        replace(base, content_hash="other"),
        replace(base, interface=base.interface[1:]),
        replace(base, model_name="N"),
        replace(base, fmi_version="3"),
    ]
    assert len({base.guid, *(other.guid for other in changed)}) == 5


def test_the_guid_follows_the_map_and_the_kind(fmus: dict[str, Path]) -> None:
    descriptions = [read_model_description(str(path)) for path in fmus.values()]
    assert len({d.guid or d.instantiationToken for d in descriptions}) == len(fmus) == 8


def test_model_identifiers_are_c_names() -> None:
    assert model_identifier("Loads of 2 wings") == "Loads_of_2_wings"
    assert model_identifier("2 wings (mü)") == "m_2_wings_m"
    with pytest.raises(InputError, match="at least one letter"):
        model_identifier("(ü)")


def test_the_time_stamp_ends_in_z_and_honours_the_epoch(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    base = FmuDescription(
        model_name="M", description="d", interface=(), content_hash="hash", stop_time=1.0, step_size=0.1
    )
    for version in ("2", "3"):
        root = model_description(replace(base, fmi_version=version))
        assert root.get("generationDateAndTime") == "2023-11-14T22:13:20Z"
        assert root.get("variableNamingConvention") == "structured"
    for wrong in ("today", "-5"):
        monkeypatch.setenv("SOURCE_DATE_EPOCH", wrong)
        with pytest.raises(InputError, match=f"SOURCE_DATE_EPOCH: expected .* got '{wrong}'"):
            generation_time()
    monkeypatch.delenv("SOURCE_DATE_EPOCH")
    assert generation_time() == "1980-01-01T00:00:00Z"


@pytest.mark.parametrize("kind", ["native", "native_3", "python"])
def test_the_documentation_is_complete_and_stands_alone(fmus: dict[str, Path], kind: str) -> None:
    with zipfile.ZipFile(fmus[kind]) as archive:
        page = archive.read("documentation/index.html").decode()
        names = set(archive.namelist())
    licences = {"license", "pythonfmu"} if kind == "python" else {"license", "zig", "mingw-w64"}
    assert {f"documentation/licenses/{name}.txt" for name in licences} <= names
    assert ("documentation/externalDependencies.txt" in names) is (kind == "python")
    interface = estimator_interface(synthetic_inverse_map())
    for variable in interface if kind != "native_3" else estimator_arrays(interface):
        assert f"<td>{variable.name}</td>" in page or f"<td>{variable.name}[{variable.dimension}]</td>" in page
    words = [
        "INCONSISTENT",
        "UNIDENTIFIED",
        "<td>C_N</td><td>-1 to 1</td>",
        "synthetic vehicle 1 &lt;&amp;&gt;",
        "<svg",
    ]
    words += ["lag by one communication step", "2408.15286", "<td>G5</td>"]
    words += ["numpy and h5py"] if kind == "python" else ["compiled code"]
    for word in words:
        assert word in page
    assert "src=" not in page
    assert "href=" not in page


def test_the_licence_in_the_fmu_is_the_projects() -> None:
    root = Path(__file__).parents[3]
    assert (root / "fmus/licenses/license.txt").read_text() == (root / "LICENSE").read_text()
