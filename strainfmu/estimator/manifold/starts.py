"""Starts of the iterations where no last state is known: a search of the tables."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.estimator.manifold.error_covariance import strain_covariance
from strainfmu.estimator.manifold.flight_tables import LOG_PRESSURE, evaluate
from strainfmu.estimator.manifold.manifold_map import ManifoldMap
from strainfmu.estimator.manifold.navigation import StateMeasurement, predicted

MACHS, INCIDENCES, ROLLS = 3, 6, 16
"""States of the search: Mach numbers, of each the best is a start; incidences; roll angles of the wind."""


@dataclass(frozen=True, eq=False, kw_only=True)
class SearchTable:
    """States of the search.

    Attributes
    ----------
    state : (MACHS, n, 4) flight states at p_inf = 1 Pa.
    strain : (MACHS, n, n_d) strain per p_inf there [1/Pa].
    fixed_strain : (n_d,) that does not follow p_inf [m/m].
    whitening : (n_d,) reciprocal standard deviation of each gauge about the tables in the middle of the range.
    """

    state: FloatArray
    strain: FloatArray
    fixed_strain: FloatArray
    whitening: FloatArray


def search_table(manifold: ManifoldMap) -> SearchTable:
    """Return the states that a start is searched in."""
    n_d = manifold.tables.n_gauges
    mach = np.linspace(manifold.mach_range[0], manifold.mach_range[1], MACHS)
    incidence = manifold.incidence_limit * np.arange(1, INCIDENCES + 1) / INCIDENCES
    roll = 2.0 * np.pi * np.arange(ROLLS) / ROLLS
    u = np.concatenate([[0.0], np.outer(incidence, np.cos(roll)).ravel()])
    w = np.concatenate([[0.0], np.outer(incidence, np.sin(roll)).ravel()])
    state = np.zeros((MACHS, len(u), 4))
    state[:, :, 0], state[:, :, 1], state[:, :, 2] = mach[:, None], u, w
    fixed = manifold.tables.fixed_response[:n_d]
    strain = evaluate(manifold.tables, state.reshape(-1, 4)).value[:, :n_d] - fixed
    middle = float(np.exp(np.log(manifold.pressure_range).mean()))
    at = np.append(state[1, -1, :3], np.log(middle))[None]
    response = evaluate(manifold.tables, at).value
    covariance = strain_covariance(manifold, np.array([middle]), response[:, :n_d], response[:, n_d:])
    return SearchTable(
        state=state,
        strain=strain.reshape(MACHS, -1, n_d),
        fixed_strain=fixed,
        whitening=1.0 / np.sqrt(np.diagonal(covariance[0])),
    )


def starts(table: SearchTable, strain: FloatArray, used: BoolArray, measured: StateMeasurement) -> FloatArray:
    """Return (MACHS, k, 4) the best state of the table at each Mach number, p_inf chosen for each state."""
    weight = np.where(used, table.whitening, 0.0)
    data = np.where(used, strain - table.fixed_strain, 0.0) * weight
    found = np.empty((MACHS, len(strain), 4))
    for i, (states, unit) in enumerate(zip(table.state, table.strain, strict=True)):
        dot = (data * weight) @ unit.T
        size = (weight * weight) @ (unit * unit).T
        pressure = np.clip(dot / np.maximum(size, 1e-300), 10.0, 5e5)
        log_pressure = _with_navigation(np.log(pressure), size * pressure**2, states[0, 0], measured)
        pressure = np.exp(log_pressure)
        cost = -2.0 * pressure * dot + pressure**2 * size
        best = np.argmin(cost, axis=1)
        rows = np.arange(len(strain))
        found[i, :, :3] = states[best, :3]
        found[i, :, LOG_PRESSURE] = log_pressure[rows, best]
    return found


def _with_navigation(
    log_pressure: FloatArray, information: FloatArray, mach: float, measured: StateMeasurement
) -> FloatArray:
    """Return ln p_inf (k, n) that joins strain, of ``information`` (k, n), with navigation at a Mach number."""
    state = np.zeros((len(log_pressure), 4))
    state[:, 0] = mach
    value, jacobian = predicted(state)
    rows = [1, 2, 6]
    precision = measured.precision[:, rows] * jacobian[:, rows, LOG_PRESSURE] ** 2
    target = measured.value[:, rows] - value[:, rows]
    total = information + precision.sum(axis=1)[:, None]
    return np.asarray((information * log_pressure + np.sum(precision * target, axis=1)[:, None]) / total)
