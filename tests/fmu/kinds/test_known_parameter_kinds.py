"""FMUs whose tables follow further parameters of the flow: valid, and every kind gives what numpy does."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from deflected_shape import NAME, known_map
from fmpy import read_model_description
from fmpy.validation import validate_fmu
from fmu_host import OPTIONS, exported_kinds, loaded

from strainfmu.estimator.manifold.estimator import ManifoldEstimator
from strainfmu.estimator.manifold.tracker import FlightTracker
from strainfmu.estimator.tables.flight_tables import evaluate
from strainfmu.estimator.tables.parameter_tables import with_known
from strainfmu.fmu.checks.crosscheck import write_crosscheck

pytestmark = pytest.mark.fast

STATE = np.array([6.4, 0.02, -0.01, np.log(4e3)])
VALUE, STD = f"parameter.{NAME}", f"parameter_std.{NAME}"


@pytest.fixture(scope="module")
def paths(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    return exported_kinds(known_map(), tmp_path_factory.mktemp("known"))


@pytest.mark.parametrize("kind", OPTIONS)
def test_no_faults(paths: dict[str, Path], kind: str) -> None:
    """Value and deviation are inputs, on which all that is estimated depends."""
    assert validate_fmu(str(paths[kind])) == []
    description = read_model_description(str(paths[kind]))
    variables = {one.name: one for one in description.modelVariables}
    assert variables[STD].causality == "input"
    assert float(variables[STD].start) == 0.0
    depends = {one.variable.name: {of.name for of in one.dependencies} for one in description.outputs}
    coefficient = "C_A" if "C_A" in depends else "coefficients"
    for name in (coefficient, "M_R", "air_data.angle_of_attack", "health.state", "health.chi_square"):
        assert {VALUE, STD} <= depends[name]
    assert not {VALUE, STD} & depends["health.valid_gauges"]


@pytest.mark.parametrize("kind", OPTIONS)
def test_an_importer_finds_the_reference(paths: dict[str, Path], tmp_path: Path, kind: str) -> None:
    results = write_crosscheck(paths[kind], tmp_path)
    assert [one.outcome for one in results if one.importer.startswith("FMPy")] == ["passed"], results


@pytest.mark.parametrize("kind", ["native", "python"])
def test_a_deviation_sharpens_the_rolling_moment(paths: dict[str, Path], tmp_path: Path, kind: str) -> None:
    held, manifold = known_map(), known_map().manifold
    assert manifold is not None
    n = held.n_gauges
    at = with_known(manifold, np.array([3.0]), np.zeros(1))
    strain = evaluate(at.tables, STATE[None]).value[0, :n]
    q = float(0.7 * STATE[0] ** 2 * np.exp(STATE[3]))
    tracker, sigmas = FlightTracker(ManifoldEstimator(held)), list[float]()
    with loaded(paths[kind], tmp_path / kind) as host:
        host.initialize()
        for k, std in enumerate((0.0, np.nan, -1.0, np.inf, 1.0, 0.1, 1e-3, np.nan)):
            host.set([f"strain[{i + 1}]" for i in range(n)], strain)
            host.set(["dynamic_pressure", "mach_number", VALUE, STD], [q, STATE[0], 3.0, std])
            host.fmu.doStep(0.01 * k, 0.01)
            found = tracker.step(
                strain,
                q,
                mach_number=STATE[0],
                parameters={NAME: 3.0},
                parameters_std={NAME: std if 0.0 < std < np.inf else np.nan},
            )
            expected = [found.C_N, found.M_R, *found.further_coefficients_std, found.chi_square]
            names = ["C_N", "M_R", "sigma.M_R", "health.chi_square"]
            np.testing.assert_allclose(host.get(names), expected, rtol=1e-10)
            assert host.health() == found.health
            sigmas.append(float(host.get(["sigma.M_R"])[0]))
    assert sigmas[1:4] == pytest.approx([sigmas[0]] * 3, rel=1e-12)
    assert sigmas[0] == pytest.approx(sigmas[7], rel=1e-3)
    assert sigmas[0] > sigmas[4] > sigmas[5] > 1.5 * sigmas[6]
