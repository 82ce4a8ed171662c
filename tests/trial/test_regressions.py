"""Learning estimators: flights that they learn from, bands of split conformal prediction, what they answer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from flight_maps import flight_map
from shape_case import shape_map

from builder.trial import regressions
from builder.trial.readings import ANGLES
from builder.trial.regressions import LEVEL, REGRESSIONS, conformal_half_width, of_regression, step_costs
from builder.trial.training_flights import training_flights, with_drawn_errors
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE
from strainfmu.estimator.reference.nonlinear import strain_covariance
from strainfmu.estimator.tables.flight_tables import evaluate

ALTITUDES_KM = (15.0, 25.0)


@pytest.mark.fast
def test_bands_hold_the_stated_share() -> None:
    random = np.random.default_rng(1)
    half = conformal_half_width(random.standard_normal((20_000, 2)))
    np.testing.assert_allclose(half, 3.0, atol=0.15)
    assert np.mean(np.abs(random.standard_normal((50_000, 2))) <= half) == pytest.approx(LEVEL, abs=1e-3)


@pytest.mark.fast
def test_too_few_residuals_give_no_band() -> None:
    assert np.isinf(conformal_half_width(np.ones((300, 1)))).all()
    assert np.isfinite(conformal_half_width(np.ones((400, 1)))).all()


def test_drawn_errors_have_the_covariance_of_the_estimator() -> None:
    manifold, k = flight_map(discrepancy=0.05, hardware=True), 20_000
    pressure = np.full(k, 5e3)
    state = np.array([[6.0, 0.08, 0.03, np.log(5e3)]])
    at = evaluate(manifold.tables, state).value
    n_d = manifold.tables.n_gauges
    strain, loads = np.repeat(at[:, :n_d], k, axis=0), np.repeat(at[:, n_d:], k, axis=0)
    read, drawn = with_drawn_errors(
        manifold=manifold, pressure=pressure, strain=strain, loads=loads, random=np.random.default_rng(3)
    )
    expected = strain_covariance(manifold, manifold.gauge_covariance, state)[0]
    found = np.cov(read.T)
    size = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    assert np.abs((found - expected) / size).max() < 0.06
    of_load = np.cov(drawn.T)
    np.testing.assert_allclose(np.diag(of_load), 5e3**2 * np.diag(manifold.load_covariance), rtol=0.1, atol=1e-9)


def test_training_flights_of_a_shape_are_inside_the_ranges_of_both_angles() -> None:
    manifold = shape_map().manifold
    assert manifold is not None
    flights = training_flights(manifold, ALTITUDES_KM, 400, np.random.default_rng(1))
    angles = np.degrees(flights.truth[:, 5:])
    assert np.all(np.abs(angles) <= [4.01, 2.01])
    assert np.all(np.ptp(angles, axis=0) > [7.5, 3.7])


@pytest.mark.parametrize("name", REGRESSIONS)
def test_a_regression_learns_loads_and_angles(name: str) -> None:
    """The tree without Mach number."""
    pytest.importorskip("sklearn")
    manifold, random = flight_map(), np.random.default_rng(4)
    training, calibration, flown = (
        training_flights(manifold, ALTITUDES_KM, count, random) for count in (1500, 600, 400)
    )
    if name == "regression tree":
        training = replace(training, known={DYNAMIC_PRESSURE: training.known[DYNAMIC_PRESSURE]})
    estimates = of_regression(name, training, calibration, seed=1)(flown)
    error = estimates.value - flown.truth[:, :5]
    assert np.all(error.std(axis=0) < 0.5 * flown.truth[:, :5].std(axis=0))
    assert np.mean(np.abs(error) <= 3.0 * estimates.std) > 0.98
    assert estimates.health is None
    for column, angle in enumerate(ANGLES, start=5):
        assert (estimates.others[angle][0] - flown.truth[:, column]).std() < np.radians(2.5)


def test_the_cost_of_a_step_of_each_is_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("sklearn")
    monkeypatch.setattr(regressions, "COST_TRAINING", 200)
    costs = list(step_costs(flight_map(hardware=True)).values())
    assert len(costs) == len(REGRESSIONS)
    assert all(0.0 < cost < 1.0 for cost in costs)
    assert len(set(costs)) == len(costs)
