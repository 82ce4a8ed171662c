"""Strain and loads over the flight state x = (M, u, w, ln p_inf), their errors, and what flow parameters change.

With the total incidence a and h = (u + i w) / a = exp(i phi), every row of the tables is

    y = p_inf Re sum_m c_m(M, a) h^m + y_fixed,   c_m = A_m - i B_m,

c_m tensor-product cubic splines. Rows are the n_d strains, then the m outputs: five loads, rolling moment and
section loads.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from strainfmu.arrays import ComplexArray, FloatArray
from strainfmu.estimator.map.inverse_map import InverseMap

N_STATES = 4
MACH, U, W, LOG_PRESSURE = range(N_STATES)
LOADS = 5
MIN_INCIDENCE = 1e-7
"""Rounds the cone a = |(u, w)| off at its tip [rad]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Tables:
    """Tables of n_d + m rows, and the errors of pressure about them, per p_inf.

    ``mach_knots`` (n_M,) and ``incidence_knots`` (n_a,) [rad] are those of ``spline`` (n_M + 2, n_a + 2, n_d + m,
    n_m), coefficients of c_m; ``fixed`` (n_d + m,) is y_fixed. Pressure off the tables has the strain columns
    ``error_strain`` (n_d, k) per standard deviation, covariances ``cross`` (n_d, m) with the outputs and
    ``output_variance`` (m, m) of them, behind the five loads variances alone.
    """

    mach_knots: FloatArray
    incidence_knots: FloatArray
    spline: ComplexArray
    fixed: FloatArray
    error_strain: FloatArray
    cross: FloatArray
    output_variance: FloatArray


def tables_of(inverse_map: InverseMap) -> Tables:
    """Return the tables of a nonlinear map."""
    manifold = inverse_map.manifold
    assert manifold is not None
    response, fixed = manifold.response, manifold.fixed_response
    cross = manifold.error_strain @ manifold.error_load.T
    variance = manifold.error_load @ manifold.error_load.T
    further = manifold.further
    if further is not None:
        response = np.concatenate([response, further.response], axis=2)
        fixed = np.concatenate([fixed, further.fixed_response])
        cross = np.hstack([cross, further.strain_covariance.T])
        variance = _with_further(variance, further.variance)
    return Tables(
        mach_knots=manifold.mach_knots,
        incidence_knots=manifold.incidence_knots,
        spline=response[..., 0] - 1j * response[..., 1],
        fixed=fixed,
        error_strain=manifold.error_strain,
        cross=cross,
        output_variance=variance,
    )


def evaluate(tables: Tables, state: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the rows (n_d + m,) at the flight ``state`` (4,), and their derivatives (n_d + m, 4)."""
    mach, u, w, log_pressure = state
    a, pressure = np.sqrt(u * u + w * w + MIN_INCIDENCE**2), np.exp(log_pressure)
    h, order = (u + 1j * w) / a, np.arange(tables.spline.shape[3])
    first, of_mach, by_mach = basis(tables.mach_knots, mach)
    second, of_a, by_a = basis(tables.incidence_knots, a)
    cell = tables.spline[first : first + 4, second : second + 4]
    c, c_by_mach, c_by_a = (
        np.tensordot(np.outer(one, other), cell, 2)
        for one, other in ((of_mach, of_a), (by_mach, of_a), (of_mach, by_a))
    )
    power, slope = h**order, order * h ** np.maximum(order - 1, 0)
    value, along_a = (c @ power).real, (c_by_a @ power).real
    by_u, by_w = ((c @ slope) * (one / a - x * h / a**2) for one, x in ((1.0, u), (1j, w)))
    jacobian = [(c_by_mach @ power).real, along_a * u / a + by_u.real, along_a * w / a + by_w.real, value]
    return pressure * value + tables.fixed, pressure * np.stack(jacobian, axis=1)


def basis(knots: FloatArray, x: float) -> tuple[int, FloatArray, FloatArray]:
    """Return the first of the four cubic B-splines that are not 0 at ``x``, their values and their derivatives.

    Knots at the ends are fourfold; beyond them splines go on along their tangent. Source: de Boor, A Practical
    Guide to Splines, chapter X, the recurrence of Cox and de Boor.
    """
    inside = float(np.clip(x, knots[0], knots[-1]))
    cell = int(np.clip(np.searchsorted(knots, inside, side="right") - 1, 0, len(knots) - 2))
    padded = np.concatenate([np.repeat(knots[0], 3), knots, np.repeat(knots[-1], 3)])
    value, derivative = np.ones(1), np.zeros(0)
    for degree in (1, 2, 3):
        left = padded[cell + 4 - degree : cell + 4]
        right = padded[cell + 4 : cell + 4 + degree]
        part = value / (right - left)
        value = np.append((right - inside) * part, 0.0) + np.append(0.0, (inside - left) * part)
        derivative = degree * (np.append(0.0, part) - np.append(part, 0.0))
    return cell, value + (x - inside) * derivative, derivative


def with_known_parameters(inverse_map: InverseMap, tables: Tables, value: FloatArray, std: FloatArray) -> Tables:
    """Return ``tables`` where flow parameters are known: ``value`` and ``std`` (n_p,), NaN of one that is not.

    A row changes by p_inf sum_j (z^j - offset_j) s_j, z the parameter less its mean over its spread. A stated
    value and the spread over the snapshots are joined, both normal; the errors are those that the join leaves.
    """
    assert inverse_map.manifold is not None
    held = inverse_map.manifold.parameters
    assert held is not None
    powers, j = held.powers, held.powers.power
    known = np.isfinite(value) & np.isfinite(std) & (powers.spread > 0.0)
    if not known.any():
        return tables
    spread = np.where(powers.spread > 0.0, powers.spread, 1.0)
    weight = np.where(known, spread**2 / (spread**2 + np.where(known, std, 0.0) ** 2), 0.0)
    z = (weight * np.where(known, value - powers.mean, 0.0) / spread)[powers.parameter]
    left = (1.0 - weight)[powers.parameter]
    expected = z**j + 0.5 * j * (j - 1) * left * z ** np.maximum(j - 2, 0)  # of a normal z, j up to 3
    shift = np.where(known[powers.parameter], expected - powers.offset, 0.0)
    change = np.tensordot(held.slope, shift, axes=(2, 0))
    by_one = j * z ** (j - 1) * np.sqrt(weight * (1.0 - weight))[powers.parameter]
    columns = [held.error]
    for parameter, part in enumerate(weight):
        own = powers.parameter == parameter
        columns += [
            np.tensordot(by_one[own], held.unit_error[own], 1),
            (1.0 - part) * held.spread_error[parameter],
        ]
    error, n_d = np.hstack(columns), len(tables.error_strain)
    strain, load = error[:n_d], error[n_d : n_d + LOADS]
    return replace(
        tables,
        spline=tables.spline + change[..., 0] - 1j * change[..., 1],
        error_strain=strain,
        cross=strain @ error[n_d:].T,
        output_variance=_with_further(load @ load.T, np.sum(error[n_d + LOADS :] ** 2, axis=1)),
    )


def _with_further(covariance: FloatArray, variance: FloatArray) -> FloatArray:
    """Return the ``covariance`` of the five loads and the ``variance`` (m - 5,) of the other outputs together."""
    whole = np.diag(np.append(np.zeros(LOADS), variance))
    whole[:LOADS, :LOADS] = covariance
    return whole
