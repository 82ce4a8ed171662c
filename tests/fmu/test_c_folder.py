"""The folder of C sources of a map: built here by its own CMakeLists.txt, it gives the bits of the estimator."""

import csv
import platform
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from flight_fmu import random_flight, whole_map
from once import once
from platforms import by_aarch64, program
from raw_fmu import this_platform
from snippets import ROOT
from whole_maps import MAPS

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.core import Series
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import InverseMap, load_inverse_map, save_inverse_map
from strainfmu.fmu.c_folder import WARNING_FLAGS, bounds_in
from strainfmu.fmu.export import ExportOptions, export_estimator
from strainfmu.fmu.native.build import compile_with_zig
from strainfmu.fmu.native.sources import ARITHMETIC_FLAGS

Run = Callable[..., tuple[int, str, str]]

C = ExportOptions(kind="c")
QUICK = "-O0"
"""Optimised, the build takes three times as long; the bits are the same."""

ALL_EQUAL = re.compile(r"All \d+ outputs have the bits that strainfmu computes\.")


def found_compiler() -> str:
    """The C compiler of this machine."""
    return program("cc", "gcc", "clang", install="apt install gcc")


def found_cmake() -> str:
    """The command of CMake, beside Python or on the path."""
    return program("cmake", str(Path(sys.executable).with_name("cmake")), install="pip install cmake")


def exported(inverse_map: InverseMap, folder: Path) -> Path:
    """The folder of sources of a map, beside its file in ``folder``."""
    save_inverse_map(inverse_map, folder / "map.h5")
    export_estimator(folder / "map.h5", folder / "c", C)
    return folder / "c"


def output_of(*command: str | Path, code: int = 0) -> str:
    """What a command writes; it ends with ``code``."""
    done = subprocess.run([*map(str, command)], capture_output=True, text=True, check=False)
    assert done.returncode == code, done.stdout[-2000:] + done.stderr[-2000:]
    return done.stdout + done.stderr


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with ``map.h5`` of a map with tables, its sources in ``c``, built in ``build``."""
    cmake, compiler = found_cmake(), found_compiler()

    def build(folder: Path) -> None:
        sources = exported(whole_map(), folder)
        options = [f"-DCMAKE_C_COMPILER={compiler}", f"-DCMAKE_C_FLAGS_RELEASE={QUICK}"]
        output_of(cmake, "-S", sources, "-B", folder / "build", *options)
        output_of(cmake, "--build", folder / "build")

    return once(tmp_path_factory, "c_folder", build)


def test_the_example_has_the_bits_of_the_estimator(built: Path) -> None:
    lines = output_of(built / "build" / "example").splitlines()
    assert ALL_EQUAL.fullmatch(lines[-1])
    assert len(lines) == 1 + 41 + 1
    assert {line.split()[-1] for line in lines[1:-1]} >= {HealthState.OK.name}


def test_the_example_states_another_result(built: Path, tmp_path: Path) -> None:
    """A sample whose expected loads are others: the check can fail."""
    sources = shutil.copytree(built / "c", tmp_path / "c")
    text = (sources / "samples.c").read_text()
    head, name, values = text.partition("sl_sample_output[] = {\n")
    first, comma, others = values.partition(",")
    (sources / "samples.c").write_text(f"{head}{name}{1.5 * float(first)!r}{comma}{others}")
    linked = link(sources, built / "build" / "libstrainload.a", tmp_path / "example")
    assert "1 outputs differ from those of strainfmu, by up to 3.3e-01" in output_of(linked, code=1)


def link(sources: Path, library: Path, output: Path) -> Path:
    """The example of a map, with the library of another one: the code is the same."""
    files = [sources / name for name in ("example.c", "samples.c", "map_data.c")]
    flags = ["-std=c99", *ARITHMETIC_FLAGS, *WARNING_FLAGS]
    output_of(found_compiler(), QUICK, *flags, *files, library, "-lm", "-o", output)
    return output


CPP = """
#include <cstdio>
#include <vector>
#include "estimator/interface/strainload.h"
#include "map_data.h"
#include "positions.h"
#include "samples.h"

static unsigned char buffer[SL_MEMORY_SIZE];

