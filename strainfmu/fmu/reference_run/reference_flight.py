"""The flight of the reference run as a map has it: strains, true outputs, and the size of their errors.

A linear map flies states within what its snapshots cover, a map with tables flies directions of the flow.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.estimator.air_inputs import AIR_DATA_NAMES
from strainfmu.estimator.map.flight_tables import LOG_PRESSURE, MACH, N_STATES, U, W, evaluate
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, InverseMap
from strainfmu.estimator.map.nonlinear_map import ManifoldMap
from strainfmu.estimator.other_loads import FIVE_LOADS
from strainfmu.estimator.reference.air import air_data_at
from strainfmu.estimator.reference.gain import residual_precision
from strainfmu.estimator.reference.linear import excess_covariance, excess_parts
from strainfmu.estimator.reference.nonlinear import load_errors, strain_covariance
from strainfmu.fmu.reference_run.flight_path import FlightPath

_ROUND_OFF = 1e-9
"""Variance, of the largest and the noise, below which it is round-off."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ReferenceFlight:
    """A flight of n samples as a map of n_d gauges has it, without errors, and the size of these.

    Attributes
    ----------
    strain : (n, n_d) rows of the map [m/m].
    loads : (n, 5) [N, N m].
    load_per_coefficient : (n, 5) q_inf S and q_inf S L [N, N m].
    covariance : (n, k, k) of the errors of strain that last, as the map states them, in ``basis`` [(m/m)^2].
    residual_precision : (n_d, n_d) of what the estimate leaves of the strain, amid the flight [1/(m/m)^2].
    noise_std : (n_d,) of errors that differ from sample to sample [m/m].
    load_strain_covariance : (n, 5, k) of the loads with the errors in ``basis``, as with pressure that no state
        holds.
    basis : (n_d, k) orthonormal strains; None for the strains of single gauges.
    own_std : (n, n_d) of more errors that last, of each gauge alone [m/m].
    air_data : (n,) true, by name of the output of the FMU.
    """

    strain: FloatArray
    loads: FloatArray
    load_per_coefficient: FloatArray
    covariance: FloatArray
    residual_precision: FloatArray
    noise_std: FloatArray
    load_strain_covariance: FloatArray
    basis: FloatArray | None = None
    own_std: FloatArray | float = 0.0
    air_data: Mapping[str, FloatArray] = field(default_factory=dict)

    def sample(self, seed: int) -> tuple[FloatArray, dict[str, FloatArray]]:
        """Return (n, n_d) strains with errors [m/m], and the true outputs (n,) by name.

        All but the noise belongs to hardware and flow: it lasts, and its load is part of the truth.
        """
        random, (n, n_d) = np.random.Generator(np.random.PCG64(seed)), self.strain.shape
        lasting, noise = random.standard_normal((n_d,)), random.standard_normal((n, n_d))
        own = self.own_std * random.standard_normal((n_d,))
        in_basis: FloatArray = lasting if self.basis is None else self.basis.T @ lasting
        values, vectors = np.linalg.eigh(self.covariance)
        values = np.maximum(values, 0.0)
        largest = np.max(np.diagonal(self.covariance, axis1=1, axis2=2), axis=1, keepdims=True)
        above = values + _ROUND_OFF * (largest + np.max(self.noise_std**2))
        # The symmetric root, without what is round-off in it, is the only one that every machine finds alike.
        along = values / np.sqrt(above) * np.einsum("kji,j->ki", vectors, in_basis)
        errors = np.einsum("kij,kj->ki", vectors, along)
        strain = errors if self.basis is None else errors @ self.basis.T
        weighted = along / above
        loads = np.einsum("kli,kij,kj->kl", self.load_strain_covariance, vectors, weighted, optimize=True)
        coefficients = (self.loads + loads) / self.load_per_coefficient
        truth = dict(zip(COEFFICIENT_NAMES, coefficients.T, strict=True))
        return self.strain + strain + own + self.noise_std * noise, {**truth, **self.air_data}


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
    errors = _errors_by_columns if inverse_map.is_low_rank else _errors_of_gauges
    return ReferenceFlight(
        strain=strain,
        loads=loads,
        load_per_coefficient=load_per_coefficient,
        residual_precision=residual_precision(inverse_map),
        **errors(inverse_map, loads / load_per_coefficient, ratio[:, 0]),
    )


def _errors_of_gauges(inverse_map: InverseMap, coefficients: FloatArray, ratio: FloatArray) -> dict[str, Any]:
    """Return the errors of a :class:`ReferenceFlight` by matrices of all gauges."""
    noise_std = white_noise(inverse_map.noise_std, inverse_map.gauge_covariance)
    loads = inverse_map.strain_load_covariance[:, FIVE_LOADS].T
    return {
        "covariance": error_covariance(inverse_map, coefficients, ratio) - np.diag(noise_std**2),
        "noise_std": noise_std,
        "load_strain_covariance": (ratio * ratio)[:, None, None] * loads,
    }


def _errors_by_columns(inverse_map: InverseMap, coefficients: FloatArray, ratio: FloatArray) -> dict[str, Any]:
    """Return the same of many gauges: errors of each alone, and common ones in the basis of all their columns.

    These are the error that does not scale, the columns N of the map, and six columns E of each error that follows
    strain. With [1 N E] = Q T the covariance is Q T diag(c, s^2 1, s^2 P, ..) T' Q', with the products P of
    [1, C] less their mean.
    """
    of_gauge, products = excess_parts(inverse_map, coefficients)
    columns, following = inverse_map.error_strain, inverse_map.common_error
    n_d, k = columns.shape
    basis, triangle = np.linalg.qr(np.hstack([np.ones((n_d, 1)), columns, following.reshape(-1, n_d).T]))
    square = (ratio * ratio)[:, None, None]
    core = np.zeros((len(ratio), triangle.shape[1], triangle.shape[1]))
    core[:, 0, 0] = inverse_map.common_variance
    core[:, 1 : k + 1, 1 : k + 1] = square * np.eye(k)
    for first in range(k + 1, core.shape[1], products.shape[1]):
        some = slice(first, first + products.shape[1])
        core[:, some, some] = square * products
    white = np.minimum(inverse_map.gauge_variance, inverse_map.noise_std**2)
    own = inverse_map.gauge_variance - white + square[:, 0] * (inverse_map.own_error_strain**2 + of_gauge)
    return {
        "covariance": triangle @ core @ triangle.T,
        "basis": basis,
        "own_std": np.sqrt(np.maximum(own, 0.0)),
        "noise_std": np.sqrt(white),
        "load_strain_covariance": square * (inverse_map.error_load[FIVE_LOADS] @ triangle[:, 1 : k + 1].T),
    }


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
    state, n = flight_states(manifold, path), manifold.n_gauges
    value, jacobian = evaluate(manifold.tables, state)
    strain, loads = value[:, :n], value[:, n:]
    covariance = strain_covariance(manifold, manifold.gauge_covariance, state)
    middle, noise_std = len(state) // 2, white_noise(inverse_map.noise_std, manifold.gauge_covariance)
    of_loads, _ = load_errors(manifold, state)
    air_data = dict(zip(AIR_DATA_NAMES, air_data_at(state).T, strict=True))
    return ReferenceFlight(
        strain=strain,
        loads=loads,
        load_per_coefficient=path.dynamic_pressure[:, None] * manifold.references,
        covariance=covariance - np.diag(noise_std**2),
        residual_precision=free_precision(covariance[middle], jacobian[middle, :n]),
        noise_std=noise_std,
        load_strain_covariance=np.swapaxes(of_loads, 1, 2)[:, FIVE_LOADS],
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
