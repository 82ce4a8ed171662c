"""Matrix algebra as a parameter: fast by BLAS and LAPACK, or in the same bits on every processor.

One formula serves both. Maps are built and checked with :data:`LAPACK`. The matrices of estimator and FMUs are
made with :data:`FIXED_ORDER`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.estimator.numerics import fixed_order

_Two = Callable[[FloatArray, FloatArray], FloatArray]


@dataclass(frozen=True, kw_only=True)
class Algebra:
    """The operations that the formulas of this room need.

    Attributes
    ----------
    product : (m, k) times (k, n).
    cholesky : L, lower triangular, of a positive definite matrix L L'.
    solve_lower : L^-1 X for a lower triangular L (n, n) and X (n, m).
    eigen : eigenvalues (n,) in any order and eigenvectors (n, n), by columns, of a symmetric matrix.
    """

    product: _Two
    cholesky: Callable[[FloatArray], FloatArray]
    solve_lower: _Two
    eigen: Callable[[FloatArray], tuple[FloatArray, FloatArray]]


def _symmetric_eigen(matrix: FloatArray) -> tuple[FloatArray, FloatArray]:
    values, vectors = np.linalg.eigh(matrix)
    return values, vectors


LAPACK = Algebra(
    product=np.matmul,
    cholesky=lambda matrix: np.asarray(np.linalg.cholesky(matrix)),
    solve_lower=lambda lower, right: np.asarray(np.linalg.solve(lower, right)),
    eigen=_symmetric_eigen,
)
"""numpy's: the last bits follow the processor."""

FIXED_ORDER = Algebra(
    product=fixed_order.product,
    cholesky=fixed_order.cholesky,
    solve_lower=fixed_order.solve_lower,
    # Jacobi's method takes the matrix as it stands; what round-off leaves unsymmetric is averaged.
    eigen=lambda matrix: fixed_order.eigen(0.5 * (matrix + matrix.T)),
)
"""Sums in the order of their index (:mod:`strainfmu.estimator.numerics.fixed_order`)."""
