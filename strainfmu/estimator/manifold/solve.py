"""Loads, coefficients and air data of k samples from strain and navigation, by the flight state.

f = L(x) + K r with r = d - y(x) and K = Gamma_Ld S^-1: loads of the tables, and what the residual says of pressure
off them. With E_x the covariance of the state, cov f = (J_L - K J) E_x (J_L - K J)' + Gamma_LL - K Gamma_dL.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray, IntArray
from strainfmu.estimator.manifold.ambiguity import Ends, Widened, pressure_untold, widening
from strainfmu.estimator.manifold.further_estimate import further_estimate
from strainfmu.estimator.manifold.gauss_newton import (
    Linearised,
    Samples,
    deviance,
    linearise,
    linearise_anew,
    stepped,
)
from strainfmu.estimator.manifold.load_solution import load_solution
from strainfmu.estimator.manifold.starts import STARTS, SearchTable, starts
from strainfmu.estimator.numerics.triangular import forward_substituted
from strainfmu.estimator.policies import COLD_ITERATIONS as COLD_ITERATIONS
from strainfmu.estimator.policies import START_ITERATIONS as START_ITERATIONS
from strainfmu.estimator.policies import WARM_ITERATIONS as WARM_ITERATIONS
from strainfmu.estimator.tables.flight_tables import LOG_PRESSURE
from strainfmu.estimator.tables.manifold_map import ManifoldMap

BETTER = 9.0
"""-2 ln likelihood by which a state of a search must fit better than that of the last step to count."""

LEAST_SEEN = 1e-9
"""Fraction of the variance of a shape below which what others leave of it is lost in rounding."""

LARGEST_EXCESS = 5.0
"""ln of a pressure over the largest of the tables up to which starts are taken; beyond it S loses its digits."""


@dataclass(frozen=True, eq=False, kw_only=True)
class FlightSolution:
    """Estimates of k samples, all of them arrays over the samples.

    Attributes
    ----------
    state : (k, 4) flight state, and its covariance (k, 4, 4). Covariances and variances hold what else fits.
    loads, coefficients : (k, 5) [N, N m], [1]; covariances (k, 5, 5).
    chi_square : (k,) sum of squares of strain and navigation.
    standardised_residual : (k, n_d) leave-one-out residuals z of the gauges, 0 of lost ones.
    navigation_residual : (k, 3) the same of M, p_inf and q_inf; 0 where not known.
    shape_residual : (k, n_s) standardised sizes of the shapes of pressure off the tables in the residual, each
        what those before it leave: the sum of their squares is chi-square of n_s degrees of freedom.
    rest : (k,) what another iteration would move the state by, in its standard deviations.
    further_loads, further_variance : (k, m) further loads of the map [N, N m], m = 0 for none.
    further_coefficients, further_coefficient_variance : (k, m) the same over q S, moments over q S L [1].
    """

    state: FloatArray
    state_covariance: FloatArray
    loads: FloatArray
    load_covariance: FloatArray
    coefficients: FloatArray
    coefficient_covariance: FloatArray
    chi_square: FloatArray
    standardised_residual: FloatArray
    navigation_residual: FloatArray
    shape_residual: FloatArray
    rest: FloatArray
    further_loads: FloatArray
    further_variance: FloatArray
    further_coefficients: FloatArray
    further_coefficient_variance: FloatArray

    def with_rows(self, rows: IntArray, other: FlightSolution) -> FlightSolution:
        """Return the estimates with those of ``other`` as the samples ``rows``."""
        out = {entry.name: np.array(getattr(self, entry.name)) for entry in fields(self)}
        for name, value in out.items():
            value[rows] = getattr(other, name)
        return FlightSolution(**out)


def solve_cold(manifold: ManifoldMap, table: SearchTable, samples: Samples) -> Linearised:
    """Return the best solution from the states of the search, and what else fits as well.

    Each of them is iterated, S renewed half-way; the best is iterated on, S renewed in every iteration.
    """
    ends = search_ends(manifold, table, samples)
    best = np.argmin(ends.deviance, axis=0)
    at = solve_from(manifold, ends.state[best, np.arange(len(best))], samples)
    return replace(at, widening=widening(manifold, at, samples, ends))


def solve_again(manifold: ManifoldMap, table: SearchTable, state: FloatArray, samples: Samples) -> Linearised:
    """Return the solution of :func:`solve_warm` of the one sample, and what a search finds that fits as well.

    A state of the search counts in its place where it is better by :data:`BETTER`: of two that fit about as well
    the one stays that there is.
    """
    warm, ends = solve_warm(manifold, state, samples), search_ends(manifold, table, samples)
    at, best = linearise_anew(manifold, warm.state, samples), int(np.argmin(ends.deviance[:, 0]))
    if ends.deviance[best, 0] < deviance(at)[0] - BETTER:
        at = warm = solve_from(manifold, ends.state[best], samples)
    return replace(warm, widening=widening(manifold, at, samples, ends))


def search_ends(manifold: ManifoldMap, table: SearchTable, samples: Samples) -> Ends:
    """Return where the iterations from the states of the search end, S renewed half-way."""
    k = len(samples.strain)
    state = starts(table, samples.strain, samples.used, samples.measured).reshape(-1, 4)
    low, high = np.log(manifold.pressure_range)  # a pressure that navigation makes up must not overflow
    state[:, LOG_PRESSURE] = np.clip(state[:, LOG_PRESSURE], low - LARGEST_EXCESS, high + LARGEST_EXCESS)
    each = samples.rows(np.tile(np.arange(k), STARTS))
    before: Linearised | None = None
    for _ in range(2):
        at = linearise_anew(manifold, state, each)
        for _ in range(START_ITERATIONS // 2):
            state = stepped(manifold, at, before)
            before, at = at, linearise(manifold, state, at.factor, each)
    return Ends(state=state.reshape(STARTS, k, 4), deviance=deviance(at).reshape(STARTS, k))


def solve_from(manifold: ManifoldMap, state: FloatArray, samples: Samples) -> Linearised:
    """Return the solution from ``state`` (k, 4), S renewed in every iteration."""
    before: Linearised | None = None
    at = linearise_anew(manifold, state, samples)
    for _ in range(COLD_ITERATIONS):
        state = stepped(manifold, at, before)
        before, at = at, linearise_anew(manifold, state, samples)
    return at


def solve_near(manifold: ManifoldMap, table: SearchTable, state: FloatArray, samples: Samples) -> Linearised:
    """Return the solution from ``state`` (k, 4), and what else fits as well."""
    at = solve_from(manifold, state, samples)
    if not pressure_untold(samples.measured).any():
        return at
    return replace(at, widening=widening(manifold, at, samples, search_ends(manifold, table, samples)))


def solve_warm(manifold: ManifoldMap, state: FloatArray, samples: Samples) -> Linearised:
    """Return the solution from ``state`` (k, 4), or (1, 4) for all, after a fixed number of iterations, with S of
    that state."""
    at, pressure = linearise_anew(manifold, state, samples), np.exp(state[:, LOG_PRESSURE])
    before: Linearised | None = None
    for _ in range(WARM_ITERATIONS):
        before, at = at, linearise(manifold, stepped(manifold, at, before), at.factor, samples)
    return replace(at, factor_pressure=pressure)


def solution(manifold: ManifoldMap, at: Linearised, used: BoolArray) -> FlightSolution:
    """Return the estimates at the solved state ``at``."""
    covariance = np.asarray(np.linalg.inv(at.hessian), dtype=np.float64)
    found = load_solution(manifold, at, used, covariance)
    further = further_estimate(manifold, at, used, found.errors)
    wide = Widened.of(at.widening, further.loads.shape[1])
    return FlightSolution(
        state=at.state,
        state_covariance=wide.state * covariance,
        loads=found.loads,
        load_covariance=wide.loads * found.load_covariance,
        coefficients=found.coefficients,
        coefficient_covariance=wide.coefficients * found.coefficient_covariance,
        chi_square=at.cost,
        standardised_residual=_gauge_residuals(at, covariance, used),
        navigation_residual=_navigation_residuals(at, covariance),
        shape_residual=_shape_residuals(manifold, at, covariance, used),
        rest=np.sqrt(np.maximum(np.einsum("kx,kxy,ky->k", at.gradient, covariance, at.gradient), 0.0)),
        further_loads=further.loads,
        further_variance=wide.further_loads * further.variance,
        further_coefficients=further.coefficients,
        further_coefficient_variance=wide.further_coefficients * further.coefficient_variance,
    )


def _gauge_residuals(at: Linearised, covariance: FloatArray, used: BoolArray) -> FloatArray:
    """Return (k, n_d) (S^-1 r)_i / sqrt(P_ii) with P = S^-1 - S^-1 J E_x J' S^-1: leave-one-out residuals.

    P times the strain that nobody expected, which :mod:`strainfmu.estimator.linear.isolation` takes, is S^-1 r of
    the solution.
    """
    inverse = np.linalg.inv(at.factor)
    back = np.swapaxes(inverse, 1, 2)
    of_state = back @ at.whitened_jacobian
    product = (back @ at.whitened[:, :, None])[:, :, 0]
    diagonal = np.einsum("kmn,kmn->kn", inverse, inverse)
    diagonal = diagonal - np.einsum("knx,kxy,kny->kn", of_state, covariance, of_state)
    checked = used & (diagonal > 0.0)
    return np.where(checked, product / np.sqrt(np.where(checked, diagonal, 1.0)), 0.0)


def _shape_residuals(manifold: ManifoldMap, at: Linearised, covariance: FloatArray, used: BoolArray) -> FloatArray:
    """Return (k, n_s) C^-1 A' P r with C C' = A' P A; A are the shapes, P is that of the gauges."""
    shapes = np.where(used[:, :, None], manifold.shapes, 0.0)
    turned = np.swapaxes(forward_substituted(at.factor, shapes), 1, 2)
    product, of_state = (turned @ at.whitened[:, :, None])[:, :, 0], turned @ at.whitened_jacobian
    alone = turned @ np.swapaxes(turned, 1, 2)
    return independent_sizes(product, alone - of_state @ covariance @ np.swapaxes(of_state, 1, 2), alone)


