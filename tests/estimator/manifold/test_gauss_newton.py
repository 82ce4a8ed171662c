"""Flight state by Gauss-Newton: accuracy, coverage, roll, masks, a linear table, navigation that is wrong."""

from dataclasses import fields, replace

import numpy as np
import pytest
from flight_maps import INCIDENCE, NOISE_STD, ROWS, STATIONS, exact_response, flight_map

from strainfmu.estimator.manifold.gauss_newton import (
    Samples,
    gauss_newton_step,
    linearise,
    strain_factor,
)
from strainfmu.estimator.manifold.navigation import (
    Navigation,
    inconsistent_navigation,
    predicted,
    state_measurement,
)
from strainfmu.estimator.manifold.solve import FlightSolution, solution, solve_cold, solve_warm
from strainfmu.estimator.manifold.starts import search_table
from strainfmu.estimator.numerics.triangular import MANY, forward_substituted
from strainfmu.estimator.tables.flight_tables import LOG_PRESSURE, MACH, U, W, evaluate
from strainfmu.estimator.tables.manifold_map import ManifoldMap

pytestmark = pytest.mark.fast
N_D = STATIONS * ROWS


def flights(k: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    angle, roll = INCIDENCE[-1] * np.sqrt(rng.uniform(0.0, 1.0, k)), rng.uniform(0.0, 2.0 * np.pi, k)
    return np.column_stack(
        [rng.uniform(5.1, 6.9, k), angle * np.cos(roll), angle * np.sin(roll), rng.uniform(7.5, 9.5, k)]
    )


def strains(state: np.ndarray, seed: int) -> np.ndarray:
    exact = np.array([exact_response(m, u, w, np.exp(p))[:N_D] for m, u, w, p in state])
    return exact + NOISE_STD * np.random.default_rng(seed).standard_normal(exact.shape)


def navigation(state: np.ndarray, seed: int | None, known: tuple[bool, bool, bool]) -> Navigation:
    pressure = np.exp(state[:, LOG_PRESSURE])
    true = np.column_stack([state[:, MACH], pressure, 0.7 * state[:, MACH] ** 2 * pressure])
    std = np.column_stack([np.full(len(state), 0.05), 0.02 * pressure, 0.01 * true[:, 2]])
    error = 0.0 if seed is None else np.random.default_rng(seed).standard_normal(true.shape)
    return Navigation(value=np.where(known, true + std * error, np.nan), std=std)


def samples(manifold: ManifoldMap, strain: np.ndarray, nav: Navigation, used: np.ndarray | None = None) -> Samples:
    mask = np.ones(strain.shape, dtype=bool) if used is None else used
    return Samples(strain=strain, used=mask, measured=state_measurement(manifold, nav))


def cold(manifold: ManifoldMap, given: Samples) -> FlightSolution:
    return solution(manifold, solve_cold(manifold, search_table(manifold), given), given.used)


@pytest.mark.parametrize("known", [(True, True, True), (False, False, True), (False, False, False)])
def test_three_sigma_cover_state_loads_and_coefficients(known: tuple[bool, bool, bool]) -> None:
    manifold, state = flight_map(discrepancy=2e-3), flights(300, 1)
    found = cold(manifold, samples(manifold, strains(state, 2), navigation(state, 3, known)))
    exact = np.array([exact_response(m, u, w, np.exp(p))[N_D:] for m, u, w, p in state])
    std = np.sqrt(np.diagonal(found.load_covariance, axis1=1, axis2=2))
    assert np.mean(np.abs(found.loads - exact) <= 3.0 * std) > 0.985
    of_state = np.sqrt(np.diagonal(found.state_covariance, axis1=1, axis2=2))
    assert np.mean(np.abs(found.state - state) <= 3.0 * of_state) > 0.985
    assert 0.8 < np.mean(found.chi_square) / (N_D + sum(known)) < 1.15


def test_a_warm_start_ends_where_the_search_ends() -> None:
    manifold, state = flight_map(discrepancy=1e-4, hardware=True), flights(40, 4)
    given = samples(manifold, strains(state, 5), navigation(state, 6, (True, True, True)))
    at = solve_cold(manifold, search_table(manifold), given)
    near = at.state + np.array([0.01, 1e-3, -1e-3, 0.005])
    warm = solve_warm(manifold, near, given)
    std = np.sqrt(np.diagonal(np.linalg.inv(at.hessian), axis1=1, axis2=2))
    assert np.max(np.abs(warm.state - at.state) / std) < 0.05


def drawn(manifold: ManifoldMap, state: np.ndarray, seed: int) -> np.ndarray:
    """Return strain of the tables with the errors that the map expects."""
    factor = strain_factor(manifold, state, np.ones((len(state), N_D), dtype=bool))
    noise = np.random.default_rng(seed).standard_normal((len(state), N_D))
    return evaluate(manifold.tables, state).value[:, :N_D] + np.einsum("kij,kj->ki", factor, noise)


@pytest.mark.parametrize(("discrepancy", "known"), [(2e-3, (False, False, True)), (0.1, (False, False, False))])
def test_the_iterations_end(discrepancy: float, known: tuple[bool, bool, bool]) -> None:
    """Whole Gauss-Newton steps end in cycles of two states, up to a deviation apart."""
    manifold, state = flight_map(discrepancy=discrepancy, hardware=True), flights(300, 1)
    given = samples(manifold, drawn(manifold, state, 2), navigation(state, 3, known))
    at = solve_cold(manifold, search_table(manifold), given)
    for _ in range(10):
        at = solve_warm(manifold, at.state, given)
    size = np.sqrt(np.einsum("kx,kx->k", at.gradient, gauss_newton_step(at)))  # in deviations
    assert np.max(size) < 0.05


@pytest.mark.parametrize("noise", [0.0, NOISE_STD])
def test_strain_without_incidence_fits_without_navigation(noise: float) -> None:
    """It looks like that of a small incidence at a far lower pressure."""
    manifold, state = flight_map(discrepancy=2e-3, hardware=True), flights(64, 5)
    small = manifold.response.copy()
    small[:, :, :N_D, 0] *= 0.3  # what hardly depends on the incidence
    manifold = replace(manifold, response=small)
    random = np.random.default_rng(6)
    state[:, U : W + 1] *= random.uniform(0.0, 1e-3, (len(state), 1))
    state[:, LOG_PRESSURE] = random.uniform(*np.log(manifold.pressure_range), len(state))
    strain = evaluate(manifold.tables, state).value[:, :N_D] + noise * random.standard_normal((len(state), N_D))
    found = cold(manifold, samples(manifold, strain, navigation(state, None, (False, False, False))))
    assert np.max(found.chi_square) < 2.0 * N_D


def test_samples_of_one_start_have_the_solution_of_each() -> None:
    manifold, state = flight_map(discrepancy=3e-2), np.repeat(flights(1, 4), 30, axis=0)
    given = samples(manifold, strains(state, 5), navigation(state, 6, (True, True, True)))
    together, each = (
        solution(manifold, solve_warm(manifold, start, given), given.used) for start in (state[:1], state)
    )
    for entry in fields(FlightSolution):
        one, other = getattr(together, entry.name), getattr(each, entry.name)
        np.testing.assert_allclose(
            one, other, rtol=1e-6, atol=1e-9 * np.max(np.abs(other), initial=0.0), err_msg=entry.name
        )


def test_a_rolled_wind_gives_the_rolled_answer() -> None:
    manifold, state = flight_map(discrepancy=1e-3, hardware=True), flights(20, 7)
    turn = 2.0 * np.pi * 5 / ROWS
    strain = strains(state, 8)
    rolled = np.roll(strain.reshape(-1, STATIONS, ROWS), 5, axis=2).reshape(strain.shape)
    nav = navigation(state, 9, (True, True, True))
    one, other = (cold(manifold, samples(manifold, d, nav)) for d in (strain, rolled))
    c, s = np.cos(turn), np.sin(turn)
    expected = one.loads.copy()
    for first, second in ((1, 2), (3, 4)):
        expected[:, first] = c * one.loads[:, first] - s * one.loads[:, second]
        expected[:, second] = s * one.loads[:, first] + c * one.loads[:, second]
    assert np.max(np.abs(other.loads - expected)) < 1e-10 * np.max(np.abs(expected)) * 1e3
    assert np.allclose(other.chi_square, one.chi_square, rtol=1e-8)


def test_a_lost_gauge_is_as_one_that_is_not_there() -> None:
    manifold, state = flight_map(discrepancy=1e-3, hardware=True), flights(10, 10)
    strain, nav = strains(state, 11), navigation(state, 12, (True, True, True))
    lost = np.array([3, 20, 21])
    used = np.ones(strain.shape, dtype=bool)
    used[:, lost] = False
    strain[:, lost] = 1.0  # whatever it reads
    found = cold(manifold, samples(manifold, strain, nav, used))
    kept = np.delete(np.arange(N_D), lost)
    both = np.append(kept, N_D + np.arange(5))
    without = replace(
        manifold,
        response=manifold.response[:, :, both],
        fixed_response=manifold.fixed_response[both],
        gauge_covariance=manifold.gauge_covariance[np.ix_(kept, kept)],
        error_strain=manifold.error_strain[kept],
        gauge_error_product=manifold.gauge_error_product[:, kept],
        common_error=manifold.common_error[:, :, kept],
    )
    reference = cold(without, samples(without, strain[:, kept], nav))
    assert np.allclose(found.loads, reference.loads, rtol=1e-9)
    assert np.allclose(found.load_covariance, reference.load_covariance, rtol=1e-8)
    assert np.allclose(found.standardised_residual[:, kept], reference.standardised_residual, atol=1e-7)
    assert np.all(found.standardised_residual[:, lost] == 0.0)


@pytest.mark.parametrize("known", [(True, True, True), (False, False, False)])
def test_residuals_are_those_of_a_prediction_by_all_other_gauges(known: tuple[bool, bool, bool]) -> None:
    manifold, state = flight_map(discrepancy=1e-3, hardware=True), flights(1, 19)
    strain, nav = strains(state, 20), navigation(state, 21, known)
    given = samples(manifold, strain, nav)
    at = solve_cold(manifold, search_table(manifold), given)
    found = solution(manifold, at, given.used)
    covariance = at.factor[0] @ at.factor[0].T
    for gauge in (0, 5, 20):
        used = np.ones((1, N_D), dtype=bool)
        used[:, gauge] = False
        others = used[0]
        without = linearise(
            manifold, at.state, strain_factor(manifold, at.state, used), samples(manifold, strain, nav, used)
        )
        step = np.linalg.solve(without.hessian[0], without.gradient[0])
        left = at.residual[0] - at.strain_jacobian[0] @ step
        weights = np.linalg.solve(covariance[np.ix_(others, others)], covariance[others, gauge])
        rows = at.strain_jacobian[0, gauge] - weights @ at.strain_jacobian[0, others]
        variance = covariance[gauge, gauge] - weights @ covariance[others, gauge]
        variance += rows @ np.linalg.inv(without.hessian[0]) @ rows
        expected = (left[gauge] - weights @ left[others]) / np.sqrt(variance)
        np.testing.assert_allclose(found.standardised_residual[0, gauge], expected, atol=1e-2)


def test_one_linearisation_is_the_bayes_estimate_of_the_linear_problem() -> None:
    manifold, state = flight_map(discrepancy=1e-3), flights(1, 13)
    given = samples(manifold, strains(state, 14), navigation(state, 15, (True, True, True)))
    at = linearise(manifold, state, strain_factor(manifold, state, given.used), given)
    response, (value, rows) = evaluate(manifold.tables, state), predicted(state)
    covariance = manifold.gauge_covariance + np.exp(2.0 * state[0, 3]) * manifold.scaled_covariance
    precision = np.linalg.inv(covariance)
    j, h, weight = response.jacobian[0, :N_D], rows[0], np.diag(given.measured.precision[0])
    hessian = j.T @ precision @ j + h.T @ weight @ h
    residual, innovation = given.strain[0] - response.value[0, :N_D], given.measured.value[0] - value[0]
    gradient = j.T @ precision @ residual + h.T @ weight @ innovation
    assert np.allclose(at.hessian[0], hessian, rtol=1e-9)
    assert np.allclose(
        np.linalg.solve(at.hessian[0], at.gradient[0]), np.linalg.solve(hessian, gradient), rtol=1e-6
    )


@pytest.mark.parametrize("which", [0, 1])
def test_inconsistent_navigation_is_found(which: int) -> None:
    manifold, state = flight_map(discrepancy=2e-4), flights(100, 16)
    nav = navigation(state, 17, (True, True, True))
    value = nav.value.copy()
    value[:, which] += 8.0 * nav.std[:, which]
    wrong = cold(manifold, samples(manifold, strains(state, 18), replace(nav, value=value)))
    assert np.mean(inconsistent_navigation(wrong.navigation_residual).any(axis=1)) > 0.95
    right = cold(manifold, samples(manifold, strains(state, 18), nav))
    assert np.mean(inconsistent_navigation(right.navigation_residual).any(axis=1)) < 0.05


@pytest.mark.parametrize("k", [1, MANY, 3 * MANY])
def test_forward_substitution_is_that_of_a_solver(k: int) -> None:
    random = np.random.default_rng(5)
    factor = np.tril(random.standard_normal((k, 9, 9))) + 9.0 * np.eye(9)
    right = random.standard_normal((k, 9, 4))
    np.testing.assert_allclose(forward_substituted(factor, right), np.linalg.solve(factor, right), rtol=1e-12)
