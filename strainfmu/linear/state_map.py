"""The affine map from strain to pressure states, of either case: q = T d + k, with what it follows from.

A gauge reads d = m + A q + noise, noise ~ N(0, Gamma), Gamma = L L^T, m the strain of the mean pressure. The map
minimises |L^-1 (d - m - A q)|^2 + gamma |q|^2 (Pham et al., eq. objective).

Case 1, at most as many states as gauges: q are coefficients of POD modes, A = Z V_r, gamma = 0,

    T = (A^T Gamma^-1 A)^-1 A^T Gamma^-1,               cov q = (A^T Gamma^-1 A)^-1           (eq. sls-cov).

Modes beyond r strain the gauges too. They count as noise with the covariance they have over the snapshots: left
out of Gamma, they alias into q, and the stated sigma is far too small.

Case 2, more states than gauges: q ~ N(0, I) under a prior of factor F, A = Z F. With L^-1 A = U S V^T and
lambda = S^2 of the prior-preconditioned Hessian (eq. eigproblem)

    T = V diag(S / (lambda + gamma)) U^T L^-1           (eq. p2o-ls-solution).

Woodbury's form of the posterior covariance subtracts nearly equal matrices and loses log10(lambda_1 / gamma)
digits. Here every covariance is a sum of positive terms.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from strainfmu.arrays import FloatArray, inverse_root, is_covariance
from strainfmu.errors import InputError
from strainfmu.linear.regularisation import RULES
from strainfmu.records import brief

if TYPE_CHECKING:
    from scipy.sparse.linalg import LinearOperator

MAX_CONDITION_NUMBER = 1e10
"""Of the whitened, scaled A in Case 1: above it the gauges do not identify the states."""


def check_covariance(covariance: FloatArray) -> None:
    """Check that ``covariance`` (n_d, n_d) of gauges is one."""
    if not is_covariance(covariance):
        raise InputError("noise_covariance must be symmetric and positive definite")


@dataclass(frozen=True, eq=False, kw_only=True)
class StateMap:
    """q = T d + k minimises |L^-1 (d - m - A q)|^2 + gamma |q|^2 with L L^T = Gamma; n_d gauges, n_q states.

    Attributes
    ----------
    state_operator : (n_d, n_q) A, strain per state [1/Pa, or 1 where states are standard normal].
    mean_strain : (n_d,) m, strain of the mean pressure [m/m].
    noise_covariance : (n_d, n_d) Gamma, covariance of the strain that the states do not explain [(m/m)^2].
    regularisation : gamma [1], 0 in Case 1.
    strain_gain : (n_q, n_d) T = (A^T Gamma^-1 A + gamma I)^-1 A^T Gamma^-1.
    state_offset : (n_q,) k = -T m.
    unresolved : (n_q, j) factor E of the part of q that the gain does not resolve: E E^T = (I - T A)(I - T A)^T.
    """

    state_operator: FloatArray
    mean_strain: FloatArray
    noise_covariance: FloatArray
    regularisation: float
    strain_gain: FloatArray
    state_offset: FloatArray
    unresolved: FloatArray

    __repr__ = brief


@dataclass(frozen=True, eq=False, kw_only=True)
class LeastSquaresMap(StateMap):
    """The state map of Case 1; states are POD coefficients [Pa], gamma = 0.

    Attributes
    ----------
    covariance_factor : (r, r) R [Pa], R R^T = (A^T Gamma^-1 A)^-1.
    condition_number : kappa of the whitened A with its columns scaled by the states' spread.
    """

    covariance_factor: FloatArray
    condition_number: float

    __repr__ = brief

    @property
    def state_covariance(self) -> FloatArray:
        """(r, r) (A^T Gamma^-1 A)^-1 (paper, eq. sls-cov) [Pa^2]."""
        return self.covariance_factor @ self.covariance_factor.T


def least_squares_map(
    state_operator: FloatArray,
    mean_strain: FloatArray,
    noise_covariance: FloatArray,
    state_std: FloatArray,
    whitening: FloatArray | LinearOperator | None = None,
) -> LeastSquaresMap:
    """Build the map (paper, eq. ls-solution with gamma = 0) of A = Z_p V_r and m = Z_p (p_mean - p_internal).

    The condition number alone depends on ``state_std`` (r,), the standard deviation of the states [Pa].
    ``whitening`` W (n_d, n_d) with W^T W = Gamma^-1, a matrix or its products alone, is computed if it is not
    known already.
    """
    n_gauges, n_states = state_operator.shape
    if n_states > n_gauges:
        raise InputError(f"modes: expected at most {n_gauges} with {n_gauges} gauges, got {n_states}")
    if whitening is None:
        check_covariance(noise_covariance)
        whitening = inverse_root(noise_covariance)
    # Columns are scaled by the states' spread: the condition number then depends on gauges, not on units.
    condition_number = float(np.linalg.cond(whitening @ (state_operator * state_std)))
    if not condition_number < MAX_CONDITION_NUMBER:
        raise InputError(
            f"modes: the {n_gauges} gauges do not identify {n_states} modes (condition number "
            f"{condition_number:.1e}); keep fewer modes or place gauges elsewhere"
        )
    # Normal equations by QR of the whitened A, whose condition number they would square.
    q, upper = np.linalg.qr(whitening @ state_operator)
    gain = np.linalg.solve(upper, (whitening.T @ q).T)
    return LeastSquaresMap(
        state_operator=state_operator,
        mean_strain=mean_strain,
        noise_covariance=noise_covariance,
        regularisation=0.0,
        strain_gain=gain,
        state_offset=-gain @ mean_strain,
        unresolved=np.zeros((n_states, 0)),
        covariance_factor=np.linalg.inv(upper),
        condition_number=condition_number,
    )


@dataclass(frozen=True, kw_only=True)
class RelativeCondition:
    """K = kappa(A) / (nu cos theta) (paper, eq. of the relative condition number) and its inputs.

    K equals |d| / (sigma_min(A) |q|). It changes with the units of d and q, so they are stated with it.

    Attributes
    ----------
    value : K [1].
    strain_norm : |d| [m/m].
    state_norm : |q| [1], in multiples of ``state_scale``.
    state_scale : unit of the states [Pa].
    smallest_singular_value : sigma_min of A times ``state_scale`` [m/m].
    kappa : sigma_max / sigma_min of A.
    """

    value: float
    strain_norm: float
    state_norm: float
    state_scale: float
    smallest_singular_value: float
    kappa: float

    @property
    def scaling(self) -> str:
        """The scaling in words, printed with K."""
        return (
            f"|d| = {1e6 * self.strain_norm:.6g} um/m, |q| = {self.state_norm:g} in units of "
            f"{self.state_scale:.6g} Pa, sigma_min(A) = {1e6 * self.smallest_singular_value:.6g} um/m"
        )


def relative_condition(
    state_operator: FloatArray, strain_norm: float, state_norm: float, state_scale: float
) -> RelativeCondition:
    """Return K of ``state_operator`` A (n_d, r) [1/Pa].

    The published numbers follow with |d| = 100e-6 sqrt(n_d), |q| = 1 and states in units of the root mean square
    of |q| over the snapshots.
    """
    for name, value in (("strain norm", strain_norm), ("state norm", state_norm), ("state scale", state_scale)):
        if not 0.0 < value < np.inf:
            raise InputError(f"relative condition: {name}: expected a positive number, got {value}")
    singular_values = state_scale * np.linalg.svd(state_operator, compute_uv=False)
    largest, smallest = float(singular_values[0]), float(singular_values[-1])
    if not smallest > 1e-14 * largest or len(state_operator) < state_operator.shape[1]:
        raise InputError("relative condition: the gauges do not observe every state, K is infinite")
    return RelativeCondition(
        value=strain_norm / (smallest * state_norm),
        strain_norm=strain_norm,
        state_norm=state_norm,
        state_scale=state_scale,
        smallest_singular_value=smallest,
        kappa=largest / smallest,
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class WhitenedSpectrum:
    """L^-1 A = U S V^T, complete on both sides.

    Attributes
    ----------
    whitening : (n_d, n_d) L^-1 [1/(m/m)].
    left_vectors : (n_d, n_d) U.
    singular_values : (k,) S, k = min(n_d, n_q), falling.
    right_vectors : (n_q, n_q) V; no gauge observes its columns beyond k.
    """

    whitening: FloatArray
    left_vectors: FloatArray
    singular_values: FloatArray
    right_vectors: FloatArray

    @property
    def eigenvalues(self) -> FloatArray:
        """(k,) lambda = S^2 of the prior-preconditioned Hessian (paper, eq. eigproblem)."""
        return self.singular_values**2

    @property
    def state_eigenvalues(self) -> FloatArray:
        """(n_q,) lambda of every column of V, 0 beyond k."""
        return np.concatenate([self.eigenvalues, np.zeros(len(self.right_vectors) - len(self.singular_values))])

    def whitened_data(self, strain: FloatArray, mean_strain: FloatArray) -> FloatArray:
        """Return z = U^T L^-1 (d - m), (.., n_d) [1], of strains (.., n_d) [m/m]."""
        return (strain - mean_strain) @ self.whitening.T @ self.left_vectors


def whitened_spectrum(state_operator: FloatArray, noise_covariance: FloatArray) -> WhitenedSpectrum:
    """Decompose the whitened strain per state A = Z_p F (n_d, n_q)."""
    check_covariance(noise_covariance)
    whitening = inverse_root(noise_covariance)
    left_vectors, singular_values, right = np.linalg.svd(whitening @ state_operator)
    return WhitenedSpectrum(
        whitening=whitening, left_vectors=left_vectors, singular_values=singular_values, right_vectors=right.T
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class GaussianMap(StateMap):
    """The state map of Case 2; states are standard normal under the prior.

    Attributes
    ----------
    spectrum : of the whitened state operator.
    """

    spectrum: WhitenedSpectrum

    __repr__ = brief

    @property
    def filter_factors(self) -> FloatArray:
        """(k,) lambda / (lambda + gamma): the fraction of each mode that the data determine, not the prior."""
        return self.spectrum.eigenvalues / (self.spectrum.eigenvalues + self.regularisation)

    @property
    def n_recoverable(self) -> int:
        """Number of modes with lambda >= gamma, where the data outweigh the regularisation."""
        return int(np.sum(self.spectrum.eigenvalues >= self.regularisation))

    def inverse_hessian_factor(self) -> FloatArray:
        """Return R (n_q, n_q) with R R^T = (A^T Gamma^-1 A + gamma I)^-1, the paper's posterior covariance of q.

        It is the covariance of the error only where gamma = 1.
        """
        weight = 1.0 / np.sqrt(self.spectrum.state_eigenvalues + self.regularisation)
        return self.spectrum.right_vectors * weight

    def error_factor(self) -> FloatArray:
        """Return R (n_q, n_q) with R R^T = T Gamma T^T + (I - T A)(I - T A)^T.

        The covariance of the error of q for noise Gamma and q standard normal, for any gamma (Joseph's form). With
        gamma = 1 it is the inverse Hessian.
        """
        eigenvalues, gamma = self.spectrum.state_eigenvalues, self.regularisation
        return self.spectrum.right_vectors * (np.sqrt(eigenvalues + gamma**2) / (eigenvalues + gamma))


def gaussian_map(
    state_operator: FloatArray,
    mean_strain: FloatArray,
    noise_covariance: FloatArray,
    regularisation: float = 1.0,
    spectrum: WhitenedSpectrum | None = None,
) -> GaussianMap:
    """Build the map q = V diag(S / (lambda + gamma)) U^T L^-1 (d - m) of A = Z_p F.

    A ``regularisation`` of 1 is the Bayesian value for calibrated prior and noise; the ``spectrum`` is computed if
    it is not known already.
    """
    if not 0.0 < regularisation < np.inf:
        raise InputError(f"gamma: expected a positive number or one of {', '.join(RULES)}, got {regularisation!r}")
    if spectrum is None:
        spectrum = whitened_spectrum(state_operator, noise_covariance)
    singular = spectrum.singular_values
    observed = spectrum.right_vectors[:, : len(singular)] * (singular / (singular**2 + regularisation))
    gain = observed @ (spectrum.left_vectors[:, : len(singular)].T @ spectrum.whitening)
    return GaussianMap(
        state_operator=state_operator,
        mean_strain=mean_strain,
        noise_covariance=noise_covariance,
        regularisation=regularisation,
        strain_gain=gain,
        state_offset=-gain @ mean_strain,
        unresolved=spectrum.right_vectors * (regularisation / (spectrum.state_eigenvalues + regularisation)),
        spectrum=spectrum,
    )