int main() {
    char text[SL_TEXT_SIZE];
    if (sl_open_in(sl_map_data, sl_map_size, buffer, sizeof buffer / 2, text) != nullptr) {
        return 1;
    }
    std::printf("%s\\n", text);
    StrainLoad *handle = sl_open_in(sl_map_data, sl_map_size, buffer, sizeof buffer, text);
    if (handle == nullptr || sl_size(handle, SL_INPUTS) != SL_IN_SIZE
        || sl_size(handle, SL_OUTPUTS) != SL_OUT_SIZE) {
        return 2;
    }
    std::vector<double> output(SL_OUT_SIZE);
    sl_step(handle, sl_sample_time[0], sl_sample_input, nullptr, output.data());
    std::printf("%zu rows %d %d %d\\n", sl_size(handle, SL_ROWS),
                output[SL_OUT_C_N] == sl_sample_output[SL_OUT_C_N],
                output[SL_OUT_NORMAL_FORCE_STD] == sl_sample_output[SL_OUT_NORMAL_FORCE_STD],
                sl_sample_input[SL_IN_MACH_NUMBER] > 0.0);
    sl_close(handle);
}
"""


def test_a_program_in_cpp_needs_no_heap_and_names_values(built: Path, tmp_path: Path) -> None:
    """Names of functions are other ones in C++ unless the headers declare them as C."""
    compiler = program("c++", "g++", "clang++", install="apt install g++")
    (tmp_path / "host.cpp").write_text(CPP)
    library, host = built / "build" / "libstrainload.a", tmp_path / "host"
    sources = [tmp_path / "host.cpp", built / "c" / "samples.c", built / "c" / "map_data.c"]
    flags = ("-Wall", "-Wextra", "-pedantic", "-Werror")
    output_of(compiler, *flags, f"-I{built / 'c'}", *sources, library, "-lm", "-o", host)
    n = load_inverse_map(built / "map.h5").n_gauges
    assert output_of(host).splitlines() == ["needs more memory than there is", f"{n} rows 1 1 1"]


def test_the_export_states_what_must_be_set_aside(built: Path) -> None:
    core = Estimator(load_inverse_map(built / "map.h5")).core
    line = bounds_in(built / "c")
    assert f"a handle {core.memory_size:,} bytes" in line
    assert f"at most {core.most_iterations} iterations in a step" in line
    measured = output_of(built / "build" / "measure", "1")
    assert re.search(rf"a handle of sl_open_in +{core.memory_size} bytes", measured)


@pytest.mark.parametrize("name", MAPS)
def test_maps_with_all_that_a_map_can_have(built: Path, tmp_path: Path, name: str) -> None:
    """Further sensors, temperatures, thrust, flow parameters, section loads: in sample, results and README.txt."""
    sources = exported(MAPS[name](), tmp_path)
    linked = link(sources, built / "build" / "libstrainload.a", tmp_path / "example")
    assert ALL_EQUAL.search(output_of(linked))
    text = (sources / "README.txt").read_text()
    core = Estimator(MAPS[name]()).core
    assert f"at most {core.most_iterations} in all." in " ".join(text.split())
    for layout in (core.inputs, core.outputs, core.settings):
        for field, part in layout.items():
            last = "" if part.stop - 1 == part.start else rf" \.\. {part.stop - 1}"
            row = re.search(rf"^ +{part.start}{last} +{field} +\S", text, re.MULTILINE)
            assert (row is not None) == (part.stop > part.start), field
    assert all(gauge in text for gauge in MAPS[name]().gauge_names)


def flight(inverse_map: InverseMap) -> tuple[FloatArray, list[str], list[list[float]]]:
    """Times, names of columns, and rows of a flight that loses gauges and air data."""
    samples = random_flight(inverse_map, 40, seed=11)
    names = ["mach_number", "static_pressure", "dynamic_pressure"]
    rows = [[*sample.strain.tolist(), *(float(sample.flow[name]) for name in names)] for sample in samples]
    for k in range(10, 20):
        rows[k][k] = np.nan
        rows[k][-1 - k % 3] = np.nan
    columns = [f"strain[{i}]" for i in range(1, inverse_map.n_gauges + 1)] + names
    return 0.02 * np.arange(len(rows)), columns, rows


@pytest.mark.parametrize("seconds", [0.0, 0.5])
def test_a_table_has_the_bits_of_the_estimator(built: Path, tmp_path: Path, seconds: float) -> None:
    inverse_map = load_inverse_map(built / "map.h5")
    time, columns, rows = flight(inverse_map)
    table = tmp_path / "flight.csv"
    with table.open("w", newline="") as stream:
        writer = csv.writer(stream, quoting=csv.QUOTE_ALL if seconds else csv.QUOTE_MINIMAL)
        writer.writerow(["time", *columns])
        writer.writerows(
            [repr(t), *("" if np.isnan(v) else repr(v) for v in row)]
            for t, row in zip(time.tolist(), rows, strict=True)
        )
    filtered = (str(seconds),) if seconds else ()
    lines = output_of(built / "build" / "example", table, *filtered).splitlines()
    found = np.array([[float(value) for value in line.split(",")] for line in lines[1:]])
    core = Estimator(inverse_map).core
    if seconds:
        core.set(core.settings["filter_time_constant"].start, np.array([seconds]))
    inputs = np.full((len(rows), core.n_inputs), np.nan)
    n = inverse_map.n_gauges
    inputs[:, :n] = [row[:n] for row in rows]
    for k, name in enumerate(columns[n:], start=n):
        inputs[:, core.inputs[name]] = np.array([row[k] for row in rows])[:, None]
    expected = core.series(Series.TRACK, inputs, time=time)
    assert np.array_equal(found[:, 0], time)
    assert np.array_equal(found[:, 1:], expected, equal_nan=True)
    heading = lines[0].split(",")
    by_python = (
        Estimator(inverse_map)
        .filter(seconds)
        .track(
            np.array(rows)[:, :n],
            time=time,
            **{name: np.array(rows)[:, k] for k, name in enumerate(columns[n:], start=n)},
        )
    )
    loads = found[:, heading.index("loads[1]") : heading.index("loads[1]") + 5]
    assert np.array_equal(loads, by_python.loads)
    assert len(set(found[:, heading.index("health")].tolist())) > 1


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ("time,strain[1]\n0,abc\n", "the table has an entry that is no number: abc"),
        ("time,strain[1]\n0\n", "the table has an entry that is no number: none"),
        ("time,strain[0]\n", "the table has a column that is no input of this map: strain[0]"),
        ("time,strain\n", "the table has a column that is no input of this map: strain"),
        ("time,strain[999]\n", "the table has a column that is no input of this map: strain[999]"),
        ("time,plant.C_A\n", "the table has a column that is no input of this map: plant.C_A"),
    ],
)
def test_tables_that_cannot_be_are_one_line(built: Path, tmp_path: Path, table: str, words: str) -> None:
    (tmp_path / "t.csv").write_text(table)
    done = subprocess.run([built / "build" / "example", tmp_path / "t.csv"], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (1, f"example: {words}\n")


def test_memory_and_time_are_measured(built: Path) -> None:
    if this_platform() != "linux64":
        pytest.skip("needs a linker with --wrap, and threads")
    text = output_of(built / "build" / "measure", "3")
    resource = Estimator(load_inverse_map(built / "map.h5")).core.resource
    found = dict(re.findall(r"^([a-z_. ]+?) +(\d+) bytes", text, re.MULTILINE))
    assert len(resource) < int(found["a handle"]) < 100 * len(resource)
    assert 1000 < int(found["stack of sl_open"]) < 100_000
    assert 1000 < int(found["stack of a step"]) < 100_000
    assert re.search(r"^requests of memory by steps +0$", text, re.MULTILINE)
    rows = re.findall(r"^(\S.*?)((?: +\d+\.\d){4})\s*$", text, re.MULTILINE)
    assert len(rows) == 8
    assert all(float(m) <= float(most) for _, times in rows for m, most in [times.split()[:2], times.split()[2:]])


def test_the_page_states_what_measure_prints(built: Path, ic3x_demo: Path, tmp_path: Path) -> None:
    """Memory of the shipped vehicle's map; its stack without optimisation is that of -O2 to 3 %."""
    if this_platform() != "linux64":
        pytest.skip("needs a linker with --wrap, and threads")
    export_estimator(ic3x_demo / "map.h5", tmp_path / "c", C)
    files = [tmp_path / "c" / name for name in ("measure.c", "samples.c", "map_data.c")]
    flags = ["-std=c99", *ARITHMETIC_FLAGS, "-DWRAPPED", "-pthread", "-Wl,--wrap=malloc,--wrap=calloc,--wrap=free"]
    library = built / "build" / "libstrainload.a"
    output_of(found_compiler(), QUICK, *flags, *files, library, "-lm", "-o", tmp_path / "measure")
    printed = output_of(tmp_path / "measure", "1")
    size = {name: int(n) for name, n in re.findall(r"^([a-z_. ]+?) +(\d+) bytes", printed, re.MULTILINE)}
    (blocks,) = re.findall(r"bytes in (\d+) blocks", printed)
    page = (ROOT / "docs" / "howto" / "run_without_fmi.md").read_text(encoding="utf-8")
    assert f"| map, constant | {size['map_data.c'] / 1e6:.2f} MB |" in page
    heap, buffer = (size[name] / 1e6 for name in ("a handle", "a handle of sl_open_in"))
    assert f"| a handle | {heap:.1f} MB in {blocks} blocks, {buffer:.1f} MB in a buffer of `sl_open_in` |" in page
    assert f"| a sample and its results | {size['records']} bytes |" in page
    (most,) = re.findall(r"\| stack of .* \| ([\d,]+) bytes at most \|", page)
    assert max(size["stack of sl_open"], size["stack of a step"]) < int(most.replace(",", ""))


