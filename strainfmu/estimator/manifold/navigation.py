"""What is known of the flight state beside strain: navigation, each with a standard deviation, and weak priors."""

from __future__ import annotations

from dataclasses import dataclass
from math import log

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray, IntArray
from strainfmu.atmosphere import HEAT_CAPACITY_RATIO, static_pressure_at
from strainfmu.estimator.air_data import NAVIGATION as NAVIGATION
from strainfmu.estimator.linear.isolation import outlier_threshold
from strainfmu.estimator.policies import FALSE_ALARMS as FALSE_ALARMS
from strainfmu.estimator.policies import NAVIGATION_ALARM as NAVIGATION_ALARM
from strainfmu.estimator.tables.flight_tables import LOG_PRESSURE, MACH, N_STATES, U, W
from strainfmu.estimator.tables.manifold_map import ManifoldMap

LEAST_RELATIVE_STD = 1e-3
"""Least standard deviation of a quantity of navigation over its value. A smaller one would say no more of the
loads, and the iterations would have to end that near to the value of navigation."""

DISCERNED = 16.0
"""Difference of two sums of squares from which the quantity that leaves the larger one is not the wrong one."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Navigation:
    """Values of navigation of k samples, NaN where not known, and their standard deviations.

    Attributes
    ----------
    value, std : (k, 3) M [1], p_inf [Pa], q_inf [Pa].
    """

    value: FloatArray
    std: FloatArray

    def rows(self, rows: slice | IntArray) -> Navigation:
        """Return the samples ``rows``."""
        return Navigation(value=self.value[rows], std=self.std[rows])


@dataclass(frozen=True, eq=False, kw_only=True)
class StateMeasurement:
    """Linear knowledge of the flight state of k samples: navigation, then priors.

    Pressures count as logarithms, in which q_inf = gamma / 2 M^2 p_inf is linear but for ln M.

    Attributes
    ----------
    value : (k, 7) M, ln p_inf, ln q_inf; then the priors' M, u, w, ln p_inf.
    precision : (k, 7) 1 / variance; 0 where not known.
    """

    value: FloatArray
    precision: FloatArray


def pressure_by_altitude(altitude: FloatArray) -> FloatArray:
    """Return p(h) [Pa] (k,); NaN where h is not known, 0, which no flight has, where it is above the
    atmosphere."""
    found = static_pressure_at(altitude)
    return np.where(np.isnan(found) & ~np.isnan(altitude), 0.0, found)


def state_measurement(manifold: ManifoldMap, navigation: Navigation) -> StateMeasurement:
    """Return what ``navigation`` and the ranges of ``manifold`` say of the flight state."""
    value, std = navigation.value, navigation.std
    known = np.isfinite(value) & (value > 0.0) & np.isfinite(std) & (std > 0.0)
    number = np.where(known, value, 1.0)
    rows = np.column_stack([number[:, 0], np.log(number[:, 1]), np.log(number[:, 2])])
    with np.errstate(over="ignore", divide="ignore"):
        scale = np.where(known, std, 1.0) / np.column_stack([np.ones(len(value)), number[:, 1:]])
        weight = 1.0 / scale**2
    precision = np.where(known & np.isfinite(weight), weight, 0.0)
    rows = np.where(precision > 0.0, rows, 0.0)  # the square of what counts for nothing may overflow
    mean, weight = prior(manifold)
    k = len(value)
    return StateMeasurement(
        value=np.hstack([rows, np.broadcast_to(mean, (k, N_STATES))]),
        precision=np.hstack([precision, np.broadcast_to(weight, (k, N_STATES))]),
    )


def prior(manifold: ManifoldMap) -> tuple[FloatArray, FloatArray]:
    """Return mean (4,) and precision (4,) of the flight state where nothing is known: the ranges of the map.

    The standard deviation is half the range; that of u and w of a body of revolution is the largest incidence.
    """
    low, high = np.log(manifold.pressure_range)
    middle, half = manifold.mach_range.mean(), max(0.5 * np.ptp(manifold.mach_range), 0.1)
    mean, std = np.empty(N_STATES), np.empty(N_STATES)
    mean[MACH], std[MACH] = middle, half
    mean[U : W + 1], std[U : W + 1] = manifold.crossflow
    mean[LOG_PRESSURE], std[LOG_PRESSURE] = 0.5 * (low + high), 0.5 * (high - low)
    return mean, 1.0 / std**2


def predicted(state: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return (k, 7) what the measurement would read at ``state`` (k, 4), and its derivative (k, 7, 4)."""
    mach, log_pressure = state[:, MACH], state[:, LOG_PRESSURE]
    log_mach = np.log(np.maximum(mach, 0.1))
    value = np.column_stack(
        [mach, log_pressure, log(0.5 * HEAT_CAPACITY_RATIO) + 2.0 * log_mach + log_pressure, state]
    )
    jacobian = np.zeros((len(state), 7, N_STATES))
    jacobian[:, 0, MACH] = jacobian[:, 1, LOG_PRESSURE] = jacobian[:, 2, LOG_PRESSURE] = 1.0
    jacobian[:, 2, MACH] = 2.0 / np.maximum(mach, 0.1)
    jacobian[:, 3:] = np.eye(N_STATES)
    return value, jacobian


_LIMITS = np.array([outlier_threshold(1, rate) for rate in FALSE_ALARMS])


def inconsistent_navigation(residual: FloatArray) -> BoolArray:
    """Return (k, 3) the quantity of navigation that fits strain and the others worst, where it does not fit.

    ``residual`` (k, 3) are standardised leave-one-out residuals.
    """
    excess = np.abs(residual) / _LIMITS
    worst, rows = np.argmax(excess, axis=1), np.arange(len(residual))
    out = np.zeros(residual.shape, dtype=bool)
    out[rows, worst] = excess[rows, worst] > 1.0
    return out


def doubted_precision(precision: FloatArray, residual: FloatArray, dropped: BoolArray) -> FloatArray:
    """Return the precision (k, 3) of navigation once ``dropped`` (k, 3) quantities do not count.

    It may as well be one of the others that is wrong, where it would leave a sum of squares larger by less than
    :data:`DISCERNED`, and, below :data:`NAVIGATION_ALARM`, any of them or none: such ones count with deviations
    larger by the standardised ``residual`` (k, 3) of the one that is dropped, and one more for the noise in it.
    Then three of them hold the error, whichever it is.
    """
    size = np.max(np.where(dropped, np.abs(residual), 0.0), axis=1, keepdims=True)
    may_be_wrong = (size <= NAVIGATION_ALARM) | (size * size - residual * residual < DISCERNED)
    widening = np.where((size > 0.0) & may_be_wrong, size + 1.0, 1.0)
    return np.where(dropped, 0.0, precision / (widening * widening))
