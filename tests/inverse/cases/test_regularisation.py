"""The rules for gamma, on problems whose right answer is known."""

from dataclasses import replace

import numpy as np
import pytest
from inverse_case import Case, gaussian
from scipy.optimize import minimize_scalar
from scipy.stats import multivariate_normal

from strainfmu.errors import InputError
from strainfmu.linear.pressure_modes import LowRankPrior
from strainfmu.linear.regularisation import (
    RULES,
    DataSpectrum,
    Rule,
    expected_data,
    l_curve,
    log_evidence,
    measured_data,
    select_gamma,
)
from strainfmu.linear.state_map import GaussianMap, gaussian_map, whitened_spectrum

pytestmark = pytest.mark.fast


def drawn_strain(solved: GaussianMap, gamma: float, n: int, seed: int = 1) -> np.ndarray:
    """(n, n_d) strain of states drawn from N(0, I/gamma), with noise."""
    random = np.random.default_rng(seed)
    n_gauges, n_states = solved.state_operator.shape
    states = random.normal(size=(n, n_states)) / np.sqrt(gamma)
    noise = random.normal(size=(n, n_gauges)) @ np.linalg.cholesky(solved.noise_covariance).T
    return solved.mean_strain + states @ solved.state_operator.T + noise


def test_residual_and_solution_are_those_of_the_estimate(case: Case, prior: LowRankPrior) -> None:
    """The spectral sums against |L^-1 (d - m - A q)|^2 and |q|^2 of real estimates: 1e-8."""
    for gamma in (1e-3, 1.0, 50.0):
        solved = gaussian(case, prior, gamma)
        strain = drawn_strain(solved, 1.0, 5)
        data = measured_data(
            solved.spectrum.eigenvalues, solved.spectrum.whitened_data(strain, solved.mean_strain)
        )
        states = strain @ solved.strain_gain.T + solved.state_offset
        misfit = (strain - solved.mean_strain - states @ solved.state_operator.T) / case.noise_std
        assert data.residual(gamma) == pytest.approx(np.mean(np.sum(misfit**2, axis=1)), rel=1e-7)
        assert data.solution(gamma) == pytest.approx(np.mean(np.sum(states**2, axis=1)), rel=1e-7)
        trace = np.trace(solved.state_operator @ solved.strain_gain)
        assert data.degrees_of_freedom(gamma) == pytest.approx(trace, rel=1e-8)


@pytest.mark.parametrize("rule", ["corrected_discrepancy", "gcv", "evidence"])
def test_calibrated_data_ask_for_gamma_one(rule: Rule, case: Case, prior: LowRankPrior) -> None:
    """By expectation each of the three rules has its answer at 1; exactly so, to 1e-4."""
    spectrum = gaussian(case, prior).spectrum
    data = expected_data(spectrum.eigenvalues, len(spectrum.left_vectors))
    assert select_gamma(rule, data) == pytest.approx(1.0, rel=1e-4)


@pytest.mark.parametrize("truth", [0.1, 1.0, 10.0])
@pytest.mark.parametrize(("rule", "factor"), [("corrected_discrepancy", 1.6), ("gcv", 2.0), ("evidence", 1.3)])
def test_gamma_of_the_states_is_found_from_strain(
    rule: Rule, factor: float, truth: float, case: Case, prior: LowRankPrior
) -> None:
    """400 flights with states from N(0, I/gamma): found within a factor; evidence is the sharpest."""
    solved = gaussian(case, prior)
    data = measured_data(
        solved.spectrum.eigenvalues,
        solved.spectrum.whitened_data(drawn_strain(solved, truth, 400), solved.mean_strain),
    )
    assert truth / factor < select_gamma(rule, data) < truth * factor


def test_morozov_leaves_the_noise_and_smooths_more(case: Case, prior: LowRankPrior) -> None:
    """Its residual is sigma sqrt(n_d) in the mean, so gamma is above Bayes' 1; the published value is 10^0.5."""
    solved = gaussian(case, prior)
    data = measured_data(
        solved.spectrum.eigenvalues,
        solved.spectrum.whitened_data(drawn_strain(solved, 1.0, 400), solved.mean_strain),
    )
    gamma = select_gamma("morozov", data)
    assert data.residual(gamma) == pytest.approx(54.0, rel=1e-9)
    assert 1.5 < gamma < 30.0


