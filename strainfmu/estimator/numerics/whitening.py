"""Whitening: rows of errors with a covariance become rows of independent errors of unit size."""

from __future__ import annotations

import numpy as np

from strainfmu.arrays import FloatArray


def inverse_root(covariance: FloatArray) -> FloatArray:
    """Return (n, n) L^-1, lower triangular, of the positive definite ``covariance`` (n, n) = L L'."""
    size = np.sqrt(np.diag(covariance))  # rows of unlike units and noise cost no digits
    return np.tril(np.linalg.inv(np.linalg.cholesky(covariance / np.outer(size, size)))) / size
