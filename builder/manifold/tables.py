"""Splines over Mach number and total incidence through the flows of the snapshots.

By symmetry, harmonic m of the pressure is even or odd in the total incidence as m is, and all but the mean vanish
without incidence. So m = 0 has no slope there, m = 1 no curvature, the others neither value nor slope: the strain
is smooth at zero incidence.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import BSpline, CubicSpline, PPoly

from builder.manifold.flow_amplitudes import FlowAmplitudes
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.estimator.numerics import DEGREE, padded_knots

MIN_SPACING = np.radians(0.9)
"""Spacing of incidences below which a spline would show the solver's noise; flows between are for checking."""


def spline_rows(incidence: FloatArray, spacing: float = MIN_SPACING) -> IntArray:
    """Return the ``incidence`` (n_a,) that become knots, by index: the largest, and from there down by
    ``spacing``."""
    rows = [len(incidence) - 1]
    for row in range(len(incidence) - 2, -1, -1):
        if incidence[rows[-1]] - incidence[row] >= spacing and incidence[row] > 0.5 * spacing:
            rows.append(row)
    return np.array(rows[::-1], dtype=np.int64)


def ring_response(operator: FloatArray, grid: SurfaceGrid, n_m: int) -> FloatArray:
    """Return (n, n_x, n_m, 2) sums of ``operator`` (n, n_p) times cos m phi and sin m phi round every ring."""
    rings = operator.reshape(len(operator), len(grid.x), -1)
    angle = np.outer(grid.roll_angle, np.arange(n_m))
    return np.stack([rings @ np.cos(angle), rings @ np.sin(angle)], axis=-1)


def response_values(flows: FlowAmplitudes, response: FloatArray) -> FloatArray:
    """Return (n_M, n_a, n, n_m, 2) of ``response`` (n, n_x, n_m, 2) to the flows at unit p_inf."""
    return of_amplitudes(flows.amplitude, response)


def of_amplitudes(amplitude: FloatArray, response: FloatArray) -> FloatArray:
    """Return (..., n, n_m, 2) of ``response`` (n, n_x, n_m, 2) to flows of ``amplitude`` (..., n_x, n_m)."""
    return np.einsum("...xm,nxms->...nms", amplitude, response, optimize=True)


def spline_coefficients(
    mach: FloatArray, incidence: FloatArray, values: FloatArray, rows: IntArray, at_zero: FloatArray | None
) -> tuple[FloatArray, FloatArray]:
    """Return knots of the incidence (n_k,) from 0, and coefficients (n_M + 2, n_k + 2, ..., n_m, 2).

    Parameters
    ----------
    mach : (n_M,) [1], at least two.
    incidence : (n_a,) positive [rad].
    values : (n_M, n_a, ..., n_m, 2); between the knots the splines fit them by least squares.
    rows : (n_k - 1,) of the incidences that are knots.
    at_zero : (n_M, ..., n_m, 2) without incidence, or None to take the mean from the spline.
    """
    knots = np.concatenate([[0.0], incidence[rows]])
    parts = []
    for m in range(values.shape[-2]):
        of_m = values[..., m, :]
        known = at_zero is not None or m > 0
        start = at_zero[..., 0, :] if at_zero is not None and m == 0 else np.zeros_like(of_m[:, 0])
        along = _through(knots, _fitted(knots, incidence, of_m, start if known else None, m), m)
        parts.append(_as_bspline(knots, along, axis=1))
    of_incidence = np.stack(parts, axis=-2)
    return knots, interpolating(mach, of_incidence)


def interpolating(knots: FloatArray, values: FloatArray) -> FloatArray:
    """Return the coefficients (n + 2, ...) of the cubic spline through ``values`` (n, ...) at ``knots`` (n,).

    Three knots have a parabola, two a straight line.
    """
    return _as_bspline(knots, CubicSpline(knots, values, axis=0), axis=0)


def _through(knots: FloatArray, values: FloatArray, m: int) -> CubicSpline:
    """Return the spline of harmonic ``m`` through ``values`` (n_M, n_k, ...), by symmetry at zero incidence."""
    order = 2 if m == 1 else 1  # of the derivative that vanishes
    zero = np.zeros_like(values[:, 0])
    end = "not-a-knot" if len(knots) > 3 else (2, zero)
    return CubicSpline(knots, values, axis=1, bc_type=((order, zero), end))


def _fitted(
    knots: FloatArray, incidence: FloatArray, values: FloatArray, start: FloatArray | None, m: int
) -> FloatArray:
    """Return the values (n_M, n_k, ...) at ``knots`` whose spline fits ``values`` (n_M, n_a, ...) best.

    ``start`` (n_M, ...) is the value without incidence. None continues the spline to there: as for an even
    function without a knot at zero, its third derivative is 0 in the first interval.
    """
    n, through = len(knots), _through(knots, np.eye(len(knots))[None], m)
    cardinal, data = np.asarray(through(incidence))[0], np.moveaxis(values, 1, 0)
    if start is None:
        third = np.asarray(through(0.0, 3))[0]
        of_others = -third[1:] / third[0]
        design = cardinal[:, 1:] + np.outer(cardinal[:, 0], of_others)
        rest = np.linalg.lstsq(design, data.reshape(len(incidence), -1), rcond=None)[0]
        fitted = np.concatenate([of_others[None] @ rest, rest])
    else:
        remainder = data - cardinal[:, :1].reshape(-1, *[1] * (data.ndim - 1)) * start
        rest = np.linalg.lstsq(cardinal[:, 1:], remainder.reshape(len(incidence), -1), rcond=None)[0]
        fitted = np.concatenate([start.reshape(1, -1), rest])
    return np.moveaxis(fitted.reshape(n, *data.shape[1:]), 0, 1)


def _as_bspline(knots: FloatArray, spline: PPoly, axis: int) -> FloatArray:
    """Return the coefficients of ``spline``, piecewise cubic on ``knots`` (n,), n + 2 along ``axis``."""
    padded = padded_knots(knots)
    sites = np.array([padded[i + 1 : i + 1 + DEGREE].mean() for i in range(len(knots) + 2)])
    sites = np.clip(sites, knots[0], knots[-1])  # the mean of equal knots may round beyond them
    design = BSpline.design_matrix(sites, padded, DEGREE).toarray()
    values = np.moveaxis(np.asarray(spline(sites)), axis, 0)
    solved = np.linalg.solve(design, values.reshape(len(sites), -1)).reshape(values.shape)
    return np.moveaxis(solved, 0, axis)
