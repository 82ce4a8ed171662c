"""The filter of linear maps gives the same bits on other processors, and keeps its memory."""

import platform
from pathlib import Path

import numpy as np
import pytest
from c_host import host_by_clang, loading_host, run_host
from linear_fmu import linear_flight
from native_case import NativeCase
from platforms import AARCH64, LINUX, NARROWER, by_aarch64, by_processor
from raw_fmu import write_resource
from scaled_maps import scaled_map, whole_scaled_map
from thermal_maps import with_temperature

from strainfmu.estimator.signal_names import FILTER_TIME_CONSTANT
from strainfmu.fmu.native.build import library_file
from strainfmu.interface.estimator_variables import estimator_interface

pytest.importorskip("ziglang", reason="needs zig: pip install 'strainfmu[native]'")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        (platform.system(), platform.machine()) != ("Linux", "x86_64"), reason="needs Linux on x86-64"
    ),
]

STEPS = 60
MAPS = {
    "case 1": lambda: whole_scaled_map(1, seed=1),
    "temperature": lambda: with_temperature(whole_scaled_map(2, seed=3)),
    "more states than gauges": lambda: scaled_map(2, seed=4, n=5, n_states=6),
}


@pytest.fixture(scope="module", params=MAPS)
def case(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> NativeCase:
    held = MAPS[request.param]()
    return NativeCase(held, write_resource(held, tmp_path_factory.mktemp("linear")))


@pytest.fixture(scope="module")
def inputs(case: NativeCase, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A flight that jumps half way; gauges, samples and q_inf get lost."""
    flight = [*linear_flight(case.inverse_map, STEPS // 2, 2), *linear_flight(case.inverse_map, STEPS // 2, 99)]
    navigation = [0.0, 0.0]
    rows = [np.concatenate([one.strain, one.valid, [one.pressure, one.deviation], navigation]) for one in flight]
    path = tmp_path_factory.mktemp("inputs") / "flight.bin"
    path.write_bytes(np.array(rows).astype("<f8").tobytes())
    return path


def replayed(command: list[str], case: NativeCase, inputs: Path) -> bytes:
    """Outputs of all steps with the filter."""
    names = [one.name for one in estimator_interface(case.inverse_map)]
    return run_host(command, case, "replay", STEPS, inputs, names.index(FILTER_TIME_CONSTANT), 1.0)


@pytest.mark.parametrize("processor", NARROWER)
def test_narrower_instructions(case: NativeCase, inputs: Path, tmp_path: Path, processor: str) -> None:
    emulated = by_processor(processor)
    command = [str(loading_host(LINUX, tmp_path / "host")), str(library_file("linux64"))]
    assert replayed([*emulated, *command], case, inputs) == replayed(command, case, inputs)


def test_aarch64(case: NativeCase, inputs: Path, tmp_path: Path) -> None:
    emulated = by_aarch64()
    here = [str(loading_host(LINUX, tmp_path / "here")), str(library_file("linux64"))]
    there = [str(loading_host(AARCH64, tmp_path / "there")), str(library_file("aarch64-linux"))]
    assert replayed([*emulated, *there], case, inputs) == replayed(here, case, inputs)


def test_memory(case: NativeCase, inputs: Path, tmp_path: Path) -> None:
    """Under sanitizers; leaks are errors too."""
    host = host_by_clang(tmp_path / "host", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
    assert replayed([str(host)], case, inputs)
    assert run_host([str(host)], case, "many", 1).startswith(b"many: same")
