"""Splines over Mach number and total incidence through the flows of the snapshots.

By symmetry, harmonic m of the pressure is even or odd in the total incidence as m is, and all but the mean vanish
without incidence. So m = 0 has no slope there, m = 1 no curvature, the others neither value nor slope: the strain
is smooth at zero incidence.

How far the tables are from flows that they were not made from.
"""

import numpy as np
from scipy.interpolate import BSpline, CubicSpline, PPoly

from builder.manifold.flow_amplitudes import FlowAmplitudes
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.estimator.numerics import DEGREE, basis, padded_knots

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
    for m in (slice(0, 1), slice(1, 2), slice(2, None)):  # harmonics from 2 are alike without incidence
        of_m = values[..., m, :]
        if of_m.size:
            known = at_zero is not None or m.start > 0
            start = at_zero[..., m, :] if at_zero is not None and m.start == 0 else np.zeros_like(of_m[:, 0])
            fitted = _fitted(knots, incidence, of_m, start if known else None, m.start)
            parts.append(np.tensordot(_bspline_matrix(knots, _cardinal(knots, m.start)), fitted, 1))
    of_incidence = np.concatenate(parts, axis=-2)
    return knots, interpolating(mach, np.moveaxis(of_incidence, 1, 0))


def interpolating(knots: FloatArray, values: FloatArray) -> FloatArray:
    """Return the coefficients (n + 2, ...) of the cubic spline through ``values`` (n, ...) at ``knots`` (n,).

    Three knots have a parabola, two a straight line.
    """
    matrix = _bspline_matrix(knots, CubicSpline(knots, np.eye(len(knots))))
    return np.asarray(np.tensordot(matrix, values, 1))


def _cardinal(knots: FloatArray, m: int) -> CubicSpline:
    """Return the splines of harmonic ``m``, by symmetry at zero incidence, which are 1 at one of ``knots`` (n,)
    each."""
    order = 2 if m == 1 else 1  # of the derivative that vanishes
    zero = np.zeros(len(knots))
    end = "not-a-knot" if len(knots) > 3 else (2, zero)
    return CubicSpline(knots, np.eye(len(knots)), bc_type=((order, zero), end))


def _fitted(
    knots: FloatArray, incidence: FloatArray, values: FloatArray, start: FloatArray | None, m: int
) -> FloatArray:
    """Return the values (n_k, n_M, ...) at ``knots`` whose spline fits ``values`` (n_M, n_a, ...) best.

    ``start`` (n_M, ...) is the value without incidence. None continues the spline to there: as for an even
    function without a knot at zero, its third derivative is 0 in the first interval.
    """
    spline, data = _cardinal(knots, m), np.moveaxis(values, 1, 0)
    at_data = np.asarray(spline(incidence))
    if start is None:
        third = np.asarray(spline(0.0, 3))
        of_others = -third[1:] / third[0]
        design = at_data[:, 1:] + np.outer(at_data[:, 0], of_others)
        rest = np.tensordot(np.linalg.pinv(design), data, 1)
        start = np.tensordot(of_others, rest, 1)
    else:
        remainder = data - np.multiply.outer(at_data[:, 0], start)
        rest = np.tensordot(np.linalg.pinv(at_data[:, 1:]), remainder, 1)
    return np.concatenate([start[None], rest])


def _bspline_matrix(knots: FloatArray, cardinal: PPoly) -> FloatArray:
    """Return (n + 2, n) coefficients of ``cardinal`` splines, piecewise cubic on ``knots`` (n,)."""
    padded = padded_knots(knots)
    sites = np.array([padded[i + 1 : i + 1 + DEGREE].mean() for i in range(len(knots) + 2)])
    sites = np.clip(sites, knots[0], knots[-1])  # the mean of equal knots may round beyond them
    design = BSpline.design_matrix(sites, padded, DEGREE).toarray()
    return np.asarray(np.linalg.solve(design, np.asarray(cardinal(sites))))


MACH_FRACTION = 0.5
"""Part of the error at a Mach number left out that remains at the spacing of the tables.

Of a cubic spline at twice the spacing 1/16 would remain where it converges; few Mach numbers do not show that.
"""

ROLLS = 24
"""Roll angles of the wind at which an error counts."""


