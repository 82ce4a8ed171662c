"""The compiled estimator and bridge under sanitizers and valgrind, and what a fuzzer found."""

import os
import random
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest
from c_host import MEMORY, fuzz_program, host_by_clang, run_fuzz, run_host, tare_input
from flight_fmu import whole_map
from library_under_test import VARIABLE
from native_case import NativeCase
from platforms import clang, program
from raw_fmu import GUID
from thermal_maps import with_temperature

from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.resource.map_file import native_resource
from strainfmu.fmu.native.build import source_files

pytestmark = pytest.mark.slow

CORPUS = Path(__file__).parent / "corpus"
TESTS = Path(__file__).parents[2]
COMPILED_IN_PYTHON = ("can", "estimator/zeros")
"""Tests of what Python calls in the library: samples, tares, and the bridge."""
OF_PROCESS_MEMORY = "tests/can/test_endurance.py::test_some_seconds_without_growth"
"""A test of the memory of the process, of which a sanitizer keeps what is freed, and a record of each place."""


@pytest.fixture(scope="module")
def checked(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """The host under AddressSanitizer and UndefinedBehaviorSanitizer."""
    return [str(host_by_clang(tmp_path_factory.mktemp("asan") / "host", *MEMORY))]


def test_two_hundred_instances(case: NativeCase, checked: list[str]) -> None:
    # States move between instances; each gives the outputs of the one they come from; leaks are errors too.
    # Each set of gauges of form "dynamic_pressure" computes levels first, which takes long under sanitizers.
    steps = 10 if case.inverse_map.form == "absolute" else 1
    assert run_host(checked, case, "many", steps).startswith(b"many: same")


@pytest.mark.parametrize("steps", [10, 64, 1000])
def test_tare(case: NativeCase, checked: list[str], steps: int) -> None:
    said = run_host(checked, case, "tare", steps, tare_input(case)).decode()
    assert said.startswith("tare: 3 0" if steps < 64 else "tare: 2 ")


@pytest.mark.parametrize("names", [("few gauges", "case 1"), ("case 1", "case 2")])
def test_states_of_another_map(cases: dict[str, NativeCase], checked: list[str], names: tuple[str, str]) -> None:
    one, other = (cases[name] for name in names)
    assert run_host(checked, one, "foreign", 0, other.uri).startswith(b"foreign: refused")


def test_million_steps(small: NativeCase, checked: list[str]) -> None:
    assert run_host(checked, small, "endure", 1_000_000).startswith(b"endure")


def test_memory_does_not_grow(cases: dict[str, NativeCase], tmp_path: Path) -> None:
    host = host_by_clang(tmp_path / "host")
    words = run_host([str(host)], cases["case 1"], "endure", 1_000_000).split()
    before, after = int(words[1]), int(words[4])
    # Pages of code come and go with the machine's load; one byte lost per step would be 220 pages.
    assert 0 < after <= before + 50


@pytest.fixture(scope="module")
def threaded(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """The host under ThreadSanitizer."""
    output = tmp_path_factory.mktemp("tsan") / "host"
    return [str(host_by_clang(output, "-fsanitize=thread", "-DHOST_THREADS", "-pthread"))]


def test_threads(case: NativeCase, threaded: list[str]) -> None:
    steps = 300 if case.inverse_map.form == "absolute" else 20
    assert run_host(threaded, case, "threads", steps).startswith(b"threads: done")


def test_valgrind(small: NativeCase, tmp_path: Path) -> None:
    valgrind = program("valgrind", install="apt install valgrind")
    host = host_by_clang(tmp_path / "host")
    command = [valgrind, "-q", "--error-exitcode=9", "--leak-check=full", "--errors-for-leak-kinds=all", str(host)]
    assert run_host(command, small, "many", 3).startswith(b"many: same")
    assert run_host(command, small, "endure", 20_000).startswith(b"endure")


@pytest.fixture(scope="module")
def fuzz(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The program that runs inputs of a fuzzer."""
    return fuzz_program(tmp_path_factory.mktemp("fuzz") / "fuzz")


@pytest.fixture(scope="module")
def maps(cases: Mapping[str, NativeCase]) -> dict[str, InverseMap]:
    """Maps that inputs change: of every form, and with the nonlinear estimator and temperature."""
    small = {name: cases[name].inverse_map for name in ("few gauges", "envelope", "scaled, few gauges")}
    return small | {"nonlinear": whole_map(), "temperature": with_temperature(whole_map())}


@pytest.fixture(params=["few gauges", "envelope", "scaled, few gauges", "nonlinear", "temperature"])
def map_bin(request: pytest.FixtureRequest, maps: dict[str, InverseMap], tmp_path: Path) -> Path:
    """``map.bin`` of each of ``maps`` in turn."""
    path = tmp_path / "map.bin"
    path.write_bytes(native_resource(maps[request.param], GUID))
    return path


def test_inputs_that_a_fuzzer_found(fuzz: Path, map_bin: Path) -> None:
    inputs = sorted(CORPUS.iterdir())
    assert len(inputs) > 30
    assert run_fuzz(fuzz, map_bin, "inputs", *inputs) == f"{len(inputs)} inputs\n"


@pytest.mark.parametrize("choice", range(6))
def test_inputs_by_chance(fuzz: Path, map_bin: Path, tmp_path: Path, choice: int) -> None:
    drawn, inputs = random.Random(choice), [tmp_path / f"{k}.bin" for k in range(20)]
    for path in inputs:
        path.write_bytes(bytes([choice]) + drawn.randbytes(drawn.randrange(1, 1500 if choice == 5 else 200)))
    assert run_fuzz(fuzz, map_bin, "inputs", *inputs) == "20 inputs\n"


def test_flipped_bits(fuzz: Path, map_bin: Path) -> None:
    said = run_fuzz(fuzz, map_bin, "flips", 40, 3).split()
    assert said[0] == "40"
    assert 0 < int(said[2]) < 41  # some of them are maps still


def test_failing_allocations(fuzz: Path, map_bin: Path) -> None:
    said = run_fuzz(fuzz, map_bin, "allocations", 200, 3).split()
    assert int(said[0]) > 5  # of which each has failed alone
    assert 0 < int(said[4]) < 200


def test_what_python_calls(tmp_path: Path) -> None:
    # Leaks of the interpreter are not ours. The sanitizer has to be there before Python.
    library = host_by_clang(
        tmp_path / "estimator.so", *MEMORY, "-shared", "-fPIC", "-shared-libasan", sources=source_files()
    )
    asked = [clang(), "-print-file-name=libclang_rt.asan-x86_64.so"]
    runtime = Path(subprocess.run(asked, capture_output=True, text=True, check=True).stdout.strip())
    environment = os.environ | {
        VARIABLE: str(library),
        "LD_PRELOAD": str(runtime),
        "LD_LIBRARY_PATH": str(runtime.parent),
        "PYTHONPATH": str(TESTS / "support"),
        "ASAN_OPTIONS": "detect_leaks=0",
    }
    command = [sys.executable, "-m", "pytest", "-p", "library_under_test", "-n", "0", "-q", "-x", "-m", "not slow"]
    finished = subprocess.run(
        [*command, *(str(TESTS / name) for name in COMPILED_IN_PYTHON), "--deselect", OF_PROCESS_MEMORY],
        capture_output=True,
        text=True,
        check=False,
        env=environment,
        cwd=TESTS.parent,
    )
    assert finished.returncode == 0, (finished.stdout + finished.stderr)[-4000:]
