"""The native run-time under sanitizers, valgrind and the inputs that a fuzzer found."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
from c_host import host_by_clang, run_host
from native_case import NativeCase
from platforms import program

from strainfmu.fmu.native.build import source_files

pytestmark = pytest.mark.slow

CORPUS = Path(__file__).parent / "corpus"
MEMORY = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all")


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
    said = run_host(checked, case, "tare", steps).decode()
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


def test_threads(case: NativeCase, tmp_path: Path) -> None:
    host = host_by_clang(tmp_path / "host", "-fsanitize=thread", "-DHOST_THREADS", "-pthread")
    steps = 300 if case.inverse_map.form == "absolute" else 20
    assert run_host([str(host)], case, "threads", steps).startswith(b"threads: done")


def test_valgrind(small: NativeCase, tmp_path: Path) -> None:
    valgrind = program("valgrind", install="apt install valgrind")
    host = host_by_clang(tmp_path / "host")
    command = [valgrind, "-q", "--error-exitcode=9", "--leak-check=full", "--errors-for-leak-kinds=all", str(host)]
    assert run_host(command, small, "many", 3).startswith(b"many: same")
    assert run_host(command, small, "endure", 20_000).startswith(b"endure")


def test_inputs_that_a_fuzzer_found(tmp_path: Path) -> None:
    core = tuple(path for path in source_files() if not path.parent.name.startswith("fmi"))
    sources = (Path(__file__).parent / "fuzz.c", *core)
    fuzz = host_by_clang(tmp_path / "fuzz", *MEMORY, "-DREPLAY", sources=sources)
    inputs = sorted(str(path) for path in CORPUS.iterdir())
    assert len(inputs) > 100
    finished = subprocess.run([str(fuzz), *inputs], capture_output=True, text=True, check=False)
    assert finished.returncode == 0, finished.stderr[-4000:]
    assert finished.stdout == f"{len(inputs)} inputs\n"