def test_the_folder_holds_no_front_of_fmi(built: Path) -> None:
    names = sorted(file.relative_to(built / "c").as_posix() for file in (built / "c").rglob("*") if file.is_file())
    assert [name for name in names if "/" not in name] == [
        "CMakeLists.txt",
        "README.txt",
        "example.c",
        "map_data.c",
        "map_data.h",
        "measure.c",
        "positions.h",
        "samples.c",
        "samples.h",
    ]
    assert {name.partition("/")[0] for name in names if "/" in name} == {"core", "estimator"}
    assert not {"core/instance.c", "core/state.c"} & {*names}
    text = "".join((built / "c" / name).read_text() for name in names if name.endswith((".c", ".h")))
    assert "Functions.h" not in text
    listed = ", ".join(f'"{state.name}"' for state in HealthState)
    held = re.search(r"HEALTH\[\] = \{(.*?)\}", (built / "c" / "example.c").read_text(), re.DOTALL)
    assert held is not None
    assert " ".join(held.group(1).split()) == listed


def test_two_exports_are_equal(built: Path, tmp_path: Path) -> None:
    export_estimator(built / "map.h5", tmp_path / "again" / "c", C)
    for file in (built / "c").rglob("*.*"):
        assert (tmp_path / "again" / "c" / file.relative_to(built / "c")).read_bytes() == file.read_bytes()
    assert [one.name for one in (tmp_path / "again").iterdir()] == ["c"]


