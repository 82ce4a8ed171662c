"""Motion over the flight state, for the reference run of a map with tables: strains and their errors."""

from __future__ import annotations

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.atmosphere import HEAT_CAPACITY_RATIO
from strainfmu.estimator.manifold.error_covariance import strain_covariance
from strainfmu.estimator.tables.flight_tables import LOG_PRESSURE, MACH, N_STATES, U, W, evaluate
from strainfmu.estimator.tables.manifold_map import ManifoldMap

_PART_OF_RANGE = 0.3
"""Amplitude of Mach number and ln p_inf, of their ranges' halves."""

_INCIDENCES = (0.5, 0.2)
"""Mean and amplitude of the incidence, of its range: its roll angle turns once."""


def flight_motion(manifold: ManifoldMap, n_rows: int) -> FloatArray:
    """Return (n, 4) flight states of a whole turn, inside the ranges of ``manifold``."""
    phase = 2.0 * np.pi * np.arange(n_rows) / (n_rows - 1)
    low, high = np.log(manifold.pressure_range)
    slowest, fastest = manifold.mach_range
    mean, amplitude = _INCIDENCES
    middle, half = manifold.crossflow
    size = half[:, None] * (mean + amplitude * np.cos(2.0 * phase))
    state = np.empty((n_rows, N_STATES))
    state[:, MACH] = 0.5 * (slowest + fastest) + _PART_OF_RANGE * 0.5 * (fastest - slowest) * np.sin(phase)
    state[:, U], state[:, W] = middle[0] + size[0] * np.cos(phase), middle[1] + size[1] * np.sin(phase)
    state[:, LOG_PRESSURE] = 0.5 * (low + high) + _PART_OF_RANGE * 0.5 * (high - low) * np.sin(phase)
    return state


def motion_strains(manifold: ManifoldMap, n_rows: int) -> tuple[FloatArray, FloatArray]:
    """Return (n, n_d) strains without errors [m/m], and (n, n_d, n_d) the covariance of the errors."""
    state, n = flight_motion(manifold, n_rows), manifold.tables.n_gauges
    value = evaluate(manifold.tables, state).value
    pressure = np.exp(state[:, LOG_PRESSURE])
    return value[:, :n], strain_covariance(manifold, pressure, value[:, :n], value[:, n:])


def clean_motion(manifold: ManifoldMap, n_rows: int) -> tuple[FloatArray, FloatArray]:
    """Return (n, n_d) strains without errors [m/m] and (n,) q_inf [Pa] of the motion."""
    state = flight_motion(manifold, n_rows)
    return evaluate(manifold.tables, state).value[:, : manifold.tables.n_gauges], _dynamic_pressure(state)


def motion_coefficients(manifold: ManifoldMap, n_rows: int) -> FloatArray:
    """Return (n, 5) true coefficients of the motion [1]."""
    state = flight_motion(manifold, n_rows)
    loads = evaluate(manifold.tables, state).value[:, manifold.tables.n_gauges :]
    return np.asarray(loads / (_dynamic_pressure(state)[:, None] * manifold.references))


def _dynamic_pressure(state: FloatArray) -> FloatArray:
    """Return (n,) q_inf [Pa] of (n, 4) flight states."""
    return np.asarray(0.5 * HEAT_CAPACITY_RATIO * state[:, MACH] ** 2 * np.exp(state[:, LOG_PRESSURE]))
