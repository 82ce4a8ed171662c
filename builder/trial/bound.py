"""The Cramer-Rao bound of the coefficients: no unbiased estimate of one reading has a smaller rms error.

At the true flight state the tables of a map are linear to first order. There strain, navigation and the ranges of
the map as prior have the information J on the state (Van Trees 1968, section 2.4):

    J = X' S^-1 X + (information of M, ln p_inf, ln q_inf and prior),  bound = sqrt(diag(T J^-1 T'))

X are the derivatives of the strain by the state, T the slopes of the coefficients. S holds gauge noise and the
errors of the installation at their stated sizes. Errors of the flow are not in it: an estimator that knew the flow
exactly would not make them. A map holds the error of the internal pressure together with these, and flow
parameters count as known: both make the bound smaller than it could be. It bounds the rms over many vehicles with
errors as stated: one vehicle, exactly built ones, or a filter of many readings may be below it.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from builder.trial.conditions import flight_states
from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.atmosphere import HEAT_CAPACITY_RATIO
from strainfmu.estimator.air_inputs import ALTITUDE, DYNAMIC_PRESSURE, MACH_NUMBER, STATIC_PRESSURE
from strainfmu.estimator.map.flight_tables import LOG_PRESSURE, MACH, U, W, evaluate
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.nonlinear_map import ManifoldMap
from strainfmu.estimator.policies import RANGE_TOLERANCE
from strainfmu.estimator.reference.nonlinear import strain_covariance
from strainfmu.flight_condition import FlightCondition

KNOWN = (MACH_NUMBER, STATIC_PRESSURE, DYNAMIC_PRESSURE)
"""Navigation, by the names of the estimator's arguments; ``altitude`` stands for p_inf too."""

EXACT = 1e-4
"""Relative standard deviation of a q_inf that is known exactly; a smaller one changes nothing."""

PIECE = 500
"""Flights at a time: their covariances are n_d by n_d each."""


def cramer_rao_bound(
    inverse_map: InverseMap,
    conditions: Sequence[FlightCondition],
    known: Collection[str],
    dynamic_pressure_std: float = np.nan,
) -> FloatArray | None:
    """Return (k, 5) standard deviations of the coefficients [1]; None of a map without tables.

    They are NaN at conditions beyond the ranges of the map, where its tables say nothing.

    Parameters
    ----------
    conditions : k true flight conditions.
    known : what the estimator is given in addition to strain, as in :data:`KNOWN`.
    dynamic_pressure_std : of the stated q_inf [Pa]; NaN for the map's own.
    """
    manifold = inverse_map.manifold
    if manifold is None:
        return None
    n_d, n_f = len(manifold.error_strain), len(manifold.error_load)
    none = np.zeros((n_d, 1)), np.zeros((n_f, 1))
    sound = replace(
        manifold,
        error_strain=none[0],
        error_load=none[1],
        considered_strain=np.zeros(0),
        considered_load=np.zeros(0),
        considered_response=None,
        parameters=None,
        shape_field=None,
    )
    state = flight_states(conditions)
    of_navigation = _of_navigation(manifold, state, known, dynamic_pressure_std)
    pieces = [slice(first, first + PIECE) for first in range(0, len(state), PIECE)]
    bound = np.concatenate([_bound_at(sound, state[piece], of_navigation[piece]) for piece in pieces])
    return np.where(_inside(manifold, state)[:, None], bound, np.nan)


def _bound_at(sound: ManifoldMap, state: FloatArray, of_navigation: FloatArray) -> FloatArray:
    """Return (k, 5) the bound at ``state`` (k, 4), where navigation has the information (k, 4, 4)."""
    at_state, n = evaluate(sound.tables, state), sound.tables.n_gauges
    mach, pressure = state[:, MACH], np.exp(state[:, LOG_PRESSURE])
    loads = at_state.value[:, n:]
    noise = strain_covariance(sound, sound.gauge_covariance, state)
    by_state = at_state.jacobian[:, :n]
    information = np.swapaxes(by_state, 1, 2) @ np.linalg.solve(noise, by_state) + of_navigation
    scale = 1.0 / (0.5 * HEAT_CAPACITY_RATIO * (mach**2 * pressure)[:, None] * sound.references)
    slope = scale[:, :, None] * (at_state.jacobian[:, n:] - loads[:, :, None] * _by_log(state)[:, None])
    covariance = slope @ np.linalg.solve(information, np.swapaxes(slope, 1, 2))
    return np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))


def _by_log(state: FloatArray) -> FloatArray:
    """Return (k, 4) derivatives of ln q_inf by ``state`` (k, 4)."""
    slope = np.zeros_like(state)
    slope[:, MACH], slope[:, LOG_PRESSURE] = 2.0 / state[:, MACH], 1.0
    return slope


def _of_navigation(
    manifold: ManifoldMap, state: FloatArray, known: Collection[str], dynamic_pressure_std: float
) -> FloatArray:
    """Return (k, 4, 4) the information of navigation and of the ranges of the map."""
    unit = np.eye(state.shape[1])
    information = np.tile(np.diag(manifold.state_prior[1] ** -2.0), (len(state), 1, 1))
    if MACH_NUMBER in known:
        information += np.outer(unit[MACH], unit[MACH]) / manifold.mach_number_error**2
    of_pressure = {STATIC_PRESSURE: manifold.static_pressure_error, ALTITUDE: manifold.altitude_error}
    for error in (of_pressure[name] for name in known if name in of_pressure):
        information += np.outer(unit[LOG_PRESSURE], unit[LOG_PRESSURE]) / error**2
    if DYNAMIC_PRESSURE in known:
        by_log, pressure = _by_log(state), np.exp(state[:, LOG_PRESSURE])
        stated = dynamic_pressure_std / (0.5 * HEAT_CAPACITY_RATIO * state[:, MACH] ** 2 * pressure)
        relative = np.maximum(np.where(np.isnan(stated), manifold.dynamic_pressure_error, stated), EXACT)
        information += by_log[:, :, None] * by_log[:, None] / (relative**2)[:, None, None]
    return information


def _inside(manifold: ManifoldMap, state: FloatArray) -> BoolArray:
    """Return (k,) whether the ranges of the map hold ``state`` (k, 4)."""
    middle, half = manifold.crossflow
    across = (state[:, [U, W]] - middle) / half
    off = np.abs(across).max(axis=1) if manifold.crossflow_range is not None else np.hypot(*across.T)
    low, high = manifold.mach_range
    excess = np.maximum(low - state[:, MACH], state[:, MACH] - high) / low
    return (off <= 1.0 + RANGE_TOLERANCE) & (excess <= RANGE_TOLERANCE)
