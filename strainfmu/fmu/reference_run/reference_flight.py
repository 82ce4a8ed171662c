"""The flight of the reference run as a map has it: strains, true outputs, and the size of their errors.

A linear map flies states within what its snapshots cover, a map with tables flies directions of the flow.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.estimator.air_inputs import AIR_DATA_NAMES
from strainfmu.estimator.map.flight_tables import LOG_PRESSURE, MACH, N_STATES, U, W, evaluate
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, InverseMap
from strainfmu.estimator.map.nonlinear_map import ManifoldMap
from strainfmu.estimator.other_loads import FIVE_LOADS
from strainfmu.estimator.reference.air import air_data_at
from strainfmu.estimator.reference.gain import residual_precision
from strainfmu.estimator.reference.linear import excess_covariance
from strainfmu.estimator.reference.nonlinear import strain_covariance
from strainfmu.fmu.reference_run.flight_path import FlightPath

_ROUND_OFF = 1e-9
"""Variance, of the largest, below which it is round-off."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ReferenceFlight:
    """A flight of n samples as a map of n_d gauges has it, without errors, and the size of these.

    Attributes
    ----------
    strain : (n, n_d) rows of the map [m/m].
    loads : (n, 5) [N, N m].
    load_per_coefficient : (n, 5) q_inf S and q_inf S L [N, N m].
    covariance : (n, n_d, n_d) of the errors of strain as the map states them [(m/m)^2].
    residual_precision : (n_d, n_d) of what the estimate leaves of the strain, amid the flight [1/(m/m)^2].
    noise_std : (n_d,) of what differs from sample to sample, a part of them [m/m].
    load_strain_covariance : (n, 5, n_d) of their loads with them, as with pressure that no state holds.
    air_data : (n,) true, by name of the output of the FMU.
    """

    strain: FloatArray
    loads: FloatArray
    load_per_coefficient: FloatArray
    covariance: FloatArray
    residual_precision: FloatArray
    noise_std: FloatArray
    load_strain_covariance: FloatArray
    air_data: Mapping[str, FloatArray] = field(default_factory=dict)

    def sample(self, seed: int) -> tuple[FloatArray, dict[str, FloatArray]]:
        """Return (n, n_d) strains with errors [m/m], and the true outputs (n,) by name.

        All but the noise belongs to hardware and flow: it lasts, and its load is part of the truth.
        """
        random, (n, n_d) = np.random.Generator(np.random.PCG64(seed)), self.strain.shape
        lasting, noise = random.standard_normal(n_d), random.standard_normal((n, n_d))
        values, vectors = np.linalg.eigh(self.covariance - np.diag(self.noise_std**2))
        values = np.maximum(values, 0.0)
        above = values + _ROUND_OFF * np.max(np.diagonal(self.covariance, axis1=1, axis2=2), axis=1, keepdims=True)
        # The symmetric root, without what is round-off in it, is the only one that every machine finds alike.
        along = values / np.sqrt(above) * np.einsum("kji,j->ki", vectors, lasting)
        strain = np.einsum("kij,kj->ki", vectors, along)
        weighted = along / above
        loads = np.einsum("kli,kij,kj->kl", self.load_strain_covariance, vectors, weighted, optimize=True)
        coefficients = (self.loads + loads) / self.load_per_coefficient
        truth = dict(zip(COEFFICIENT_NAMES, coefficients.T, strict=True))
        return self.strain + strain + self.noise_std * noise, {**truth, **self.air_data}


def white_noise(noise_std: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return (n_d,) ``noise_std`` as far as the ``covariance`` (n_d, n_d) of the gauges includes it."""
    included = np.linalg.eigvalsh(covariance / np.outer(noise_std, noise_std))[0]
    return np.asarray(noise_std * np.sqrt(np.clip(included, 0.0, 1.0)))


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
