"""Health of a flight estimate: chi-square, gauges that do not fit, and the ranges that the tables hold for."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray, IntArray
from strainfmu.estimator.air_data import NAVIGATION
from strainfmu.estimator.alarm_limits import gauge_threshold as gauge_threshold
from strainfmu.estimator.alarm_limits import outside_score as outside_score
from strainfmu.estimator.alarm_limits import shape_limit as shape_limit
from strainfmu.estimator.health import HealthState, chi_square_limit
from strainfmu.estimator.manifold.navigation import Navigation
from strainfmu.estimator.manifold.solve import FlightSolution
from strainfmu.estimator.policies import NAVIGATION_ALARM
from strainfmu.estimator.policies import RANGE_TOLERANCE as RANGE_TOLERANCE
from strainfmu.estimator.tables.flight_tables import LOG_PRESSURE, MACH, U, W
from strainfmu.estimator.tables.manifold_map import ManifoldMap

LARGEST_REST = 1.0
"""Deviations of the flight state that the next iteration may move it by; above, the estimate is degraded."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FlightHealth:
    """Health of k samples.

    Attributes
    ----------
    health : (k,) numbers of :class:`~strainfmu.estimator.health.HealthState`.
    chi_square_limit, degrees_of_freedom : (k,).
    fits : (k,) whether strain and navigation fit the tables.
    suspect : (k,) the gauge, by index, that does not fit the others; -1 for none.
    range_score : (k,) standard deviations by which the flight state leaves the ranges; 0 inside.
    """

    health: IntArray
    chi_square_limit: FloatArray
    degrees_of_freedom: IntArray
    fits: BoolArray
    suspect: IntArray
    range_score: FloatArray


def flight_health(
    manifold: ManifoldMap,
    found: FlightSolution,
    *,
    used: BoolArray,
    navigation: Navigation,
    navigation_used: BoolArray,
    alarm_scale: float,
) -> FlightHealth:
    """Return the health of ``found``: (k, n_d) gauges and (k, 3) quantities of navigation ``used``."""
    k, n = used.shape
    freedom = used.sum(axis=1) + navigation_used.sum(axis=1)
    limit = alarm_scale * manifold.chi_square_scale * np.array(_limits(n + len(NAVIGATION)))[freedom]
    threshold = gauge_threshold(manifold, alarm_scale)
    size = np.abs(found.standardised_residual)
    worst = np.argmax(size, axis=1)
    suspect = np.where(size[np.arange(k), worst] > threshold, worst, -1)
    score = range_score(manifold, found)
    outside = (score > outside_score(manifold)) | _navigation_outside(manifold, navigation, navigation_used)
    fits = np.asarray(found.chi_square <= limit)
    fits &= np.sum(found.shape_residual**2, axis=1) <= shape_limit(manifold, alarm_scale)
    dropped = navigation_alarms(navigation, navigation_used, found.navigation_residual)
    health = np.select(
        [outside, ~fits, suspect >= 0, dropped | ~used.all(axis=1) | (found.rest > LARGEST_REST)],
        [HealthState.OUTSIDE, HealthState.INCONSISTENT, HealthState.SUSPECT, HealthState.DEGRADED],
        HealthState.OK,
    )
    return FlightHealth(
        health=health,
        chi_square_limit=limit,
        degrees_of_freedom=freedom,
        fits=fits,
        suspect=suspect,
        range_score=score,
    )


def whole_chi_square_limit(manifold: ManifoldMap, alarm_scale: float) -> float:
    """Return the alarm level of chi-square with all gauges and all navigation."""
    return alarm_scale * manifold.chi_square_scale * _limits(manifold.tables.n_gauges + len(NAVIGATION))[-1]


@cache
def _limits(largest: int) -> tuple[float, ...]:
    """Return the alarm levels of chi-square for 0 (as for 1) to ``largest`` degrees of freedom."""
    return tuple(chi_square_limit(max(one, 1)) for one in range(largest + 1))


def navigation_alarms(navigation: Navigation, used: BoolArray, residual: FloatArray) -> BoolArray:
    """Return (k,) whether a quantity of navigation has a value that is not used, and no correct one.

    Correct ones are dropped at the rates :data:`~strainfmu.estimator.policies.FALSE_ALARMS`, and the
    loads are right as well. Health alarms at the rate of its other tests.
    """
    size = np.abs(residual)
    may_be_correct = (size > 0.0) & (size <= NAVIGATION_ALARM)
    return np.any(~np.isnan(navigation.value) & ~used & ~may_be_correct, axis=1)


def range_score(manifold: ManifoldMap, found: FlightSolution) -> FloatArray:
    """Return (k,) standard deviations by which the flight state leaves the ranges of the map, 0 inside."""
    state = found.state
    std = np.sqrt(np.diagonal(found.state_covariance, axis1=1, axis2=2))
    slowest, fastest = manifold.mach_range * np.array([1.0 - RANGE_TOLERANCE, 1.0 + RANGE_TOLERANCE])
    low, high = np.log(manifold.pressure_range)
    mach, pressure = state[:, MACH], state[:, LOG_PRESSURE]
    excess = np.column_stack(
        [
            np.maximum(slowest - mach, mach - fastest) / std[:, MACH],
            _crossflow_excess(manifold, state[:, U : W + 1], std[:, U : W + 1]),
            np.maximum(low - pressure, pressure - high) / std[:, LOG_PRESSURE],
        ]
    )
    return np.asarray(np.maximum(excess.max(axis=1), 0.0))


def _crossflow_excess(manifold: ManifoldMap, crossflow: FloatArray, std: FloatArray) -> FloatArray:
    """Return (k,) standard deviations by which u and w (k, 2) leave their ranges."""
    if manifold.crossflow_range is None:
        incidence = np.hypot(crossflow[:, 0], crossflow[:, 1])
        return np.asarray((incidence - (1.0 + RANGE_TOLERANCE) * manifold.incidence_limit) / np.max(std, axis=1))
    middle, half = manifold.crossflow
    excess = np.abs(crossflow - middle) - (1.0 + RANGE_TOLERANCE) * half
    return np.asarray(np.max(excess / std, axis=1))


def _navigation_outside(manifold: ManifoldMap, navigation: Navigation, used: BoolArray) -> BoolArray:
    """Return (k,) whether Mach number or p_inf of navigation, if used, leaves the ranges of the map."""
    outside = np.zeros(len(used), dtype=bool)
    for column, (low, high) in enumerate((manifold.mach_range, manifold.pressure_range)):
        value, slack = navigation.value[:, column], outside_score(manifold) * navigation.std[:, column]
        beyond = (value < (1.0 - RANGE_TOLERANCE) * low - slack) | (value > (1.0 + RANGE_TOLERANCE) * high + slack)
        outside |= beyond & used[:, column]
    return outside
