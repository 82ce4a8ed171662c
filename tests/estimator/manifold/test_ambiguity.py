"""Flight states that fit as well as the estimated one: coverage without a pressure, what is left alone, steps."""

import json
from dataclasses import replace

import numpy as np
import pytest
from flight_maps import ROWS, STATIONS, flight_map
from scaled_maps import scaled_map

from strainfmu.estimator.filter.switched import SwitchedFilter, TimedTrack, as_numbers, from_numbers
from strainfmu.estimator.manifold import solve
from strainfmu.estimator.manifold.ambiguity import N_WIDENING, Ends, widening
from strainfmu.estimator.manifold.error_covariance import strain_covariance
from strainfmu.estimator.manifold.estimator import ManifoldEstimator
from strainfmu.estimator.manifold.flight_estimate import FlightEstimates
from strainfmu.estimator.manifold.gauss_newton import Linearised, Samples, deviance
from strainfmu.estimator.manifold.navigation import Navigation, state_measurement
from strainfmu.estimator.manifold.solve import BETTER, solution, solve_from
from strainfmu.estimator.manifold.tracker import SEARCH_EVERY, FlightTracker
from strainfmu.estimator.tables.flight_tables import MACH, evaluate
from strainfmu.estimator.tables.manifold_map import ManifoldMap

pytestmark = pytest.mark.fast
N_D = STATIONS * ROWS
PRESSURE = 400.0
"""Low, where the errors of hardware leave the most open [Pa]."""


@pytest.fixture(scope="module")
def estimator() -> ManifoldEstimator:
    manifold = flight_map(discrepancy=2e-3, hardware=True)
    return ManifoldEstimator(replace(scaled_map(2, 1, N_D), manifold=manifold))


