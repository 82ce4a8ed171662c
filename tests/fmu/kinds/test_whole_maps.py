"""FMUs of every kind whose maps have all that a map can have: valid, and what they state of their variables."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import fromstring
from zipfile import ZipFile

import pytest
from flight_fmu import whole_map
from fmpy import read_model_description
from fmpy.validation import validate_fmu
from fmu_host import OPTIONS
from parameter_maps import PARAMETERS
from scaled_maps import scaled_map
from sensor_maps import ROWS
from thermal_maps import with_temperature
from whole_maps import MAPS, N_LINEAR, N_T, linear_with_everything

from strainfmu.estimator.signal_names import FILTER_TIME_CONSTANT
from strainfmu.fmu.checks.integrity import damaged_entries
from strainfmu.interface.estimator_variables import estimator_interface
from strainfmu.interface.sensor_variables import sensor_names

pytestmark = pytest.mark.fast

Fmus = Callable[[str], dict[str, Path]]

of_all_kinds = pytest.mark.parametrize("kind", OPTIONS)
of_both_maps = pytest.mark.parametrize("name", MAPS)

description = cache(lambda path: read_model_description(str(path)))


def depends(unknowns: Iterable[Any]) -> dict[str, set[str]]:
    """Return the names of what each of ``unknowns`` depends on."""
    return {one.variable.name: {of.name for of in one.dependencies} for one in unknowns}


@of_both_maps
@of_all_kinds
def test_no_faults(whole_fmus: Fmus, name: str, kind: str) -> None:
    path = whole_fmus(name)[kind]
    assert validate_fmu(str(path)) == []
    assert damaged_entries(path) == []


@of_all_kinds
def test_sensors_are_inputs_with_their_units(whole_fmus: Fmus, kind: str) -> None:
    """Thrust is one of 0 N, and outputs depend on all of them."""
    held, found = linear_with_everything(), description(whole_fmus("linear")[kind])
    variables = {one.name: one for one in found.modelVariables}
    units = {"m/m": "1", "N m": "N.m"}
    for name, (_, unit, scale, _) in zip(sensor_names(held), ROWS.values(), strict=True):
        assert (variables[name].causality, variables[name].unit) == ("input", units.get(unit, unit))
        assert float(variables[name].nominal) < 10.0 * scale
    assert (variables["thrust"].unit, float(variables["thrust"].start)) == ("N", 0.0)
    for name, known in depends(found.outputs).items():
        whole = {*sensor_names(held), "thrust"} <= known
        assert whole == (name != "tare_state" and not name.startswith("health.outside."))
    zeros = [name for name in variables if name.startswith("zero[")]
    assert len(zeros) == (0 if kind == "native_3" else N_LINEAR - len(ROWS))


def test_names_are_identifiers() -> None:
    names = sensor_names(linear_with_everything())
    assert names[-2:] == ("sensor.displacement_0_2m_45deg", "sensor.fibre_90deg_1")


@of_all_kinds
def test_every_output_depends_on_temperatures_but_counts_and_parameters(whole_fmus: Fmus, kind: str) -> None:
    found = description(whole_fmus("linear")[kind])
    names = {"temperature"} if kind == "native_3" else {f"temperature[{i + 1}]" for i in range(N_T)}
    inputs = {one.name: one for one in found.modelVariables if one.name in names}
    assert {one.unit for one in inputs.values()} == {"K"}
    assert set(inputs) == names
    for name, known in depends(found.outputs).items():
        is_apart = name in ("health.valid_gauges", "tare_state") or name.startswith("health.outside.")
        assert (names <= known) == (not is_apart), name


@of_all_kinds
def test_section_loads_are_outputs_with_their_units(whole_fmus: Fmus, kind: str) -> None:
    variables = {one.name: one for one in description(whole_fmus("linear")[kind]).modelVariables}
    index = "" if kind == "native_3" else "[1]"
    for name, unit in (
        ("M_R", "1"),
        ("moment.roll", "N.m"),
        (f"section.axial{index}", "N"),
        (f"sigma.section.torsion{index}", "N.m"),
    ):
        assert (variables[name].causality, variables[name].unit) == ("output", unit)


@of_all_kinds
def test_flow_parameters_are_inputs(whole_fmus: Fmus, kind: str) -> None:
    """With their scores as outputs; where tables follow them their deviations are inputs, on which all depends."""
    for of in MAPS:
        variables = {one.name: one for one in description(whole_fmus(of)[kind]).modelVariables}
        for name in PARAMETERS:
            assert variables[f"parameter.{name}"].causality == "input"
            assert variables[f"health.outside.{name}"].causality == "output"
            assert (f"parameter_std.{name}" in variables) == (of == "flight")
    assert float(variables["parameter_std.fin_deg"].start) == 0.0
    known, stated = (
        depends(description(whole_fmus("flight")[kind]).outputs),
        {"parameter.fin_deg", "parameter_std.fin_deg"},
    )
    coefficient = "C_A" if "C_A" in known else "coefficients"
    for name in (coefficient, "M_R", "air_data.angle_of_attack", "health.state", "health.chi_square"):
        assert stated <= known[name]
    assert not stated & known["health.valid_gauges"]


@of_all_kinds
def test_loads_depend_on_the_dynamic_pressure(whole_fmus: Fmus, kind: str) -> None:
    found = description(whole_fmus("linear")[kind])
    known, first = depends(found.outputs), depends(found.initialUnknowns)
    load = "force" if kind == "native_3" else "force.normal"
    for name in (load, f"sigma.{load}", "health.chi_square", "health.chi_square_limit", "health.suspects"):
        assert {"dynamic_pressure", "dynamic_pressure_std"} <= known[name] & first[name]
        assert {"mach_number", "altitude", "q_source"} <= known[name]  # the deviation of a computed one is theirs
    assert {"mach_number", "altitude"} <= known["health.state"]
    assert not {"dynamic_pressure"} & known["health.valid_gauges"]


@of_all_kinds
def test_derivatives_without_model_exchange(whole_fmus: Fmus, kind: str) -> None:
    """Of the map with tables."""
    with ZipFile(whole_fmus("flight")[kind]) as archive:
        root = fromstring(archive.read("modelDescription.xml"))
    assert root.find("ModelExchange") is None
    simulation = root.find("CoSimulation")
    assert simulation is not None
    offered = {
        "python": set[str](),
        "native": {"providesDirectionalDerivative"},
        "native_3": {"providesDirectionalDerivatives", "providesAdjointDerivatives"},
    }
    found = {name for name, value in simulation.attrib.items() if "Derivative" in name and value == "true"}
    assert found == offered[kind]


@of_all_kinds
def test_names_of_the_air_data(whole_fmus: Fmus, kind: str) -> None:
    found = {one.name: one for one in description(whole_fmus("flight")[kind]).modelVariables}
    for name in ("angle_of_attack", "static_pressure"):
        for prefix in ("air_data", "sigma.air_data", "identified.air_data"):
            assert f"{prefix}.{name}" in found
    assert {"navigation_used.mach_number", "health.linear_loads", "static_pressure_std"} <= set(found)
    assert found[FILTER_TIME_CONSTANT].causality == "parameter"


@of_all_kinds
def test_page_terminals_and_contents(whole_fmus: Fmus, kind: str) -> None:
    held = linear_with_everything()
    with ZipFile(whole_fmus("linear")[kind]) as archive:
        page = archive.read("documentation/index.html").decode()
        terminals = archive.read("terminalsAndIcons/terminalsAndIcons.xml").decode()
        contents = archive.read("extra/strainfmu/contents.json").decode()
    assert "and the readings of 8 auxiliary sensors" in page
    assert all(name in page and name in terminals for name in sensor_names(held))
    assert '<Terminal name="sensors"' in terminals
    assert '"displacement_0.2m_45deg": "sensor.displacement_0_2m_45deg"' in contents
    largest = 1e6 * held.strain_range[: N_LINEAR - len(ROWS)].max()
    assert f'"|strain| of the gauge that strains most": "0 to {largest:.6g} um/m"' in contents
    assert "Sensors in the order of temperature" in page
    assert all(f"<td>{name}</td>" in page for name in ("T0", "T3"))


def test_the_time_constant_stands_behind_zeros_and_temperatures() -> None:
    """A linear map of gamma other than 1 has none."""
    plain, warm = whole_map(), with_temperature(whole_map())
    for held, before in (
        (scaled_map(1, seed=1), "zero_common_std"),
        (plain, "zero_common_std"),
        (warm, "temperature[4]"),
    ):
        names = [one.name for one in estimator_interface(held)]
        assert names[names.index(before) + 1] == FILTER_TIME_CONSTANT
    other_gain = replace(scaled_map(2, seed=1), form="absolute", regularisation=0.5)
    assert FILTER_TIME_CONSTANT not in [one.name for one in estimator_interface(other_gain)]
