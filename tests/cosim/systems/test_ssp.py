"""SSP packages of a closed loop: valid, and flown by FMPy and other engines."""

import ctypes.util
import importlib.util
import json
import subprocess
import sys
import zipfile
from dataclasses import replace
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.ssp.simulation import simulate_ssp
from lxml import etree

from strainfmu.cosim.flight import INSTANCES, flight_system, fly
from strainfmu.cosim.scenario import Scenario
from strainfmu.cosim.systems.recording import Recording
from strainfmu.cosim.systems.ssp import write_ssp
from strainfmu.errors import InputError

WATCHED = (
    "plant.angle_of_attack",
    "plant.pitch_rate",
    "autopilot.estimated_angle_of_attack",
    "autopilot.control_moment",
)


@pytest.fixture(scope="module")
def at_once(scenario: Scenario, fmus: dict[str, Path]) -> Recording:
    """The flight as other engines step it."""
    return fly(scenario, fmus, "estimate", at_once=True)


@pytest.mark.parametrize("connectors", [False, True])
def test_ssp_packages_are_valid(packages: dict[bool, Path], connectors: bool) -> None:
    schema = Path(fmpy.__file__).parent / "ssp" / "schema" / "SystemStructureDescription.xsd"
    with zipfile.ZipFile(packages[connectors]) as archive:
        root = etree.fromstring(archive.read("SystemStructure.ssd"))
        assert sorted(archive.namelist())[1:] == sorted(f"resources/{name}.fmu" for name in INSTANCES)
    etree.XMLSchema(etree.parse(str(schema))).assertValid(root)
    ssd = {"ssd": "http://ssp-standard.org/SSP1/SystemStructureDescription"}
    assert bool(root.findall("ssd:System/ssd:Connectors", ssd)) == connectors


@pytest.mark.parametrize("connectors", [False, True])
def test_fmpy_flies_the_ssp(
    packages: dict[bool, Path], scenario: Scenario, fmus: dict[str, Path], connectors: bool
) -> None:
    # FMPy gives every connected input 0 for the first step, so the flights begin differently and meet later.
    found = simulate_ssp(
        str(packages[connectors]), stop_time=scenario.stop_time - 1e-6, step_size=scenario.step_size
    )
    wanted = fly(scenario, fmus, "estimate", at_once=True)
    assert len(found) == len(wanted.time) - 1
    last = slice(-50, None)
    for name in WATCHED:
        # What is left of the start after 4.5 s of a motion that decays with 3.2 per s.
        scale = np.abs(wanted[name]).max()
        np.testing.assert_allclose(found[name][last], wanted[name][1:][last], rtol=0.0, atol=1e-5 * scale)


def other_engine(engine: str, path: Path, scenario: Scenario, fmus: dict[str, Path], folder: Path) -> np.ndarray:
    """(n, k) watched signals after every step, by a program of its own: should the engine die, only that."""
    references = {}
    for name in INSTANCES:
        variables = fmpy.read_model_description(str(fmus[name]), validate=False).modelVariables
        references |= {f"{name}.{variable.name}": variable.valueReference for variable in variables}
    task = {
        "engine": engine,
        "ssp": str(path),
        "folder": str(folder),
        "step": scenario.step_size,
        "steps": round(scenario.stop_time / scenario.step_size),
        "signals": [(name, references[name]) for name in WATCHED],
        "output": str(folder / "found.npy"),
    }
    program = Path(__file__).with_name("ssp_engines.py")
    finished = subprocess.run(
        [sys.executable, str(program), json.dumps(task)], capture_output=True, text=True, check=False
    )
    assert finished.returncode == 0, finished.stderr[-2000:]
    found: np.ndarray = np.load(folder / "found.npy")
    return found


@pytest.mark.parametrize(("engine", "package"), [("ecos", "ecospy"), ("libcosim", "libcosimpy")])
def test_other_engines_fly_the_ssp(
    engine: str,
    package: str,
    packages: dict[bool, Path],
    scenario: Scenario,
    fmus: dict[str, Path],
    at_once: Recording,
    tmp_path: Path,
) -> None:
    if importlib.util.find_spec(package) is None:
        pytest.skip(f"needs {engine}: pip install {package}")
    if engine == "ecos" and not (ctypes.util.find_library("tbb") or Path(sys.prefix, "lib/libtbb.so.12").exists()):
        pytest.skip("ecos needs libtbb.so.12: apt install libtbb12")
    found = other_engine(engine, packages[False], scenario, fmus, tmp_path)
    wanted = np.column_stack([at_once[name] for name in WATCHED])[1:]
    # The same FMUs, steps and delays: round-off of the engines' clocks is all that differs.
    size = np.abs(wanted).max(axis=0)
    np.testing.assert_allclose(found / size, wanted / size, rtol=0.0, atol=1e-10)


def test_packages_have_the_right_name(scenario: Scenario, fmus: dict[str, Path], tmp_path: Path) -> None:
    system = flight_system(scenario, fmus, "truth")
    with pytest.raises(InputError, match=r"must end in \.ssp"):
        write_ssp(system, tmp_path / "x.zip", "x", 1.0, 0.1)
    with pytest.raises(InputError, match="start values"):
        write_ssp(replace(system, start_values={"plant.mass": 3.0}), tmp_path / "x.ssp", "x", 1.0, 0.1)
