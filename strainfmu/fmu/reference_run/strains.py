"""Strains of a reference run: motion within what a map's snapshots cover, errors, one failing gauge."""

from __future__ import annotations

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.proportional_errors import PAIRS, ErrorModel, excess_products
from strainfmu.fmu.reference_run.flight_motion import motion_coefficients, motion_strains

MOVING_STATES = 5
"""States that move, the first: those that the snapshots use most."""

PERSISTENCE = 0.97
"""Correlation of the errors of a row with those of the run: most of them belong to the hardware."""

FAULT_SIZE = 15.0
"""Error of the failing gauge, in standard deviations of its residual."""

_WEIGHTS = (0.3, 0.3, 0.1, 0.1, 0.1)
"""Amplitudes, of the largest that a state may have alone; together below 1, so that the motion stays inside."""

_SEED = 20


def true_states(inverse_map: InverseMap, n_rows: int) -> FloatArray:
    """Return (n, n_q) states of a whole turn.

    Each state alone could reach the bound of the envelope's half-spaces, of the coefficients' ranges or of the
    strains over the snapshots. All of these are convex: a sum of parts that are together below 1 is inside.
    """
    phase = 2.0 * np.pi * np.arange(n_rows) / (n_rows - 1)
    largest = largest_states(inverse_map)
    moving = min(MOVING_STATES, len(largest))
    states = np.zeros((len(phase), len(largest)))
    for k in range(moving):
        turn = (k // 2 + 1) * phase
        states[:, k] = _WEIGHTS[k] * largest[k] * (np.sin(turn) if k % 2 == 0 else np.cos(turn))
    return states


def largest_states(inverse_map: InverseMap) -> FloatArray:
    """Return (n_q,) the size that each state, up or down, may have alone; 0 where nothing bounds it."""
    mean, per_state = true_coefficients(inverse_map)
    low, high = inverse_map.coefficient_range.T
    eye = np.eye(len(mean))
    rows = [(eye, high - mean), (-eye, mean - low)]
    if inverse_map.envelope_direction is not None and inverse_map.envelope_limit is not None:
        direction = inverse_map.envelope_direction
        rows.append((direction, inverse_map.envelope_limit - direction @ mean))
    change = np.concatenate([a @ per_state for a, _ in rows] + [inverse_map.state_operator])
    room = np.concatenate([b for _, b in rows] + [inverse_map.strain_range - np.abs(inverse_map.mean_strain)])
    # Round-off of a coefficient that a state does not move bounds nothing.
    used = np.abs(change) > 1e-9 * np.max(np.abs(change), axis=0)
    bound = np.where(used, np.maximum(room, 0.0)[:, None] / np.where(used, np.abs(change), 1.0), np.inf)
    smallest = np.min(bound, axis=0)
    return np.where(np.isfinite(smallest), smallest, 0.0)


def true_coefficients(inverse_map: InverseMap) -> tuple[FloatArray, FloatArray]:
    """Return (5,) coefficients of the mean and (5, n_q) their change with each state, at the nominal q_inf."""
    force = inverse_map.nominal_dynamic_pressure * inverse_map.reference_area
    scale = force * np.array([1.0, 1.0, 1.0, inverse_map.reference_length, inverse_map.reference_length])
    return inverse_map.load_of_mean / scale, inverse_map.load_per_state / scale[:, None]


def reference_truth(inverse_map: InverseMap, n_rows: int) -> FloatArray:
    """Return (n, 5) true coefficients of the run [1]."""
    if inverse_map.manifold is not None:
        return motion_coefficients(inverse_map.manifold, n_rows)
    mean, per_state = true_coefficients(inverse_map)
    return mean + true_states(inverse_map, n_rows) @ per_state.T


def reference_strains(inverse_map: InverseMap, n_rows: int) -> tuple[FloatArray, BoolArray]:
    """Return (n, n_d) strains [m/m], and (n,) whether the gauge fails.

    They are those of a motion over the flight state where the map has tables of it; of any other map they are at
    the nominal dynamic pressure.

    Errors have the covariance that the map states: gauge noise, hardware, what its modes leave out.
    """
    healthy, covariance = _healthy_strains(inverse_map, n_rows)
    random = np.random.Generator(np.random.PCG64(_SEED))
    lasting = random.standard_normal(inverse_map.n_gauges)
    fresh = random.standard_normal((n_rows, inverse_map.n_gauges))
    drawn = PERSISTENCE * lasting + np.sqrt(1.0 - PERSISTENCE**2) * fresh
    strain = healthy + np.einsum("kij,kj->ki", _root(covariance), drawn)
    gauge, size = failing_gauge(inverse_map)
    row = np.arange(n_rows)
    fails = (row >= n_rows // 2) & (row < 3 * n_rows // 4)
    strain[fails, gauge] += size
    return strain, fails


def _healthy_strains(inverse_map: InverseMap, n_rows: int) -> tuple[FloatArray, FloatArray]:
    """Return (n, n_d) strains without errors, and (n, n_d, n_d) the covariance of the errors."""
    if inverse_map.manifold is not None:
        return motion_strains(inverse_map.manifold, n_rows)
    states, coefficients = true_states(inverse_map, n_rows), reference_truth(inverse_map, n_rows)
    healthy = inverse_map.mean_strain + states @ inverse_map.state_operator.T
    return healthy, error_covariance(inverse_map, coefficients)


def error_covariance(inverse_map: InverseMap, coefficients: FloatArray) -> FloatArray:
    """Return (k, n_d, n_d) covariance of the errors of the strains [1] at ``coefficients`` (k, 5).

    The map's own holds errors in proportion to strain at their mean over the snapshots:
    :mod:`strainfmu.estimator.map.proportional_errors`.
    """
    covariance = np.repeat(inverse_map.noise_covariance[None], len(coefficients), axis=0)
    of_gauge, common, mean_product = (
        inverse_map.gauge_error_product,
        inverse_map.common_error,
        inverse_map.mean_product,
    )
    if of_gauge is None or common is None or mean_product is None:
        return covariance
    errors = ErrorModel(of_gauge=of_gauge, common=common, mean_product=mean_product)
    excess = excess_products(errors, coefficients)
    diagonal = np.arange(inverse_map.n_gauges)
    covariance[:, diagonal, diagonal] += excess @ of_gauge
    for pair, (a, b) in enumerate(PAIRS):
        product = common[:, a].T @ common[:, b]
        covariance += excess[:, pair, None, None] * (product if a == b else product + product.T)
    return covariance


def _root(covariance: FloatArray) -> FloatArray:
    """Return the symmetric square root of (k, n, n) matrices, the only one that every machine finds alike."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray((vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]) @ vectors.transpose(0, 2, 1))


def failing_gauge(inverse_map: InverseMap) -> tuple[int, float]:
    """Return index and error [m/m] of the gauge that fails: the one whose error is best seen and told."""
    whitening = inverse_map.residual_whitening
    precision = whitening.T @ whitening
    variance = np.diag(precision)
    checked = np.where(variance > 0.0, variance, 1.0)
    alike = precision**2 / np.outer(checked, checked)
    np.fill_diagonal(alike, 0.0)
    gauge = int(np.argmax(variance * (1.0 - np.max(alike, axis=0))))
    return gauge, FAULT_SIZE / float(np.sqrt(checked[gauge]))
