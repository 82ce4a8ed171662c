"""Cubic B-splines on given knots: basis functions, their derivatives, and the coefficients of an interpolant."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from strainfmu.arrays import FloatArray, IntArray

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
    """Return the basis at ``x`` (k,) real or complex; beyond the outer knots splines go on along their tangent.

    Source: the recurrence of Cox and de Boor (de Boor, A Practical Guide to Splines, chapter X).
    """
    inside = np.where(x.real < knots[0], knots[0], np.where(x.real > knots[-1], knots[-1], x))
    cell = np.clip(np.searchsorted(knots, inside.real, side="right") - 1, 0, len(knots) - 2)
    t, c = (inside - knots[cell])[:, None], _polynomials(np.asarray(knots, dtype=np.float64).tobytes())[cell]
    value = c[:, :, 0] + t * (c[:, :, 1] + t * (c[:, :, 2] + t * c[:, :, 3]))
    derivative = c[:, :, 1] + t * (2.0 * c[:, :, 2] + t * (3.0 * c[:, :, 3]))
    return LocalBasis(cell, value + (x - inside)[:, None] * derivative, derivative)


def basis(knots: FloatArray, x: FloatArray) -> Basis:
    """Return all basis functions at ``x`` (k,), see :func:`local_basis`."""
    local = local_basis(knots, x)
    rows, columns = np.arange(len(x))[:, None], local.cell[:, None] + np.arange(DEGREE + 1)
    found = Basis(*(np.zeros((len(x), len(knots) + 2), dtype=local.value.dtype) for _ in range(2)))
    found.value[rows, columns], found.derivative[rows, columns] = local.value, local.derivative
    return found


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
        for j, one in enumerate(lower):
            left, right = padded[span - degree + 1 + j], padded[span + 1 + j]
            part = one / (right - left)[:, None]
            higher = np.zeros_like(part)
            higher[:, 1:] = part[:, :-1]
            values[j] += (right - first)[:, None] * part - higher
            values[j + 1] += (first - left)[:, None] * part + higher
    return np.stack(values, axis=1)
