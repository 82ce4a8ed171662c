"""The score of a flight, on a recording made by hand."""

from __future__ import annotations

import numpy as np
import pytest

from builder.pipeline.demonstration.flight_trial import score_flight
from strainfmu.cosim.systems.recording import Recording
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES

pytestmark = pytest.mark.fast


def recording(truth: np.ndarray, estimate: np.ndarray, sigma: float) -> Recording:
    """Return a recording of n samples of five coefficients (n, 5)."""
    names = [f"plant.{name}" for name in COEFFICIENT_NAMES]
    names += [f"estimator.{name}" for name in COEFFICIENT_NAMES]
    names += [f"estimator.sigma.{name}" for name in COEFFICIENT_NAMES]
    health = np.zeros((len(truth), 1))
    values = np.hstack([truth, estimate, np.full_like(truth, sigma), health])
    cost = np.array([[1e-4, 2e-5]] * (len(truth) - 1))
    return Recording(
        time=np.arange(len(truth)) * 0.01,
        names=(*names, "estimator.health.state"),
        units=("1",) * (len(names) + 1),
        values=values,
        instances=("plant", "estimator"),
        step_cost=cost,
    )


def test_errors_and_coverage_of_known_numbers() -> None:
    truth = np.zeros((4, 5))
    truth[:, 1] = [0.0, 1.0, 2.0, 4.0]
    estimate = truth + 0.02
    estimate[0, 1] += 0.08
    score = score_flight(recording(truth, estimate, 0.01))
    rms = np.sqrt((0.1**2 + 3 * 0.02**2) / 4)
    assert score["rms_error"]["C_N"] == pytest.approx(rms, rel=1e-12)
    assert score["rms_error_of_range"]["C_N"] == pytest.approx(rms / 4.0, rel=1e-12)
    assert list(score["coverage"].values()) == [1.0, 0.75, 1.0, 1.0, 1.0]
    assert score["undetected"]["C_N"] == 0.25
    assert score["step_time"] == {"plant": 1e-4, "estimator": 2e-5}


def test_a_constant_coefficient_has_no_range() -> None:
    score = score_flight(recording(np.zeros((3, 5)), np.full((3, 5), 0.01), 0.01))
    assert set(score["rms_error_of_range"].values()) == {None}
    np.testing.assert_allclose(list(score["rms_error"].values()), 0.01)
