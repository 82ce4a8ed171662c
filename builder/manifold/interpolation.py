"""How far the tables are from flows that they were not made from."""

from __future__ import annotations

import numpy as np

from builder.manifold.flow_amplitudes import FlowAmplitudes
from builder.manifold.tables import response_values, spline_coefficients, spline_rows
from strainfmu.arrays import FloatArray
from strainfmu.estimator.numerics import basis

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
