"""Case 2: more pressure states than gauges, with a Gaussian prior of low rank (paper, section Case 2).

With p = p_mean + F q, q standard normal, and Gamma = L L^T everything follows from one singular value
decomposition, L^-1 Z_p F = U S V^T. Woodbury's form of the posterior covariance subtracts nearly equal matrices
and loses log10(lambda_1 / gamma) digits. Here every covariance is a sum of positive terms.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from builder.inverse.cases.state_map import StateMap
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.map.inverse_map_checks import check_covariance
from strainfmu.estimator.numerics.whitening import inverse_root
from strainfmu.estimator.reference.gain import nominal, state_model


@dataclass(frozen=True, eq=False, kw_only=True)
class WhitenedSpectrum:
    """L^-1 A = U S V^T, complete on both sides.

    Attributes
    ----------
    whitening : (n_d, n_d) L^-1 [1/(m/m)].
    left : (n_d, n_d) U.
    singular_values : (k,) S, k = min(n_d, n_q), falling.
    right : (n_q, n_q) V; no gauge observes its columns beyond k.
    """

    whitening: FloatArray
    left: FloatArray
    singular_values: FloatArray
    right: FloatArray

    @property
    def eigenvalues(self) -> FloatArray:
        """(k,) lambda = S^2 of the prior-preconditioned Hessian (paper, eq. eigproblem)."""
        return self.singular_values**2

    @property
    def state_eigenvalues(self) -> FloatArray:
        """(n_q,) lambda of every column of V, 0 beyond k."""
        return np.concatenate([self.eigenvalues, np.zeros(len(self.right) - len(self.singular_values))])

    def whitened_data(self, strain: FloatArray, mean_strain: FloatArray) -> FloatArray:
        """Return z = U^T L^-1 (d - m), (.., n_d) [1], of strains (.., n_d) [m/m]."""
        return (strain - mean_strain) @ self.whitening.T @ self.left


def whitened_spectrum(state_operator: FloatArray, noise_covariance: FloatArray) -> WhitenedSpectrum:
    """Decompose the whitened strain per state A = Z_p F (n_d, n_q).

    Raises
    ------
    InputError
        The covariance is not positive definite.
    """
    check_covariance(noise_covariance)
    whitening = inverse_root(noise_covariance)
    left, singular_values, right = np.linalg.svd(whitening @ state_operator)
    return WhitenedSpectrum(whitening=whitening, left=left, singular_values=singular_values, right=right.T)


@dataclass(frozen=True, eq=False, kw_only=True)
class GaussianMap(StateMap):
    """The state map of Case 2; states are standard normal under the prior.

    Attributes
    ----------
    spectrum : of the whitened state operator.
    """

    spectrum: WhitenedSpectrum

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
        return self.spectrum.right * weight

    def error_factor(self) -> FloatArray:
        """Return R (n_q, n_q) with R R^T = T Gamma T^T + (I - T A)(I - T A)^T.

        The covariance of the error of q for noise Gamma and q standard normal, for any gamma (Joseph's form). With
        gamma = 1 it is the inverse Hessian.
        """
        eigenvalues, gamma = self.spectrum.state_eigenvalues, self.regularisation
        return self.spectrum.right * (np.sqrt(eigenvalues + gamma**2) / (eigenvalues + gamma))


def gaussian_map(
    state_operator: FloatArray,
    mean_strain: FloatArray,
    noise_covariance: FloatArray,
    regularisation: float = 1.0,
    spectrum: WhitenedSpectrum | None = None,
) -> GaussianMap:
    """Build the map q = V diag(S / (lambda + gamma)) U^T L^-1 (d - m).

    Parameters
    ----------
    state_operator : (n_d, n_q) A = Z_p F [1].
    mean_strain : (n_d,) m = Z_p (p_mean - p_internal) [m/m].
    noise_covariance : (n_d, n_d) Gamma [(m/m)^2].
    regularisation : gamma [1]; 1 is the Bayesian value for calibrated prior and noise.
    spectrum : of ``state_operator`` and ``noise_covariance``, if it is known already.

    Raises
    ------
    InputError
        gamma is not positive and finite, or the covariance is not positive definite.
    """
    if not 0.0 < regularisation < np.inf:
        raise InputError(f"map.gamma: {regularisation} found, must be positive and finite")
    if spectrum is None:
        spectrum = whitened_spectrum(state_operator, noise_covariance)
    gain = nominal(state_model(state_operator, noise_covariance, regularisation)).gain[0]
    return GaussianMap(
        state_operator=state_operator,
        mean_strain=mean_strain,
        noise_covariance=noise_covariance,
        regularisation=regularisation,
        strain_gain=gain,
        state_offset=-gain @ mean_strain,
        unresolved=spectrum.right * (regularisation / (spectrum.state_eigenvalues + regularisation)),
        spectrum=spectrum,
    )
