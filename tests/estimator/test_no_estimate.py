"""Outputs while nothing can be estimated: no loads, but numbers for the tests of a residual without terms."""

from dataclasses import replace

import numpy as np
import pytest
from flight_fmu import N_D, whole_map
from synthetic_vehicle import N_GAUGES, synthetic_inverse_map

from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState, chi_square_limit

SCALE = 2.0


def estimator_and_limit(kind: str) -> tuple[Estimator, float]:
    """An estimator of 2 times the alarm limits, and the limit of the chi-square of all gauges."""
    inverse_map = synthetic_inverse_map() if kind == "linear" else whole_map()
    manifold, free = inverse_map.manifold, inverse_map.residual_degrees_of_freedom
    limit = (
        inverse_map.chi_square_scale * chi_square_limit(free)
        if manifold is None
        else manifold.chi_square_scale * chi_square_limit(N_D)
    )
    estimator = Estimator(inverse_map)
    return estimator.with_settings(replace(estimator.settings, alarm_scale=SCALE)), SCALE * limit


@pytest.mark.parametrize("kind", ["linear", "nonlinear"])
def test_invalid_has_a_residual_without_terms(kind: str) -> None:
    estimator, limit = estimator_and_limit(kind)
    found = estimator.step(np.full(N_GAUGES if kind == "linear" else N_D, np.nan), 9e4)
    assert found.health == HealthState.INVALID
    assert np.isnan([*found.loads, *found.coefficients, *found.loads_std]).all()
    assert (found.chi_square, found.envelope_score) == (0.0, 0.0)
    assert found.chi_square_limit == pytest.approx(limit, rel=1e-12)


def test_coefficients_alone_are_missing_without_a_dynamic_pressure() -> None:
    estimator, _ = estimator_and_limit("linear")
    found = estimator.step(1e-6 * np.arange(1.0, N_GAUGES + 1), 0.0)
    assert found.health == HealthState.NO_COEFFICIENTS
    assert np.isnan(found.coefficients).all()
    assert np.isfinite([*found.loads, found.chi_square, found.chi_square_limit]).all()
    assert found.envelope_score == 0.0
