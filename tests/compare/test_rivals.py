"""Learning estimators: flights that they learn from, bands of split conformal prediction, what they answer."""

from __future__ import annotations

import numpy as np
import pytest
from flight_maps import flight_map

from builder.compare import rival_costs
from builder.compare.candidate import GIVEN, PRESSURE_ALONE
from builder.compare.flights import Readings
from builder.compare.rivals import LEVEL, RIVALS, RivalCandidate, conformal_half_width
from builder.compare.training import TrainingFlights, training_flights, with_drawn_errors
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


def read_of(flights: TrainingFlights) -> Readings:
    return Readings(
        strain=flights.strain[None],
        dynamic_pressure=flights.dynamic_pressure,
        dynamic_pressure_std=0.0,
        mach_number=flights.mach_number,
        static_pressure=flights.dynamic_pressure,
    )


@pytest.mark.parametrize(
    "name", ["regression tree", "random forest", "gradient boosting", "multi-layer perceptron"]
)
def test_a_rival_learns_loads_and_angles(name: str) -> None:
    pytest.importorskip("sklearn")
    manifold, random = flight_map(), np.random.default_rng(4)
    training, calibration, flown = (
        training_flights(manifold=manifold, altitudes_km=ALTITUDES_KM, count=n, random=random)
        for n in (1500, 600, 400)
    )
    navigation = PRESSURE_ALONE if name == "regression tree" else GIVEN
    rival = RivalCandidate(name=name, training=training, calibration=calibration, navigation=navigation, seed=1)
    answer = rival.answer(read_of(flown), navigation)
    error = answer.coefficients - flown.target[:, :5]
    assert np.all(error.std(axis=0) < 0.5 * flown.target[:, :5].std(axis=0))
    assert np.mean(np.abs(error) <= 3.0 * answer.std) > 0.98
    assert answer.air_data is not None
    assert np.all((answer.air_data[:, :2] - flown.target[:, 5:]).std(axis=0) < np.radians(2.5))
    assert np.isnan(answer.air_data[:, 2:]).all()
    assert answer.field is None


def test_the_cost_of_a_step_of_each_is_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("sklearn")
    monkeypatch.setattr(rival_costs, "TRAINING", 200)
    costs = list(rival_costs.rival_costs(flight_map(hardware=True)).values())
    assert len(costs) == len(RIVALS)
    assert all(0.0 < cost < 1.0 for cost in costs)
    assert len(set(costs)) == len(costs)
