"""Array types by the kind of their values, and covariances; shapes and units stand in the docstrings of what uses
them."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]


def float_or_array(values: FloatArray) -> Any:
    """Return the value of one sample as a float, the values (k,) of k samples as they are."""
    return values if values.ndim else float(values)


def component(name: str, place: int, text: str) -> Any:
    """Return the property that ``text`` describes: ``place`` of the last axis of the array ``name``.

    It is a float of one sample, (k,) of k samples.
    """
    return property(lambda self: float_or_array(getattr(self, name)[..., place]), doc=text)


def lower_factor(columns: FloatArray) -> FloatArray:
    """Return (n, k) columns, k at most n, with the covariance of ``columns`` (n, m)."""
    size = np.linalg.norm(columns, axis=1, keepdims=True)
    size[size == 0.0] = 1.0  # rows of one size: strain and newtons differ by many orders of magnitude
    upper: FloatArray = np.asarray(np.linalg.qr((columns / size).T, mode="r"))
    return size * upper.T


def is_covariance(matrix: FloatArray) -> bool:
    """Tell whether ``matrix`` (n, n) is symmetric and positive definite."""
    variance = np.diag(matrix)
    common = common_to_pairs(matrix)
    if common is not None and common >= 0.0:
        return bool(np.all(variance > common))
    if not (np.all(variance > 0.0) and np.allclose(matrix, matrix.T, rtol=1e-9, atol=0.0)):
        return False
    size = np.sqrt(variance)  # rows of unlike units and noise cost no digits
    try:
        np.linalg.cholesky(matrix / np.outer(size, size))
    except np.linalg.LinAlgError:
        return False
    return True


def common_to_pairs(matrix: FloatArray) -> float | None:
    """Return what all elements off the diagonal of ``matrix`` (n, n) are; None where they differ."""
    common = matrix[-1, 0] if len(matrix) > 1 else 0.0
    others = np.count_nonzero(matrix != common) - np.count_nonzero(np.diag(matrix) != common)
    return None if others else float(common)


def inverse_root(covariance: FloatArray) -> FloatArray:
    """Return (n, n) L^-1, lower triangular, of the positive definite ``covariance`` (n, n) = L L'.

    It whitens: rows of errors with this covariance become rows of independent errors of unit size.
    """
    size = np.sqrt(np.diag(covariance))  # rows of unlike units and noise cost no digits
    return np.tril(np.linalg.inv(np.linalg.cholesky(covariance / np.outer(size, size)))) / size
