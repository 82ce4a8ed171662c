"""Health of an estimate: its states, the detection thresholds, and the smallest bias of a gauge that they detect.

With P (n_d, n_d) the precision of the residual r = d - m, (P r)_i / P_ii is the difference of gauge i from the
value that all others predict, with variance 1 / P_ii; so z_i = (P r)_i / sqrt(P_ii) is standard normal without a
fault. A bias b of gauge i shifts z_i by b sqrt(P_ii). Source: Baarda, A testing procedure for use in geodetic
networks (1968), the w-test of "data snooping"; Rasmussen & Williams, section 5.4.2, for a Gaussian prior.
"""

from enum import IntEnum
from functools import cache
from math import erfc, exp, lgamma, log, sqrt
from statistics import NormalDist

import numpy as np

from strainfmu.arrays import FloatArray

FALSE_ALARM_PROBABILITY = 1e-4

AMBIGUOUS_CORRELATION = 0.9
"""|correlation| of two z above which a 10 sigma bias of one is taken for the other in more than 1 % of cases."""

MISS_PROBABILITY = 0.01
"""Probability that a bias of the stated detectable size is missed."""


class HealthState(IntEnum):
    """State of an estimate. The numbers are an FMU's output and never change; states are added at the end.

    ``sample/health.c`` of the compiled core has the order in which conditions count.
    """

    OK = 0
    """Strain and dynamic pressure are valid and the residual is as expected."""
    INCONSISTENT = 1
    """The residual's chi-square is above its alarm level: the strains do not fit any known pressure. Or measured
    angles, or the specific force of the stated mass, contradict the loads."""
    NO_COEFFICIENTS = 2
    """Dynamic pressure is not given (0, below, or no number), is above 1e7 Pa, or its standard deviation is
    negative or infinite: no coefficients. A map in form "absolute" still gives loads, and chi-square refers to
    them; in form "dynamic_pressure" nothing is known without q_inf."""
    INVALID = 3
    """No gauge gives a valid strain, or all that do read exactly zero in a flow, as no gauge under load does:
    nothing can be computed, and a filter holds the last loads, with growing sigmas. The linear estimator takes a
    dynamic pressure for a flow, the nonlinear one any sample."""
    DEGRADED = 4
    """Gauges are missing or, of the nonlinear estimator, navigation is left out; the rest identifies the state,
    fits a known pressure, and sigma has grown accordingly. Or matrices for other standard deviations of zero
    offsets are being made over several steps: the old ones, and the old zero offsets, are in use."""
    UNIDENTIFIED = 5
    """Gauges are missing and the others do not identify the state: nothing can be computed. Of the nonlinear
    estimator, fewer than four are left and the linear map does not identify the loads."""
    SUSPECT = 6
    """The chi-square is in order, but one gauge does not fit the others: its z is above its alarm level."""
    OUTSIDE = 7
    """Dynamic pressure, navigation or the estimated coefficients leave what the snapshots of the map cover, or
    navigation contradicts the dynamic pressure: the stated standard deviations need not hold."""

    @property
    def usable(self) -> bool:
        """Whether loads may be used with their standard deviations."""
        return self in USABLE_STATES


USABLE_STATES = (HealthState.OK, HealthState.DEGRADED)
"""States in which loads may be used with their standard deviations; in others they may be wrong, or are none."""

MANY = 512
"""Degrees of freedom above which the survival is one product of ratios of its terms."""

_MOST_STEPS, _SMALLEST_STEP = 50, 1e-14
"""Of Newton's method: their number, and the last one relative to the value."""


def chi_square_survival(value: float, degrees_of_freedom: int) -> float:
    """Return the probability that a chi-square variable exceeds ``value``.

    Source: the recurrence Q(k + 2) = Q(k) + (x/2)^(k/2) e^(-x/2) / Gamma(k/2 + 1)
    (Abramowitz & Stegun, 26.4.8), started from Q(1) = erfc(sqrt(x/2)) or Q(2) = e^(-x/2).
    """
    if value <= 0.0:
        return 1.0
    half = 0.5 * value
    if degrees_of_freedom > MANY:
        k = degrees_of_freedom - 2
        largest = exp(0.5 * k * log(half) - half - lgamma(0.5 * k + 1.0))
        return min(largest * (1.0 + float(np.sum(np.cumprod(np.arange(k, 1, -2) / value)))), 1.0)
    start = 1 if degrees_of_freedom % 2 else 2
    total = erfc(sqrt(half)) if start == 1 else exp(-half)
    for k in reversed(range(start, degrees_of_freedom, 2)):
        term = exp(0.5 * k * log(half) - half - lgamma(0.5 * k + 1.0))
        total += term
        if k < value and term < 1e-20 * total:
            break  # terms below fall
    return min(total, 1.0)


@cache
def chi_square_limit(degrees_of_freedom: int, false_alarm_probability: float = FALSE_ALARM_PROBABILITY) -> float:
    """Return the value that a chi-square variable exceeds with ``false_alarm_probability``.

    By Newton's method for the logarithm of the probability, which is concave: no step passes the value by much.
    """
    half_freedom, wanted = 0.5 * degrees_of_freedom, log(false_alarm_probability)
    value = float(degrees_of_freedom)
    if degrees_of_freedom > MANY:  # Wilson and Hilferty (1931): the cube root is nearly normal
        spread = 2.0 / (9.0 * degrees_of_freedom)
        value *= (1.0 - spread + NormalDist().inv_cdf(1.0 - false_alarm_probability) * sqrt(spread)) ** 3
    for _ in range(_MOST_STEPS):
        survival = chi_square_survival(value, degrees_of_freedom)
        log_density = (half_freedom - 1.0) * log(0.5 * value) - 0.5 * value - lgamma(half_freedom)
        slope = 0.5 * exp(log_density) / survival
        step = (log(survival) - wanted) / slope
        value += step
        if abs(step) <= _SMALLEST_STEP * value:
            break
    return value


def outlier_threshold(n_gauges: int, false_alarm_probability: float) -> float:
    """Return the level that the largest |z| of ``n_gauges`` exceeds with no more than the probability given.

    Two-sided, Bonferroni: each gauge gets 1 / n_gauges of the probability, whatever their correlation.
    """
    return -NormalDist().inv_cdf(0.5 * false_alarm_probability / n_gauges)


def detectable_bias(
    precision: FloatArray, threshold: float, miss_probability: float = MISS_PROBABILITY
) -> FloatArray:
    """Return (n_d,) the bias of each gauge [m/m] that takes its |z| beyond ``threshold`` but for the probability.

    Baarda's (1968), without the far tail. ``precision`` (n_d,) holds P_ii [1/(m/m)^2]; the bias is infinite where
    it is 0, as no other gauge checks this one.
    """
    with np.errstate(divide="ignore"):
        return np.asarray((threshold + NormalDist().inv_cdf(1.0 - miss_probability)) / np.sqrt(precision))
