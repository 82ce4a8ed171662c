"""The shipped libraries give the same bits on every processor and system that can be tried on this machine."""

import platform
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from agreement import Sample, random_samples, strain_at
from c_host import loading_host, run_host
from native_case import NativeCase
from platforms import AARCH64, LINUX, NARROWER, WINDOWS, by_aarch64, by_processor, by_windows
from raw_fmu import N_OUTPUTS

from strainfmu.estimator.reference.gain import residual_precision
from strainfmu.fmu.native.build import library_file

pytest.importorskip("ziglang", reason="needs zig: pip install 'strainfmu[native]'")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        (platform.system(), platform.machine()) != ("Linux", "x86_64"), reason="needs Linux on x86-64"
    ),
]

STEPS = 2000


def inputs_of(case: NativeCase) -> bytes:
    """Inputs as the host replays them: gauges missing, broken, and off by more or less than the threshold.

    Two thirds fit the map but for one gauge that is 2 to 7 of its deviations off.
    """
    random = np.random.default_rng(6)
    deviation = 1.0 / np.sqrt(np.diag(residual_precision(case.inverse_map)))
    content = b""
    for k, sample in enumerate(random_samples(case.inverse_map, STEPS, seed=5)):
        strain, valid = sample.strain, sample.valid
        if k % 3:
            strain = strain_at(case.inverse_map, sample.dynamic_pressure) + 0.6 * deviation * random.normal(
                size=case.n
            )
            strain[k % case.n] += random.uniform(2.0, 7.0) * deviation[k % case.n]
        if k == STEPS // 2:
            valid = np.zeros(case.n, dtype=bool)
        content += line_of(replace(sample, strain=strain, valid=valid))
    return content


def line_of(sample: Sample) -> bytes:
    """One set of inputs: strains, valid, flow and navigation as float64."""
    return np.concatenate([sample.strain, sample.valid, sample.flow]).astype("<f8").tobytes()


@pytest.fixture(scope="module")
def inputs(cases: dict[str, NativeCase], tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The file of inputs for each map."""
    folder = tmp_path_factory.mktemp("inputs")
    files = {name: folder / f"{k}.bin" for k, name in enumerate(cases)}
    for name, file in files.items():
        file.write_bytes(inputs_of(cases[name]))
    return files


@pytest.fixture(scope="module")
def linux_host(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The host on this machine."""
    return loading_host(LINUX, tmp_path_factory.mktemp("host") / "host")


@pytest.fixture(scope="module")
def linux(cases: dict[str, NativeCase], inputs: dict[str, Path], linux_host: Path) -> dict[str, bytes]:
    """Outputs of the library for Linux, run by this processor, for each map."""
    return outputs_by([str(linux_host), str(library_file("linux64"))], cases, inputs)


def outputs_by(command: list[str], cases: dict[str, NativeCase], inputs: dict[str, Path]) -> dict[str, bytes]:
    """Outputs for each map of host and library in ``command``: of the inputs, then of random strains."""
    root = "Z:" if command[-1].startswith("Z:") else ""
    found = {}
    for name, case in cases.items():
        location = f"file:///{root}{case.resources}" if root else case.uri
        replayed = run_host(command, case, "replay", STEPS, f"{root}{inputs[name]}", location=location)
        found[name] = replayed + run_host(command, case, "run", STEPS, 5, location=location)
    return found


def test_inputs_take_all_branches(linux: dict[str, bytes]) -> None:
    states = {}
    for name, content in linux.items():
        outputs = np.frombuffer(content).reshape(-1, N_OUTPUTS)
        assert len(outputs) == 2 * STEPS
        states[name] = set(outputs[:, 20].astype(int).tolist())
    assert set().union(*states.values()) == set(range(8))
    assert {0, 1, 2, 4, 6} <= states["case 1"]


@pytest.mark.parametrize("processor", NARROWER)
def test_narrower_instructions(
    processor: str,
    cases: dict[str, NativeCase],
    inputs: dict[str, Path],
    linux: dict[str, bytes],
    linux_host: Path,
) -> None:
    command = [*by_processor(processor), str(linux_host), str(library_file("linux64"))]
    assert outputs_by(command, cases, inputs) == linux


def test_aarch64(
    cases: dict[str, NativeCase], inputs: dict[str, Path], linux: dict[str, bytes], tmp_path: Path
) -> None:
    emulated = by_aarch64()
    command = [*emulated, str(loading_host(AARCH64, tmp_path / "host")), str(library_file("aarch64-linux"))]
    assert outputs_by(command, cases, inputs) == linux


def test_windows(
    cases: dict[str, NativeCase], inputs: dict[str, Path], linux: dict[str, bytes], tmp_path: Path
) -> None:
    wine = by_windows()
    host = loading_host(WINDOWS, tmp_path / "host.exe")
    assert outputs_by([*wine, str(host), f"Z:{library_file('win64')}"], cases, inputs) == linux


def test_windows_paths(small: NativeCase, tmp_path: Path) -> None:
    wine = by_windows()
    host = loading_host(WINDOWS, tmp_path / "host.exe")
    content = (small.resources / "map.bin").read_bytes()
    folders = ["Jürgen Groß + (1)", "日本語", "/".join(["a folder of many letters " * 4] * 3) + "/x"]
    for name in folders:
        folder = tmp_path / name
        folder.mkdir(parents=True)
        (folder / "map.bin").write_bytes(content)
        location = f"file:///Z:{folder.as_uri().removeprefix('file://')}"
        command = [*wine, str(host), f"Z:{library_file('win64')}"]
        assert run_host(command, small, "run", 1, 5, location=location)
