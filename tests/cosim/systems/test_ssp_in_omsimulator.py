"""SSP packages in OMSimulator; what it needs is checked without it too: names, causalities, no loop at start."""

import csv
import os
import re
import shutil
import subprocess
import zipfile
from dataclasses import replace
from graphlib import TopologicalSorter
from math import radians
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lxml import etree
from slender_vehicle import NOISE_STD, SlenderFiles
from starting_fmu import Starting

from strainfmu.cosim.flight import flight_system, fly
from strainfmu.cosim.models.flight_model import load_flight_model
from strainfmu.cosim.scenario import FaultEvent, Scenario, load_scenario
from strainfmu.cosim.systems.instance import read_description
from strainfmu.cosim.systems.master import simulate
from strainfmu.cosim.systems.ssp import identifier, write_ssp
from strainfmu.cosim.systems.system import Connection, System, split_signal
from strainfmu.errors import InputError
from strainfmu.estimator.health import HealthState
from strainfmu.fmu.flight_export import export_flight
from strainfmu.interface.plant_variables import GaugeFault

SSD = {"ssd": "http://ssp-standard.org/SSP1/SystemStructureDescription"}
WATCHED = ("chi_square", "chi_square_limit", "suspect_gauge")
C_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")


@pytest.fixture(scope="module")
def scenario(files: SlenderFiles) -> Scenario:
    """A flight with a name that is no identifier, and a gauge that fails on the way."""
    fault = FaultEvent(time=2.0, gauge="G1", kind=GaugeFault.BIAS, value=20 * NOISE_STD)
    return replace(load_scenario(files.scenario), name="7th flight, steps of 0.5 s", faults=(fault,))


def structure_of(package: Path) -> Any:
    with zipfile.ZipFile(package) as archive:
        return etree.fromstring(archive.read("SystemStructure.ssd"))


@pytest.mark.fast
@pytest.mark.parametrize("connectors", [False, True])
def test_names_are_identifiers(packages: dict[bool, Path], connectors: bool) -> None:
    """Those of the model, the system, its components and its connectors; a component's are FMU variables."""
    root = structure_of(packages[connectors])
    system = root.find("ssd:System", SSD)
    assert root.get("name") == "m_7th_flight_steps_of_0_5_s"
    of_components = [item.get("name") for item in system.findall("ssd:Elements/ssd:Component", SSD)]
    of_system = [item.get("name") for item in system.findall("ssd:Connectors/ssd:Connector", SSD)]
    names = [root.get("name"), system.get("name"), *of_components, *of_system]
    assert [name for name in names if not C_NAME.fullmatch(name)] == []
    assert len(set(of_system)) == len(of_system)
    assert ("estimator_sigma_C_N" in of_system) == connectors


@pytest.mark.fast
@pytest.mark.parametrize("connectors", [False, True])
def test_connections_join_fitting_causalities(
    packages: dict[bool, Path], fmus: dict[str, Path], connectors: bool
) -> None:
    """Within the system from an output to an input, and to the system's output from a component's output.

    An end is looked up as an engine does that splits at the first dot: a connector of the system holds none.
    """
    system = structure_of(packages[connectors]).find("ssd:System", SSD)
    kinds = {
        ("", item.get("name")): item.get("kind") for item in system.findall("ssd:Connectors/ssd:Connector", SSD)
    }
    for component in system.findall("ssd:Elements/ssd:Component", SSD):
        name = component.get("name")
        causality = {v.name: v.causality for v in read_description(fmus[name]).modelVariables}
        for connector in component.findall("ssd:Connectors/ssd:Connector", SSD):
            kinds[name, connector.get("name")] = connector.get("kind")
            assert connector.get("kind") == causality[connector.get("name")]
    for connection in system.findall("ssd:Connections/ssd:Connection", SSD):
        start = connection.get("startElement", ""), connection.get("startConnector")
        end = connection.get("endElement", ""), connection.get("endConnector")
        assert start[0]
        assert kinds[start] == "output"
        assert kinds[end] == ("input" if end[0] else "output")
        assert end[0] or "." not in end[1]


@pytest.mark.fast
def test_nothing_is_its_own_cause_at_the_start(scenario: Scenario, fmus: dict[str, Path]) -> None:
    """Variables by what they depend on: InitialUnknowns within FMUs, connections between; no cycle to iterate."""
    system = flight_system(scenario, fmus, "estimate")
    TopologicalSorter(dependencies(system)).prepare()  # raises CycleError


