"""Derivatives of the nonlinear estimator by strain and navigation, at the flight state it ends at.

The iterations end where F(x, y) = J(x)' S(x)^-1 (d - y(x)) + H(x)' W (z - h(x)) is zero, S the covariance at that
state. With the estimates g(x, y) the theorem of implicit functions gives

    dg/dy = g_y - g_x F_x^-1 F_y.

F_x holds everything: the second derivatives of the tables times the residual of strain, the change of S with the
state and that of ln M. It is not the matrix of the Gauss-Newton steps, the inverse of the state's covariance. The
partial derivatives are those of complex steps: exact but for rounding.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from strainfmu.arrays import BoolArray, ComplexArray, FloatArray
from strainfmu.atmosphere import HEAT_CAPACITY_RATIO
from strainfmu.errors import InputError
from strainfmu.estimator.manifold.air_data import air_data_of_state
from strainfmu.estimator.manifold.error_covariance import strain_covariance
from strainfmu.estimator.manifold.estimator import ManifoldEstimator
from strainfmu.estimator.manifold.gauss_newton import Samples
from strainfmu.estimator.manifold.inputs import EstimatorInputs
from strainfmu.estimator.manifold.navigation import NAVIGATION, prior, state_measurement
from strainfmu.estimator.manifold.solve import solve_from
from strainfmu.estimator.tables.flight_tables import LOG_PRESSURE, MACH, N_STATES, evaluate
from strainfmu.estimator.tables.manifold_map import ManifoldMap

_STEP = 1e-30
"""Imaginary step relative to the size of an argument."""

LARGEST_REMAINDER = 0.1
"""Standard deviations that the next iteration may still move the state by: farther, F is not zero and the theorem
does not hold, as where the state is kept in the reach of the tables."""

_CONVERGED = 5
"""Times that the iterations are repeated: each leaves a small part of the distance to their end."""


@dataclass(frozen=True, eq=False, kw_only=True)
class EstimateDerivative:
    """Derivatives of the estimates of one sample, about the map's references and moment point.

    Columns are the inputs: strain of the n_d gauges, 0 of lost ones; M, p_inf, q_inf of navigation; their standard
    deviations, each held while the value changes. Those of navigation that is not known are 0. Standard
    deviations of loads are those of the linearised problem, without what else fits
    (:mod:`strainfmu.estimator.manifold.ambiguity`).

    Attributes
    ----------
    state : (4, n_d + 6) of the flight state.
    loads, coefficients : (5, n_d + 6) [N, N m], [1] per unit of the input.
    loads_std, coefficients_std : (5, n_d + 6) of their standard deviations.
    chi_square : (n_d + 6,).
    air_data : (7, n_d + 6) in the order of :data:`~strainfmu.estimator.manifold.air_data.AIR_DATA_NAMES`.
    """

    state: FloatArray
    loads: FloatArray
    coefficients: FloatArray
    loads_std: FloatArray
    coefficients_std: FloatArray
    chi_square: FloatArray
    air_data: FloatArray


def estimate_derivative(estimator: ManifoldEstimator, inputs: EstimatorInputs) -> EstimateDerivative:
    """Return the derivatives at the estimate of the one sample in ``inputs``, navigation used as it is.

    Raises
    ------
    InputError
        No gauge is used, or the flight state is none at which the iterations end.
    """
    manifold, n_d = estimator.manifold, estimator.manifold.tables.n_gauges
    if not inputs.used.any():
        raise InputError("derivatives: no gauge is used")
    samples = Samples(
        strain=np.where(inputs.used, inputs.strain, 0.0),
        used=inputs.used,
        measured=state_measurement(manifold, inputs.navigation),
    )
    at = estimator.search(samples)
    for _ in range(_CONVERGED):
        at = solve_from(manifold, at.state, samples)
    if at.gradient[0] @ np.linalg.solve(at.hessian[0], at.gradient[0]) > LARGEST_REMAINDER**2:
        raise InputError("derivatives: the iterations have not ended: the flight state is beyond the tables")
    known = samples.measured.precision[0, :3] > 0.0
    navigation = inputs.navigation
    values = np.concatenate(
        [
            at.state[0],
            samples.strain[0],
            np.where(known, navigation.value[0], 1.0),
            np.where(known, navigation.std[0], 1.0),
        ]
    )
    n = len(values)
    sizes = np.maximum(np.abs(values), np.where(np.arange(n) < N_STATES + n_d, 1e-6, 1e-3))
    rows = values.astype(np.complex128) + 1j * _STEP * np.diag(sizes)
    both = _conditions(manifold, rows, inputs.used[0], known)
    partial = (both.imag / (_STEP * sizes[:, None])).T
    by_state, by_input = partial[:, :N_STATES], partial[:, N_STATES:]
    by_input[:, :n_d] *= inputs.used[0]
    of_state = -np.linalg.solve(by_state[:N_STATES], by_input[:N_STATES])
    whole = by_input[N_STATES:] + by_state[N_STATES:] @ of_state
    loads, coefficients, loads_std, coefficients_std = whole[:20].reshape(4, 5, -1)
    return EstimateDerivative(
        state=of_state,
        loads=loads,
        coefficients=coefficients,
        loads_std=loads_std,
        coefficients_std=coefficients_std,
        chi_square=whole[20],
        air_data=air_data_of_state(at.state)[1][0] @ of_state,
    )


def _conditions(manifold: ManifoldMap, rows: ComplexArray, used: BoolArray, known: BoolArray) -> ComplexArray:
    """Return (k, 4 + 21) F; then loads, coefficients, their deviations, chi-square; of the ``rows`` (k, n) of
    state, strain, values and deviations of navigation."""
    n_d = manifold.tables.n_gauges
    state, strain, value, std = np.split(rows, [4, 4 + n_d, 7 + n_d], axis=1)
    response = evaluate(manifold.tables, state)  # type: ignore[arg-type]  # complex steps
    model, pressure = response.value, np.exp(state[:, LOG_PRESSURE])
    covariance = strain_covariance(manifold, pressure, model[:, :n_d], model[:, n_d:])
    residual = np.where(used, strain - model[:, :n_d], 0.0)
    jacobian = np.where(used[:, None], response.jacobian[:, :n_d], 0.0)
    square = (pressure * pressure)[:, None, None]
    cross = np.where(used, square * manifold.load_strain_covariance, 0.0)
    covariance = np.where(used[:, None] & used, covariance, np.eye(n_d))
    turned = np.linalg.solve(covariance, np.concatenate([residual[:, :, None], jacobian], axis=2))
    gain = np.swapaxes(np.linalg.solve(covariance, np.swapaxes(cross, 1, 2)), 1, 2)
    gradient = np.einsum("knx,kn->kx", jacobian, turned[:, :, 0])
    hessian = np.swapaxes(jacobian, 1, 2) @ turned[:, :, 1:]
    cost = np.sum(residual * turned[:, :, 0], axis=1)
    for innovation, row, precision in _measurement(manifold, state, value, std, known):
        gradient = gradient + (precision * innovation)[:, None] * row
        hessian = hessian + precision[:, None, None] * row[:, :, None] * row[:, None, :]
        cost = cost + precision * innovation * innovation
    errors = np.linalg.inv(hessian)
    loads = model[:, n_d:] + (gain @ residual[:, :, None])[:, :, 0]
    by_state = response.jacobian[:, n_d:] - gain @ jacobian
    remaining = square * manifold.load_covariance - gain @ np.swapaxes(cross, 1, 2)
    mach = state[:, MACH]
    scale = 1.0 / ((0.5 * HEAT_CAPACITY_RATIO * mach * mach * pressure)[:, None] * manifold.references)
    of_pressure = np.zeros_like(state)
    of_pressure[:, MACH], of_pressure[:, LOG_PRESSURE] = 2.0 / mach, 1.0
    of_log = np.sqrt(np.einsum("kx,kxy,ky->k", of_pressure, errors, of_pressure))
    wider = ((np.exp(3.0 * of_log) - 1.0) / (3.0 * of_log))[:, None]
    coefficients = scale * loads
    of_coefficient = scale[:, :, None] * by_state - coefficients[:, :, None] * of_pressure[:, None, :]
    variance = _diagonal(remaining)
    loads_std = np.sqrt(_spread(by_state, errors) + variance)
    coefficients_std = wider * np.sqrt(_spread(of_coefficient, errors) + scale * scale * variance)
    parts = [gradient, loads, coefficients, loads_std, coefficients_std, cost[:, None]]
    return np.concatenate(parts, axis=1, dtype=np.complex128)


def _measurement(
    manifold: ManifoldMap, state: ComplexArray, value: ComplexArray, std: ComplexArray, known: BoolArray
) -> list[tuple[ComplexArray, ComplexArray, ComplexArray]]:
    """Return innovation (k,), row of the Jacobian (k, 4) and precision (k,) of navigation, then of the priors."""
    unit = np.eye(N_STATES, dtype=np.complex128)
    mach, log_pressure = state[:, MACH], state[:, LOG_PRESSURE]
    of_mach, of_pressure = np.tile(unit[MACH], (len(state), 1)), np.tile(unit[LOG_PRESSURE], (len(state), 1))
    of_both = (2.0 / mach)[:, None] * of_mach + of_pressure
    log_dynamic = np.log(0.5 * HEAT_CAPACITY_RATIO * mach * mach) + log_pressure
    relative = std / value
    found = [
        (value[:, 0] - mach, of_mach, 1.0 / std[:, 0] ** 2),
        (np.log(value[:, 1]) - log_pressure, of_pressure, 1.0 / relative[:, 1] ** 2),
        (np.log(value[:, 2]) - log_dynamic, of_both, 1.0 / relative[:, 2] ** 2),
    ]
    found = [one for one, is_known in zip(found, known[: len(NAVIGATION)], strict=True) if is_known]
    mean, weight = prior(manifold)
    for k in range(N_STATES):
        row = np.tile(unit[k], (len(state), 1))
        found.append((mean[k] - state[:, k], row, np.full(len(state), weight[k], dtype=np.complex128)))
    return found


def _diagonal(matrix: ComplexArray) -> ComplexArray:
    return np.diagonal(matrix, axis1=1, axis2=2)


def _spread(jacobian: ComplexArray, covariance: ComplexArray) -> ComplexArray:
    return np.asarray(np.einsum("kix,kxy,kiy->ki", jacobian, covariance, jacobian), dtype=np.complex128)
