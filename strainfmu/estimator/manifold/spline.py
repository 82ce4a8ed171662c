"""Cubic B-splines on given knots: basis functions, their derivatives, and the coefficients of an interpolant."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from strainfmu.arrays import FloatArray

DEGREE = 3


class Basis(NamedTuple):
    """Basis functions (k, n + 2) at k points of n knots, and their first derivatives."""

    value: FloatArray
    derivative: FloatArray


def padded_knots(knots: FloatArray) -> FloatArray:
    """Return the knot vector (n + 6,) of cubic splines on increasing ``knots`` (n,), n >= 2: ends fourfold."""
    return np.concatenate([np.repeat(knots[0], DEGREE), knots, np.repeat(knots[-1], DEGREE)])


def basis(knots: FloatArray, x: FloatArray) -> Basis:
    """Return the basis at ``x`` (k,) real or complex; beyond the outer knots splines go on along their tangent.

    Source: the recurrence of Cox and de Boor (de Boor, A Practical Guide to Splines, chapter X).
    """
    inside = np.where(x.real < knots[0], knots[0], np.where(x.real > knots[-1], knots[-1], x))
    padded, n = padded_knots(knots), len(knots)
    span = np.clip(np.searchsorted(knots, inside.real, side="right") - 1, 0, n - 2) + DEGREE
    local, slope = _local(padded, span, inside)
    rows = np.arange(len(x))[:, None]
    columns = span[:, None] - DEGREE + np.arange(DEGREE + 1)
    value = np.zeros((len(x), n + 2), dtype=inside.dtype)
    derivative = np.zeros_like(value)
    value[rows, columns], derivative[rows, columns] = local, slope
    beyond = (x - inside)[:, None]
    return Basis(value + beyond * derivative, derivative)


def _local(padded: FloatArray, span: np.ndarray, x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the four basis functions (k, 4) that are not zero at ``x``, and their derivatives."""
    values = [np.ones_like(x)]
    lower = values
    for degree in range(1, DEGREE + 1):
        lower, values = values, [np.zeros_like(x) for _ in range(degree + 1)]
        for j, one in enumerate(lower):
            left, right = padded[span - degree + 1 + j], padded[span + 1 + j]
            part = one / (right - left)
            values[j] = values[j] + (right - x) * part
            values[j + 1] = values[j + 1] + (x - left) * part
    slope = [np.zeros_like(x) for _ in range(DEGREE + 1)]
    for j, one in enumerate(lower):
        part = DEGREE * one / (padded[span + 1 + j] - padded[span - DEGREE + 1 + j])
        slope[j] = slope[j] - part
        slope[j + 1] = slope[j + 1] + part
    return np.stack(values, axis=1), np.stack(slope, axis=1)
