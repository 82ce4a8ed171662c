"""Plant, autopilot and schedule in C: the same bits on every platform, and clean under sanitizers."""

import os
import subprocess
from dataclasses import dataclass
from pathlib import Path

import fmpy
import pytest
from platforms import AARCH64, LINUX, WINDOWS, by_aarch64, by_windows, clang
from slender_vehicle import make_slender_files
from synthetic_vehicle import SyntheticFiles

from strainfmu.cosim.scenario import load_scenario
from strainfmu.fmu.flight_export import export_flight
from strainfmu.fmu.native.build import (
    NATIVE,
    compile_with_zig,
    fmi_headers,
    source_files,
)
from strainfmu.fmu.plant_export import export_native_plant
from strainfmu.interface.plant_variables import FlightStart, Motion

pytestmark = pytest.mark.slow

HOST = Path(__file__).with_name("model_host.c")
INCLUDES = [f"-I{NATIVE}"]
FILES = [str(HOST), *map(str, source_files("plant"))]
STEPS = 300


@dataclass(frozen=True)
class Resources:
    """A folder with a model.bin, and the guid in it."""

    folder: Path
    guid: str


@pytest.fixture(scope="module")
def models(synthetic: SyntheticFiles, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Resources]:
    """One of every kind."""
    folder = tmp_path_factory.mktemp("models")
    files = make_slender_files(folder)
    fmus = export_flight(load_scenario(files.scenario), folder / "fmus")
    del fmus["estimator"]
    fmus["trajectory"] = folder / "trajectory.fmu"
    start = FlightStart(mach_number=6.0, altitude=20e3)
    export_native_plant(
        flight_model_path=synthetic.flight_model,
        fmu_path=fmus["trajectory"],
        motion=Motion.TRAJECTORY,
        start=start,
        trajectory_path=synthetic.trajectory,
    )
    made = {}
    for name, path in fmus.items():
        fmpy.extract(str(path), str(folder / name))
        made[name] = Resources(folder / name / "resources", fmpy.read_model_description(str(path)).guid)
    return made


def by_zig(target: str, output: Path) -> str:
    pytest.importorskip("ziglang", reason="needs zig: pip install 'strainfmu[native]'")
    compile_with_zig(target, [*INCLUDES, *FILES, "-s", "-o", str(output)])
    return str(output)


def output_of(command: list[str], *arguments: str) -> list[str]:
    finished = subprocess.run(
        [*command, *arguments], capture_output=True, text=True, check=False, env=os.environ | {"WINEDEBUG": "-all"}
    )
    assert finished.returncode == 0, finished.stderr[-4000:]
    return finished.stdout.split()


def run_all(command: list[str], models: dict[str, Resources], root: str = "") -> dict[str, list[str]]:
    return {
        name: output_of(command, "run", f"file://{root}{item.folder}", item.guid, str(STEPS))
        for name, item in models.items()
    }


@pytest.fixture(scope="module")
def linux(models: dict[str, Resources], tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[str]]:
    """Outputs on x86-64 Linux."""
    found = run_all([by_zig(LINUX, tmp_path_factory.mktemp("host") / "host")], models)
    for name, numbers in found.items():
        assert len(numbers) % STEPS == 0
        assert name == "schedule" or len(set(numbers)) > STEPS
    return found


def test_aarch64(models: dict[str, Resources], linux: dict[str, list[str]], tmp_path: Path) -> None:
    emulated = by_aarch64()
    host = by_zig(AARCH64, tmp_path / "host")
    assert run_all([*emulated, host], models) == linux


def test_windows(models: dict[str, Resources], linux: dict[str, list[str]], tmp_path: Path) -> None:
    wine = by_windows()
    host = by_zig(WINDOWS, tmp_path / "host.exe")
    assert run_all([*wine, host], models, "/Z:") == linux


def test_sanitizers(models: dict[str, Resources], tmp_path: Path) -> None:
    host = tmp_path / "host"
    flags = ["-std=c99", "-g", "-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
    command = [clang(), *flags, f"-I{fmi_headers()}", *INCLUDES, *FILES, "-lm", "-o", str(host)]
    built = subprocess.run(command, capture_output=True, text=True, check=False)
    if built.returncode != 0 and "clang_rt" in built.stderr:
        pytest.skip("needs the sanitizers' run-time: apt install libclang-rt-14-dev")
    assert built.returncode == 0, built.stderr
    run_all([str(host)], models)
    for item in models.values():
        words = output_of([str(host)], "damage", str(item.folder / "model.bin"), "3000")
        assert 0 < int(words[0]) < 3000
