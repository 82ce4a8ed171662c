"""Gauss-Newton iterations of the flight state: strain and navigation against the tables.

Each minimises |L^-1 (d - y(x))|^2 + sum_i w_i (z_i - h_i(x))^2, S = L L' the covariance of strain about the tables
at an earlier state: S follows the state slowly, and its decomposition is most of the work.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray, IntArray
from strainfmu.estimator.manifold.error_covariance import strain_covariance
from strainfmu.estimator.manifold.navigation import StateMeasurement, doubted_precision, predicted
from strainfmu.estimator.numerics.triangular import forward_substituted
from strainfmu.estimator.policies import LARGEST_STEP as LARGEST_STEP
from strainfmu.estimator.tables.flight_tables import LOG_PRESSURE, MACH, Response, U, evaluate
from strainfmu.estimator.tables.manifold_map import ManifoldMap

SMALLEST_PART = 0.25
"""Least part of a Gauss-Newton step that is taken."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Linearised:
    """Strain and loads of k samples about a flight state.

    Attributes
    ----------
    state : (k, 4).
    residual : (k, n_d) d - y(x) [m/m], 0 of lost gauges.
    loads : (k, 5) of the tables [N, N m].
    strain_jacobian, load_jacobian : (k, n_d, 4), (k, 5, 4); the first 0 of lost gauges.
    factor : (k, n_d, n_d) Cholesky factor L of S, that of the unit matrix for lost gauges.
    whitened : (k, n_d) L^-1 r.
    whitened_jacobian : (k, n_d, 4) L^-1 J.
    innovation : (k, 7) of the measurement.
    measurement_jacobian : (k, 7, 4).
    precision : (k, 7) of the measurement.
    hessian : (k, 4, 4) J' S^-1 J + H' W H.
    gradient : (k, 4) J' S^-1 r + H' W nu.
    cost : (k,) sum of squares.
    factor_pressure : (k,) p_inf that ``factor`` belongs to [Pa]; None for that of ``state``.
    widening : (k, 14) of :func:`~strainfmu.estimator.manifold.ambiguity.widening`; None for none.
    """

    state: FloatArray
    residual: FloatArray
    loads: FloatArray
    strain_jacobian: FloatArray
    load_jacobian: FloatArray
    factor: FloatArray
    whitened: FloatArray
    whitened_jacobian: FloatArray
    innovation: FloatArray
    measurement_jacobian: FloatArray
    precision: FloatArray
    hessian: FloatArray
    gradient: FloatArray
    cost: FloatArray
    factor_pressure: FloatArray | None = None
    widening: FloatArray | None = None

    def rows(self, index: IntArray) -> Linearised:
        """Return the samples of ``index``."""
        values: dict[str, Any] = {entry.name: getattr(self, entry.name) for entry in fields(self)}
        for name, value in values.items():
            values[name] = None if value is None else value[index]
        return Linearised(**values)


@dataclass(frozen=True, eq=False, kw_only=True)
class Samples:
    """What is known of k samples.

    Attributes
    ----------
    strain : (k, n_d) [m/m].
    used : (k, n_d) gauges to use.
    measured : navigation and priors.
    """

    strain: FloatArray
    used: BoolArray
    measured: StateMeasurement

    def rows(self, index: IntArray) -> Samples:
        """Return the samples of ``index``, which may name one more than once."""
        measured = StateMeasurement(value=self.measured.value[index], precision=self.measured.precision[index])
        return Samples(strain=self.strain[index], used=self.used[index], measured=measured)


def strain_factor(manifold: ManifoldMap, state: FloatArray, used: BoolArray) -> FloatArray:
    """Return the Cholesky factor (k, n_d, n_d) of S at ``state`` (k, 4), of the unit matrix for lost gauges."""
    return _factor_of(manifold, state, used, evaluate(manifold.tables, state))


def _factor_of(manifold: ManifoldMap, state: FloatArray, used: BoolArray, response: Response) -> FloatArray:
    n_d, pressure = manifold.tables.n_gauges, np.exp(state[:, LOG_PRESSURE])
    covariance = strain_covariance(manifold, pressure, response.value[:, :n_d], response.value[:, n_d:])
    return np.asarray(np.linalg.cholesky(_without_lost(covariance, used)))


def linearise_anew(manifold: ManifoldMap, state: FloatArray, samples: Samples) -> Linearised:
    """Return the problem of ``samples`` about ``state`` (k, 4), weighted by S there."""
    response = evaluate(manifold.tables, state)
    return _linearised(manifold, state, _factor_of(manifold, state, samples.used, response), samples, response)


def linearise(manifold: ManifoldMap, state: FloatArray, factor: FloatArray, samples: Samples) -> Linearised:
    """Return the problem of ``samples`` about ``state`` (k, 4), weighted by ``factor`` of
    :func:`strain_factor`."""
    return _linearised(manifold, state, factor, samples, evaluate(manifold.tables, state))