def test_the_linear_estimator_alone(built: Path, tmp_path: Path) -> None:
    assert (
        export_estimator(built / "map.h5", tmp_path / "c", ExportOptions(kind="c", estimator="linear")) == "linear"
    )
    assert "(linear estimator," in (tmp_path / "c" / "README.txt").read_text()


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (("-o", "there"), "there: expected the name of a new folder, got one that is there already"),
        (("-o", "file"), "file: expected the name of a new folder, got one that is there already"),
        ((), "estimator.fmu: expected the name of a new folder for kind c, got the name of an FMU"),
        (("-o", "n", "--fmi", "3"), "fmi: expected none with kind c"),
        (("-o", "n", "--platforms", "linux64"), "platforms: expected none with kind c"),
        (("-o", "n", "--zero-inputs"), "zero inputs: expected none with kind c"),
        (("-o", "n", "--tare-known", "k.toml"), "tare known: expected none with kind c"),
        pytest.param(("-o", "n" * 300), f"{'n' * 300}: could not be written: File name too long", id="long name"),
    ],
)
def test_what_cannot_be_is_one_line(
    built: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, run: Run, arguments: tuple[str, ...], line: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("there").mkdir()
    Path("file").write_text("kept")
    code, out, errors = run("export", built / "map.h5", "--kind", "c", *arguments)
    assert (code, out, errors.count("\n")) == (1 if "n" * 300 in arguments else 2, "", 1)
    assert errors.startswith(f"strainfmu: {line}")
    assert sorted(one.name for one in tmp_path.iterdir()) == ["file", "there"]


def test_a_failed_write_leaves_nothing(built: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.rename", full)
    with pytest.raises(Exception, match="c: could not be written: No space left on device"):
        export_estimator(built / "map.h5", tmp_path / "c", C)
    assert list(tmp_path.iterdir()) == []


def test_no_map_no_folder(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        export_estimator(tmp_path / "none.h5", tmp_path / "c", C)
    assert list(tmp_path.iterdir()) == []


EMULATED = {
    "aarch64-linux-musl": lambda: by_aarch64()[:1],
    "arm-linux-musleabihf": lambda: [program("qemu-arm", install="apt install qemu-user")],
    "x86_64-linux-musl": list,
}
"""Command before a program of each target of zig."""


@pytest.mark.slow
@pytest.mark.skipif((platform.system(), platform.machine()) != ("Linux", "x86_64"), reason="needs Linux on x86-64")
@pytest.mark.parametrize("target", EMULATED)
def test_other_processors(target: str, built: Path, tmp_path: Path) -> None:
    """32-bit ARM too: its floating-point unit has the double precision of IEEE 754."""
    pytest.importorskip("ziglang", reason="needs zig: pip install 'strainfmu[native]'")
    emulator = EMULATED[target]()
    sources = built / "c"
    files = [*sources.glob("core/*.c"), *sources.glob("estimator/**/*.c")]
    files += [sources / name for name in ("example.c", "samples.c", "map_data.c")]
    compile_with_zig(target, [*WARNING_FLAGS, *map(str, files), "-o", str(tmp_path / "example")])
    assert ALL_EQUAL.search(output_of(*emulator, tmp_path / "example"))