def interpolation_errors(flows: FlowAmplitudes, response: FloatArray) -> FloatArray:
    """Return (n, n_c) errors of the channels of ``response`` (n_c, n_x, n_m, 2) per p_inf; their squares add up to
    the mean one.

    Every incidence but the largest, and every inner Mach number, is left out in turn and predicted. Of two Mach
    numbers the inner one comes from :meth:`~builder.manifold.flow_amplitudes.FlowAmplitudes.with_middle_mach`.
    """
    return rolled_errors(
        left_out_errors(flows.mach, flows.incidence, response_values(flows, response), flows.of_two)
    )


def rolled_errors(errors: FloatArray) -> FloatArray:
    """Return (n, n_c) values of ``errors`` (q, n_c, n_m, s) at roll angles all round; their squares add up to the
    mean one."""
    if not len(errors):
        return np.zeros((0, errors.shape[1]))
    rolled = _rolled(errors)
    return rolled / np.sqrt(len(rolled))


def left_out_errors(
    mach: FloatArray, all_incidence: FloatArray, values: FloatArray, of_two: bool = False
) -> FloatArray:
    """Return (q, n, n_m, s) errors of the splines at what is left out in turn, see :func:`interpolation_errors`.

    Parameters
    ----------
    mach, all_incidence : (n_M,) [1], (n_a,) [rad].
    values : (n_M, n_a, n, n_m, s).
    of_two : whether the middle Mach number is made from the others, per dynamic pressure; its difference from a
        straight line in M counts.
    """
    inclined = np.flatnonzero(all_incidence > 1e-9)
    incidence, of_flows = all_incidence[inclined], values[:, inclined]
    zero = values[:, 0] if len(inclined) < len(all_incidence) else None
    errors: list[FloatArray] = []
    at_mach = basis(mach, mach).value
    for omitted in range(len(incidence) - 1):
        remaining = np.delete(np.arange(len(incidence)), omitted)
        knots, table = spline_coefficients(
            mach, incidence[remaining], of_flows[:, remaining], spline_rows(incidence[remaining]), zero
        )
        predicted = _table(at_mach, basis(knots, incidence[omitted : omitted + 1]).value, table)
        errors += list(of_flows[:, omitted] - predicted[:, 0])
    rows = spline_rows(incidence)
    for omitted in range(1, len(mach) - 1):
        remaining = np.delete(np.arange(len(mach)), omitted)
        if len(remaining) < 2:
            break
        if len(remaining) == 2 and not of_two:
            errors += list(MACH_FRACTION * (of_flows[omitted] - between_two(mach, of_flows)))
            continue
        knots, table = spline_coefficients(
            mach[remaining], incidence, of_flows[remaining], rows, None if zero is None else zero[remaining]
        )
        predicted = _table(
            basis(mach[remaining], mach[omitted : omitted + 1]).value, basis(knots, incidence).value, table
        )
        errors += list(MACH_FRACTION * (of_flows[omitted] - predicted[0]))
    return np.array(errors).reshape(-1, *values.shape[2:])


def between_two(mach: FloatArray, values: FloatArray) -> FloatArray:
    """Return the middle one of ``values`` (3, ...) at three Mach numbers by a straight line in M^2 of the others.

    Pressure over p_inf is nearly one and a part in proportion to M^2. A line in M would miss most of that part,
    which the parabola through three Mach numbers holds.
    """
    square = mach**2
    part = (square[1] - square[0]) / (square[2] - square[0])
    return np.asarray((1.0 - part) * values[0] + part * values[2])


def _table(of_mach: FloatArray, of_incidence: FloatArray, coefficients: FloatArray) -> FloatArray:
    return np.einsum("ia,jb,abnms->ijnms", of_mach, of_incidence, coefficients, optimize=True)


def _rolled(amplitude: FloatArray) -> FloatArray:
    """Return (n ROLLS, n_c) values of ``amplitude`` (n, n_c, n_m, 2) at roll angles all round."""
    angle = np.outer(2.0 * np.pi * np.arange(ROLLS) / ROLLS, np.arange(amplitude.shape[2]))
    wind = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    return np.einsum("qnms,pms->qpn", amplitude, wind, optimize=True).reshape(-1, amplitude.shape[1])