def test_evidence_is_the_marginal_likelihood(case: Case, prior: LowRankPrior) -> None:
    """Differences over gamma against scipy's normal density with covariance Gamma + A A'/gamma: 1e-6."""
    solved = gaussian(case, prior)
    strain = drawn_strain(solved, 1.0, 3)
    data = measured_data(solved.spectrum.eigenvalues, solved.spectrum.whitened_data(strain, solved.mean_strain))
    whitened = (strain - solved.mean_strain) / case.noise_std
    a = solved.state_operator / case.noise_std[:, None]
    direct = [
        np.mean(multivariate_normal(np.zeros(54), np.eye(54) + a @ a.T / gamma).logpdf(whitened))
        for gamma in (0.3, 4.0)
    ]
    found = [log_evidence(data, gamma) for gamma in (0.3, 4.0)]
    assert found[1] - found[0] == pytest.approx(direct[1] - direct[0], rel=1e-6)


def test_gcv_is_leave_one_out_where_all_gauges_are_alike() -> None:
    """On a circulant problem every leverage is equal, so GCV is the leave-one-out error (Golub et al. 1979)."""
    n = 16
    shape = 3e-7 * np.exp(-0.5 * np.minimum(np.arange(n), n - np.arange(n)) ** 2)
    a = np.array([np.roll(shape, i) for i in range(n)])
    m, covariance = np.zeros(n), 1e-14 * np.eye(n)
    strain = drawn_strain(gaussian_map(a, m, covariance), 1.0, 1)[0]

    def left_out(t: float) -> float:
        errors = []
        for i in range(n):
            keep = np.arange(n) != i
            part = gaussian_map(a[keep], m[keep], covariance[np.ix_(keep, keep)], float(np.exp(t)))
            errors.append(strain[i] - a[i] @ (part.strain_gain @ strain[keep]))
        return float(np.sum(np.square(errors)))

    best = np.exp(minimize_scalar(left_out, bounds=(-8.0, 5.0), method="bounded", options={"xatol": 1e-8}).x)
    spectrum = whitened_spectrum(a, covariance)
    data = measured_data(spectrum.eigenvalues, spectrum.whitened_data(strain, m))
    assert select_gamma("gcv", data) == pytest.approx(best, rel=1e-4)


def test_rules_without_an_answer_say_so() -> None:
    data = DataSpectrum(
        eigenvalues=np.array([100.0, 1.0]), mean_square=np.array([0.1, 0.1]), outside=0.1, n_gauges=3
    )
    with pytest.raises(InputError, match=r"no gamma fulfils 'morozov', the misfit stays below the noise"):
        select_gamma("morozov", data)
    with pytest.raises(InputError, match=r"no gamma fulfils 'morozov', the misfit stays above the noise"):
        select_gamma("morozov", replace(data, outside=50.0))
    with pytest.raises(InputError, match=r"'evidence' finds its optimum at the largest gamma"):
        select_gamma("evidence", data)
    with pytest.raises(InputError, match=rf"'best' found, must be a positive number or one of {', '.join(RULES)}"):
        select_gamma("best", data)  # type: ignore[arg-type]  # no such rule


def test_l_curve_is_monotonous_with_a_corner() -> None:
    """Residual rises, solution falls; the corner of a problem with a clear gap lies inside the gap."""
    eigenvalues = np.array([1e6, 1e5, 1e4, 1e-4, 1e-5, 1e-6])
    data = DataSpectrum(eigenvalues=eigenvalues, mean_square=eigenvalues + 1.0, outside=0.0, n_gauges=6)
    curve = l_curve(data, np.logspace(-8, 8, 161))
    assert np.all(np.diff(curve.residual_norm) > 0.0)
    assert np.all(np.diff(curve.solution_norm) < 0.0)
    assert 1e-4 < curve.corner < 1e4
    assert curve.curvature.shape == (161,)