def _linearised(
    manifold: ManifoldMap, state: FloatArray, factor: FloatArray, samples: Samples, response: Response
) -> Linearised:
    strain, used, measured = samples.strain, samples.used, samples.measured
    n_d = manifold.tables.n_gauges
    model, loads = response.value[:, :n_d], response.value[:, n_d:]
    residual = np.where(used, strain - model, 0.0)
    jacobian = np.where(used[:, :, None], response.jacobian[:, :n_d], 0.0)
    both = forward_substituted(factor, np.concatenate([residual[:, :, None], jacobian], axis=2))
    whitened, whitened_jacobian = both[:, :, 0], both[:, :, 1:]
    value, of_state = predicted(state)
    innovation = measured.value - value
    weighted = measured.precision[:, :, None] * of_state
    turned = np.swapaxes(whitened_jacobian, 1, 2)
    with np.errstate(over="ignore", invalid="ignore"):  # of navigation out of every range
        of_navigation = np.sum(measured.precision * innovation**2, axis=1)
    return Linearised(
        state=state,
        residual=residual,
        loads=loads,
        strain_jacobian=jacobian,
        load_jacobian=response.jacobian[:, n_d:],
        factor=factor,
        whitened=whitened,
        whitened_jacobian=whitened_jacobian,
        innovation=innovation,
        measurement_jacobian=of_state,
        precision=measured.precision,
        hessian=turned @ whitened_jacobian + np.swapaxes(of_state, 1, 2) @ weighted,
        gradient=np.einsum("knx,kn->kx", whitened_jacobian, whitened)
        + np.einsum("kix,ki->kx", weighted, innovation),
        cost=np.sum(whitened * whitened, axis=1) + of_navigation,
    )


def deviance(at: Linearised) -> FloatArray:
    """Return (k,) -2 ln likelihood, less a constant: what two states of a sample are compared by."""
    return np.asarray(at.cost + 2.0 * np.sum(np.log(np.diagonal(at.factor, axis1=1, axis2=2)), axis=1))


def _without_lost(covariance: FloatArray, used: BoolArray) -> FloatArray:
    """Return S with the rows and columns of lost gauges those of the unit matrix."""
    if used.all():
        return covariance
    both = used[:, :, None] & used[:, None, :]
    out = np.where(both, covariance, 0.0)
    diagonal = np.arange(used.shape[1])
    out[:, diagonal, diagonal] += ~used
    return out


def gauss_newton_step(at: Linearised) -> FloatArray:
    """Return (k, 4) the step to the minimum of the linearised problem."""
    return np.asarray(np.linalg.solve(at.hessian, at.gradient[:, :, None])[:, :, 0])


def stepped(manifold: ManifoldMap, at: Linearised, before: Linearised | None = None) -> FloatArray:
    """Return (k, 4) the next state, inside the reach of the tables; ``before`` is the problem of the last one."""
    step = gauss_newton_step(at)
    if before is not None:
        step = step * _part(at, step, at.state - before.state, gauss_newton_step(before) - step)[:, None]
    size = np.max(np.abs(step) / LARGEST_STEP, axis=1, keepdims=True)
    return kept_in_reach(manifold, at.state + step / np.maximum(size, 1.0))


def _part(at: Linearised, step: FloatArray, change: FloatArray, shrunk: FloatArray) -> FloatArray:
    """Return (k,) the part of ``step`` (k, 4) to take after a ``change`` that has shrunk it by ``shrunk``.

    Where strain curves away from the residual the minimum is steeper than the linearised problem has it: steps are
    too long, beyond twice the distance they end in a cycle of two states. What the last change of the state has
    done to the step tells by how much (Barzilai and Borwein 1988, the shorter step, in the metric of the Hessian).
    """
    turned = (at.hessian @ shrunk[:, :, None])[:, :, 0]
    along, size = np.sum(change * turned, axis=1), np.sum(shrunk * turned, axis=1)
    shorter = (along > 0.0) & (along < size)
    return np.where(shorter, np.maximum(along / np.where(shorter, size, 1.0), SMALLEST_PART), 1.0)


def kept_in_reach(manifold: ManifoldMap, state: FloatArray) -> FloatArray:
    """Return ``state`` (k, 4) not farther beyond the tables than their tangents are good for."""
    low, high = manifold.mach_range
    out = state.copy()
    out[:, MACH] = np.clip(state[:, MACH], 0.7 * low, 1.3 * high)
    angle = np.linalg.norm(state[:, U : U + 2], axis=1, keepdims=True)
    limit = 1.5 * manifold.incidence_limit
    out[:, U : U + 2] = state[:, U : U + 2] * np.minimum(1.0, limit / np.maximum(angle, 1e-12))
    low, high = np.log(manifold.pressure_range)
    out[:, LOG_PRESSURE] = np.clip(state[:, LOG_PRESSURE], low - 1.0, high + 1.0)
    return out


def without_navigation(samples: Samples, residual: FloatArray, dropped: BoolArray) -> Samples:
    """Return ``samples`` without the ``dropped`` (k, 3) quantities of navigation, of ``residual`` (k, 3)."""
    precision = samples.measured.precision.copy()
    precision[:, :3] = doubted_precision(precision[:, :3], residual, dropped)
    return replace(samples, measured=replace(samples.measured, precision=precision))
