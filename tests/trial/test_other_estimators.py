"""Estimators that are no part of a map: flights that learning ones learn from, bands of split conformal
prediction, and the Kalman filter with a random walk."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from flight_maps import flight_map
from shape_case import shape_map
from state_estimates import state_gain, state_offset

from builder.trial import other_estimators
from builder.trial.other_estimators import (
    LEVEL,
    REGRESSIONS,
    after_reading,
    before_readings,
    conformal_half_width,
    of_random_walk,
    of_regression,
    step_costs,
    training_flights,
    with_drawn_errors,
)
from builder.trial.readings import ANGLES, Readings
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE
from strainfmu.estimator.map.flight_tables import evaluate
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.other_loads import FIVE_LOADS
from strainfmu.estimator.reference.nonlinear import strain_covariance

ALTITUDES_KM = (15.0, 25.0)


@pytest.mark.fast
def test_bands_hold_the_stated_share() -> None:
    random = np.random.default_rng(1)
    half = conformal_half_width(random.standard_normal((20_000, 2)))
    np.testing.assert_allclose(half, 3.0, atol=0.15)
    assert np.mean(np.abs(random.standard_normal((50_000, 2))) <= half) == pytest.approx(LEVEL, abs=1e-3)
    # Too few residuals give no band.
    assert [bool(np.isfinite(conformal_half_width(np.ones((n, 1)))).all()) for n in (300, 400)] == [False, True]


def test_drawn_errors_have_the_covariance_of_the_estimator() -> None:
    manifold, state = flight_map(discrepancy=0.05, hardware=True), np.array([[6.0, 0.08, 0.03, np.log(5e3)]])
    strain, loads = np.split(evaluate(manifold.tables, state).value, [manifold.tables.n_gauges], axis=1)
    pressure, *many = (np.repeat(one, 20_000, axis=0) for one in (np.array([5e3]), strain, loads))
    read, drawn = with_drawn_errors(manifold, pressure, *many, random=np.random.default_rng(3))
    expected = strain_covariance(manifold, manifold.gauge_covariance, state)[0]
    size = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    assert np.abs((np.cov(read.T) - expected) / size).max() < 0.06
    of_loads = 5e3**2 * np.diag(manifold.load_covariance)
    np.testing.assert_allclose(np.diag(np.cov(drawn.T)), of_loads, rtol=0.1, atol=1e-9)


def test_training_flights_of_a_shape_are_inside_the_ranges_of_both_angles() -> None:
    manifold = shape_map().manifold
    assert manifold is not None
    flights = training_flights(manifold, ALTITUDES_KM, 400, np.random.default_rng(1))
    angles = np.degrees(flights.truth[:, 5:])
    assert np.all(np.abs(angles) <= [4.01, 2.01])
    assert np.all(np.ptp(angles, axis=0) > [7.5, 3.7])


@pytest.fixture
def few_trees(monkeypatch: pytest.MonkeyPatch) -> None:
    """Gradient boosting of a tenth of the trees: its training takes longer than all else."""
    pytest.importorskip("sklearn")
    module, kind, arguments = REGRESSIONS["gradient boosting"]
    monkeypatch.setitem(REGRESSIONS, "gradient boosting", (module, kind, {**arguments, "max_iter": 20}))
    monkeypatch.setattr(other_estimators, "COST_TRAINING", 200)


@pytest.mark.usefixtures("few_trees")
@pytest.mark.parametrize("name", REGRESSIONS)
def test_a_regression_learns_loads_and_angles(name: str) -> None:
    """The tree without Mach number."""
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


@pytest.mark.usefixtures("few_trees")
def test_the_cost_of_a_step_of_each_is_its_own() -> None:
    costs = list(step_costs(flight_map(hardware=True)).values())
    assert len(set(costs)) == len(costs) == len(REGRESSIONS)
    assert all(0.0 < cost < 1.0 for cost in costs)


def readings_of(inverse_map: InverseMap, count: int) -> Readings:
    """Return ``count`` readings of each of three states of the map at its nominal q_inf."""
    random = np.random.default_rng(2)
    state = random.standard_normal((3, inverse_map.state_operator.shape[1]))
    strain = inverse_map.mean_strain + state @ inverse_map.state_operator.T
    q = np.full(3, inverse_map.nominal_dynamic_pressure)
    loads = (inverse_map.load_of_mean + state @ inverse_map.load_per_state.T)[:, FIVE_LOADS]
    noise = inverse_map.noise_std * random.standard_normal((count, *strain.shape))
    return Readings(
        strain=np.swapaxes(strain + noise, 0, 1),
        known={DYNAMIC_PRESSURE: q},
        truth=loads / (q[:, None] * inverse_map.references[FIVE_LOADS]),
        vehicle=np.arange(3),
        flight=np.arange(3),
    )


def test_one_reading_without_a_walk_is_case_2(noise_map: InverseMap, monkeypatch: pytest.MonkeyPatch) -> None:
    """More readings are better, and inside the band."""
    one, many = readings_of(noise_map, 1), readings_of(noise_map, 20)
    first, last = (of_random_walk(noise_map)(read) for read in (one, many))
    assert np.all(last.std < first.std)
    assert np.all(np.abs(last.value - many.truth) <= 4.0 * last.std)
    assert last.health is None
    monkeypatch.setattr(other_estimators, "STEP_STD", 0.0)
    mean, _ = after_reading(noise_map, before_readings(noise_map, 3), one.last, np.ones(3))
    expected = one.last @ state_gain(noise_map).T + state_offset(noise_map)
    np.testing.assert_allclose(mean, expected, atol=1e-6 * np.abs(expected).max())
