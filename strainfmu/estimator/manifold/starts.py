"""Starts of the iterations where no last state is known: a search of the tables."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.estimator.manifold.error_covariance import strain_covariance
from strainfmu.estimator.manifold.navigation import StateMeasurement, predicted
from strainfmu.estimator.tables.flight_tables import LOG_PRESSURE, MACH, U, W, evaluate
from strainfmu.estimator.tables.manifold_map import ManifoldMap

STARTS, MACHS, ROLLS = 6, 3, 16
"""States of the search: incidences, of each the best is a start; Mach numbers; roll angles of the wind.

Strain is nearly in proportion to p_inf times incidence: without navigation the search cannot tell them apart, and
from a wrong incidence the iterations end elsewhere.
"""


@dataclass(frozen=True, eq=False, kw_only=True)
class SearchTable:
    """States of the search.

    Attributes
    ----------
    state : (STARTS, n, 4) flight states at p_inf = 1 Pa, the incidence rising.
    strain : (STARTS, n, n_d) strain per p_inf there [1/Pa].
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
    middle, half = manifold.crossflow
    size = half[:, None, None, None] * (np.arange(STARTS)[:, None, None] + 0.5) / STARTS
    roll = 2.0 * np.pi * np.arange(ROLLS) / ROLLS
    states = np.zeros((STARTS, MACHS, ROLLS, 4))
    states[..., MACH] = mach[:, None]
    states[..., U] = middle[0] + size[0] * np.cos(roll)
    states[..., W] = middle[1] + size[1] * np.sin(roll)
    state = states.reshape(STARTS, -1, 4)
    fixed = manifold.tables.fixed_response[:n_d]
    strain = evaluate(manifold.tables, state.reshape(-1, 4)).value[:, :n_d] - fixed
    pressure = float(np.exp(np.log(manifold.pressure_range).mean()))
    at = np.append(state[STARTS // 2, 0, :3], np.log(pressure))[None]
    response = evaluate(manifold.tables, at).value
    covariance = strain_covariance(manifold, np.array([pressure]), response[:, :n_d], response[:, n_d:])
    return SearchTable(
        state=state,
        strain=strain.reshape(STARTS, -1, n_d),
        fixed_strain=fixed,
        whitening=1.0 / np.sqrt(np.diagonal(covariance[0])),
    )


def starts(table: SearchTable, strain: FloatArray, used: BoolArray, measured: StateMeasurement) -> FloatArray:
    """Return (STARTS, k, 4) the best state of the table at each incidence, p_inf chosen for each state."""
    weight = np.where(used, table.whitening, 0.0)
    data = np.where(used, strain - table.fixed_strain, 0.0) * weight
    found = np.empty((STARTS, len(strain), 4))
    for i, (states, unit) in enumerate(zip(table.state, table.strain, strict=True)):
        dot = (data * weight) @ unit.T
        size = (weight * weight) @ (unit * unit).T
        pressure = np.clip(dot / np.maximum(size, 1e-300), 10.0, 5e5)
        log_pressure, of_navigation = _with_navigation(
            np.log(pressure), size * pressure**2, states[:, MACH], measured
        )
        with np.errstate(over="ignore", invalid="ignore"):  # of navigation out of every range
            pressure = np.exp(log_pressure)
            cost = pressure**2 * size - 2.0 * pressure * dot + of_navigation
        best = np.argmin(cost, axis=1)
        rows = np.arange(len(strain))
        found[i, :, :3] = states[best, :3]
        found[i, :, LOG_PRESSURE] = log_pressure[rows, best]
    return found


def _with_navigation(
    log_pressure: FloatArray, information: FloatArray, mach: FloatArray, measured: StateMeasurement
) -> tuple[FloatArray, FloatArray]:
    """Return ln p_inf (k, n) that joins strain, of ``information`` (k, n), with navigation, and its cost (k, n).

    ``mach`` (n,) are the Mach numbers of the states.
    """
    state = np.zeros((len(mach), 4))
    state[:, MACH] = mach
    value, _ = predicted(state)
    rows = [1, 2, 6]  # ln p_inf of navigation, ln q_inf less that of the state, the prior of ln p_inf
    precision = measured.precision[:, None, rows]
    target = measured.value[:, None, rows] - value[None, :, rows]
    total = information + precision.sum(axis=2)
    joined = (information * log_pressure + np.sum(precision * target, axis=2)) / total
    cost = np.sum(precision * (target - joined[:, :, None]) ** 2, axis=2)
    both = [0, 3]  # Mach number of navigation, its prior
    off = measured.value[:, None, both] - mach[None, :, None]
    return np.asarray(joined), np.asarray(cost + np.sum(measured.precision[:, None, both] * off**2, axis=2))