def dependencies(system: System) -> dict[str, set[str]]:
    """What every variable of a system depends on during initialization."""
    descriptions = {name: read_description(Path(fmu)) for name, fmu in system.instances.items()}
    graph: dict[str, set[str]] = {}
    for name, description in descriptions.items():
        for unknown in description.initialUnknowns:
            graph[f"{name}.{unknown.variable.name}"] = {f"{name}.{known.name}" for known in unknown.dependencies}
    for connection in system.connections:
        split_signal(connection.source, descriptions)
        graph.setdefault(connection.target, set()).add(connection.source)
    return graph


@pytest.mark.fast
def test_the_autopilot_states_its_true_dependencies(fmus: dict[str, Path], tmp_path: Path) -> None:
    """All that its first outputs depend on is listed, and nothing else; so valid depends on nothing."""
    autopilot = Starting(fmus["autopilot"], tmp_path)
    for name, start in (("C_N", 0.05), ("M_P", 0.01), ("pitch_rate", 0.02), ("confirmations", 1)):
        autopilot.set(name, start)
    starts = {name: float(v.start) for name, v in autopilot.variables.items() if v.causality == "parameter"}
    starts |= {"commanded_angle_of_attack": 0.0, "C_N": 0.05, "M_P": 0.01, "pitch_rate": 0.02, "confirmations": 1}
    starts |= {"chi_square": 0.0, "chi_square_limit": 1.0, "suspect_gauge": 0.0}
    starts["dynamic_pressure"] = float(autopilot.variables["dynamic_pressure"].start)
    values: dict[str, tuple[float, ...]] = {
        "chi_square": (2.0,),
        "chi_square_limit": (-1.0,),
        "suspect_gauge": (1, 3),
        "confirmations": (0, 5),
        "largest_isolated": (0, 9),
        "largest_moment": (1.0,),
        "hold_time": (0.0, 7.0),
    }
    changed: dict[str, set[str]] = {name: set() for name in autopilot.stated}
    for name, start in starts.items():
        tried = values.get(name, (start + 0.013, 1.5 * start, float("nan")))
        if autopilot.variables[name].causality == "parameter":
            tried = tuple(value for value in tried if not np.isnan(value))
        for output in autopilot.changed_by(name, tried, start):
            changed[output].add(name)
    assert changed == autopilot.stated
    assert changed["valid[1]"] == changed["isolated_gauges"] == set()
    autopilot.fmu.freeInstance()


@pytest.mark.fast
def test_valid_holds_true_until_the_first_step(fmus: dict[str, Path], tmp_path: Path) -> None:
    autopilot = Starting(fmus["autopilot"], tmp_path)
    for name, value in (("confirmations", 1), ("suspect_gauge", 1), ("chi_square", 9.0)):
        autopilot.set(name, value)
    assert autopilot.outputs()["valid[1]"] == 1.0
    autopilot.fmu.exitInitializationMode()
    assert autopilot.outputs()["valid[1]"] == 1.0
    autopilot.fmu.doStep(currentCommunicationPoint=0.0, communicationStepSize=0.01)
    assert autopilot.outputs()["valid[1]"] == 0.0
    assert autopilot.outputs()["isolated_gauges"] == 1.0
    autopilot.fmu.freeInstance()


@pytest.mark.fast
@pytest.mark.parametrize(
    ("name", "made"),
    [("IC3X surrogate, Mach 6", "IC3X_surrogate_Mach_6"), ("6 s", "m_6_s"), ("a.b", "a_b"), ("...", "m_")],
)
def test_identifiers(name: str, made: str) -> None:
    assert identifier(name) == made


def test_names_that_would_collide_are_refused(fmus: dict[str, Path], tmp_path: Path) -> None:
    twice = System({"a": fmus["plant"], "a b": fmus["plant"]})
    with pytest.raises(InputError, match=r"instance 'a b': expected an identifier such as 'a_b'"):
        write_ssp(twice, tmp_path / "x.ssp", "x", 1.0, 0.1)
    # sigma.C_N of instance a, C_N of instance a_sigma.
    alike = System({"a": fmus["estimator"], "a_sigma": fmus["estimator"]})
    with pytest.raises(
        InputError, match=r"'a\.sigma\.C_A' and 'a_sigma\.C_A' would both become connector 'a_sigma_C_A'"
    ):
        write_ssp(alike, tmp_path / "x.ssp", "x", 1.0, 0.1, system_connectors=True)


