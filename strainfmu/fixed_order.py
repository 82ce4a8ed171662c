"""Matrix algebra that gives the same bits on every processor, and what of a map needs it.

BLAS and LAPACK choose kernels by processor, so their last bits differ between machines. Here every sum runs in the
order of its index, by element-wise operations that IEEE 754 defines to the bit.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from strainfmu.inverse_map import InverseMap

FloatArray = NDArray[np.float64]


def product(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return ``a`` (m, k) times ``b`` (k, n), summed in the order of k."""
    out = np.zeros((a.shape[0], b.shape[1]))
    for k in range(a.shape[1]):
        out += a[:, k, None] * b[None, k, :]
    return out


def cholesky(matrix: FloatArray) -> FloatArray:
    """Return (n, n) L, lower triangular, of the positive definite ``matrix`` = L L'."""
    rest, lower = matrix.copy(), np.zeros_like(matrix)
    for j in range(len(matrix)):
        column = rest[j:, j] / np.sqrt(rest[j, j])
        lower[j:, j] = column
        rest[j:, j:] -= column[:, None] * column[None, :]
    return lower


def solve_lower(lower: FloatArray, right: FloatArray) -> FloatArray:
    """Return L^-1 ``right`` (n, m) for the lower triangular L (n, n), by forward substitution."""
    solution = right.copy()
    for k in range(len(lower)):
        solution[k] /= lower[k, k]
        solution[k + 1 :] -= lower[k + 1 :, k, None] * solution[None, k]
    return solution


def noise_whitening_of(covariance: FloatArray) -> FloatArray:
    """Return (n, n) L^-1 of ``covariance`` = L L', as :func:`strainfmu.innovation.inverse_cholesky`."""
    std = np.sqrt(np.diag(covariance))
    root = cholesky(covariance / (std[:, None] * std[None, :]))
    return np.asarray(solve_lower(root, np.eye(len(root))) / std)


def load_gain_of(inverse_map: InverseMap, noise_whitening: FloatArray) -> FloatArray:
    """Return (5, n_d) G of all gauges [N, N m], as ``inverse_map.load_gain``; L^-1 is ``noise_whitening``."""
    x = inverse_map.strain_load_covariance
    if x is None:
        return product(inverse_map.load_per_state, inverse_map.strain_gain)
    of_residual = product(product(noise_whitening, x).T.copy(), noise_whitening)
    of_states = inverse_map.load_per_state - product(of_residual, inverse_map.state_operator)
    return np.asarray(product(of_states, inverse_map.strain_gain) + of_residual)