@pytest.fixture(scope="module")
def flights(estimator: ManifoldEstimator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """States (k, 4) all over the tables at one pressure, strain and loads with errors as the map expects them."""
    random, manifold, k = np.random.default_rng(3), estimator.manifold, 200
    incidence = manifold.incidence_limit * np.sqrt(random.random(k))
    mach, roll = random.uniform(*manifold.mach_range, k), random.uniform(0.0, 2.0 * np.pi, k)
    log_pressure = np.full(k, np.log(PRESSURE))
    state = np.column_stack([mach, incidence * np.cos(roll), incidence * np.sin(roll), log_pressure])
    response = evaluate(manifold.tables, state).value
    strain, loads = response[:, :N_D], response[:, N_D:]
    covariance = strain_covariance(manifold, np.full(k, PRESSURE), strain, loads)
    error = (np.linalg.cholesky(covariance) @ random.standard_normal((k, N_D, 1)))[:, :, 0]
    gain = PRESSURE**2 * manifold.load_strain_covariance
    left = PRESSURE**2 * manifold.load_covariance - gain @ np.linalg.solve(covariance, gain.T)
    value, vector = np.linalg.eigh(left)
    own = (vector * np.sqrt(np.maximum(value, 0.0))[:, None, :]) @ random.standard_normal((k, 5, 1))
    followed = np.einsum("ln,kn->kl", gain, np.linalg.solve(covariance, error[:, :, None])[:, :, 0])
    return state, strain + error, loads + followed + own[:, :, 0]


def estimates(estimator: ManifoldEstimator, strain: np.ndarray, **flow: np.ndarray) -> FlightEstimates:
    found = estimator.estimate(strain, **flow)
    assert isinstance(found, FlightEstimates)
    return found


def test_three_sigma_hold_the_coefficients_without_a_pressure(
    estimator: ManifoldEstimator,
    flights: tuple[np.ndarray, np.ndarray, np.ndarray],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The linearised problem alone leaves 4 % of a coefficient outside."""
    state, strain, loads = flights
    dynamic = 0.7 * state[:, MACH] ** 2 * PRESSURE
    true = loads / (dynamic[:, None] * estimator.manifold.references)

    def least_share() -> float:
        found = estimates(estimator, strain)
        held = np.abs(found.coefficients - true) <= 3.0 * found.coefficients_std
        return float(held.mean(axis=0).min())

    assert least_share() >= 0.995
    monkeypatch.setattr(solve, "widening", lambda *_: None)
    assert least_share() <= 0.98


@pytest.mark.parametrize("told", ["static_pressure", "dynamic_pressure"])
def test_a_pressure_of_navigation_leaves_the_estimate_alone(
    estimator: ManifoldEstimator,
    flights: tuple[np.ndarray, np.ndarray, np.ndarray],
    monkeypatch: pytest.MonkeyPatch,
    told: str,
) -> None:
    """To the last bit, beside samples without one, which become wider."""
    state, strain, _ = flights
    is_told = np.arange(40) % 2 == 0
    value = PRESSURE * (1.0 if told == "static_pressure" else 0.7 * state[:40, MACH] ** 2)
    flow = {told: np.where(is_told, value, np.nan)}
    found = estimates(estimator, strain[:40], **flow)
    monkeypatch.setattr(solve, "widening", lambda *_: None)
    without = estimates(estimator, strain[:40], **flow)
    for name in ("loads_std", "coefficients_std", "state_covariance"):
        assert np.array_equal(getattr(found, name)[is_told], getattr(without, name)[is_told])
    assert np.any(found.coefficients_std[~is_told] > 1.01 * without.coefficients_std[~is_told])


def test_a_linear_problem_keeps_its_deviations() -> None:
    """Where strain tells the state to a ten-thousandth, the covariance of the problem is right."""
    manifold = flight_map()
    manifold = replace(manifold, gauge_covariance=1e-8 * manifold.gauge_covariance)
    state = np.array([[6.0, 0.1, 0.03, np.log(2e4)], [5.4, -0.06, 0.08, np.log(5e4)]])
    samples = blind(manifold, evaluate(manifold.tables, state).value[:, :N_D])
    at = solve_from(manifold, state, samples)
    factor = widening(manifold, at, samples, Ends(state=at.state[None], deviance=deviance(at)[None]))
    assert factor is not None
    assert factor.shape == (2, N_WIDENING)
    assert np.all(factor >= 1.0)
    assert np.all(factor < 1.01)


def blind(manifold: ManifoldMap, strain: np.ndarray) -> Samples:
    navigation = Navigation(value=np.full((len(strain), 3), np.nan), std=np.ones((len(strain), 3)))
    used = np.ones(strain.shape, dtype=bool)
    return Samples(strain=strain, used=used, measured=state_measurement(manifold, navigation))


@pytest.mark.parametrize(("better_by", "is_taken"), [(BETTER - 0.5, False), (BETTER + 0.5, True)])
def test_of_two_states_that_fit_the_track_keeps_its_own(
    estimator: ManifoldEstimator,
    flights: tuple[np.ndarray, np.ndarray, np.ndarray],
    monkeypatch: pytest.MonkeyPatch,
    better_by: float,
    is_taken: bool,
) -> None:
    """A search every few steps would else jump between them; one that fits much worse is left."""
    manifold, (state, strain, _) = estimator.manifold, flights
    samples = blind(manifold, strain[:1])
    at = solve_from(manifold, state[:1], samples)
    ends = Ends(state=at.state[None] + [0.0, 0.01, 0.0, 0.2], deviance=deviance(at)[None] - better_by)
    monkeypatch.setattr(solve, "search_ends", lambda *_: ends)
    started: list[np.ndarray] = []

    def noted(manifold: ManifoldMap, state: np.ndarray, samples: Samples) -> Linearised:
        started.append(state)
        return solve_from(manifold, state, samples)

    monkeypatch.setattr(solve, "solve_from", noted)
    found = estimator.search_again(samples, at.state)
    assert len(started) == is_taken
    assert found.widening is not None


def test_the_track_holds_the_widening_between_searches(
    estimator: ManifoldEstimator, flights: tuple[np.ndarray, np.ndarray, np.ndarray]
) -> None:
    _, strain, _ = flights
    tracker, seen = FlightTracker(estimator), []
    for _ in range(SEARCH_EVERY + 2):
        tracker.step(strain[0])
        assert tracker.track.widening is not None
        seen.append(tracker.track.widening)
    assert all(one is seen[0] or np.array_equal(one, seen[0]) for one in seen[:-1])
    assert not np.array_equal(seen[-1], seen[0])
    without = FlightTracker(estimator, replace(tracker.track, widening=None))
    found = [one.step(strain[0], static_pressure=PRESSURE).loads_std for one in (tracker, without)]
    assert np.array_equal(*found)
    assert without.track.widening is None
    tracker.step(strain[0])
    held = tracker.track.widening
    assert held is not None
    assert np.array_equal(held, seen[-1])


def test_the_track_of_an_fmu_in_python_keeps_it(
    estimator: ManifoldEstimator, flights: tuple[np.ndarray, np.ndarray, np.ndarray]
) -> None:
    """As JSON between two searches; the filter, once on, leaves none."""
    names = ("dynamic_pressure", "mach_number", "static_pressure", "altitude")
    unknown = dict.fromkeys((*names, *(f"{name}_std" for name in names[:3])), np.nan)
    inputs = estimator.checked_inputs(flights[1][:1], None, unknown)
    switched, track = SwitchedFilter(estimator, 0.0), TimedTrack()
    for step in range(3):
        _, track = switched.step(inputs, track, 0.01 * step)
    read = from_numbers(json.loads(json.dumps(as_numbers(track))))
    one, other = (switched.step(inputs, last, 0.03)[0] for last in (track, read))
    assert np.array_equal(one.coefficients_std, other.coefficients_std)
    assert read.track.widening is not None
    assert read.track.widening.max() > 1.0
    _, after = SwitchedFilter(estimator, 0.5).step(inputs, read, 0.03)
    assert after.track.widening is None


def test_no_combination_becomes_more_certain(
    estimator: ManifoldEstimator, flights: tuple[np.ndarray, np.ndarray, np.ndarray]
) -> None:
    """Not q_inf, and no moment about another point, although correlated errors have factors of their own."""
    manifold, (_, strain, _) = estimator.manifold, flights
    samples = blind(manifold, strain)
    at = estimator.search(samples)
    assert at.widening is not None
    before = solution(manifold, replace(at, widening=None), samples.used)
    after = solution(manifold, at, samples.used)
    for name in ("state_covariance", "load_covariance", "coefficient_covariance"):
        narrow, wide = getattr(before, name), getattr(after, name)
        scale = 1.0 / np.sqrt(np.diagonal(wide, axis1=1, axis2=2))
        added = np.linalg.eigvalsh((wide - narrow) * scale[:, :, None] * scale[:, None, :])
        assert added.min() > -1e-12, name
        assert added.max() > 0.5, name
