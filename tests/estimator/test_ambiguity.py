"""Flight states that fit as well as the estimated one: coverage without a pressure, what is left alone, steps."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest
from flight_maps import ROWS, STATIONS, flight_map
from scaled_maps import scaled_map

from strainfmu.estimator.air_inputs import AIR_INPUT_NAMES
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.flight_tables import MACH, evaluate
from strainfmu.estimator.map.nonlinear_map import ManifoldMap
from strainfmu.estimator.policies import POLICIES
from strainfmu.estimator.reference.air import air_inputs_of
from strainfmu.estimator.reference.nonlinear import NonlinearReference, Sample, strain_covariance

pytestmark = pytest.mark.fast
N_D = STATIONS * ROWS
PRESSURE = 400.0
"""Low, where the errors of hardware leave the most open [Pa]."""

Flights = tuple[np.ndarray, np.ndarray, np.ndarray]


def estimator_of(manifold: ManifoldMap) -> Estimator:
    return Estimator(replace(scaled_map(2, 1, N_D), manifold=manifold))


def tables_of(estimator: Estimator) -> ManifoldMap:
    assert estimator.inverse_map.manifold is not None
    return estimator.inverse_map.manifold


@pytest.fixture(scope="module")
def estimator() -> Estimator:
    return estimator_of(flight_map(discrepancy=2e-3, hardware=True))


@pytest.fixture(scope="module")
def flights(estimator: Estimator) -> Flights:
    """States (k, 4) all over the tables at one pressure, strain and loads with errors as the map expects them."""
    random, manifold, k = np.random.default_rng(3), tables_of(estimator), 200
    incidence = manifold.incidence_limit * np.sqrt(random.random(k))
    mach, roll = random.uniform(*manifold.mach_range, k), random.uniform(0.0, 2.0 * np.pi, k)
    log_pressure = np.full(k, np.log(PRESSURE))
    state = np.column_stack([mach, incidence * np.cos(roll), incidence * np.sin(roll), log_pressure])
    response = evaluate(manifold.tables, state).value
    strain, loads = response[:, :N_D], response[:, N_D:]
    covariance = strain_covariance(manifold, manifold.gauge_covariance, state)
    error = (np.linalg.cholesky(covariance) @ random.standard_normal((k, N_D, 1)))[:, :, 0]
    gain = PRESSURE**2 * (manifold.error_load @ manifold.error_strain.T)
    left = PRESSURE**2 * (manifold.error_load @ manifold.error_load.T) - gain @ np.linalg.solve(covariance, gain.T)
    value, vector = np.linalg.eigh(left)
    own = (vector * np.sqrt(np.maximum(value, 0.0))[:, None, :]) @ random.standard_normal((k, 5, 1))
    followed = np.einsum("ln,kn->kl", gain, np.linalg.solve(covariance, error[:, :, None])[:, :, 0])
    return state, strain + error, loads + followed + own[:, :, 0]


class Linearised(NamedTuple):
    """What the linearised problem says of a sample, by the reference; names as those of an estimate."""

    state: np.ndarray
    state_covariance: np.ndarray
    load_covariance: np.ndarray
    coefficients: np.ndarray
    coefficient_covariance: np.ndarray

    @property
    def loads_std(self) -> np.ndarray:
        return np.sqrt(np.diagonal(self.load_covariance))

    @property
    def coefficients_std(self) -> np.ndarray:
        return np.sqrt(np.diagonal(self.coefficient_covariance))


def linearised(estimator: Estimator, strain: np.ndarray, start: np.ndarray, **air: float) -> Linearised:
    """Return the linearised problem of ``strain`` (n_d,) where iterations from ``start`` (4,) end."""
    manifold = tables_of(estimator)
    reference = NonlinearReference(estimator.inverse_map, manifold, manifold.gauge_covariance)
    given = dict.fromkeys(AIR_INPUT_NAMES, np.nan) | air
    sample = Sample(rows=strain, used=np.ones(N_D, dtype=bool), air=air_inputs_of(estimator.inverse_map, given))
    found = reference.solved(sample, start)
    return Linearised(
        found.state,
        found.state_covariance,
        found.covariance[:5, :5],
        found.coefficients[:5],
        found.coefficient_covariance[:5, :5],
    )


@pytest.fixture(scope="module")
def narrow(estimator: Estimator, flights: Flights) -> list[Linearised]:
    """Of the linearised problem alone, about the flight states of the core."""
    states = estimator.estimate(flights[1]).state
    return [linearised(estimator, *one) for one in zip(flights[1], states, strict=True)]


def test_three_sigma_hold_the_coefficients_without_a_pressure(
    estimator: Estimator, flights: Flights, narrow: list[Linearised]
) -> None:
    """The linearised problem alone leaves 4 % of a coefficient outside."""
    state, strain, loads = flights
    dynamic = 0.7 * state[:, MACH] ** 2 * PRESSURE
    true = loads / (dynamic[:, None] * tables_of(estimator).references)
    found = estimator.estimate(strain)
    apart = np.abs(found.coefficients - true)
    assert np.min(np.mean(apart <= 3.0 * found.coefficients_std, axis=0)) >= 0.995
    std = np.array([one.coefficients_std for one in narrow])
    of_linearised = np.abs(np.array([one.coefficients for one in narrow]) - true)
    assert np.min(np.mean(of_linearised <= 3.0 * std, axis=0)) <= 0.98


@pytest.mark.parametrize("told", ["static_pressure", "dynamic_pressure"])
def test_a_pressure_of_navigation_leaves_the_estimate_alone(
    estimator: Estimator, flights: Flights, narrow: list[Linearised], told: str
) -> None:
    """To what the linearised problem has; beside samples without a pressure, which become wider."""
    state, strain, _ = flights
    k = 20
    value = PRESSURE * (np.ones(k) if told == "static_pressure" else 0.7 * state[:k, MACH] ** 2)
    both = {told: np.where(np.arange(2 * k) % 2 == 0, np.repeat(value, 2), np.nan)}
    found = estimator.estimate(np.repeat(strain[:k], 2, axis=0), **both)
    for i in range(k):
        alone = linearised(estimator, strain[i], found.state[2 * i], **{told: value[i]})
        static = estimator.estimate(strain[i : i + 1], start=alone.state[None], **{told: value[i]})[0]
        for name in ("loads_std", "coefficients_std"):
            np.testing.assert_allclose(getattr(static, name), getattr(alone, name), rtol=1e-6)
            np.testing.assert_array_equal(
                getattr(estimator.step(strain[i], **{told: value[i]}), name), getattr(found[2 * i], name)
            )
    std = np.array([one.coefficients_std for one in narrow[:k]])
    assert np.any(found.coefficients_std[1::2] > 1.01 * std)


def test_a_linear_problem_keeps_its_deviations() -> None:
    """Where strain determines the state to a ten-thousandth, the covariance of the problem is right."""
    manifold = flight_map()
    estimator = estimator_of(replace(manifold, gauge_covariance=1e-8 * manifold.gauge_covariance))
    state = np.array([[6.0, 0.1, 0.03, np.log(2e4)], [5.4, -0.06, 0.08, np.log(5e4)]])
    strain = evaluate(manifold.tables, state).value[:, :N_D]
    found = estimator.estimate(strain, start=state)
    for k in range(2):
        jacobian = evaluate(manifold.tables, state).jacobian[k, :N_D]
        weighted = jacobian / np.sqrt(np.diagonal(tables_of(estimator).gauge_covariance))[:, None]
        std = np.sqrt(np.diagonal(np.linalg.inv(weighted.T @ weighted)))
        ratio = np.sqrt(np.diagonal(found.state_covariance[k])) / std
        assert np.all(ratio > 0.999)
        assert np.all(ratio < 1.01)


def widest(estimator: Estimator, flights: Flights, narrow: list[Linearised]) -> tuple[np.ndarray, np.ndarray]:
    """Return the strain whose deviations are widened most, and these without it."""
    std = np.array([one.coefficients_std for one in narrow])
    row = np.argmax(np.max(estimator.estimate(flights[1]).coefficients_std / std, axis=1))
    return flights[1][row], std[row]


def test_the_track_holds_the_widening_between_searches(
    estimator: Estimator, flights: Flights, narrow: list[Linearised]
) -> None:
    """A pressure that is known for some steps has none, and the next step has it again."""
    (strain, narrowest), flight = widest(estimator, flights, narrow), estimator.filter(0.0)
    found = flight.track(np.tile(strain, (POLICIES.search_every + 2, 1)))
    assert np.max(found.coefficients_std[2] / narrowest) > 1.5
    np.testing.assert_allclose(
        found.coefficients_std[4 : POLICIES.search_every], found.coefficients_std[3:-3], rtol=1e-3
    )
    known = flight.track(np.tile(strain, (4, 1)), static_pressure=PRESSURE)[-1]
    expected = linearised(estimator, strain, known.state, static_pressure=PRESSURE)
    np.testing.assert_allclose(known.loads_std, expected.loads_std, rtol=1e-3)
    after = flight.track(np.tile(strain, (3, 1)))[-1]
    np.testing.assert_allclose(after.coefficients_std, found.coefficients_std[-1], rtol=1e-2)


def test_the_memory_of_a_track_includes_the_widening(
    estimator: Estimator, flights: Flights, narrow: list[Linearised]
) -> None:
    """As bytes between two searches."""
    strain, narrowest = widest(estimator, flights, narrow)
    first, second = estimator.filter(0.0), estimator.filter(0.0)
    first.track(np.tile(strain, (3, 1)))
    second.memory = first.memory
    one, other = (flight.track(strain) for flight in (first, second))
    np.testing.assert_array_equal(one.coefficients_std, other.coefficients_std)
    assert np.max(one.coefficients_std / narrowest) > 1.5


def test_no_combination_becomes_more_certain(
    estimator: Estimator, flights: Flights, narrow: list[Linearised]
) -> None:
    """Not q_inf, and no moment about another point, although correlated errors have factors of their own."""
    found, start = estimator.estimate(flights[1]), np.array([one.state for one in narrow])
    std = np.sqrt(np.array([np.diagonal(one.state_covariance) for one in narrow]))
    same = np.flatnonzero(np.all(np.abs(found.state - start) < 5e-7 * std, axis=1))
    assert len(same) > 50
    for name in ("state_covariance", "load_covariance", "coefficient_covariance"):
        before, wide = np.array([getattr(narrow[k], name) for k in same]), getattr(found, name)[same]
        scale = 1.0 / np.sqrt(np.diagonal(wide, axis1=1, axis2=2))
        added = np.linalg.eigvalsh((wide - before) * scale[:, :, None] * scale[:, None, :])
        assert added.min() > -1e-5, name
        assert added.max() > 0.5, name
