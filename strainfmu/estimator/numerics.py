"""Matrix algebra that gives the same bits on every processor, and cubic B-splines on given knots.

BLAS and LAPACK choose kernels by processor, so their last bits differ between machines. In :func:`product`,
:func:`row_squares` and :func:`householder` every sum runs in the order of its index, by element-wise operations
that IEEE 754 defines to the bit. They are for matrices of some hundred rows.
"""

from functools import lru_cache
from math import copysign, sqrt
from typing import NamedTuple

import numpy as np

from strainfmu.arrays import FloatArray, IntArray


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


def arrow_triangle(diagonal: FloatArray, rows: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the first n rows (n, w) of R, and what it leaves (k, w), of diag(``diagonal``) over ``rows`` (k, w).

    The diagonal has n <= w columns. A reflection changes one of its rows and ``rows``: n^2 k operations, not n^3.
    """
    n, (k, w) = len(diagonal), rows.shape
    if not diagonal.any():  # rows that are used up stay 0
        reflected, _ = householder(np.vstack([rows, np.zeros((max(n - k, 0), w))]), n)
        return reflected[:n], reflected[n:]
    triangle, both = np.zeros((n, w)), np.vstack([np.zeros((1, w)), rows])
    for j in range(n):
        both[0, j:] = 0.0
        both[0, j] = diagonal[j]
        v = both[:, j].copy()
        v[0] += copysign(sqrt(_ordered_sum(v * v)), v[0])
        _reflect(v, both[:, j:])
        triangle[j, j:] = both[0, j:]
        both[1:, j] = 0.0
    return triangle, both[1:]


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


DEGREE = 3


class Basis(NamedTuple):
    """Basis functions (k, n + 2) at k points of n knots, and their first derivatives."""

    value: FloatArray
    derivative: FloatArray


class LocalBasis(NamedTuple):
    """The four basis functions (k, 4) that are not zero in the cell of each of k points, and their derivatives.

    ``cell`` (k,) is the number of the cell, and of the first of the four functions.
    """

    cell: IntArray
    value: FloatArray
    derivative: FloatArray


def padded_knots(knots: FloatArray) -> FloatArray:
    """Return the knot vector (n + 6,) of cubic splines on increasing ``knots`` (n,), n >= 2: ends fourfold."""
    return np.concatenate([np.repeat(knots[0], DEGREE), knots, np.repeat(knots[-1], DEGREE)])


def local_basis(knots: FloatArray, x: FloatArray) -> LocalBasis:
    """Return the basis at ``x`` (k,); beyond the outer knots splines go on along their tangent.

    Source: the recurrence of Cox and de Boor (de Boor, A Practical Guide to Splines, chapter X).
    """
    inside = np.clip(x, knots[0], knots[-1])
    cell = np.clip(np.searchsorted(knots, inside, side="right") - 1, 0, len(knots) - 2)
    t, c = (inside - knots[cell])[:, None], _polynomials(np.asarray(knots, dtype=np.float64).tobytes())[cell]
    value = c[:, :, 0] + t * (c[:, :, 1] + t * (c[:, :, 2] + t * c[:, :, 3]))
    derivative = c[:, :, 1] + t * (2.0 * c[:, :, 2] + t * (3.0 * c[:, :, 3]))
    return LocalBasis(cell, value + (x - inside)[:, None] * derivative, derivative)


def basis(knots: FloatArray, x: FloatArray) -> Basis:
    """Return all basis functions at ``x`` (k,), see :func:`local_basis`."""
    local = local_basis(knots, x)
    rows, columns = np.arange(len(x))[:, None], local.cell[:, None] + np.arange(DEGREE + 1)
    functions = Basis(*(np.zeros((len(x), len(knots) + 2)) for _ in range(2)))
    functions.value[rows, columns], functions.derivative[rows, columns] = local.value, local.derivative
    return functions


@lru_cache(maxsize=64)
def _polynomials(knots: bytes) -> FloatArray:
    """Return (n - 1, 4, 4) the four basis functions in each cell of the knots, as coefficients of the powers of x
    less the cell's first knot."""
    inner = np.frombuffer(knots, dtype=np.float64)
    padded, first = padded_knots(inner), inner[:-1]
    span = np.arange(len(first)) + DEGREE
    values = [np.zeros((len(first), DEGREE + 1))]
    values[0][:, 0] = 1.0
    for degree in range(1, DEGREE + 1):
        lower, values = values, [np.zeros_like(values[0]) for _ in range(degree + 1)]
        for j, spline in enumerate(lower):
            low, high = padded[span - degree + 1 + j], padded[span + 1 + j]
            part = spline / (high - low)[:, None]
            higher = np.zeros_like(part)
            higher[:, 1:] = part[:, :-1]
            values[j] += (high - first)[:, None] * part - higher
            values[j + 1] += (first - low)[:, None] * part + higher
    return np.stack(values, axis=1)
