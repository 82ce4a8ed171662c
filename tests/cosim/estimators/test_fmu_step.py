"""The FMU as the bridge's step: the same numbers as the estimator, and what each FMI status leads to."""

import sys
from pathlib import Path

import numpy as np
import pytest
from synthetic_vehicle import SyntheticFiles, synthetic_inverse_map

from strainfmu.cosim.estimators.description import gauge_names_of
from strainfmu.cosim.estimators.fmu_step import FmuStep
from strainfmu.cosim.estimators.step import StepRefused
from strainfmu.errors import InputError, StrainfmuError
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState

pytestmark = pytest.mark.fast


def test_a_step_is_the_estimate(synthetic: SyntheticFiles) -> None:
    inverse_map = synthetic_inverse_map(1)
    strain = inverse_map.mean_strain + inverse_map.state_operator @ [1e4, -2e4, 3e4]
    path = list(sys.path)
    with FmuStep(synthetic.estimator_1) as step:
        result = step(strain, 95.8e3, 0.01)
        complete = step.gauge_names
    assert sys.path == path
    expected = Estimator(inverse_map).estimate(strain, 95.8e3)
    # The FMU may sum in another order: round-off alone.
    np.testing.assert_allclose(result.coefficients, expected.coefficients, rtol=1e-9)
    np.testing.assert_allclose(result.coefficients_std, expected.coefficients_std, rtol=1e-9)
    assert result.health == HealthState.OK
    assert complete == inverse_map.gauge_names == gauge_names_of(synthetic.estimator_1)


def test_a_gauge_that_is_nan_is_never_used(synthetic: SyntheticFiles) -> None:
    """Either the FMU goes without it, or it says that it cannot."""
    inverse_map = synthetic_inverse_map(1)
    strain = inverse_map.mean_strain + inverse_map.state_operator @ [1e4, -2e4, 3e4]
    strain[2] = np.nan
    with FmuStep(synthetic.estimator_1) as step:
        result = step(strain, 95.8e3, 0.01)
    expected = Estimator(inverse_map).estimate(strain, 95.8e3)
    if result.health == HealthState.DEGRADED:
        np.testing.assert_allclose(result.coefficients, expected.coefficients, rtol=1e-9)
    else:
        assert result.health == HealthState.INVALID
        assert np.isnan(result.coefficients).all()


def test_without_dynamic_pressure_there_are_no_coefficients(synthetic: SyntheticFiles) -> None:
    with FmuStep(synthetic.estimator_1) as step:
        result = step(synthetic_inverse_map(1).mean_strain, np.nan, 0.01)
    assert result.health == HealthState.NO_COEFFICIENTS
    assert np.isnan(result.coefficients).all()


def fail(step: FmuStep, status: str) -> None:
    """Let the next doStep end with ``status``, in the words of the instance."""

    def broken(step_size: float) -> None:
        raise StrainfmuError(f"{step.path}: instance 'bridge': fmi2DoStep returned {status}: no reason")

    step._step = broken


def test_discard_loses_one_step(synthetic: SyntheticFiles) -> None:
    strain = synthetic_inverse_map(1).mean_strain
    with FmuStep(synthetic.estimator_1) as step:
        good = step._step
        for _ in range(3):
            fail(step, "fmi2Discard")
            with pytest.raises(StepRefused):
                step(strain, 95.8e3, 0.01)
        step._step = good
        assert step(strain, 95.8e3, 0.01).health == HealthState.OK


def test_an_error_is_tried_once_more_with_a_new_instance(synthetic: SyntheticFiles) -> None:
    strain = synthetic_inverse_map(1).mean_strain
    with FmuStep(synthetic.estimator_1) as step:
        first = step._instance
        fail(step, "fmi2Error")
        with pytest.raises(StepRefused):
            step(strain, 95.8e3, 0.01)
        assert step._instance is not first
        assert step(strain, 95.8e3, 0.01).health == HealthState.OK
        fail(step, "fmi2Error")
        with pytest.raises(StrainfmuError) as caught:
            step(strain, 95.8e3, 0.01)
        assert not isinstance(caught.value, StepRefused)


def test_fatal_is_the_end(synthetic: SyntheticFiles) -> None:
    with FmuStep(synthetic.estimator_1) as step:
        fail(step, "fmi2Fatal")
        with pytest.raises(StrainfmuError) as caught:
            step(synthetic_inverse_map(1).mean_strain, 95.8e3, 0.01)
        assert not isinstance(caught.value, StepRefused)


def test_an_fmu_that_is_no_estimator_is_refused(synthetic: SyntheticFiles, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no input 'strain\[1\]' found: not an estimator FMU"):
        FmuStep(synthetic.plant)
    with pytest.raises(InputError, match="no such FMU"):
        gauge_names_of(tmp_path / "none.fmu")
