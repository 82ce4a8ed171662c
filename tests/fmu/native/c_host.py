"""The C host ``host.c``, built for a platform or under a sanitizer, and what it takes to run it."""

import os
import subprocess
from pathlib import Path

import pytest
from native_case import NativeCase
from platforms import clang
from raw_fmu import GUID, first_zero, of_filter

from strainfmu.fmu.native.build import NATIVE, compile_with_zig, fmi_headers, source_files

HOST = Path(__file__).parent / "host.c"
FUZZ = Path(__file__).parent / "fuzz.c"
MEMORY = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all")


def program_by_zig(target: str, output: Path, sources: list[Path], *flags: str) -> Path:
    """A program of C files for ``target``, compiled as the libraries are."""
    compile_with_zig(target, [f"-I{NATIVE}", *map(str, sources), *flags, "-s", "-o", str(output)])
    return output


def loading_host(target: str, output: Path) -> Path:
    """The host for ``target`` that loads the library named by its first argument."""
    return program_by_zig(target, output, [HOST], "-DHOST_LOADS")


def host_by_clang(output: Path, *flags: str, sources: tuple[Path, ...] | None = None) -> Path:
    """The host and the run-time with ``flags``, by clang."""
    files = (HOST, *source_files()) if sources is None else sources
    # DWARF 4: older valgrinds cannot read 5.
    common = ["-std=c99", "-gdwarf-4", "-O1", "-ffp-contract=off", "-fno-omit-frame-pointer"]
    includes = [f"-I{fmi_headers()}", f"-I{NATIVE}"]
    command = [clang(), *common, *flags, *includes, *map(str, files), "-lm", "-o", str(output)]
    finished = subprocess.run(command, capture_output=True, text=True, check=False)
    if finished.returncode != 0 and "clang_rt" in finished.stderr:
        pytest.skip("needs the sanitizers' run-time: apt install libclang-rt-14-dev")
    assert finished.returncode == 0, finished.stderr
    return output


def run_host(command: list[str], case: NativeCase, *task: object, location: str | None = None) -> bytes:
    """Standard output of the host for a task; ``command`` ends with the library, if the host loads one."""
    arguments = [*command, GUID, location or case.uri, str(case.n), *map(str, task)]
    environment = os.environ | {"WINEDEBUG": "-all", "UBSAN_OPTIONS": "print_stacktrace=1"}
    finished = subprocess.run(arguments, capture_output=True, check=False, env=environment)
    assert finished.returncode == 0, finished.stderr.decode(errors="replace")[-4000:]
    return finished.stdout


def tare_input(case: NativeCase) -> int:
    """Value reference of the input of the tare; its state and the zeros in use follow."""
    return first_zero(case.n) + 2 * case.n + 1 + of_filter(case.inverse_map)


def fuzz_program(output: Path) -> Path:
    """``fuzz.c`` and the estimator under AddressSanitizer and UndefinedBehaviorSanitizer."""
    core = tuple(path for path in source_files() if not path.parent.name.startswith("fmi"))
    wrapped = "-Wl,--wrap=malloc,--wrap=calloc"
    return host_by_clang(output, *MEMORY, wrapped, sources=(FUZZ, *core))


def run_fuzz(program: Path, *arguments: object) -> str:
    """Standard output of :func:`fuzz_program`."""
    command = [str(program), *map(str, arguments)]
    finished = subprocess.run(command, capture_output=True, text=True, check=False)
    assert finished.returncode == 0, finished.stderr[-4000:]
    return finished.stdout
