"""Flight states that fit about as well as the estimated one, where navigation does not tell the pressure.

Strain is nearly in proportion to p_inf times incidence. Without either pressure of navigation the likelihood is a
long and bent ridge, sometimes with a second maximum: the covariance of the linearised problem reaches along its
tangent, and knows nothing of the other maximum. So three more states are looked at,

- the two at three deviations of ln p_inf to either side, the other states there being the best: with dD the
  excess of their deviance (-2 ln likelihood), 3 sigma reach 3 / sqrt(dD) of the way there (a profile of the
  likelihood, Venzon and Moolgavkar, Applied Statistics 37, 1988);
- of the states at which the search ended the farthest that the covariance does not explain,

and every deviation is as large as the largest of them needs. Of a linear problem that is the deviation itself.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray, IntArray
from strainfmu.estimator.further_loads import SECTION_LOADS
from strainfmu.estimator.manifold.gauss_newton import (
    LARGEST_STEP,
    Linearised,
    Samples,
    deviance,
    kept_in_reach,
    linearise_anew,
)
from strainfmu.estimator.manifold.load_solution import load_solution
from strainfmu.estimator.manifold.navigation import StateMeasurement
from strainfmu.estimator.tables.flight_tables import LOG_PRESSURE, N_STATES
from strainfmu.estimator.tables.manifold_map import ManifoldMap

TOLD = 100.0
"""Precision of ln p_inf, or of ln q_inf, of navigation from which it tells the pressure: known to a tenth."""

ASIDE, LARGEST_ASIDE, ITERATIONS = 3.0, 3.0, 3
"""Deviations of ln p_inf to either side, the largest change of it, and iterations of the other states there."""

UNLIKELY = (16.0, 25.0)
"""Excess of the deviance from which, and from which on not at all, a state counts less."""

UNEXPLAINED = (4.0, 9.0)
"""Square of the distance, in deviations, less the excess of the deviance, from which a state of the search counts,
and from which it counts fully. Of a linear problem it is 0."""

LEAST_EXCESS = 4.0
"""Excess of the deviance that a state has at least."""

N_WIDENING = N_STATES + 10
"""Flight state, loads, coefficients."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Ends:
    """Where the iterations from the s states of a search end, for k samples.

    Attributes
    ----------
    state : (s, k, 4).
    deviance : (s, k).
    """

    state: FloatArray
    deviance: FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class Widened:
    """Factors on covariances (k, n, n), and on variances (k, m) of further loads."""

    state: FloatArray | float = 1.0
    loads: FloatArray | float = 1.0
    coefficients: FloatArray | float = 1.0
    further_loads: FloatArray | float = 1.0
    further_coefficients: FloatArray | float = 1.0

    @classmethod
    def of(cls, factor: FloatArray | None, n_further: int) -> Widened:
        """Return those of ``factor`` (k, 14) of :func:`widening`, None for none."""
        if factor is None:
            return cls()
        state, loads, coefficients = np.split(factor, [N_STATES, N_STATES + 5], axis=1)
        return cls(
            state=_of_covariance(state),
            loads=_of_covariance(loads),
            coefficients=_of_covariance(coefficients),
            further_loads=_of_further(loads, n_further) ** 2,
            further_coefficients=_of_further(coefficients, n_further) ** 2,
        )


def _of_covariance(factor: FloatArray) -> FloatArray:
    """Return (k, n, n) factors on a covariance whose deviations grow by ``factor`` (k, n).

    The smaller of two, squared: less 1 it is a covariance, and so is its product by entries with one (Schur). No
    combination, such as q_inf or a moment about another point, becomes more certain; equal factors scale all.
    """
    return np.minimum(factor[:, :, None], factor[:, None, :]) ** 2


def _of_further(factor: FloatArray, n_further: int) -> FloatArray:
    """Return (k, m) the ``factor`` (k, 5) of the load of the same kind; the largest for rolling and torsion."""
    largest = factor.max(axis=1, keepdims=True)
    sections = max(n_further - 1, 0) // len(SECTION_LOADS)
    parts = [largest, np.repeat(factor, sections, axis=1), np.repeat(largest, sections, axis=1)]
    return np.concatenate(parts, axis=1)[:, :n_further]


def pressure_untold(measured: StateMeasurement) -> BoolArray:
    """Return (k,) whether navigation tells neither p_inf nor q_inf."""
    return np.asarray(measured.precision[:, 1] + measured.precision[:, 2] < TOLD)


