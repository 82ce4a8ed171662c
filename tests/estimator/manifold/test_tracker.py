"""The nonlinear estimator step by step: jumps, spikes, a solution elsewhere, iterations that have not ended."""

from dataclasses import replace

import numpy as np
import pytest
from flight_maps import ROWS, STATIONS, flight_map
from scaled_maps import scaled_map

from strainfmu.estimator.health import HealthState
from strainfmu.estimator.manifold import solve
from strainfmu.estimator.manifold.estimator import ManifoldEstimator
from strainfmu.estimator.manifold.flight_health import LARGEST_REST, flight_health
from strainfmu.estimator.manifold.gauss_newton import Linearised, Samples
from strainfmu.estimator.manifold.navigation import Navigation, state_measurement
from strainfmu.estimator.manifold.solve import solution, solve_cold
from strainfmu.estimator.manifold.starts import search_table
from strainfmu.estimator.manifold.tracker import RETURN_AFTER, SEARCH_EVERY, FlightTracker, Track
from strainfmu.estimator.tables.flight_tables import LOG_PRESSURE, MACH, U, W, evaluate
from strainfmu.estimator.tables.manifold_map import ManifoldMap

pytestmark = pytest.mark.fast
N_D = STATIONS * ROWS


@pytest.fixture(scope="module")
def estimator() -> ManifoldEstimator:
    manifold = flight_map(discrepancy=2e-3, hardware=True)
    return ManifoldEstimator(replace(scaled_map(2, 1, N_D), manifold=manifold))


