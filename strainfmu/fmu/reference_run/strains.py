"""Strains of the reference run of a linear map: states within what its snapshots cover, and their errors."""

from __future__ import annotations

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.other_loads import FIVE_LOADS
from strainfmu.estimator.reference.gain import residual_precision
from strainfmu.estimator.reference.linear import excess_covariance
from strainfmu.fmu.reference_run.flight_path import FlightPath
from strainfmu.fmu.reference_run.reference_flight import ReferenceFlight, white_noise

MOVING_STATES = 5
"""States that move, the first: those that the snapshots use most."""

_WEIGHTS = (0.3, 0.3, 0.1, 0.1, 0.1)
"""Amplitudes, of the largest that a state may have alone; together below 1, so that the motion stays inside."""


def true_states(inverse_map: InverseMap, n_rows: int) -> FloatArray:
    """Return (n, n_q) states that end where they begin.

    Each state alone could reach the bound of the envelope's half-spaces, of the coefficients' ranges or of the
    strains over the snapshots. All of these are convex: a sum of parts that are together below 1 is inside.
    """
    phase = np.linspace(0.0, 2.0 * np.pi, n_rows)
    largest = largest_states(inverse_map)
    states = np.zeros((n_rows, len(largest)))
    for k in range(min(MOVING_STATES, len(largest))):
        turn = (k // 2 + 1) * phase
        states[:, k] = _WEIGHTS[k] * largest[k] * (np.sin(turn) if k % 2 == 0 else np.cos(turn))
    return states


def largest_states(inverse_map: InverseMap) -> FloatArray:
    """Return (n_q,) the size that each state, up or down, may have alone; 0 where nothing bounds it."""
    scale = inverse_map.nominal_dynamic_pressure * inverse_map.references[FIVE_LOADS]
    mean = inverse_map.load_of_mean[FIVE_LOADS] / scale
    per_state = inverse_map.load_per_state[FIVE_LOADS] / scale[:, None]
    low, high = inverse_map.coefficient_range.T
    eye = np.eye(len(mean))
    rows = [(eye, high - mean), (-eye, mean - low)]
    direction = inverse_map.envelope_direction
    rows.append((direction, inverse_map.envelope_limit - direction @ mean))
    change = np.concatenate([a @ per_state for a, _ in rows] + [inverse_map.state_operator])
    room = np.concatenate([b for _, b in rows] + [inverse_map.strain_range - np.abs(inverse_map.mean_strain)])
    # Round-off of a coefficient that a state does not move bounds nothing.
    used = np.abs(change) > 1e-9 * np.max(np.abs(change), axis=0)
    bound = np.where(used, np.maximum(room, 0.0)[:, None] / np.where(used, np.abs(change), 1.0), np.inf)
    smallest = np.min(bound, axis=0)
    return np.where(np.isfinite(smallest), smallest, 0.0)


def flight_of_states(inverse_map: InverseMap, path: FlightPath) -> ReferenceFlight:
    """Return the flight of ``path`` with the states of :func:`true_states`, which scale with the dynamic pressure.

    What a map holds fixed, as the strain of an internal pressure, does not scale.
    """
    states = true_states(inverse_map, len(path.dynamic_pressure))
    ratio = (path.dynamic_pressure / inverse_map.nominal_dynamic_pressure)[:, None]
    d_0, f_0 = inverse_map.fixed_strain, inverse_map.fixed_load
    f_0 = f_0[FIVE_LOADS]
    strain = d_0 + ratio * (inverse_map.mean_strain - d_0 + states @ inverse_map.state_operator.T)
    mean, per_state = inverse_map.load_of_mean[FIVE_LOADS], inverse_map.load_per_state[FIVE_LOADS]
    loads = f_0 + ratio * (mean - f_0 + states @ per_state.T)
    load_per_coefficient = path.dynamic_pressure[:, None] * inverse_map.references[FIVE_LOADS]
    return ReferenceFlight(
        strain=strain,
        loads=loads,
        load_per_coefficient=load_per_coefficient,
        covariance=error_covariance(inverse_map, loads / load_per_coefficient, ratio[:, 0]),
        residual_precision=residual_precision(inverse_map),
        noise_std=white_noise(inverse_map.noise_std, inverse_map.gauge_covariance),
        load_strain_covariance=ratio[:, :, None] ** 2 * inverse_map.strain_load_covariance[:, FIVE_LOADS].T,
    )


def error_covariance(inverse_map: InverseMap, coefficients: FloatArray, ratio: FloatArray) -> FloatArray:
    """Return (k, n_d, n_d) covariance of the errors of the strains [1] at ``coefficients`` (k, 5).

    ``ratio`` (k,) is the dynamic pressure over the nominal one. The map's own covariance holds errors in
    proportion to strain at their mean over the snapshots: :mod:`strainfmu.estimator.map.inverse_map`.
    """
    covariance = np.repeat(inverse_map.noise_covariance[None], len(coefficients), axis=0)
    if not inverse_map.follows_pressure:
        return covariance
    square = (ratio * ratio)[:, None, None]
    return (
        covariance
        + (square - 1.0) * inverse_map.scaled_covariance
        + square * excess_covariance(inverse_map, coefficients)
    )
