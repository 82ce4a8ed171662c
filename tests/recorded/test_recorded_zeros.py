"""``strainfmu estimate --zeros``: readings with zeros give the loads of strains without, by map and by FMU."""

from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from recorded_case import NAMES, samples, write_csv
from synthetic_vehicle import N_GAUGES, SyntheticFiles, synthetic_inverse_map

from strainfmu.can.observed import observed_bridge
from strainfmu.can.options import BridgeOptions
from strainfmu.cosim.estimators.zeros_file import write_zeros
from strainfmu.errors import InputError
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.gauge_zeros import GaugeZeros
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES
from strainfmu.fmu.export import ExportOptions, export_estimator

pytestmark = pytest.mark.fast

Run = Callable[..., tuple[int, str, str]]


def test_map_and_fmu_take_them_off(synthetic: SyntheticFiles, tmp_path: Path, run: Run) -> None:
    time, strain, pressure = samples(40)
    random = np.random.default_rng(1)
    zeros = GaugeZeros(
        value=2e-4 * random.normal(size=N_GAUGES), std=1e-6 * random.uniform(size=N_GAUGES), common_std=1e-6
    )
    held = synthetic_inverse_map(1)
    write_zeros(tmp_path / "zeros.toml", held.gauge_names, zeros, {})
    data = write_csv(
        tmp_path / "d.csv", ["time", *NAMES, "dynamic_pressure"], time, strain + zeros.value, pressure
    )
    expected = Estimator(held, zeros=zeros).estimate(strain + zeros.value, pressure)
    plain = Estimator(held).estimate(strain, pressure)
    assert np.all(expected.coefficients_std > 1.01 * plain.coefficients_std)
    for source in (synthetic.map_1, synthetic.estimator_1):
        code, _, error = run("estimate", source, data, "-o", tmp_path / "o.h5", "--zeros", tmp_path / "zeros.toml")
        assert (code, error) == (0, "")
        with h5py.File(tmp_path / "o.h5") as file:
            found = np.column_stack([file[name][()] for name in COEFFICIENT_NAMES])
            sigma = np.column_stack([file[f"sigma.{name}"][()] for name in COEFFICIENT_NAMES])
        np.testing.assert_allclose(found, expected.coefficients, rtol=1e-8, atol=1e-10)
        np.testing.assert_allclose(sigma, expected.coefficients_std, rtol=1e-6)


def test_an_fmu_without_zero_inputs_is_refused(synthetic: SyntheticFiles, tmp_path: Path, run: Run) -> None:
    fmu, zeros = tmp_path / "plain.fmu", tmp_path / "zeros.toml"
    export_estimator(synthetic.map_1, fmu, ExportOptions(platforms=["linux64"]))
    known = GaugeZeros(value=np.zeros(N_GAUGES), std=np.zeros(N_GAUGES))
    write_zeros(zeros, synthetic_inverse_map(1).gauge_names, known, {})
    data = write_csv(tmp_path / "d.csv", ["time", *NAMES, "dynamic_pressure"], *samples(4))
    code, _, error = run("estimate", fmu, data, "-o", tmp_path / "o.h5", "--zeros", zeros)
    assert code == 2
    assert error.strip().endswith("plain.fmu: FMU without zero inputs: export it with --zero-inputs")
    options = BridgeOptions(interface="virtual", channel="plain", tare=synthetic.map_1)
    with pytest.raises(InputError, match="FMU without zero inputs"), observed_bridge(fmu, options):
        pass


def test_a_file_of_other_gauges_is_refused(synthetic: SyntheticFiles, tmp_path: Path, run: Run) -> None:
    (tmp_path / "zeros.toml").write_text("[gauges]\n")
    data = write_csv(tmp_path / "d.csv", ["time"], np.arange(3.0))
    code, _, error = run(
        "estimate", synthetic.map_1, data, "-o", tmp_path / "o.h5", "--zeros", tmp_path / "zeros.toml"
    )
    assert code == 2
    assert error.strip().endswith("zeros.toml: gauges.G0: gauge of the map is missing")