def flights(estimator: ManifoldEstimator, k: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return states (k, 4) all over the tables, and their strain without noise."""
    random, manifold = np.random.default_rng(seed), estimator.manifold
    angle = manifold.incidence_limit * np.sqrt(random.random(k))
    roll = random.uniform(0.0, 2.0 * np.pi, k)
    state = np.empty((k, 4))
    state[:, MACH] = random.uniform(*manifold.mach_range, k)
    state[:, U], state[:, W] = angle * np.cos(roll), angle * np.sin(roll)
    state[:, LOG_PRESSURE] = random.uniform(*np.log(manifold.pressure_range), k)
    return state, evaluate(manifold.tables, state).value[:, :N_D]


def dynamic_pressure(state: np.ndarray) -> float:
    return float(0.7 * state[MACH] ** 2 * np.exp(state[LOG_PRESSURE]))


def test_a_jump_fits_in_its_own_step(estimator: ManifoldEstimator) -> None:
    state, strain = flights(estimator, 8, 1)
    tracker = FlightTracker(estimator)
    for one, readings in zip(state, strain, strict=True):
        for _ in range(SEARCH_EVERY + 1):
            found = tracker.step(readings, dynamic_pressure(one))
            assert found.fits
            assert not found.is_linear


@pytest.fixture
def searches(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Number of samples of each search so far."""
    seen: list[int] = []
    search, again = ManifoldEstimator.search, ManifoldEstimator.search_again

    def noted(self: ManifoldEstimator, samples: Samples, rows: np.ndarray | None = None) -> Linearised:
        seen.append(len(samples.strain))
        return search(self, samples, rows)

    def noted_again(self: ManifoldEstimator, samples: Samples, state: np.ndarray) -> Linearised:
        seen.append(len(samples.strain))
        return again(self, samples, state)

    monkeypatch.setattr(ManifoldEstimator, "search", noted)
    monkeypatch.setattr(ManifoldEstimator, "search_again", noted_again)
    return seen


@pytest.mark.parametrize(("is_told", "expected"), [(True, [0, 11, 23]), (False, [0, 11, 22, 33])])
def test_a_search_comes_only_every_so_many_steps(
    estimator: ManifoldEstimator, searches: list[int], is_told: bool, expected: list[int]
) -> None:
    """The mean cost of a step is bounded whatever the strain does; without a pressure they come by themselves."""
    (state,), (strain,) = flights(estimator, 1, 2)
    q = dynamic_pressure(state) if is_told else np.nan
    tracker, at = FlightTracker(estimator), []
    for step in range(35):
        off = np.max(np.abs(strain)) * np.cos(np.arange(N_D)) if step >= 5 and step % 2 else 0.0
        before = len(searches)
        tracker.step(strain + off, q)
        at += [step] if len(searches) > before else []
    assert at == expected


def test_navigation_that_is_dropped_with_an_alarm_asks_for_a_search(
    estimator: ManifoldEstimator, searches: list[int]
) -> None:
    """It may be right, and the state another one that strain fits as well."""
    (state,), (strain,) = flights(estimator, 1, 5)
    tracker, flow = FlightTracker(estimator, Track(state=state)), {"mach_number": state[MACH] + 0.6}
    flow["static_pressure"] = float(np.exp(state[LOG_PRESSURE]))
    for _ in range(SEARCH_EVERY + 1):
        found = tracker.step(strain, dynamic_pressure(state), **flow)
        assert found.health is HealthState.DEGRADED
    assert len(searches) == 2  # with it and without
    assert found.fits
    # The others may be the wrong ones, and count for less: the priors show.
    assert np.all(np.abs(found.state - state) < 0.5 * np.sqrt(np.diagonal(found.state_covariance)))


def test_a_spike_does_not_move_the_state(estimator: ManifoldEstimator) -> None:
    state, strain = flights(estimator, 12, 3)
    for one, readings in zip(state, strain, strict=True):
        tracker = FlightTracker(estimator, Track(state=one, since_search=SEARCH_EVERY))
        spike = 5.0 * np.max(np.abs(readings)) * (np.arange(N_D) == 7)
        assert not tracker.step(readings + spike, dynamic_pressure(one)).fits
        late = [tracker.step(readings, dynamic_pressure(one)) for _ in range(RETURN_AFTER)]
        assert all(found.fits for found in late)
        assert not late[-1].is_linear


def test_a_good_sample_returns_within_a_stated_number_of_steps(estimator: ManifoldEstimator) -> None:
    """From wherever the last state is, and with a search only just behind it."""
    state, strain = flights(estimator, 15, 4)
    for before, after, readings in zip(state, state[1:], strain[1:], strict=False):
        tracker = FlightTracker(estimator, Track(state=before))
        for _ in range(SEARCH_EVERY + RETURN_AFTER):
            found = tracker.step(readings, dynamic_pressure(after))
        assert found.health is HealthState.OK
        assert not found.is_linear


def test_iterations_that_have_not_ended_degrade(estimator: ManifoldEstimator) -> None:
    manifold = estimator.manifold
    _, strain = flights(estimator, 3, 5)
    navigation = Navigation(value=np.full((3, 3), np.nan), std=np.ones((3, 3)))
    used = np.ones(strain.shape, dtype=bool)
    samples = Samples(strain=strain, used=used, measured=state_measurement(manifold, navigation))
    found = solution(manifold, solve_cold(manifold, search_table(manifold), samples), used)
    moved = replace(found, rest=np.array([0.0, 0.9, 1.1]) * LARGEST_REST)
    judged = flight_health(
        manifold,
        moved,
        used=used,
        navigation=navigation,
        navigation_used=np.zeros((3, 3), dtype=bool),
        alarm_scale=1.0,
    )
    assert judged.health.tolist() == [HealthState.OK, HealthState.OK, HealthState.DEGRADED]
    assert np.max(found.rest) < 0.1


@pytest.fixture
def iterations(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Number of iterations of the flight state so far, one entry for each call."""
    seen: list[int] = []
    one_step = solve.stepped

    def noted(manifold: ManifoldMap, at: Linearised, before: Linearised | None = None) -> np.ndarray:
        seen.append(len(at.state))
        return one_step(manifold, at, before)

    monkeypatch.setattr(solve, "stepped", noted)
    return seen


def test_a_step_takes_so_many_iterations(estimator: ManifoldEstimator, iterations: list[int]) -> None:
    """The numbers of docs/reference/step_time.md."""
    (state,), (strain,) = flights(estimator, 1, 2)
    q, mach, none = dynamic_pressure(state), float(state[MACH]), np.nan
    misfit = strain + np.max(np.abs(strain)) * np.cos(np.arange(N_D))

    def counts(tracker: FlightTracker, readings: np.ndarray, n: int, q: float, mach: float) -> list[int]:
        found = []
        for _ in range(n):
            iterations.clear()
            tracker.step(readings, q, mach_number=mach)
            found.append(sum(iterations))
        return found

    tracker = FlightTracker(estimator)
    assert counts(tracker, strain, 12, q, mach) == [32] + 11 * [2]
    settled = tracker.track
    assert counts(tracker, misfit, 12, q, mach) == [34] + 10 * [2] + [34]
    assert counts(FlightTracker(estimator), strain, 12, none, none) == [32] + 10 * [2] + [26]
    assert counts(FlightTracker(estimator, settled), misfit, 1, none, 1.5 * mach) == [124]
