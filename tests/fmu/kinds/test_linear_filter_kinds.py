"""The filter of a linear map in FMUs of every kind gives what numpy gives in an importer."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu
from fmu_host import COEFFICIENTS, OPTIONS, Host, loaded
from linear_fmu import LinearReference, LinearSample, linear_flight
from scaled_maps import NOMINAL, scaled_map, whole_scaled_map

from strainfmu.estimator.linear.estimator import Estimator
from strainfmu.estimator.map.inverse_map import InverseMap, save_inverse_map
from strainfmu.fmu.checks.crosscheck import write_crosscheck
from strainfmu.fmu.export import export_estimator
from strainfmu.interface.estimator_variables import estimator_interface
from strainfmu.interface.filter_variables import FILTER_TIME_CONSTANT

pytestmark = pytest.mark.fast

N, STEPS, STEP, SECONDS = 18, 25, 1.0 / 64.0, 0.5
BROKEN = 0.25
"""Strain beyond the sensor range; FMPy interpolates, which spreads NaN."""
OUTPUTS = [*COEFFICIENTS, *(f"sigma.{name}" for name in COEFFICIENTS)]


def the_map() -> InverseMap:
    return whole_scaled_map(1, seed=5)


@pytest.fixture(scope="module")
def paths(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("linear")
    save_inverse_map(the_map(), folder / "map.h5")
    for kind, options in OPTIONS.items():
        export_estimator(folder / "map.h5", folder / f"{kind}.fmu", options)
    return {kind: folder / f"{kind}.fmu" for kind in OPTIONS}


def strains() -> np.ndarray:
    """(STEPS + 1, n_d) of a flight; gauges, and two whole samples, get lost."""
    found = np.array([one.strain for one in linear_flight(the_map(), STEPS + 1, seed=31, poor=False)])
    found[np.random.default_rng(4).random(found.shape) < 0.05] = BROKEN
    found[10:12] = BROKEN
    return found


def reference_steps(strain: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(STEPS, 10) coefficients and their deviations by numpy, filtered and of each sample alone."""
    reference, found = LinearReference(Estimator(the_map()), SECONDS), []
    for k, row in enumerate(strain):
        sample = LinearSample(strain=row, valid=np.ones(N, dtype=bool), pressure=NOMINAL, deviation=np.nan)
        found.append([[*one.coefficients, *one.coefficients_std] for one in reference.advance(sample, k * STEP)])
    filtered, alone = np.moveaxis(np.array(found), 1, 0)
    return filtered, alone


def simulated(path: Path, strain: np.ndarray, version: str) -> np.ndarray:
    """(STEPS + 1, 10) coefficients and their deviations by FMPy: at the start, then at the end of each step."""
    time = STEP * np.arange(STEPS + 1)
    arrays = version == "3"
    fields = [("strain", float, N)] if arrays else [(f"strain[{k + 1}]", float) for k in range(N)]
    rows = [(t, row if arrays else tuple(row)) for t, row in zip(time, strain, strict=True)]
    table = np.array([(t, row) if arrays else (t, *row) for t, row in rows], dtype=[("time", float), *fields])
    outputs = ["coefficients", "sigma.coefficients"] if arrays else OUTPUTS
    result = fmpy.simulate_fmu(
        str(path),
        stop_time=time[-1],
        output_interval=STEP,
        input=table,
        start_values={FILTER_TIME_CONSTANT: SECONDS},
        output=outputs,
        fmi_type="CoSimulation",
    )
    return np.column_stack([result[name].reshape(len(time), -1) for name in outputs])


@pytest.mark.parametrize("kind", OPTIONS)
def test_an_importer_finds_the_filter(paths: dict[str, Path], kind: str) -> None:
    assert validate_fmu(str(paths[kind])) == []
    strain = strains()
    expected, alone = reference_steps(strain[:-1])
    known = np.isfinite(expected)
    assert np.sum(np.any(known & (expected != alone), axis=1)) > 15
    found = simulated(paths[kind], strain, OPTIONS[kind].fmi_version)[1:]
    assert np.isfinite(found).tolist() == known.tolist()
    apart = np.where(known, found - expected, 0.0) / np.nanmax(np.abs(expected), axis=0)
    assert np.max(np.abs(apart)) < 1e-11


@pytest.mark.parametrize("kind", OPTIONS)
def test_an_importer_finds_the_reference(paths: dict[str, Path], tmp_path: Path, kind: str) -> None:
    results = write_crosscheck(paths[kind], tmp_path)
    assert [one.outcome for one in results if one.importer.startswith("FMPy")] == ["passed"], results


@pytest.mark.parametrize("kind", ["native", "python"])
def test_the_state_holds_the_law(paths: dict[str, Path], tmp_path: Path, kind: str) -> None:
    """Back in time, and in another instance."""
    strain, names = strains(), [f"strain[{k + 1}]" for k in range(N)]

    def steps(host: Host, first: int, end: int) -> list[np.ndarray]:
        found = []
        for k in range(first, end):
            host.set(names, strain[k])
            host.fmu.doStep(k * STEP, STEP)
            found.append(host.get(OUTPUTS))
        return found

    with loaded(paths[kind], tmp_path / "one") as host:
        host.initialize()
        host.set([FILTER_TIME_CONSTANT], [SECONDS])
        steps(host, 0, 6)
        state = host.fmu.getFMUState()
        content = host.fmu.serializeFMUState(state)
        after = steps(host, 6, 14)
        host.fmu.setFMUState(state)
        np.testing.assert_array_equal(steps(host, 6, 14), after)
        host.fmu.freeFMUState(state)
    expected, _ = reference_steps(strain[:14])
    np.testing.assert_allclose(after, expected[6:], rtol=1e-9)
    with loaded(paths[kind], tmp_path / "two") as host:
        host.initialize()
        host.fmu.setFMUState(host.fmu.deserializeFMUState(content))
        np.testing.assert_array_equal(steps(host, 6, 14), after)


def test_no_time_constant_where_there_is_no_filter() -> None:
    names = [one.name for one in estimator_interface(the_map())]
    assert names[names.index("zero_common_std") + 1] == FILTER_TIME_CONSTANT
    names = [one.name for one in estimator_interface(replace(scaled_map(1, seed=1), form="absolute"))]
    assert FILTER_TIME_CONSTANT not in names
