"""The filter in FMUs of every kind gives what numpy gives in an importer."""

from __future__ import annotations

from pathlib import Path

import fmpy
import numpy as np
import pytest
from flight_fmu import N_D, random_flight, whole_map
from fmpy.validation import validate_fmu
from fmu_host import OPTIONS
from thermal_maps import with_temperature

from strainfmu.estimator.filter.flight_filter import FlightFilter
from strainfmu.estimator.filter.settings import FilterSettings
from strainfmu.estimator.manifold.estimator import ManifoldEstimator
from strainfmu.estimator.map.inverse_map import InverseMap, save_inverse_map
from strainfmu.fmu.export import export_estimator
from strainfmu.interface.estimator_variables import estimator_interface
from strainfmu.interface.filter_variables import FILTER_TIME_CONSTANT

STEPS, STEP = 25, 0.02
MACH = 6.0
BROKEN = 0.25
"""Strain beyond the sensor range; FMPy interpolates, which spreads NaN."""
NAMES = ["C_A", "C_N", "C_Y", "M_P", "M_Y"]


def strains(inverse_map: InverseMap) -> np.ndarray:
    """(STEPS + 1, n_d) of a flight; gauges, and two whole samples, get lost."""
    found = np.array([one.strain for one in random_flight(inverse_map, STEPS + 1, seed=31)])
    found[np.random.default_rng(4).random(found.shape) < 0.05] = BROKEN
    found[10:12] = BROKEN
    return found


def simulated(path: Path, strain: np.ndarray, version: str) -> np.ndarray:
    """(STEPS + 1, 10) coefficients and their deviations by FMPy: at the start, then at the end of each step."""
    time = STEP * np.arange(STEPS + 1)
    arrays = version == "3"
    fields = [("strain", float, N_D)] if arrays else [(f"strain[{k + 1}]", float) for k in range(N_D)]
    rows = [(t, row if arrays else tuple(row)) for t, row in zip(time, strain, strict=True)]
    table = np.array([(t, row) if arrays else (t, *row) for t, row in rows], dtype=[("time", float), *fields])
    of_arrays = ["coefficients", "sigma.coefficients"]
    outputs = of_arrays if arrays else [*NAMES, *(f"sigma.{name}" for name in NAMES)]
    result = fmpy.simulate_fmu(
        str(path),
        stop_time=time[-1],
        output_interval=STEP,
        input=table,
        start_values={FILTER_TIME_CONSTANT: 0.5, "mach_number": MACH},
        output=outputs,
        fmi_type="CoSimulation",
    )
    return np.column_stack([result[name].reshape(len(time), -1) for name in outputs])


@pytest.mark.parametrize("kind", OPTIONS)
def test_an_importer_finds_the_filter(tmp_path: Path, kind: str) -> None:
    inverse_map, path = whole_map(), tmp_path / "filtered.fmu"
    save_inverse_map(inverse_map, tmp_path / "map.h5")
    export_estimator(tmp_path / "map.h5", path, OPTIONS[kind])
    assert validate_fmu(path) == []
    strain = strains(inverse_map)
    flight = FlightFilter(ManifoldEstimator(inverse_map), FilterSettings(time_constant=0.5))
    steps = [flight.step(STEP, row, mach_number=MACH) for row in strain[:-1]]
    expected = np.array([[*one.coefficients, *one.coefficients_std] for one in steps])
    found = simulated(path, strain, OPTIONS[kind].fmi_version)
    assert np.max(np.abs(found[1:] - expected) / np.max(np.abs(expected), axis=0)) < 1e-9


@pytest.mark.parametrize(("warm", "before"), [(False, "zero_common_std"), (True, "temperature[4]")])
def test_the_time_constant_stands_behind_zeros_and_temperatures(warm: bool, before: str) -> None:
    held = with_temperature(whole_map()) if warm else whole_map()
    names = [one.name for one in estimator_interface(held)]
    assert names[names.index(before) + 1] == FILTER_TIME_CONSTANT
