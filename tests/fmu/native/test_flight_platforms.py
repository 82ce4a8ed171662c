"""The nonlinear estimator gives the same bits on every processor that can be tried here, and keeps its memory."""

import platform
from pathlib import Path

import numpy as np
import pytest
from c_host import host_by_clang, loading_host, run_host
from flight_fmu import N_D, random_flight, whole_map
from native_case import NativeCase
from parameter_maps import with_parameter_tables
from platforms import AARCH64, LINUX, NARROWER, by_aarch64, by_processor
from raw_fmu import N_OUTPUTS, write_resource
from sensor_maps import with_sensors
from thermal_maps import with_temperature

from strainfmu.estimator.signal_names import FILTER_TIME_CONSTANT
from strainfmu.fmu.native.build import library_file
from strainfmu.interface.estimator_variables import estimator_interface
from strainfmu.interface.input_names import FLOW_INPUTS

pytest.importorskip("ziglang", reason="needs zig: pip install 'strainfmu[native]'")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        (platform.system(), platform.machine()) != ("Linux", "x86_64"), reason="needs Linux on x86-64"
    ),
]

FLIGHTS, STEPS = 20, 10

MAPS = {
    "gauges": whole_map,
    "auxiliary sensors": lambda: with_sensors(whole_map()),
    "temperature": lambda: with_temperature(whole_map()),
    "known deflection": lambda: with_parameter_tables(whole_map()),
}


@pytest.fixture(scope="module", params=MAPS)
def flight(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> NativeCase:
    one = MAPS[request.param]()
    return NativeCase(one, write_resource(one, tmp_path_factory.mktemp("flight")))


@pytest.fixture(scope="module")
def inputs(flight: NativeCase, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Motions inside the tables that jump from one to the next; gauges lost, navigation unknown now and then or
    for a flight, strain bent."""
    random, rows = np.random.default_rng(9), []
    scale = flight.inverse_map.sensors.scale
    for number in range(FLIGHTS):
        bent = random.normal(size=N_D) * (1e-5 if number % 5 == 4 else 0.0)
        for sample in random_flight(flight.inverse_map, STEPS, seed=number):
            valid = random.random(N_D) > (0.2 if number % 3 == 1 else 0.0)
            flow = [sample.flow.get(name, 0.0) for name in FLOW_INPUTS]
            known = random.random(len(flow)) > (0.0, 0.0, 0.5, 1.0)[number % 4]
            rows.append(np.concatenate([scale * (sample.strain + bent), valid, np.where(known, flow, 0.0)]))
    path = tmp_path_factory.mktemp("inputs") / "flight.bin"
    path.write_bytes(np.array(rows).astype("<f8").tobytes())
    return path


@pytest.fixture(scope="module")
def linux_host(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return loading_host(LINUX, tmp_path_factory.mktemp("host") / "host")


def staying(flight: NativeCase, values: dict[str, float]) -> list[float]:
    """Value reference and value of each of the map's inputs among ``values``, which stay."""
    names = [one.name for one in estimator_interface(flight.inverse_map)]
    pairs = [(names.index(name), value) for name, value in values.items() if name in names]
    return [number for pair in pairs for number in pair]


def filtering(flight: NativeCase) -> list[float]:
    """Value reference of the filter's time constant, and one [s]."""
    return staying(flight, {FILTER_TIME_CONSTANT: 1.0})


def known(flight: NativeCase) -> list[float]:
    """Two parameters of the flow, where the map has some, with their deviations."""
    of_fin = {"parameter.fin_deg": 0.8, "parameter_std.fin_deg": 0.3}
    return staying(flight, of_fin | {"parameter.power": 0.2, "parameter_std.power": 0.0})


def outputs_by(command: list[str], flight: NativeCase, inputs: Path) -> bytes:
    """Outputs of all steps, and of random strains that fit no tables."""
    replayed = run_host(command, flight, "replay", FLIGHTS * STEPS, inputs, *known(flight))
    filtered = run_host(command, flight, "replay", FLIGHTS * STEPS, inputs, *filtering(flight))
    return replayed + filtered + run_host(command, flight, "run", 100, 5)


@pytest.fixture(scope="module")
def linux(flight: NativeCase, inputs: Path, linux_host: Path) -> bytes:
    return outputs_by([str(linux_host), str(library_file("linux64"))], flight, inputs)


def test_inputs_take_all_branches(linux: bytes) -> None:
    states = set(np.frombuffer(linux).reshape(-1, N_OUTPUTS)[:, 20].astype(int).tolist())
    assert {0, 1, 4, 7} <= states


@pytest.mark.parametrize("processor", NARROWER)
def test_narrower_instructions(
    processor: str, flight: NativeCase, inputs: Path, linux: bytes, linux_host: Path
) -> None:
    command = [*by_processor(processor), str(linux_host), str(library_file("linux64"))]
    assert outputs_by(command, flight, inputs) == linux


def test_aarch64(flight: NativeCase, inputs: Path, linux: bytes, tmp_path: Path) -> None:
    emulated = by_aarch64()
    command = [*emulated, str(loading_host(AARCH64, tmp_path / "host")), str(library_file("aarch64-linux"))]
    assert outputs_by(command, flight, inputs) == linux


def test_memory(flight: NativeCase, inputs: Path, tmp_path: Path) -> None:
    """Instances that pass states on, under sanitizers; leaks are errors too."""
    host = host_by_clang(tmp_path / "host", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
    assert run_host([str(host)], flight, "many", 1).startswith(b"many: same")
    assert run_host([str(host)], flight, "replay", FLIGHTS * STEPS, inputs, *known(flight))
    assert run_host([str(host)], flight, "replay", FLIGHTS * STEPS, inputs, *filtering(flight))
