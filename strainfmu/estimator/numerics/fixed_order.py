"""Matrix algebra that gives the same bits on every processor.

BLAS and LAPACK choose kernels by processor, so their last bits differ between machines. Here every sum runs in the
order of its index, by element-wise operations that IEEE 754 defines to the bit. For matrices of some hundred rows.
"""

from __future__ import annotations

from math import copysign, sqrt

import numpy as np

from strainfmu.arrays import FloatArray

_JACOBI_SWEEPS = 30


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


def inverse_cholesky(covariance: FloatArray) -> FloatArray:
    """Return L^-1 (n, n), lower triangular, of ``covariance`` = L L'."""
    # Rows and columns scaled to unit variance, so that gauges of unlike noise cost no digits.
    std = np.sqrt(np.diag(covariance))
    scaled = cholesky(covariance / (std[:, None] * std[None, :]))
    return np.asarray(solve_lower(scaled, np.eye(len(std))) / std)


def householder(matrix: FloatArray, columns: int | None = None) -> tuple[FloatArray, list[FloatArray]]:
    """Return R (m, n), upper triangular, and the reflectors v of Q = H_1 H_2 .., H_k = I - 2 v v' / v' v.

    v of H_k holds rows k .. m - 1. With ``columns`` only these first columns become triangular. Source: Golub &
    Van Loan, Matrix Computations, algorithms 5.1.1 and 5.2.1.
    """
    r, reflectors = matrix.copy(), []
    for k in range(min(r.shape) if columns is None else columns):
        v = r[k:, k].copy()
        v[0] += copysign(sqrt(_ordered_sum(v * v)), v[0])
        _reflect(v, r)
        r[k + 1 :, k] = 0.0
        reflectors.append(v)
    return r, reflectors


def _reflect(v: FloatArray, matrix: FloatArray) -> None:
    """Turn ``matrix`` into H ``matrix``, whose last len(v) rows change; H = I for v = 0."""
    square = _ordered_sum(v * v)
    if square > 0.0:
        rows = matrix[len(matrix) - len(v) :]
        along = np.add.accumulate(v[:, None] * rows, axis=0)[-1]
        rows -= v[:, None] * (2.0 / square * along)


def _ordered_sum(values: FloatArray) -> float:
    """Return the sum of ``values`` (n,), one after another."""
    return float(np.add.accumulate(values)[-1])


def eigen(matrix: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return eigenvalues (n,) and eigenvectors (n, n), by columns, of a symmetric ``matrix``, by Jacobi's method.

    Source: Golub & Van Loan, Matrix Computations, section 8.5.
    """
    a, vectors = matrix.copy(), np.eye(len(matrix))
    for _ in range(_JACOBI_SWEEPS):
        for p in range(len(a) - 1):
            for q in range(p + 1, len(a)):
                if a[p, q] == 0.0:
                    continue
                tau = float(a[q, q] - a[p, p]) / (2.0 * float(a[p, q]))
                t = copysign(1.0, tau) / (abs(tau) + sqrt(1.0 + tau * tau))
                c = 1.0 / sqrt(1.0 + t * t)
                a = _rotated(_rotated(a, p, q, c, t * c).T, p, q, c, t * c).T
                a[p, q] = a[q, p] = 0.0
                vectors = _rotated(vectors, p, q, c, t * c)
    return np.diag(a).copy(), vectors


def _rotated(matrix: FloatArray, p: int, q: int, c: float, s: float) -> FloatArray:
    """Return ``matrix`` with its columns p and q rotated."""
    out = matrix.copy()
    out[:, p], out[:, q] = c * matrix[:, p] - s * matrix[:, q], s * matrix[:, p] + c * matrix[:, q]
    return out
