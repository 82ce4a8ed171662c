"""What a gauge is worth, against maps rebuilt without it, the normal distribution, and the estimator itself."""

import numpy as np
import pytest
from inverse_case import cross_covariance
from report_case import CASE_1, CASE_2, ReportCase, case_of, map_of_some, others, solved_on_same_modes, with_gauges
from scipy.stats import norm
from state_estimates import state_gain

from builder.campaign.snapshots import Snapshots
from builder.inverse.build import on_observable_states
from builder.reports.findings.coefficient_sources import coefficient_sources, load_covariance_by_terms
from builder.reports.findings.gauge_value import gauge_value
from builder.structure.fourier.fourier_model import StructuralModel
from builder.vehicle.file import Vehicle
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.reference.gain import load_covariance

pytestmark = pytest.mark.fast

Parts = tuple[Vehicle, Snapshots, StructuralModel]


def rebuilt_std(case: ReportCase, lost: list[int]) -> np.ndarray:
    """(5,) sigma of the loads of a map of the same modes that is built without the gauges ``lost``."""
    kept = others(case.inverse_map.n_gauges, lost)
    problem = with_gauges(case.problem, kept)
    solution = solved_on_same_modes(case, kept)
    per_state = problem.load_operator @ solution.field_modes
    covariance = load_covariance_by_terms(
        solution.solved, per_state, solution.noise, cross_covariance(solution.noise)
    )
    return np.sqrt(np.diag(covariance))


def test_growth_of_sigma_is_that_of_a_map_built_without_the_gauge(case: ReportCase) -> None:
    """Every single gauge; the same algebra in another order, so to round-off: 1e-7."""
    std = np.sqrt(np.diag(load_covariance(case.inverse_map)))
    found = gauge_value(case.inverse_map).growth
    for gauge in range(case.inverse_map.n_gauges):
        np.testing.assert_allclose(found[gauge], rebuilt_std(case, [gauge]) / std, rtol=1e-7)
    assert found.max() > 1.01


def test_growth_of_pairs(case: ReportCase) -> None:
    """40 random pairs and all their columns."""
    value = gauge_value(case.inverse_map)
    n = case.inverse_map.n_gauges
    assert len(value.pairs) == n * (n - 1) // 2
    std = np.sqrt(np.diag(load_covariance(case.inverse_map)))
    for i in np.random.default_rng(3).choice(len(value.pairs), 40, replace=False):
        expected = rebuilt_std(case, value.pairs[i].tolist()) / std
        np.testing.assert_allclose(value.pair_growth[i], expected, rtol=1e-7)


def test_what_is_not_identified_is_infinite(parts: Parts) -> None:
    """One gauge more than states: one may be lost, two may not; a prior forgives it."""
    vehicle, snapshots, structure = parts
    for entry, finite in ((CASE_1, False), (CASE_2, True)):
        case = case_of((vehicle, snapshots, structure), entry)
        kept = [0, 1, 9, 14, 22][: case.inverse_map.state_operator.shape[1] + 1]
        some = with_gauges(case.problem, kept)
        value = gauge_value(map_of_some(case, some, solved_on_same_modes(case, kept), kept))
        assert np.isfinite(value.growth).all()
        assert np.isfinite(value.pair_growth).all() == finite
        assert np.isinf(value.pair_growth).all() == (not finite)


def test_states_that_no_gauge_sees_change_nothing(parts: Parts) -> None:
    """Five gauges, 18 states, and the same map on its five observable states: growth to 1e-7, sources add up."""
    case, kept = case_of(parts, CASE_2), [0, 1, 9, 14, 22]
    five = with_gauges(case.problem, kept)
    solution = five.solution
    whole = map_of_some(case, five, solution, kept)
    observable = on_observable_states(whole)
    assert observable.state_operator.shape == (5, 5)
    np.testing.assert_allclose(gauge_value(observable).growth, gauge_value(whole).growth, rtol=1e-7)
    np.testing.assert_allclose(gauge_value(observable).pair_growth, gauge_value(whole).pair_growth, rtol=1e-7)
    sources = coefficient_sources(observable, five, solution)
    np.testing.assert_allclose(sources.variance.sum(axis=0), sources.std**2, rtol=1e-9)


def test_leverage_is_the_diagonal_of_the_hat_matrix(parts: Parts) -> None:
    """Independent noise, Case 1: diag(A T), whose sum is the number of states (Hoaglin & Welsch 1978)."""
    vehicle, snapshots, structure = parts
    noise = vehicle.noise.without_hardware_errors().model_copy(update={"truncated_modes": False})
    case = case_of((vehicle.model_copy(update={"noise": noise}), snapshots, structure), CASE_1)
    leverage = gauge_value(case.inverse_map).leverage
    hat = case.inverse_map.state_operator @ state_gain(case.inverse_map)
    np.testing.assert_allclose(leverage, np.diag(hat), rtol=1e-8, atol=1e-12)
    assert leverage.sum() == pytest.approx(case.solution.facts["modes"], rel=1e-8)


def test_bias_that_is_noticed(case_2: ReportCase) -> None:
    """Case 2: (z_(alpha / 2 n) + z_beta) leave-one-out deviations, by regression on the other gauges; 1e-6."""
    case = case_2
    one, n = case.inverse_map, case.inverse_map.n_gauges
    covariance = one.noise_covariance + one.state_operator @ one.state_operator.T
    found = gauge_value(one).detectable_bias
    shift = norm.isf(0.5e-4 / n) + norm.isf(0.01)
    for i in range(n):
        rest = others(n, [i])
        known = np.linalg.solve(covariance[np.ix_(rest, rest)], covariance[rest, i])
        std = np.sqrt(covariance[i, i] - covariance[i, rest] @ known)
        assert found[i] == pytest.approx(shift * std, rel=1e-6)


def test_effect_of_an_unnoticed_bias_is_the_estimators(case: ReportCase) -> None:
    """A bias of one gauge in the estimator's input moves its loads by as many sigmas as stated, to 1e-9."""
    one = case.inverse_map
    value, estimator = gauge_value(one), Estimator(one)
    std = np.sqrt(np.diag(load_covariance(one)))
    q = one.nominal_dynamic_pressure
    at_rest = np.array(estimator.estimate(one.mean_strain, q).loads)
    for gauge in (0, 11, 29):
        strain = one.mean_strain.copy()
        strain[gauge] += value.detectable_bias[gauge]
        moved = np.array(estimator.estimate(strain, q).loads) - at_rest
        np.testing.assert_allclose(np.abs(moved) / std, value.undetected_effect[gauge], rtol=1e-9, atol=1e-9)