def independent_sizes(product: FloatArray, variance: FloatArray, alone: FloatArray) -> FloatArray:
    """Return (k, n) C^-1 ``product`` (k, n) with C C' = ``variance`` (k, n, n); 0 where nothing is left to see.

    That is where the variance, given those before, is a rounding error of the one ``alone`` without the state.
    """
    size, factor = np.zeros(product.shape), np.zeros(variance.shape)
    for s in range(product.shape[1]):
        for t in range(s):
            rest = variance[:, s, t] - np.sum(factor[:, s, :t] * factor[:, t, :t], axis=1)
            factor[:, s, t] = np.divide(
                rest, factor[:, t, t], out=np.zeros(len(rest)), where=factor[:, t, t] > 0.0
            )
        left = variance[:, s, s] - np.sum(factor[:, s, :s] ** 2, axis=1)
        seen = left > LEAST_SEEN * alone[:, s, s]
        factor[:, s, s] = np.sqrt(np.where(seen, left, 0.0))
        rest = product[:, s] - np.sum(factor[:, s, :s] * size[:, :s], axis=1)
        size[:, s] = np.divide(rest, factor[:, s, s], out=np.zeros(len(rest)), where=seen)
    return size


def _navigation_residuals(at: Linearised, covariance: FloatArray) -> FloatArray:
    """Return (k, 3) each innovation over its standard deviation, the state estimated without it.

    The innovation is that at the minimum of the linearised problem. A quantity with a small error draws the state
    to its value: what is left is far smaller than the last steps of the iterations.
    """
    jacobian, precision = at.measurement_jacobian[:, :3], at.precision[:, :3]
    turned = jacobian @ covariance
    reached = np.einsum("kix,kix->ki", turned, jacobian)
    innovation = at.innovation[:, :3] - np.einsum("kix,kx->ki", turned, at.gradient)
    variance = np.where(precision > 0.0, 1.0 / np.where(precision > 0.0, precision, 1.0) - reached, 0.0)
    known = variance > 0.0
    return np.where(known, innovation / np.sqrt(np.where(known, variance, 1.0)), 0.0)
