"""The Gaussian map: against the formulas by the book, in its limits, and as the minimum of what it minimises."""

import numpy as np
import pytest
from inverse_case import Case, estimated_field, gaussian
from state_estimates import precision_of

from builder.campaign.snapshots import Snapshots
from builder.inverse.solution import prior_of_modes
from strainfmu.errors import InputError
from strainfmu.linear.pressure_modes import (
    LowRankPrior,
    prior_of_snapshots,
    proper_orthogonal_decomposition,
)
from strainfmu.linear.state_map import GaussianMap, gaussian_map

pytestmark = pytest.mark.fast

GAMMAS = (1e-6, 1e-2, 1.0, 10**0.5, 1e4)


def some_strain(case: Case, prior: LowRankPrior, seed: int = 3) -> np.ndarray:
    """Strain of a draw from the prior, with noise."""
    random = np.random.default_rng(seed)
    pressure = prior.mean + prior.factor @ random.normal(size=prior.n_states) - case.internal_pressure
    return case.strain_operator @ pressure + case.noise_std * random.normal(size=len(case.noise_std))


def small_case(n_states: int = 9) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A (6, n_states), m, and a full covariance, of singular values over three decades."""
    random = np.random.default_rng(5)
    u, _, vt = np.linalg.svd(random.normal(size=(6, n_states)), full_matrices=False)
    a = u * np.logspace(-5, -8, len(vt)) @ vt
    root = 1e-7 * (np.eye(6) + 0.2 * random.normal(size=(6, 6)))
    return a, 1e-5 * random.normal(size=6), root @ root.T


@pytest.mark.parametrize("gamma", GAMMAS)
def test_strain_of_the_mean_gives_the_mean_back(gamma: float, case: Case, prior: LowRankPrior) -> None:
    """T Z q_mean + k = q_mean for every gamma, in the field: to 1e-10 of the largest pressure."""
    strain = case.strain_operator @ (prior.mean - case.internal_pressure)
    field = estimated_field(prior, gaussian(case, prior, gamma), strain)
    np.testing.assert_allclose(field, prior.mean, rtol=0.0, atol=1e-10 * prior.mean.max())


@pytest.mark.parametrize("gamma", GAMMAS)
def test_gain_in_the_field_is_the_published_one(gamma: float, case: Case, prior: LowRankPrior) -> None:
    """F T against Gamma_pr Z' (gamma Gamma_n + Z Gamma_pr Z')^-1 (eq. p2o-ls-solution by Woodbury): 1e-6."""
    z, std = case.strain_operator, case.noise_std
    gamma_pr = prior.factor @ prior.factor.T  # formed here only, on a coarse mesh
    whitened = z / std[:, None]
    expected = gamma_pr @ whitened.T @ np.linalg.inv(gamma * np.eye(len(std)) + whitened @ gamma_pr @ whitened.T)
    found = prior.factor @ gaussian(case, prior, gamma).strain_gain * std
    # The inverse by the book keeps 16 - log10(lambda_1 / gamma) digits.
    largest = np.linalg.norm(whitened @ prior.factor, 2) ** 2
    np.testing.assert_allclose(
        found, expected, rtol=0.0, atol=max(1e-8, 1e-15 * largest / gamma) * np.abs(found).max()
    )


def test_whitened_eigenvectors_diagonalise_the_hessian(case: Case, prior: LowRankPrior) -> None:
    """Gamma_pr H_misfit b = lambda b in the field (eq. eigproblem), for the leading modes: 1e-8 of lambda_1."""
    spectrum = gaussian(case, prior).spectrum
    b = prior.factor @ spectrum.right_vectors[:, :20]
    whitened = case.strain_operator / case.noise_std[:, None]
    applied = prior.factor @ (prior.factor.T @ (whitened.T @ (whitened @ b)))
    size = np.linalg.norm(b, axis=0) * spectrum.eigenvalues[0]
    assert np.all(np.linalg.norm(applied - b * spectrum.eigenvalues[:20], axis=0) < 1e-10 * size)


@pytest.mark.parametrize("gamma", [1e-2, 1.0, 1e2])
def test_three_forms_of_the_posterior_covariance_agree(gamma: float) -> None:
    """Normal equations, Woodbury and the singular value decomposition: 1e-8 of the largest entry."""
    a, m, covariance = small_case()
    weight = np.linalg.inv(covariance)
    n = a.shape[1]
    normal = np.linalg.inv(a.T @ weight @ a + gamma * np.eye(n))
    woodbury = (np.eye(n) - a.T @ np.linalg.inv(gamma * covariance + a @ a.T) @ a) / gamma
    factor = gaussian_map(a, m, covariance, gamma).inverse_hessian_factor()
    size = np.abs(normal).max()
    np.testing.assert_allclose(factor @ factor.T, normal, rtol=0.0, atol=1e-8 * size)
    np.testing.assert_allclose(factor @ factor.T, woodbury, rtol=0.0, atol=1e-8 * size)


def test_posterior_covariance_stays_positive_at_small_gamma(case: Case, prior: LowRankPrior) -> None:
    """gamma = 1e-6: 1/(lambda + gamma) along every right vector to 1e-6, where Woodbury has no digit left."""
    solved = gaussian(case, prior, 1e-6)
    v, eigenvalues = solved.spectrum.right_vectors, solved.spectrum.state_eigenvalues
    along = np.sum((solved.inverse_hessian_factor().T @ v) ** 2, axis=0)
    np.testing.assert_allclose(along, 1.0 / (eigenvalues + 1e-6), rtol=1e-6)
    whitened = case.strain_operator @ prior.factor / case.noise_std[:, None]
    inner = np.linalg.inv(1e-6 * np.eye(len(whitened)) + whitened @ whitened.T)
    woodbury = (np.eye(prior.n_states) - whitened.T @ inner @ whitened) / 1e-6
    of_woodbury = v[:, 0] @ woodbury @ v[:, 0]
    assert abs(of_woodbury * eigenvalues[0] - 1.0) > 10.0


@pytest.mark.parametrize("gamma", GAMMAS)
def test_error_covariance_is_josephs(gamma: float) -> None:
    """T C T' + (I - T A)(I - T A)' by the book, and the factor of its second part: 1e-9 of the largest entry."""
    a, m, covariance = small_case()
    solved = gaussian_map(a, m, covariance, gamma)
    left = np.eye(a.shape[1]) - solved.strain_gain @ a
    expected = solved.strain_gain @ covariance @ solved.strain_gain.T + left @ left.T
    found = solved.error_factor() @ solved.error_factor().T
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-9 * np.abs(expected).max())
    np.testing.assert_allclose(solved.unresolved @ solved.unresolved.T, left @ left.T, atol=1e-9)


def test_with_gamma_one_the_error_is_the_posterior(case: Case, prior: LowRankPrior) -> None:
    solved = gaussian(case, prior, 1.0)
    np.testing.assert_allclose(solved.error_factor(), solved.inverse_hessian_factor(), rtol=1e-14, atol=0.0)


def test_large_gamma_is_the_mean(case: Case, prior: LowRankPrior) -> None:
    field = estimated_field(prior, gaussian(case, prior, 1e20), some_strain(case, prior))
    np.testing.assert_allclose(field, prior.mean, rtol=1e-9)


def test_small_gamma_is_the_pseudo_inverse() -> None:
    """gamma = 1e-14 of the smallest eigenvalue: the minimum-norm solution A^+ (d - m), to 1e-10."""
    a, m, covariance = small_case()
    smallest = gaussian_map(a, m, covariance).spectrum.eigenvalues[-1]
    solved = gaussian_map(a, m, covariance, 1e-14 * smallest)
    expected = np.linalg.pinv(a, rcond=1e-12)
    np.testing.assert_allclose(solved.strain_gain, expected, rtol=0.0, atol=1e-8 * np.abs(expected).max())


def test_small_gamma_with_few_states_is_case_1() -> None:
    """Four states and six gauges: gamma -> 0 is weighted least squares, to 1e-8."""
    a, m, covariance = small_case(4)
    weight = np.linalg.inv(covariance)
    expected = np.linalg.solve(a.T @ weight @ a, a.T @ weight)
    found = gaussian_map(a, m, covariance, 1e-12).strain_gain
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-8 * np.abs(expected).max())


class Objective:
    """1/2 |L^-1 (Z_p (p - p_internal) - d)|^2 + gamma/2 |q|^2 with p = mean + F q, written from the field."""

    def __init__(self, case: Case, prior: LowRankPrior, strain: np.ndarray, gamma: float) -> None:
        self.case, self.prior, self.strain, self.gamma = case, prior, strain, gamma

    def residual(self, q: np.ndarray) -> np.ndarray:
        pressure = self.prior.mean + self.prior.factor @ q - self.case.internal_pressure
        return (self.case.strain_operator @ pressure - self.strain) / self.case.noise_std

    def value(self, q: np.ndarray) -> float:
        return 0.5 * float(np.sum(self.residual(q) ** 2) + self.gamma * np.sum(q**2))

    def gradient(self, q: np.ndarray) -> np.ndarray:
        """By the adjoint: F' Z_p' L^-T of the residual."""
        back = self.case.strain_operator.T @ (self.residual(q) / self.case.noise_std)
        return self.prior.factor.T @ back + self.gamma * q

    def hessian(self, direction: np.ndarray) -> np.ndarray:
        return self.gradient(direction) - self.gradient(np.zeros_like(direction))


@pytest.mark.parametrize("gamma", [1e-2, 1.0, 1e2])
def test_taylor_remainders_of_the_objective(gamma: float, case: Case, prior: LowRankPrior) -> None:
    """First-order remainder falls with h^2 (slope 2.00 +- 0.02), second-order one is round-off, H is symmetric."""
    objective = Objective(case, prior, some_strain(case, prior), gamma)
    random = np.random.default_rng(6)
    q, step, other = random.normal(size=(3, prior.n_states))
    value, slope = objective.value(q), objective.gradient(q) @ step
    curvature = step @ objective.hessian(step)
    h = np.array([1.0, 0.1, 0.01])
    first = np.array([abs(objective.value(q + one * step) - value - one * slope) for one in h])
    np.testing.assert_allclose(np.diff(np.log(first)) / np.diff(np.log(h)), 2.0, atol=0.02)
    second = abs(objective.value(q + step) - value - slope - 0.5 * curvature)
    assert second < 1e-10 * (abs(value) + abs(curvature))
    assert other @ objective.hessian(step) == pytest.approx(step @ objective.hessian(other), rel=1e-10)


@pytest.mark.parametrize("gamma", [1e-2, 1.0, 1e2])
def test_estimate_is_the_minimum_of_the_objective(gamma: float, case: Case, prior: LowRankPrior) -> None:
    """Zero gradient to 1e-9 of its terms; every step away costs half its curvature."""
    strain = some_strain(case, prior)
    objective, solved = Objective(case, prior, strain, gamma), gaussian(case, prior, gamma)
    q = solved.strain_gain @ strain + solved.state_offset
    at_zero = np.linalg.norm(objective.gradient(np.zeros(prior.n_states)))
    assert np.linalg.norm(objective.gradient(q)) < 1e-9 * at_zero
    step = 0.1 * np.random.default_rng(9).normal(size=prior.n_states)
    rise = objective.value(q + step) - objective.value(q)
    assert rise == pytest.approx(0.5 * step @ objective.hessian(step), rel=1e-6)


def test_adjoint_of_the_strain_operator(case: Case, prior: LowRankPrior) -> None:
    """<Z F q, d> = <q, F' Z' d> to 1e-12 of the norms: A built forward and A' applied as adjoint."""
    random = np.random.default_rng(1)
    q, d = random.normal(size=prior.n_states), random.normal(size=len(case.noise_std))
    forward = gaussian(case, prior).state_operator @ q
    adjoint = prior.factor.T @ (case.strain_operator.T @ d)
    assert abs(forward @ d - q @ adjoint) < 1e-12 * np.linalg.norm(forward) * np.linalg.norm(d)


