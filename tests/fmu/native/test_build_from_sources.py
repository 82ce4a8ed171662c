"""Libraries built from ``sources/`` of an FMU: by its CMakeLists.txt and by an importer, with equal outputs."""

import shutil
import subprocess
import sys
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmu_host import STRAINS
from raw_fmu import this_platform
from synthetic_vehicle import N_GAUGES, SyntheticFiles

from strainfmu.fmu.native.build import NATIVE, library_file
from strainfmu.fmu.native.package import FOLDERS
from strainfmu.fmu.plant_export import export_native_plant
from strainfmu.interface.plant_variables import FlightStart, Motion

KINDS = ("native", "native_3", "native_plant")
BUILT = [pytest.param(kind, marks=pytest.mark.slow if kind != "native_plant" else ()) for kind in KINDS]
"""Of the sources of the estimator ``tests/fmu/test_c_folder.py`` builds programs in every run."""
SUFFIX = library_file(this_platform()).suffix

OPTIONS = {kind: {"CMAKE_C_FLAGS_RELEASE": "-O0"} for kind in ("native", "native_plant")}
"""Of CMake; its default, -O3, takes a third of a minute here. FMI 3.0 is built with the default."""


@pytest.fixture(scope="module")
def cmake() -> str:
    """The command of CMake, beside Python or on the path."""
    beside = Path(sys.executable).with_name("cmake")
    found = str(beside) if beside.is_file() else shutil.which("cmake")
    compiler = next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None)
    if found is None or compiler is None:
        pytest.skip("needs CMake and a C compiler: pip install cmake, apt install gcc")
    return found


@pytest.fixture(scope="module")
def native_fmus(
    fmus: dict[str, Path], synthetic: SyntheticFiles, tmp_path_factory: pytest.TempPathFactory
) -> dict[str, Path]:
    """One FMU of each of :data:`KINDS`."""
    plant = tmp_path_factory.mktemp("plant") / "plant.fmu"
    start = FlightStart(mach_number=6.0, altitude=20e3)
    export_native_plant(
        flight_model_path=synthetic.flight_model,
        fmu_path=plant,
        motion=Motion.TRAJECTORY,
        start=start,
        trajectory_path=synthetic.trajectory,
    )
    return {"native": fmus["native"], "native_3": fmus["native_3"], "native_plant": plant}


def run(*command: str | Path) -> None:
    """Run a command without what this project or its environment would add."""
    done = subprocess.run([*map(str, command)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]


def shipped(unpacked: Path) -> Path:
    """The library of an unpacked FMU for this machine."""
    platform = this_platform()
    names = [platform, *(name for name, folder in FOLDERS.items() if folder == platform)]
    return next(file for name in names for file in unpacked.glob(f"binaries/{name}/*{SUFFIX}"))


def outputs(unpacked: Path, kind: str) -> bytes:
    """Outputs in fmpy; an estimator reads strains that change at every step."""
    signals = None
    if kind != "native_plant":
        names = STRAINS if kind == "native" else ["strain"]
        random = np.random.default_rng(3)
        shape = () if kind == "native" else (N_GAUGES,)
        signals = np.zeros(30, dtype=[("time", float), *((name, float, shape) for name in names)])
        signals["time"] = np.arange(30) * 0.01
        for name in names:
            signals[name] = 1e-5 * random.normal(size=(30, *shape))
    found = fmpy.simulate_fmu(str(unpacked), stop_time=0.3, output_interval=0.01, input=signals)
    assert len(found) == 31
    assert len(np.unique(found["C_N" if kind != "native_3" else "coefficients"])) > 10
    return found.tobytes()


@pytest.mark.slow
@pytest.mark.parametrize("kind", BUILT)
def test_cmake_builds_the_library_from_the_unpacked_fmu(
    native_fmus: dict[str, Path], kind: str, cmake: str, tmp_path: Path
) -> None:
    original, unpacked, build = tmp_path / "original", tmp_path / "unpacked fmu", tmp_path / "build"
    for folder in (original, unpacked):
        fmpy.extract(str(native_fmus[kind]), str(folder))
    library = shipped(unpacked)
    options = [f"-D{name}={value}" for name, value in OPTIONS.get(kind, {}).items()]
    run(cmake, "-S", unpacked / "sources", "-B", build, *options)
    run(cmake, "--build", build)
    built = build / library.name
    assert built.read_bytes() != library.read_bytes()  # another compiler: that of the machine
    library.unlink()
    shutil.copy(built, library)
    assert outputs(unpacked, kind) == outputs(original, kind)


@pytest.mark.slow
def test_cmake_builds_the_libraries_from_the_repository(cmake: str, tmp_path: Path) -> None:
    # Optimised, as by default, they are built from an unpacked FMU; the estimator, the longer one, by zig too.
    run(cmake, "-S", NATIVE, "-B", tmp_path, "-DCMAKE_BUILD_TYPE=Debug")
    run(cmake, "--build", tmp_path, "--target", "plant")
    assert {file.stem for file in tmp_path.glob(f"*{SUFFIX}")} == {"plant"}
    listed = subprocess.run(
        [cmake, "--build", tmp_path, "--target", "help"], capture_output=True, text=True, check=True
    )
    assert {"estimator", "plant"} <= set(listed.stdout.split())


@pytest.mark.slow
@pytest.mark.parametrize("kind", BUILT)
def test_an_importer_builds_the_library(
    native_fmus: dict[str, Path], kind: str, cmake: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from fmpy.build import build_platform_binary

    original, unpacked = tmp_path / "original", tmp_path / "unpacked"
    for folder in (original, unpacked):
        fmpy.extract(str(native_fmus[kind]), str(folder))
    shutil.rmtree(unpacked / "binaries")
    monkeypatch.setenv("PATH", str(Path(cmake).parent), prepend=":")
    # Optimised it is built by CMake alone, above; here it is what the importer passes on that counts.
    build_platform_binary(str(unpacked), cmake_options={"CMAKE_C_FLAGS_RELEASE": "-O0"})
    assert outputs(unpacked, kind) == outputs(original, kind)
