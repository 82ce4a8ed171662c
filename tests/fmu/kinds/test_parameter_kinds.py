"""FMUs of every kind with further parameters of the flow: valid, and all give what numpy does."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from flight_fmu import N_D, fresh_tracker, random_flight, whole_map
from fmpy import read_model_description
from fmpy.validation import validate_fmu
from fmu_host import OPTIONS, exported_kinds, loaded
from further_maps import with_further
from parameter_maps import PARAMETERS, with_parameters
from scaled_maps import NOMINAL, scaled_map

from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import save_inverse_map
from strainfmu.fmu.checks.crosscheck import write_crosscheck
from strainfmu.fmu.export import export_estimator

pytestmark = pytest.mark.fast

N = 18


@pytest.fixture(scope="module")
def paths(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    return exported_kinds(
        with_parameters(with_further(scaled_map(2, seed=4))), tmp_path_factory.mktemp("parameters")
    )


@pytest.mark.parametrize("kind", OPTIONS)
def test_no_faults(paths: dict[str, Path], kind: str) -> None:
    assert validate_fmu(str(paths[kind])) == []
    variables = {one.name: one for one in read_model_description(str(paths[kind])).modelVariables}
    for name in PARAMETERS:
        assert variables[f"parameter.{name}"].causality == "input"
        assert variables[f"health.outside.{name}"].causality == "output"


def test_an_importer_finds_the_reference(paths: dict[str, Path], tmp_path: Path) -> None:
    results = write_crosscheck(paths["native"], tmp_path)
    assert [one.outcome for one in results if one.importer.startswith("FMPy")] == ["passed"], results


@pytest.mark.parametrize("kind", ["native", "python"])
def test_health_and_scores(paths: dict[str, Path], tmp_path: Path, kind: str) -> None:
    mean = with_parameters(scaled_map(2, seed=4)).mean_strain
    inputs, outputs = ([f"{prefix}{name}" for name in PARAMETERS] for prefix in ("parameter.", "health.outside."))
    with loaded(paths[kind], tmp_path / kind) as host:
        host.initialize()
        host.set([f"strain[{i + 1}]" for i in range(N)], mean)
        host.set(["dynamic_pressure"], [NOMINAL])
        assert host.health() == HealthState.OK
        for values, state, scores in (
            ([4.0, 0.25, 2.0], HealthState.OK, [0.0, 0.0, 0.0]),
            ([6.0, 0.25, np.nan], HealthState.OUTSIDE, [0.25, 0.0, 0.0]),
            ([np.nan, -0.25, -9999.0], HealthState.OUTSIDE, [0.0, 0.5, 0.0]),
        ):
            host.set(inputs, values)
            assert host.health() == state
            np.testing.assert_allclose(host.get(outputs), scores, rtol=1e-14)


@pytest.mark.parametrize("kind", ["native", "python"])
def test_the_nonlinear_estimator_is_outside_by_a_parameter(tmp_path: Path, kind: str) -> None:
    """Its loads stay what they are: the tables hold all values of the snapshots."""
    held = with_parameters(whole_map())
    save_inverse_map(held, tmp_path / "map.h5")
    export_estimator(tmp_path / "map.h5", tmp_path / "flight.fmu", OPTIONS[kind])
    assert validate_fmu(str(tmp_path / "flight.fmu")) == []
    tracker = fresh_tracker(held)
    with loaded(tmp_path / "flight.fmu", tmp_path / kind) as host:
        host.initialize()
        for k, sample in enumerate(random_flight(held, 4, seed=3)):
            values = dict(zip(PARAMETERS, ([1.0, 0.25, 2.0], [6.0, 0.25, np.nan])[k % 2], strict=True))
            found = tracker.step(sample.strain, valid=sample.valid, parameters=values, **sample.flow)
            assert (found.health == HealthState.OUTSIDE) == bool(k % 2)
            assert found.outside_parameters == (("fin_deg",) if k % 2 else ())
            assert found.fits
            host.set([f"strain[{i + 1}]" for i in range(N_D)], sample.strain)
            host.set(list(sample.flow), list(sample.flow.values()))
            host.set([f"parameter.{name}" for name in values], list(values.values()))
            host.fmu.doStep(0.01 * k, 0.01)
            assert host.health() == found.health
            np.testing.assert_allclose(host.get(["C_A", "C_N", "M_P"]), found.coefficients[[0, 1, 3]], rtol=1e-9)
            np.testing.assert_allclose(
                host.get([f"health.outside.{name}" for name in PARAMETERS]), found.parameter_score, rtol=1e-14
            )
