"""The strain that a map's model expects: its gain, and the whitening of what deviates from the mean.

Model: d = m + A q + e with cov(e) = Gamma = L L'. The estimate minimises |L^-1 (d - m - A q)|^2 + gamma |q|^2. In
Case 1 gamma is 0 and q is free; in Case 2 the prior of q is standard normal. With B = L^-1 A = U S V' (or U R in
Case 1) everything is a sum of positive terms, where (A A' / gamma + Gamma)^-1 formed by the book loses as many
digits as S^2 / gamma has.
"""

from __future__ import annotations

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError


def inverse_cholesky(covariance: FloatArray) -> FloatArray:
    """Return (n, n) L^-1, lower triangular, of ``covariance`` = L L'.

    Raises
    ------
    InputError
        The matrix is not symmetric positive definite.
    """
    try:
        variance = np.diag(covariance)
        if not (np.all(variance > 0.0) and np.allclose(covariance, covariance.T, rtol=1e-9, atol=0.0)):
            raise np.linalg.LinAlgError
        # Rows and columns scaled to unit variance, so that gauges of unlike noise cost no digits.
        std = np.sqrt(variance)
        factor = np.linalg.cholesky(covariance / np.outer(std, std))
    except np.linalg.LinAlgError as error:
        raise InputError("noise_covariance must be symmetric and positive definite") from error
    return np.tril(np.linalg.inv(factor)) / std


def estimate_gain(state_operator: FloatArray, noise_covariance: FloatArray, regularisation: float) -> FloatArray:
    """Return (n_q, n_d) T = (A' Gamma^-1 A + gamma I)^-1 A' Gamma^-1.

    Source: Pham et al., eq. segmented-ls-solution. By QR of the stacked [L^-1 A; sqrt(gamma) I], whose condition
    number is the root of that of the normal equations (Golub & Van Loan, Matrix Computations, section 6.1).

    Parameters
    ----------
    state_operator : (n_d, n_q) A, strain per state.
    noise_covariance : (n_d, n_d) Gamma [1].
    regularisation : gamma, 0 in Case 1.
    """
    n_states = state_operator.shape[1]
    whitening = inverse_cholesky(noise_covariance)
    stacked = np.vstack([whitening @ state_operator, np.sqrt(regularisation) * np.eye(n_states)])
    size = np.linalg.norm(stacked, axis=0)
    size[size == 0.0] = 1.0
    q, r = np.linalg.qr(stacked / size)
    try:
        return np.linalg.solve(r, q[: len(whitening)].T @ whitening) / size[:, None]
    except np.linalg.LinAlgError as error:
        raise InputError("state_operator does not identify the states: its columns are dependent") from error


def innovation_whitening(
    state_operator: FloatArray, noise_covariance: FloatArray, regularisation: float
) -> FloatArray:
    """Return (n_d, n_d) W with W' W = P, the precision of d - m; chi-square is |W (d - m)|^2.

    Case 2 (gamma > 0): P = (A A' / gamma + Gamma)^-1 and W = diag(1 / sqrt(1 + S^2 / gamma)) U' L^-1. Case 1
    (gamma = 0): P = Gamma^-1 - Gamma^-1 A (A' Gamma^-1 A)^-1 A' Gamma^-1 and W = U_perp U_perp' L^-1, blind to A.
    The statistics of health take gamma = 1 in Case 2 whatever the estimate is made with: that is the covariance
    of d by the model.

    Source: Bar-Shalom, Li & Kirubarajan, Estimation with Applications to Tracking and Navigation, section 5.4.
    """
    whitening = inverse_cholesky(noise_covariance)
    whitened = whitening @ state_operator
    if regularisation > 0.0:
        u, s, _ = np.linalg.svd(whitened, full_matrices=whitened.shape[1] < len(whitened))
        weight = np.ones(len(u))
        weight[: len(s)] = 1.0 / np.sqrt(1.0 + s**2 / regularisation)
        return np.asarray(weight[:, None] * (u.T @ whitening))
    q, _ = np.linalg.qr(whitened / np.linalg.norm(whitened, axis=0))
    # Projected twice: the first leaves the round-off of the large kept part.
    residual = whitening - q @ (q.T @ whitening)
    return np.asarray(residual - q @ (q.T @ residual))
