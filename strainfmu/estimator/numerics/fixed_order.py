"""Matrix algebra that gives the same bits on every processor.

BLAS and LAPACK choose kernels by processor, so their last bits differ between machines. Here every sum runs in the
order of its index, by element-wise operations that IEEE 754 defines to the bit. For matrices of some hundred rows.
"""

from __future__ import annotations

from math import copysign, sqrt

import numpy as np

from strainfmu.arrays import FloatArray


def product(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return ``a`` (m, k) times ``b`` (k, n), summed in the order of k."""
    out = np.zeros((a.shape[0], b.shape[1]))
    for k in range(a.shape[1]):
        out += a[:, k, None] * b[None, k, :]
    return out


def row_squares(a: FloatArray) -> FloatArray:
    """Return (m,) the diagonal of ``a`` (m, k) times its transpose, with the bits of :func:`product`."""
    out = np.zeros(len(a))
    for column in a.T:
        out += column * column
    return out


def householder(matrix: FloatArray, columns: int | None = None) -> tuple[FloatArray, list[FloatArray]]:
    """Return R (m, n), upper triangular, and the reflectors v of Q = H_1 H_2 .., H_k = I - 2 v v' / v' v.

    v of H_k holds rows k .. m - 1. With ``columns`` only these first columns become triangular. Source: Golub &
    Van Loan, Matrix Computations, algorithms 5.1.1 and 5.2.1.
    """
    r, reflectors = matrix.copy(), []
    for k in range(min(r.shape) if columns is None else columns):
        v = r[k:, k].copy()
        v[0] += copysign(sqrt(_ordered_sum(v * v)), v[0])
        _reflect(v, r[:, k:])  # the columns before are zero in these rows
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
