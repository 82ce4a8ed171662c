"""What the FMUs say about themselves."""

from __future__ import annotations

import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from fmpy import read_model_description
from fmpy.validation import validate_fmu
from synthetic_vehicle import N_GAUGES, SyntheticFiles, synthetic_flight_model, synthetic_inverse_map

from strainfmu.errors import InputError
from strainfmu.fmu.model_description import (
    FmuDescription,
    generation_time,
    model_description,
    model_identifier,
)
from strainfmu.health import HealthState
from strainfmu.interface import HEALTH_ITEMS, UNITS, estimator_interface, plant_interface


@pytest.mark.parametrize("name", ["estimator_1", "estimator_2", "plant"])
def test_fmpy_finds_no_fault(synthetic: SyntheticFiles, name: str) -> None:
    assert validate_fmu(str(getattr(synthetic, name))) == []


def variables(path: Path) -> dict[str, Any]:
    """Return fmpy's ScalarVariables by name."""
    return {v.name: v for v in read_model_description(str(path)).modelVariables}


def test_coefficients_come_first_and_all_is_there(synthetic: SyntheticFiles) -> None:
    estimator, plant = variables(synthetic.estimator_1), variables(synthetic.plant)
    assert list(estimator)[:5] == list(plant)[:5] == ["C_A", "C_N", "C_Y", "M_P", "M_Y"]
    assert len(estimator) == 23 + N_GAUGES + 1
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


def test_dependencies_tell_what_feeds_what(synthetic: SyntheticFiles) -> None:
    description = read_model_description(str(synthetic.estimator_1))
    known = {u.variable.name: ({v.name for v in u.dependencies}, u.dependenciesKind) for u in description.outputs}
    strains = {f"strain[{i + 1}]" for i in range(N_GAUGES)}
    assert known["C_A"] == (strains | {"dynamic_pressure"}, ["dependent"] * (N_GAUGES + 1))
    assert known["force.side"] == (strains, ["constant"] * N_GAUGES)
    assert known["sigma.C_N"][0] == {"dynamic_pressure"}
    assert known["sigma.force.axial"][0] == set()
    assert known["health.state"][0] == strains | {"dynamic_pressure"}
    plant = read_model_description(str(synthetic.plant))
    first = {u.variable.name: {v.name for v in u.dependencies} for u in plant.initialUnknowns}
    assert first["strain[1]"] == {"noise_std", "seed"}
    assert first["altitude"] == set()


def test_states_of_health_are_those_of_the_enumeration() -> None:
    """The four with all gauges; the slave reports a state beyond them as one of them."""
    assert [state for state, _ in HEALTH_ITEMS] == [state for state in HealthState if state <= HealthState.INVALID]


@pytest.mark.parametrize(
    "interface", [estimator_interface(synthetic_inverse_map()), plant_interface(synthetic_flight_model())]
)
def test_the_interface_uses_declared_units_only(interface: Any) -> None:
    known = {unit.name: {d.name for d in unit.display_units} for unit in UNITS}
    for variable in interface:
        if variable.fmi_type == "Real":
            assert variable.unit in known
            assert variable.display_unit is None or variable.display_unit in known[variable.unit]
        assert (variable.start is None) == (variable.causality == "output")


def test_the_guid_follows_the_content() -> None:
    base = FmuDescription("M", "d", estimator_interface(synthetic_inverse_map()), "hash", 1.0, 0.1)
    assert base.guid == replace(base).guid
    changed = [
        replace(base, content_hash="other"),
        replace(base, interface=base.interface[1:]),
        replace(base, model_name="N"),
    ]
    assert len({base.guid, *(other.guid for other in changed)}) == 4


def test_the_guid_follows_the_map(synthetic: SyntheticFiles) -> None:
    guids = {read_model_description(str(p)).guid for p in (synthetic.estimator_1, synthetic.estimator_2)}
    assert len(guids) == 2


def test_model_identifiers_are_c_names() -> None:
    assert model_identifier("Loads of 2 wings") == "Loads_of_2_wings"
    assert model_identifier("2 wings (mü)") == "m_2_wings_m"
    with pytest.raises(InputError, match="at least one letter"):
        model_identifier("(ü)")


def test_the_time_stamp_ends_in_z_and_honours_the_epoch(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "0")
    root = model_description(FmuDescription("M", "d", (), "hash", 1.0, 0.1))
    assert root.get("generationDateAndTime") == "1970-01-01T00:00:00Z"
    assert root.get("variableNamingConvention") == "structured"
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "today")
    with pytest.raises(InputError, match="SOURCE_DATE_EPOCH: 'today' found"):
        generation_time()
    monkeypatch.delenv("SOURCE_DATE_EPOCH")
    assert generation_time().year >= 2024


def test_the_documentation_is_complete_and_stands_alone(synthetic: SyntheticFiles) -> None:
    with zipfile.ZipFile(synthetic.estimator_1) as archive:
        page = archive.read("documentation/index.html").decode()
        names = set(archive.namelist())
    assert {
        "documentation/externalDependencies.txt",
        "documentation/licenses/license.txt",
        "documentation/licenses/pythonfmu.txt",
    } <= names
    for variable in estimator_interface(synthetic_inverse_map()):
        assert f"<td>{variable.name}</td>" in page
    for word in ("numpy and h5py", "INCONSISTENT", "C_N -1 to 1", "synthetic vehicle 1 &lt;&amp;&gt;"):
        assert word in page
    assert "src=" not in page
    assert "href=" not in page


def test_the_licence_in_the_fmu_is_the_projects() -> None:
    root = Path(__file__).parents[2]
    assert (root / "fmus/licenses/license.txt").read_text() == (root / "LICENSE").read_text()
