"""The pressure on the surface at an estimated flight state, corrected by the residual of strain.

With C the covariance with strain of pressure off the tables that the gain may correct: p = p(x) + C S^-1 r, as the
loads. The variance of a node with the derivative J_p by the state is

    (J_p - C S^-1 J) E_x (..)' + sigma_p^2 - C S^-1 C'.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.estimator.estimates.pressure_field import PressureField, unknown_field
from strainfmu.estimator.map import flight_tables
from strainfmu.estimator.map.flight_tables import LOG_PRESSURE, MACH, MIN_INCIDENCE, U, W
from strainfmu.estimator.map.nonlinear_map import FlightField, ManifoldMap, ShapeField
from strainfmu.estimator.numerics.spline import local_basis
from strainfmu.estimator.reference.air import lognormal_std
from strainfmu.estimator.reference.nonlinear import strain_covariance

MIN_LEFT = 0.05
"""Least part of the variance of pressure off the tables that strain leaves: C holds its low harmonics alone."""


@dataclass(frozen=True, eq=False, kw_only=True)
class TablePressure:
    """Pressure of the tables at one state.

    Attributes
    ----------
    value : (n_p,) [Pa].
    jacobian : (n_p, 4) by M, u, w and ln p_inf.
    """

    value: FloatArray
    jacobian: FloatArray


def table_pressure(manifold: ManifoldMap, field: FlightField | ShapeField, state: FloatArray) -> TablePressure:
    """Return the pressure of the tables at ``state`` (4,)."""
    return (
        _of_shape(manifold, field, state) if isinstance(field, ShapeField) else _of_rings(manifold, field, state)
    )


def _of_shape(manifold: ManifoldMap, field: ShapeField, state: FloatArray) -> TablePressure:
    tables = field.tables(manifold.tables)
    value, jacobian = (field.modes @ each[0] for each in flight_tables.evaluate(tables, state[None]))
    pressure = float(np.exp(state[LOG_PRESSURE]))
    jacobian[:, LOG_PRESSURE] += pressure
    return TablePressure(value=value + pressure, jacobian=jacobian)


def _of_rings(manifold: ManifoldMap, field: FlightField, state: FloatArray) -> TablePressure:
    u, w = float(state[U]), float(state[W])
    incidence = float(np.sqrt(u * u + w * w + MIN_INCIDENCE**2))
    at_mach = local_basis(manifold.mach_knots, state[MACH : MACH + 1])
    at_incidence = local_basis(manifold.incidence_knots, np.array([incidence]))
    (i,), (of_mach,), (by_mach_knots,) = at_mach
    (j,), (of_incidence,), (by_incidence_knots,) = at_incidence
    local = field.amplitude[i : i + 4, j : j + 4].astype(float)
    pairs = ((of_mach, of_incidence), (by_mach_knots, of_incidence), (of_mach, by_incidence_knots))
    amplitude, by_mach, by_incidence = (np.einsum("a,b,abxm->xm", a, b, local, optimize=True) for a, b in pairs)
    m = np.arange(local.shape[3])
    angle = np.outer(m, field.roll_angle - np.arctan2(w, u))
    cosine, sine = np.cos(angle), np.sin(angle)
    value = (amplitude @ cosine).ravel()
    along = (by_incidence @ cosine).ravel()
    turned = ((m * amplitude) @ sine).ravel() / incidence  # by phi_T, times its derivative 1/a_T
    jacobian = np.stack(
        [
            (by_mach @ cosine).ravel(),
            (u * along - w * turned) / incidence,
            (w * along + u * turned) / incidence,
            value,
        ],
        axis=1,
    )
    pressure = float(np.exp(state[LOG_PRESSURE]))
    return TablePressure(value=pressure * value, jacobian=pressure * jacobian)


def flight_pressure(
    manifold: ManifoldMap,
    tables: ManifoldMap,
    field: FlightField | ShapeField,
    *,
    state: FloatArray,
    state_covariance: FloatArray,
    strain: FloatArray,
    used: BoolArray,
    with_std: bool = True,
) -> PressureField:
    """Return the pressure at an estimated flight state.

    Parameters
    ----------
    manifold, tables, field : the map's, with the noise of the sample; tables and field with what is known of it.
    state, state_covariance : (4,), (4, 4) of the estimate.
    strain, used : (n_d,) strain [m/m], and the gauges that the state follows from.
    with_std : false leaves the standard deviation NaN.
    """
    table, n_d = table_pressure(manifold, field, state), len(strain)
    value, by_state_of_rows = (each[0] for each in flight_tables.evaluate(tables.tables, state[None]))
    covariance = strain_covariance(tables, manifold.gauge_covariance, state[None], considered=False)[0]
    factor = np.linalg.cholesky(np.where(used[:, None] & used, covariance, np.eye(n_d)))
    residual = np.where(used, strain - value[:n_d], 0.0)
    jacobian = np.where(used[:, None], by_state_of_rows[:n_d], 0.0)
    whitened = np.linalg.solve(factor, np.column_stack([residual, jacobian]))
    pressure = float(np.exp(state[LOG_PRESSURE]))
    if not with_std:
        weights = np.asarray(np.linalg.solve(factor.T, whitened[:, 0]), dtype=float)
        correction = pressure * pressure * _corrected(field, used, weights)
        return replace(unknown_field(field.n_nodes, is_net=False), pressure=table.value + correction)
    gain = pressure * pressure * _turned(field, factor, used)
    by_state = table.jacobian - gain @ whitened[:, 1:]
    prior = pressure * pressure * _relative_variance(field, state)
    left = np.maximum(prior - np.einsum("pn,pn->p", gain, gain), MIN_LEFT * prior)
    # Errors of ln p_inf are normal, those of p_inf reach further.
    of_log = float(np.sqrt(state_covariance[LOG_PRESSURE, LOG_PRESSURE]))
    wider = (float(lognormal_std(np.array(of_log))) / of_log) ** 2
    variance = wider * np.einsum("px,xy,py->p", by_state, state_covariance, by_state) + left
    return PressureField(pressure=table.value + gain @ whitened[:, 0], std=np.sqrt(variance), is_net=False)


def _corrected(field: FlightField | ShapeField, used: BoolArray, weights: FloatArray) -> FloatArray:
    """Return (n_p,) C times ``weights`` (n_d,)."""
    if isinstance(field, ShapeField):
        return np.asarray(field.strain_covariance[:, used].astype(float) @ weights[used])
    return np.asarray((_around(field) @ _of_stations(field, used, weights)).T.ravel())


def _relative_variance(field: FlightField | ShapeField, state: FloatArray) -> FloatArray:
    """Return (n_p,) variance of the pressure off the tables, per p_inf^2."""
    if isinstance(field, ShapeField):
        return field.error_std**2
    return np.asarray((field.error_std[:, None] ** 2 + _at_wind(field, state).astype(float) ** 2).ravel())


def _turned(field: FlightField | ShapeField, factor: FloatArray, used: BoolArray) -> FloatArray:
    """Return (n_p, n_d) C L'^-1 per p_inf^2, L (n_d, n_d) the Cholesky factor of S."""
    if isinstance(field, ShapeField):
        return np.asarray(np.linalg.solve(factor, np.where(used, field.strain_covariance, 0.0).T).T)
    n_x, n_h, _, n_d = field.strain_covariance.shape
    known = np.where(used, field.strain_covariance, 0.0).reshape(-1, n_d)
    whitened = np.linalg.solve(factor, known.T).T.reshape(n_x, 2 * n_h, n_d)
    return np.asarray((_around(field) @ whitened).reshape(-1, n_d))


def _of_stations(field: FlightField, used: BoolArray, weights: FloatArray) -> FloatArray:
    """Return (2 n_h, n_x) amplitudes of C times ``weights`` (n_d,)."""
    known = field.strain_covariance[..., used].astype(float) @ weights[used]
    return np.asarray(known.reshape(len(known), -1).T)


def _around(field: FlightField) -> FloatArray:
    """Return (n_roll, 2 n_h) cosines and sines round the body."""
    angle = np.outer(field.roll_angle, np.arange(field.strain_covariance.shape[1]))
    return np.stack([np.cos(angle), np.sin(angle)], axis=2).reshape(len(angle), -1)


def _at_wind(field: FlightField, state: FloatArray) -> FloatArray:
    """Return (n_x, n_roll) the error of the tables at the nodes, with the leeward meridian where ``state`` has
    it."""
    n_roll = len(field.roll_angle)
    place = ((field.roll_angle - np.arctan2(state[W], state[U])) * n_roll / (2.0 * np.pi)) % n_roll
    below = np.floor(place).astype(np.int64) % n_roll
    other = (below + 1) % n_roll
    return np.maximum(field.table_error_std[:, below], field.table_error_std[:, other])