def omsimulator() -> str | None:
    """OMSimulator's command: STRAINFMU_OMSIMULATOR, or the one on PATH."""
    return os.environ.get("STRAINFMU_OMSIMULATOR") or shutil.which("OMSimulator")


def simulated(package: Path, scenario: Scenario, folder: Path) -> tuple[dict[str, np.ndarray], list[str]]:
    """What OMSimulator records of ``package``, by signal without the names of the systems, and its errors."""
    program = omsimulator()
    if program is None:
        pytest.skip("needs OMSimulator 3: its path in STRAINFMU_OMSIMULATOR, or on PATH")
    command = [program, f"--stopTime={scenario.stop_time:g}", "--resultFile=found.csv", str(package)]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stdout[-2000:]
    errors = [line for line in done.stderr.splitlines() if line.startswith("error")]
    assert f"{len(errors)} errors" in done.stdout or not (errors or "errors" in done.stdout)
    with (folder / "found.csv").open() as table:
        names, *rows = csv.reader(table)
    values = np.array(rows, dtype=float).T
    return dict(zip((name.split(".", 2)[-1] for name in names), values, strict=True)), errors


@pytest.mark.parametrize("connectors", [False, True])
def test_omsimulator_flies_both_packages(
    packages: dict[bool, Path], scenario: Scenario, fmus: dict[str, Path], tmp_path: Path, connectors: bool
) -> None:
    """With the tracking error of fly, to 1 %: its delays are other ones."""
    values, errors = simulated(packages[connectors], scenario, tmp_path)
    assert errors == []
    last = np.append(np.diff(values["time"]) > 0.0, True)  # it writes a row before and one after every event
    commanded, flown = values["schedule.commanded_angle_of_attack"][last], values["plant.angle_of_attack"][last]
    ours = fly(scenario, fmus, "estimate")
    error = ours["schedule.commanded_angle_of_attack"] - ours["plant.angle_of_attack"]
    assert len(flown) == len(error)
    assert _rms(commanded - flown) == pytest.approx(_rms(error), rel=0.01)
    assert np.abs(flown - ours["plant.angle_of_attack"]).max() < radians(0.1)
    assert values["autopilot.valid[1]"][-1] == 0.0
    if connectors:
        np.testing.assert_array_equal(values["plant_angle_of_attack"][last], flown)


def test_omsimulator_connects_health_while_no_gauge_reads(scenario: Scenario, tmp_path: Path) -> None:
    """From 2 to 3 s all strains are beyond the sensor range: its recorder refuses the loads, which are NaN then.

    Chi-square, limit and suspect, which the autopilot has, are no error.
    """
    gauges = range(1, load_flight_model(scenario.flight_model).n_gauges + 1)
    faults = [FaultEvent(2.0, gauge, GaugeFault.STUCK, value=1.0) for gauge in gauges]
    faults += [FaultEvent(3.0, gauge, GaugeFault.NONE) for gauge in gauges]
    blind = replace(scenario, faults=tuple(faults))
    system = flight_system(blind, export_flight(blind, tmp_path / "fmus"), "truth")
    watched = [Connection(f"estimator.health.{name}", f"autopilot.{name}") for name in WATCHED]
    system = replace(system, connections=(*system.connections, *watched))
    write_ssp(system, tmp_path / "blind.ssp", blind.name, blind.stop_time, blind.step_size)
    values, errors = simulated(tmp_path / "blind.ssp", blind, tmp_path)
    lost = errors.count("error:   [updateSignals] failed to fetch variable C_A")
    assert lost > 0
    assert errors.count("error:   [getReal] getReal returned NAN") == lost == len(errors) - lost
    ours = simulate(system, blind.stop_time, blind.step_size)
    without = (ours.time > 2.015) & (ours.time < 2.995)
    assert set(ours["estimator.health.state"][without]) == {HealthState.INVALID}
    assert not np.isnan([ours[f"estimator.health.{name}"] for name in (*WATCHED, "envelope_score")]).any()
    assert values["time"][-1] == pytest.approx(blind.stop_time)
    assert values["estimator.health.state"][-1] == HealthState.OK
    assert values["estimator.C_N"][-1] == pytest.approx(ours["estimator.C_N"][-1], rel=0.05)


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))