def widening(manifold: ManifoldMap, at: Linearised, samples: Samples, ends: Ends) -> FloatArray | None:
    """Return (k, 14) factors, 1 at least, on the deviations of state, loads and coefficients; None if all are 1.

    ``at`` is weighted by S at its own state; ``ends`` are those of the search.
    """
    out = np.ones((len(at.state), N_WIDENING))
    rows = np.flatnonzero(pressure_untold(samples.measured) & samples.used.any(axis=1))
    if len(rows) == 0:
        return None
    at, samples = at.rows(rows), samples.rows(rows)
    base = _Estimated.of(manifold, at, samples, _inverse(at.hessian))
    largest = base.variance
    asides = [_aside(manifold, at, samples, base, sign) for sign in (1.0, -1.0)]
    for weight, variance in (*asides, _other_end(manifold, at, samples, base, ends, rows)):
        larger = base.variance + weight[:, None] * (variance - base.variance)
        largest = np.where(larger > largest, larger, largest)  # not where it is no number
    with np.errstate(invalid="ignore"):  # of navigation out of every range
        ratio = largest / base.variance
    out[rows] = np.sqrt(np.where((ratio > 1.0) & np.isfinite(ratio), ratio, 1.0))
    return out


@dataclass(frozen=True, eq=False, kw_only=True)
class _Estimated:
    """State, loads and coefficients (k, 14) at a flight state, their variances and its deviance (k,)."""

    value: FloatArray
    variance: FloatArray
    deviance: FloatArray

    @classmethod
    def of(cls, manifold: ManifoldMap, at: Linearised, samples: Samples, covariance: FloatArray) -> _Estimated:
        found = load_solution(manifold, at, samples.used, covariance)
        spread = (covariance, found.load_covariance, found.coefficient_covariance)
        return cls(
            value=np.concatenate([at.state, found.loads, found.coefficients], axis=1),
            variance=np.concatenate([np.diagonal(one, axis1=1, axis2=2) for one in spread], axis=1),
            deviance=deviance(at),
        )


def _inverse(matrix: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.inv(matrix), dtype=np.float64)


def _aside(
    manifold: ManifoldMap, at: Linearised, samples: Samples, base: _Estimated, sign: float
) -> tuple[FloatArray, FloatArray]:
    """Return weight (k,) and variance (k, 14) of the state at deviations of ln p_inf to one side."""
    along = _inverse(at.hessian)[:, :, LOG_PRESSURE]
    own = along[:, LOG_PRESSURE]
    size = np.minimum(ASIDE * np.sqrt(own), LARGEST_ASIDE)
    state = kept_in_reach(manifold, at.state + (sign * size / own)[:, None] * along)
    found = linearise_anew(manifold, state, samples)
    for _ in range(ITERATIONS):
        step = np.zeros_like(state)
        inner = found.hessian[:, :LOG_PRESSURE, :LOG_PRESSURE]
        step[:, :LOG_PRESSURE] = np.linalg.solve(inner, found.gradient[:, :LOG_PRESSURE, None])[:, :, 0]
        far = np.max(np.abs(step) / LARGEST_STEP, axis=1, keepdims=True)
        state = kept_in_reach(manifold, found.state + step / np.maximum(far, 1.0))
        found = linearise_anew(manifold, state, samples)
    covariance = np.zeros_like(found.hessian)  # that of ln p_inf is the distance itself
    inner = found.hessian[:, :LOG_PRESSURE, :LOG_PRESSURE]
    covariance[:, :LOG_PRESSURE, :LOG_PRESSURE] = _inverse(inner)
    other = _Estimated.of(manifold, found, samples, covariance)
    excess = other.deviance - base.deviance
    part = 1.0 / np.maximum(excess, LEAST_EXCESS)
    return 1.0 - _risen(excess, UNLIKELY), other.variance + part[:, None] * (other.value - base.value) ** 2


def _other_end(
    manifold: ManifoldMap, at: Linearised, samples: Samples, base: _Estimated, ends: Ends, rows: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Return weight (k,) and variance (k, 14) of the farthest of ``ends`` that fits, k of whose samples are
    ``rows``."""
    weight, square = _of_end(at, ends.state[:, rows], ends.deviance[:, rows] - base.deviance)
    score = np.where(weight > 0.0, weight * square, 0.0)
    farthest, is_one = np.argmax(score, axis=0), np.any(score > 0.0, axis=0)
    found = linearise_anew(manifold, ends.state[farthest, rows], samples)
    other = _Estimated.of(manifold, found, samples, _inverse(found.hessian))
    weight, _ = _of_end(at, found.state, other.deviance - base.deviance)
    return np.where(is_one, weight, 0.0), other.variance + (other.value - base.value) ** 2 / LEAST_EXCESS


def _of_end(at: Linearised, state: FloatArray, excess: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return weights (.., k) of ``state`` (.., k, 4) of an ``excess`` (.., k), and squares of distances."""
    apart = state - at.state
    square = np.einsum("...kx,kxy,...ky->...k", apart, at.hessian, apart)
    unexplained = square - np.maximum(excess, 0.0)
    return _risen(unexplained, UNEXPLAINED) * (1.0 - _risen(excess, UNLIKELY)), square


def _risen(value: FloatArray, ends: tuple[float, float]) -> FloatArray:
    """Return 0 below the first of ``ends``, 1 above the second, between them a straight line."""
    return np.asarray(np.clip((value - ends[0]) / (ends[1] - ends[0]), 0.0, 1.0))
