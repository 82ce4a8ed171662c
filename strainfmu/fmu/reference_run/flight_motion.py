"""Flow direction of the reference run of a map with tables: strains, their errors, and the true outputs."""

from __future__ import annotations

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.estimator.air_inputs import AIR_DATA_NAMES
from strainfmu.estimator.map.flight_tables import LOG_PRESSURE, MACH, N_STATES, U, W, evaluate
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.nonlinear_map import ManifoldMap
from strainfmu.estimator.other_loads import FIVE_LOADS
from strainfmu.estimator.reference.air import air_data_at
from strainfmu.estimator.reference.nonlinear import strain_covariance
from strainfmu.fmu.reference_run.flight_path import FlightPath
from strainfmu.fmu.reference_run.reference_flight import ReferenceFlight, white_noise

_PITCH, _YAW = (0.25, 0.55), 0.1
"""Least and largest u of a pull-up and push-over, and amplitude of w, of half the ranges that the map covers."""

_ALIKE = 1e-8
"""Least singular value, of the largest, of states that act on strain in ways of their own."""


def flight_states(manifold: ManifoldMap, path: FlightPath) -> FloatArray:
    """Return (n, 4) flight states of ``path``, inside the ranges of ``manifold``: they end where they begin."""
    phase = np.linspace(0.0, 2.0 * np.pi, len(path.mach_number))
    middle, half = manifold.crossflow
    low, high = _PITCH
    state = np.empty((len(phase), N_STATES))
    state[:, MACH], state[:, LOG_PRESSURE] = path.mach_number, np.log(path.static_pressure)
    state[:, U] = middle[0] + half[0] * (low + (high - low) * 0.5 * (1.0 - np.cos(phase)))
    state[:, W] = middle[1] + half[1] * _YAW * np.sin(phase)
    return state


def flight_of_tables(inverse_map: InverseMap, path: FlightPath) -> ReferenceFlight:
    """Return the flight of ``path`` in the tables of ``inverse_map``."""
    manifold = inverse_map.manifold
    assert manifold is not None
    state, n = flight_states(manifold, path), manifold.tables.n_gauges
    value, jacobian = evaluate(manifold.tables, state)
    strain, loads = value[:, :n], value[:, n:]
    covariance = strain_covariance(manifold, manifold.gauge_covariance, state)
    middle = len(state) // 2
    square = (path.static_pressure**2)[:, None, None]
    air_data = dict(zip(AIR_DATA_NAMES, air_data_at(state).T, strict=True))
    return ReferenceFlight(
        strain=strain,
        loads=loads,
        load_per_coefficient=path.dynamic_pressure[:, None] * manifold.references,
        covariance=covariance,
        residual_precision=free_precision(covariance[middle], jacobian[middle, :n]),
        noise_std=white_noise(inverse_map.noise_std, manifold.gauge_covariance),
        load_strain_covariance=square * (manifold.error_load @ manifold.error_strain.T)[FIVE_LOADS],
        air_data={f"air_data.{name}": values for name, values in air_data.items()},
    )


def free_precision(covariance: FloatArray, jacobian: FloatArray) -> FloatArray:
    """Return (n_d, n_d) the precision of strain about tables whose state is free, ``jacobian`` (n_d, 4) by it.

    States may act alike on every gauge, as Mach number and pressure do in newtonian flow.
    """
    whitening = np.linalg.inv(np.linalg.cholesky(covariance))
    columns = whitening @ jacobian
    size = np.linalg.norm(columns, axis=0)
    vectors, value, _ = np.linalg.svd(columns / np.where(size > 0.0, size, 1.0), full_matrices=False)
    free = vectors[:, value > _ALIKE * value[0]]
    return np.asarray(whitening.T @ whitening - (whitening.T @ free) @ (free.T @ whitening))
