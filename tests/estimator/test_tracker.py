"""The nonlinear estimator step by step: jumps, spikes, a solution elsewhere, iterations that have not ended."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from flight_maps import ROWS, STATIONS, flight_map
from scaled_maps import scaled_map

from strainfmu.estimator.core import Core
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.flight_tables import LOG_PRESSURE, MACH, U, W, evaluate
from strainfmu.estimator.policies import POLICIES

pytestmark = pytest.mark.fast
N_D = STATIONS * ROWS


@pytest.fixture
def estimator() -> Estimator:
    """An estimator that has seen no sample."""
    return Estimator(replace(scaled_map(2, 1, N_D), manifold=flight_map(discrepancy=2e-3, hardware=True)))


def flights(estimator: Estimator, k: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return states (k, 4) all over the tables, and their strain without noise."""
    random, manifold = np.random.default_rng(seed), estimator.inverse_map.manifold
    assert manifold is not None
    angle = manifold.incidence_limit * np.sqrt(random.random(k))
    roll = random.uniform(0.0, 2.0 * np.pi, k)
    state = np.empty((k, 4))
    state[:, MACH] = random.uniform(*manifold.mach_range, k)
    state[:, U], state[:, W] = angle * np.cos(roll), angle * np.sin(roll)
    state[:, LOG_PRESSURE] = random.uniform(*np.log(manifold.pressure_range), k)
    return state, evaluate(manifold.tables, state).value[:, :N_D]


def dynamic_pressure(state: np.ndarray) -> np.ndarray:
    return np.asarray(0.7 * state[..., MACH] ** 2 * np.exp(state[..., LOG_PRESSURE]))


def test_a_jump_fits_in_its_own_step(estimator: Estimator) -> None:
    state, strain = flights(estimator, 8, 1)
    repeat = POLICIES.search_every + 1
    found = estimator.track(np.repeat(strain, repeat, axis=0), np.repeat(dynamic_pressure(state), repeat))
    assert np.all(found.fits)
    assert not np.any(found.is_linear)


def test_navigation_that_is_dropped_with_an_alarm_is_doubted(estimator: Estimator) -> None:
    """It may be right, and the others wrong, which count for less: the priors show."""
    (state,), (strain,) = flights(estimator, 1, 5)
    flow = {
        "mach_number": state[MACH] + 0.6,
        "static_pressure": float(np.exp(state[LOG_PRESSURE])),
        "q_source": 1.0,
    }
    k = POLICIES.search_every + 1
    found = estimator.track(np.tile(strain, (k, 1)), float(dynamic_pressure(state)), **flow)
    assert np.all(found.health == HealthState.DEGRADED)
    assert found.fits[-1]
    std = np.sqrt(np.diagonal(found.state_covariance[-1]))
    assert np.all(np.abs(found.state[-1] - state) < 0.5 * std)


def test_a_spike_does_not_move_the_state(estimator: Estimator) -> None:
    state, strain = flights(estimator, 12, 3)
    for one, readings in zip(state, strain, strict=True):
        estimator.restart()
        rows = np.tile(readings, (2 + POLICIES.return_after, 1))
        rows[1, 7] += 5.0 * np.max(np.abs(readings))
        found = estimator.track(rows, float(dynamic_pressure(one)))
        assert found.fits.tolist() == [True, False, *[True] * POLICIES.return_after]
        assert not found.is_linear[-1]


def test_a_good_sample_returns_within_a_stated_number_of_steps(estimator: Estimator) -> None:
    """From wherever the last state is, and with a search only just behind it."""
    state, strain = flights(estimator, 15, 4)
    k = POLICIES.search_every + POLICIES.return_after
    for row in range(1, 15):
        estimator.restart()
        estimator.track(strain[row - 1], float(dynamic_pressure(state[row - 1])))
        found = estimator.track(np.tile(strain[row], (k, 1)), float(dynamic_pressure(state[row])))
        assert found.health[-1] == HealthState.OK
        assert not found.is_linear[-1]


def test_iterations_that_have_not_ended_degrade(estimator: Estimator) -> None:
    """From states far away, in the two iterations of a step: what is not found is not OK."""
    state, strain = flights(estimator, 200, 5)
    away = np.random.default_rng(6).standard_normal(state.shape) * [0.3, 0.02, 0.02, 0.3]
    q = dynamic_pressure(state)
    found, searched = estimator.estimate(strain, q, start=state + away), estimator.estimate(strain, q)
    std = np.sqrt(np.diagonal(searched.state_covariance, axis1=1, axis2=2))
    is_off = np.any(np.abs(found.state - searched.state) > std, axis=1)
    assert 20 < np.sum(is_off) < 180
    assert np.all(found.health[is_off] != HealthState.OK)
    assert np.mean(found.health[~is_off] == HealthState.OK) > 0.5


def test_one_sample_from_a_state_takes_the_way_of_one_sample(
    estimator: Estimator, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The record of a series, without a sensor too, from the arrays of one sample alone."""
    state, strain = flights(estimator, 3, 7)
    q = dynamic_pressure(state)
    valid = np.ones(strain.shape[1], dtype=bool)
    valid[2] = False
    known: list[dict[str, Any]] = [{}, {"valid": valid}]
    series = [estimator.estimate(strain, q, start=state, **given) for given in known]
    monkeypatch.delattr(Core, "series")
    for given, expected in zip(known, series, strict=True):
        for row in range(3):
            one = estimator.estimate(strain[row], float(q[row]), start=state[row], **given)
            assert one.loads.tolist() == expected.loads[row].tolist()
            assert one.state.tolist() == expected.state[row].tolist()
