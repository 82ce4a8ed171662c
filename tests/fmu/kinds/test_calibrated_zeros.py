"""Zero offsets of a calibrated map: every carrier starts from them, and other ones replace them."""

from dataclasses import replace
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.simulation import simulate_fmu
from fmu_host import COEFFICIENTS, OPTIONS
from recorded_case import NAMES, read_csv, samples, write_csv
from synthetic_vehicle import N_GAUGES, SyntheticFiles

from strainfmu.cosim.estimators.source import open_step
from strainfmu.cosim.estimators.zeros_file import write_zeros
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.gauge_zeros import GaugeZeros
from strainfmu.estimator.map.inverse_map import InverseMap, load_inverse_map, save_inverse_map
from strainfmu.fmu.export import ExportOptions, export_estimator
from strainfmu.recorded.run import estimate_file

pytestmark = pytest.mark.fast

ZEROS = 1e-4 * np.random.default_rng(7).normal(size=N_GAUGES)
KINDS = {**OPTIONS, "without zero inputs": ExportOptions()}


@pytest.fixture(scope="module")
def calibrated(synthetic: SyntheticFiles, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("calibrated") / "calibrated.h5"
    save_inverse_map(replace(load_inverse_map(synthetic.map_1), zero_offset=ZEROS), path)
    return path


def expected(held: InverseMap, strain: np.ndarray, pressure: np.ndarray) -> np.ndarray:
    """(n, 5) coefficients of the map without offsets, of strain whose offsets were subtracted before."""
    bare = Estimator(replace(held, zero_offset=np.zeros(0)))
    return np.asarray(bare.estimate(strain, dynamic_pressure=pressure).coefficients)


def test_a_map_keeps_its_zeros_and_python_starts_from_them(calibrated: Path) -> None:
    held = load_inverse_map(calibrated)
    np.testing.assert_array_equal(held.zero_offset, ZEROS)
    _, strain, pressure = samples(20)
    found = Estimator(held).estimate(strain + ZEROS, dynamic_pressure=pressure)
    np.testing.assert_allclose(found.coefficients, expected(held, strain, pressure), atol=1e-9)


def test_other_zeros_replace_them(calibrated: Path) -> None:
    held = load_inverse_map(calibrated)
    _, strain, pressure = samples(5)
    other = GaugeZeros(value=2e-5 * np.ones(N_GAUGES), std=np.zeros(N_GAUGES))
    found = Estimator(held, zeros=other).estimate(strain + 2e-5, dynamic_pressure=pressure)
    np.testing.assert_allclose(found.coefficients, expected(held, strain, pressure), atol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_fmu_starts_from_them(calibrated: Path, tmp_path: Path, kind: str) -> None:
    held, fmu = load_inverse_map(calibrated), tmp_path / "calibrated.fmu"
    export_estimator(calibrated, fmu, KINDS[kind])
    _, strain, pressure = samples(1)
    names = [one.name for one in fmpy.read_model_description(str(fmu)).modelVariables]
    start: dict[str, object] = {"dynamic_pressure": float(pressure[0])}
    if "strain" in names:
        start["strain"] = (strain[0] + ZEROS).tolist()
    else:
        start |= {f"strain[{i + 1}]": value for i, value in enumerate((strain[0] + ZEROS).tolist())}
    asked = ["coefficients"] if "coefficients" in names else COEFFICIENTS
    flown = simulate_fmu(str(fmu), start_values=start, stop_time=0.02, step_size=0.01, output=asked)
    last = np.hstack([np.ravel(flown[-1][name]) for name in asked])
    np.testing.assert_allclose(last[:5], expected(held, strain, pressure)[0], atol=1e-9)


@pytest.mark.parametrize("ending", [".h5", ".fmu"])
def test_recorded_data_and_bus_start_from_them(calibrated: Path, tmp_path: Path, ending: str) -> None:
    """One line names them; a zeros.toml replaces them."""
    held, source = load_inverse_map(calibrated), calibrated
    if ending == ".fmu":
        source = tmp_path / "calibrated.fmu"
        export_estimator(calibrated, source, ExportOptions(inputs="full", zero_inputs=True))
    time, strain, pressure = samples(20)
    wanted = expected(held, strain, pressure)
    headings = ["time", *NAMES, "dynamic_pressure"]
    data = write_csv(tmp_path / "flight.csv", headings, time, strain + ZEROS, pressure)
    summary = estimate_file(source, data, tmp_path / "loads.csv")
    assert sum("calibration's zero offsets are subtracted" in note for note in summary.notes) == 1
    assert_loads(tmp_path / "loads.csv", wanted)
    other = tmp_path / "zeros.toml"
    write_zeros(other, NAMES, GaugeZeros(value=np.zeros(N_GAUGES), std=np.zeros(N_GAUGES)), {"bus": "vcan0"})
    bare = write_csv(tmp_path / "bare.csv", headings, time, strain, pressure)
    summary = estimate_file(source, bare, tmp_path / "loads.csv", zeros=other)
    assert not any("calibration's zero offsets" in note for note in summary.notes)
    assert_loads(tmp_path / "loads.csv", wanted)
    with open_step(source) as ready:
        result = ready.step(strain[3] + ZEROS, float(pressure[3]), 0.01)
    np.testing.assert_allclose(result.coefficients, wanted[3], atol=1e-9)


def assert_loads(path: Path, wanted: np.ndarray) -> None:
    found = read_csv(path)
    np.testing.assert_allclose(np.column_stack([found[f"{name} [1]"] for name in COEFFICIENTS]), wanted, atol=1e-9)
