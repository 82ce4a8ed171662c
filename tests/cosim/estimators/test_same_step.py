"""The step of a bridge by map and by FMU: every input with gaps, zeros that change meanwhile, the same results."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from flight_fmu import whole_map
from flight_maps import exact_response
from other_load_maps import with_further_tables, with_own_further
from parameter_maps import with_parameter_tables, with_parameters
from scaled_maps import NOMINAL, scaled_map
from thermal_maps import REFERENCE, with_temperature

from strainfmu.cosim.estimators.fmu_step import FmuStep
from strainfmu.cosim.estimators.source import MapStep, open_step
from strainfmu.cosim.estimators.step import StepResult, other_inputs
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.gauge_zeros import GaugeZeros
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import InverseMap, save_inverse_map
from strainfmu.fmu.export import ExportOptions, export_estimator

pytestmark = pytest.mark.fast
K, NEW_ZEROS, RENEWED = 80, 12, 72
"""Steps, the one with other zero offsets, and one from which on a native FMU has made the matrices for them.

Strain of the stream fits no flight, so that steps are long."""

VALUES = {
    "mach_number": 6.0,
    "altitude": 19970.0,
    "dynamic_pressure_std": 3e3,
    "mach_number_std": 0.1,
    "static_pressure": 5510.0,
    "static_pressure_std": 150.0,
    "total_temperature": 1770.0,
    "total_temperature_std": 20.0,
    "q_source": 1.0,
    "measured_angle_of_attack": 0.03,
    "measured_angle_of_attack_std": 0.05,
    "measured_sideslip_angle": -0.01,
    "measured_sideslip_angle_std": 0.05,
    **{f"temperature[{i + 1}]": REFERENCE + 10.0 * i for i in range(4)},
    "parameter.fin_deg": 1.5,
    "parameter.power": 0.2,
    "parameter.cant_deg": 2.0,
    "parameter_std.fin_deg": 0.1,
    "parameter_std.power": 0.05,
    "parameter_std.cant_deg": 0.0,
}


def linear_map() -> InverseMap:
    return with_parameters(with_own_further(with_temperature(scaled_map(2, seed=4))))


def nonlinear_map() -> InverseMap:
    held = whole_map()
    assert held.manifold is not None
    held = replace(held, manifold=replace(held.manifold, gauge_covariance=held.gauge_covariance))
    return with_parameter_tables(with_further_tables(with_temperature(held)))


def steps(source: Path, held: InverseMap) -> list[StepResult]:
    random, n, found = np.random.default_rng(2), held.n_gauges, []
    zeros = GaugeZeros(value=3e-6 * random.normal(size=n), std=1e-7 * random.uniform(size=n), common_std=1e-7)
    pressure = NOMINAL if held.manifold is None else 0.7 * 5500.0 * 36.0
    with open_step(source) as ready:
        names = other_inputs(ready.step)
        assert isinstance(ready.step, MapStep | FmuStep)
        for k in range(K):
            strain = held.mean_strain + held.noise_std * random.normal(size=n)
            if held.manifold is not None:
                strain = exact_response(6.0, 0.03 + 1e-3 * k, 0.01, 5500.0)[:n] + 2e-7 * random.normal(size=n)
            strain[: {3: 1, 4: n // 3, 5: n}.get(k, 0)] = np.nan
            given = {name: np.nan if k == 6 + i % 6 else VALUES[name] for i, name in enumerate(names)}
            if k == NEW_ZEROS:
                ready.step.set_zeros(zeros)
            found.append(ready.step(strain, np.nan if k == 9 else pressure, 0.01, **given))
    return found


@pytest.mark.parametrize("kind", ["linear", "nonlinear"])
def test_map_and_fmu(tmp_path: Path, kind: str) -> None:
    """The nonlinear estimator goes on from its state where zeros change."""
    held = linear_map() if kind == "linear" else nonlinear_map()
    save_inverse_map(held, tmp_path / "map.h5")
    expected = steps(tmp_path / "map.h5", held)
    export_estimator(tmp_path / "map.h5", tmp_path / "e.fmu", ExportOptions(inputs="full", zero_inputs=True))
    for k, (found, wanted) in enumerate(zip(steps(tmp_path / "e.fmu", held), expected, strict=True)):
        if NEW_ZEROS <= k < RENEWED:
            assert found.health in (wanted.health, HealthState.DEGRADED), k
            continue
        assert found.health == wanted.health, k
        assert found.other_outputs.keys() == wanted.other_outputs.keys()
        for name in ("coefficients", "coefficients_std", "chi_square"):
            np.testing.assert_allclose(getattr(found, name), getattr(wanted, name), rtol=1e-6, err_msg=str(k))
        ours, theirs = (
            np.array([by.other_outputs[name] for name in wanted.other_outputs]) for by in (found, wanted)
        )
        np.testing.assert_allclose(ours, theirs, rtol=1e-5, atol=1e-9 * np.nanmax(np.abs(theirs), initial=1.0))


def test_a_gauge_is_in_range_by_its_reading(tmp_path: Path) -> None:
    """Less its zero it is not; off the tables the linear loads hold it all the same, by map and by FMU."""
    held, strain = whole_map(), exact_response(6.0, 0.03, 0.01, 5500.0)[:48]
    largest, zero = Estimator(held).settings.sensor_range, np.zeros(48)
    zero[3], strain[3] = -0.009, largest - 0.004
    zeros, pressure = GaugeZeros(value=zero, std=np.zeros(48)), 0.7 * 5500.0 * 36.0
    expected = Estimator(held, zeros=zeros).step(strain, pressure)
    assert expected.valid.all()
    save_inverse_map(held, tmp_path / "map.h5")
    export_estimator(tmp_path / "map.h5", tmp_path / "e.fmu", ExportOptions(inputs="full", zero_inputs=True))
    for source in ("map.h5", "e.fmu"):
        with open_step(tmp_path / source) as ready:
            assert isinstance(ready.step, MapStep | FmuStep)
            ready.step.set_zeros(zeros)
            found = ready.step(strain, pressure, 0.01)
        np.testing.assert_allclose(found.coefficients, expected.coefficients, rtol=1e-7)