def test_whitening_leaves_the_estimate_alone() -> None:
    """d -> R d with R regular and Gamma -> R Gamma R': T -> T R^-1, equal eigenvalues and chi-square."""
    a, m, covariance = small_case()
    random = np.random.default_rng(8)
    change = np.eye(6) + 0.3 * random.normal(size=(6, 6))
    changed_covariance = change @ covariance @ change.T
    before = gaussian_map(a, m, covariance, 0.7)
    after = gaussian_map(change @ a, change @ m, 0.5 * (changed_covariance + changed_covariance.T), 0.7)
    size = np.abs(before.strain_gain).max()
    np.testing.assert_allclose(after.strain_gain @ change, before.strain_gain, rtol=0.0, atol=1e-9 * size)
    np.testing.assert_allclose(after.spectrum.eigenvalues, before.spectrum.eigenvalues, rtol=1e-9)
    strain = m + 1e-6 * random.normal(size=6)
    chi_square = [
        (d - one.mean_strain) @ precision_of(one) @ (d - one.mean_strain)
        for one, d in ((before, strain), (after, change @ strain))
    ]
    assert chi_square[1] == pytest.approx(chi_square[0], rel=1e-9)


def test_chi_square_of_the_prior_has_as_many_degrees_as_gauges(case: Case, prior: LowRankPrior) -> None:
    """4,000 draws: mean n_d within 3 errors, whatever gamma the estimate was made with."""
    random = np.random.default_rng(2)
    n = len(case.noise_std)
    for gamma in (1.0, 10**0.5):
        solved = gaussian(case, prior, gamma)
        deviation = random.normal(size=(4000, prior.n_states)) @ solved.state_operator.T
        deviation += random.normal(size=deviation.shape) * case.noise_std
        chi_square = np.sum((deviation @ precision_of(solved)) * deviation, axis=1)
        assert abs(chi_square.mean() - n) < 3.0 * np.sqrt(2.0 * n / 4000)


