"""Flight state of the nonlinear estimator: accuracy, coverage, roll, masks, iterations, wrong navigation."""

from dataclasses import replace

import numpy as np
import pytest
from flight_maps import INCIDENCE, NOISE_STD, ROWS, STATIONS, exact_response, flight_map
from scaled_maps import scaled_map

from strainfmu.estimator.air_inputs import NAVIGATION
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.flight_tables import LOG_PRESSURE, MACH, U, W, evaluate
from strainfmu.estimator.map.nonlinear_map import ManifoldMap
from strainfmu.estimator.reference.nonlinear import strain_covariance

pytestmark = pytest.mark.fast
N_D = STATIONS * ROWS
Known = tuple[bool, bool, bool]


def estimator_of(manifold: ManifoldMap) -> Estimator:
    return Estimator(replace(scaled_map(2, 1, manifold.n_gauges), manifold=manifold))


def flights(k: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    angle, roll = INCIDENCE[-1] * np.sqrt(rng.uniform(0.0, 1.0, k)), rng.uniform(0.0, 2.0 * np.pi, k)
    return np.column_stack(
        [rng.uniform(5.1, 6.9, k), angle * np.cos(roll), angle * np.sin(roll), rng.uniform(7.5, 9.5, k)]
    )


def strains(state: np.ndarray, seed: int) -> np.ndarray:
    exact = np.array([exact_response(m, u, w, np.exp(p))[:N_D] for m, u, w, p in state])
    return exact + NOISE_STD * np.random.default_rng(seed).standard_normal(exact.shape)


def navigation(
    state: np.ndarray, seed: int, known: Known, off: tuple[float, ...] = (0.0, 0.0, 0.0)
) -> dict[str, np.ndarray]:
    """Return air data by name, with errors as stated; ``off`` are further ones [standard deviations]."""
    pressure = np.exp(state[:, LOG_PRESSURE])
    true = np.column_stack([state[:, MACH], pressure, 0.7 * state[:, MACH] ** 2 * pressure])
    std = np.column_stack([np.full(len(state), 0.05), 0.02 * pressure, 0.01 * true[:, 2]])
    value = true + std * (np.random.default_rng(seed).standard_normal(true.shape) + off)
    found = {"q_source": np.ones(len(state))}
    for name, one, its_std, is_known in zip(NAVIGATION, value.T, std.T, known, strict=True):
        if is_known:
            found |= {name: one, f"{name}_std": its_std}
    return found


@pytest.mark.parametrize("known", [(True, True, True), (False, False, True), (False, False, False)])
def test_three_sigma_cover_state_loads_and_coefficients(known: Known) -> None:
    estimator, state = estimator_of(flight_map(discrepancy=2e-3)), flights(300, 1)
    found = estimator.estimate(strains(state, 2), **navigation(state, 3, known))
    exact = np.array([exact_response(m, u, w, np.exp(p))[N_D:] for m, u, w, p in state])
    assert np.mean(np.abs(found.loads - exact) <= 3.0 * found.loads_std) > 0.985
    of_state = np.sqrt(np.diagonal(found.state_covariance, axis1=1, axis2=2))
    assert np.mean(np.abs(found.state - state) <= 3.0 * of_state) > 0.985
    assert 0.8 < np.mean(found.chi_square) / (N_D + sum(known)) < 1.15


def test_a_warm_start_ends_where_the_search_ends() -> None:
    estimator, state = estimator_of(flight_map(discrepancy=1e-4, hardware=True)), flights(40, 4)
    strain, flow = strains(state, 5), navigation(state, 6, (True, True, True))
    at = estimator.estimate(strain, **flow)
    warm = estimator.estimate(strain, start=at.state + np.array([0.01, 1e-3, -1e-3, 0.005]), **flow)
    std = np.sqrt(np.diagonal(at.state_covariance, axis1=1, axis2=2))
    assert np.max(np.abs(warm.state - at.state) / std) < 0.05


def drawn(manifold: ManifoldMap, state: np.ndarray, seed: int) -> np.ndarray:
    """Return strain of the tables with the errors that the map expects."""
    factor = np.linalg.cholesky(strain_covariance(manifold, manifold.gauge_covariance, state))
    noise = np.random.default_rng(seed).standard_normal((len(state), N_D))
    return np.asarray(evaluate(manifold.tables, state).value[:, :N_D] + np.einsum("kij,kj->ki", factor, noise))


@pytest.mark.parametrize(("discrepancy", "known"), [(2e-3, (False, False, True)), (0.1, (False, False, False))])
def test_the_iterations_end(discrepancy: float, known: Known) -> None:
    """Whole Gauss-Newton steps end in cycles of two states, up to a deviation apart."""
    manifold, state = flight_map(discrepancy=discrepancy, hardware=True), flights(300, 1)
    estimator = estimator_of(manifold)
    strain, flow = drawn(manifold, state, 2), navigation(state, 3, known)
    found = estimator.estimate(strain, **flow)
    for _ in range(10):
        last = found.state
        found = estimator.estimate(strain, start=last, **flow)
    std = np.sqrt(np.diagonal(found.state_covariance, axis1=1, axis2=2))
    assert np.max(np.abs(found.state - last) / std) < 0.05


@pytest.mark.parametrize("noise", [0.0, NOISE_STD])
def test_strain_without_incidence_fits_without_navigation(noise: float) -> None:
    """It looks like strain of a small incidence at a far lower pressure."""
    manifold, state = flight_map(discrepancy=2e-3, hardware=True), flights(64, 5)
    small = manifold.response.copy()
    small[:, :, :N_D, 0] *= 0.3  # what hardly depends on the incidence
    manifold = replace(manifold, response=small)
    random = np.random.default_rng(6)
    state[:, U : W + 1] *= random.uniform(0.0, 1e-3, (len(state), 1))
    state[:, LOG_PRESSURE] = random.uniform(*np.log(manifold.pressure_range), len(state))
    strain = evaluate(manifold.tables, state).value[:, :N_D] + noise * random.standard_normal((len(state), N_D))
    assert np.max(estimator_of(manifold).estimate(strain).chi_square) < 2.0 * N_D


def test_a_rolled_wind_gives_the_rolled_answer() -> None:
    estimator, state = estimator_of(flight_map(discrepancy=1e-3, hardware=True)), flights(20, 7)
    turn = 2.0 * np.pi * 5 / ROWS
    strain = strains(state, 8)
    rolled = np.roll(strain.reshape(-1, STATIONS, ROWS), 5, axis=2).reshape(strain.shape)
    flow = navigation(state, 9, (True, True, True))
    one, other = (estimator.estimate(d, **flow) for d in (strain, rolled))
    c, s = np.cos(turn), np.sin(turn)
    expected = one.loads.copy()
    for first, second in ((1, 2), (3, 4)):
        expected[:, first] = c * one.loads[:, first] - s * one.loads[:, second]
        expected[:, second] = s * one.loads[:, first] + c * one.loads[:, second]
    assert np.max(np.abs(other.loads - expected)) < 1e-10 * np.max(np.abs(expected)) * 1e3
    assert np.allclose(other.chi_square, one.chi_square, rtol=1e-8)


def test_a_lost_gauge_is_as_one_that_is_not_there() -> None:
    manifold, state = flight_map(discrepancy=1e-3, hardware=True), flights(10, 10)
    strain, flow = strains(state, 11), navigation(state, 12, (True, True, True))
    lost = np.array([3, 20, 21])
    used = np.ones(strain.shape, dtype=bool)
    used[:, lost] = False
    strain[:, lost] = 1.0  # whatever it reads
    found = estimator_of(manifold).estimate(strain, valid=used, **flow)
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
        discrepancy_shapes=manifold.discrepancy_shapes[kept],
    )
    reference = estimator_of(without).estimate(strain[:, kept], **flow)
    assert np.allclose(found.loads, reference.loads, rtol=1e-9)
    assert np.allclose(found.load_covariance, reference.load_covariance, rtol=1e-8)
    assert np.allclose(found.standardised_residual[:, kept], reference.standardised_residual, atol=1e-7)
    assert np.all(found.standardised_residual[:, lost] == 0.0)


@pytest.mark.parametrize("which", [0, 1])
def test_inconsistent_navigation_is_found(which: int) -> None:
    estimator, state = estimator_of(flight_map(discrepancy=2e-4)), flights(100, 16)
    off = tuple(8.0 * (np.arange(3) == which))
    strain = strains(state, 18)
    wrong, right = (
        estimator.estimate(strain, **navigation(state, 17, (True, True, True), one)).air_data_used
        for one in (off, (0.0, 0.0, 0.0))
    )
    assert np.mean(~wrong.all(axis=1)) > 0.95
    assert np.mean(~right.all(axis=1)) < 0.05