def test_recoverable_modes_are_those_above_gamma(case: Case, prior: LowRankPrior) -> None:
    eigenvalues = gaussian(case, prior).spectrum.eigenvalues
    for r in (1, 7, 20):
        solved: GaussianMap = gaussian(case, prior, float(np.sqrt(eigenvalues[r - 1] * eigenvalues[r])))
        assert solved.n_recoverable == r
        assert solved.filter_factors[r - 1] > 0.5 > solved.filter_factors[r]
    assert np.all(np.diff(eigenvalues) <= 0.0)


def test_prior_of_all_modes_is_that_of_the_snapshots(case: Case, prior_snapshots: Snapshots) -> None:
    """F F' from the snapshots and from their POD: 1e-9; states differ by a rotation, the estimate does not."""
    modes = proper_orthogonal_decomposition(prior_snapshots.pressure)
    plain, of_modes = prior_of_snapshots(prior_snapshots.pressure), prior_of_modes(modes, modes.modes.shape[1])
    covariance = plain.factor @ plain.factor.T
    expected = np.cov(prior_snapshots.pressure.T)
    np.testing.assert_allclose(covariance, expected, rtol=0.0, atol=1e-12 * expected.max())
    np.testing.assert_allclose(of_modes.factor @ of_modes.factor.T, covariance, atol=1e-9 * covariance.max())
    strain = some_strain(case, plain)
    fields = [estimated_field(one, gaussian(case, one), strain) for one in (plain, of_modes)]
    np.testing.assert_allclose(fields[0], fields[1], rtol=1e-6)


def test_wrong_numbers_are_refused(case: Case, prior_snapshots: Snapshots) -> None:
    a, m, covariance = small_case()
    for gamma in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(InputError, match=r"gamma: expected a positive number or one of"):
            gaussian_map(a, m, covariance, gamma)
    with pytest.raises(InputError, match="symmetric and positive definite"):
        gaussian_map(a, m, -covariance)
    with pytest.raises(InputError, match="1 snapshot found"):
        prior_of_snapshots(prior_snapshots.pressure[:1])
    with pytest.raises(InputError, match="all equal"):
        prior_of_snapshots(np.tile(prior_snapshots.pressure[:1], (4, 1)))
    with pytest.raises(InputError, match=r"map.prior_modes: 90 found, at most 89 with 90 snapshots"):
        prior_of_modes(case.modes, 90)
