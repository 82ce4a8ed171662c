"""Detectable bias: how large a bias of one gauge must be to raise an alarm, and to be attributed to that gauge.

Design figures of a map, not of a step: with P the precision of the residual (see
:mod:`strainfmu.estimator.linear.isolation`), a bias b of gauge i moves the chi-square's noncentrality to b^2 P_ii
and its own z_i to b sqrt(P_ii).
"""

from __future__ import annotations

from math import erfc, exp, lgamma, log, sqrt

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.health import chi_square_limit, chi_square_survival


def noncentral_survival(value: float, degrees_of_freedom: int, noncentrality: float) -> float:
    """Return the probability that a noncentral chi-square variable exceeds ``value``.

    Source: sum over j of Poisson(j; noncentrality / 2) Q(value; n + 2 j), Abramowitz & Stegun, 26.4.25, over 12
    standard deviations to both sides of the Poisson's mean.
    """
    if noncentrality == 0.0 or value <= 0.0:
        return chi_square_survival(value, degrees_of_freedom)
    mean = 0.5 * noncentrality
    spread = int(12.0 * sqrt(mean) + 40.0)
    first = max(0, int(mean) - spread)
    half, survival = 0.5 * value, chi_square_survival(value, degrees_of_freedom + 2 * first)
    total = 0.0
    for j in range(first, int(mean) + spread):
        total += exp(j * log(mean) - mean - lgamma(j + 1.0)) * survival
        # Q(k + 2) from Q(k), as in chi_square_survival.
        k = 0.5 * degrees_of_freedom + j
        survival += exp(k * log(half) - half - lgamma(k + 1.0))
    return min(total, 1.0)


def detectable_noncentrality(
    degrees_of_freedom: int, false_alarm_probability: float, miss_probability: float
) -> float:
    """Return the noncentrality that a chi-square test of the level given misses with ``miss_probability``.

    Baarda's lambda_0(alpha, beta, n) (1968). One degree of freedom is the two-sided test of one gauge's z: there
    its root is z_(1 - alpha/2) + z_(1 - beta), but for the far tail.

    Raises
    ------
    InputError
        A probability is not between 0 and 1, or a miss is as likely as without any bias.
    """
    if not 0.0 < false_alarm_probability < 1.0:
        raise InputError(f"false alarm probability {false_alarm_probability} found, must be between 0 and 1")
    if not 0.0 < miss_probability < 1.0 - false_alarm_probability:
        raise InputError(
            f"miss probability {miss_probability} found, must be positive and below 1 - false alarm probability, "
            f"{1.0 - false_alarm_probability:.6g}"
        )
    limit = chi_square_limit(degrees_of_freedom, false_alarm_probability)
    low, high = 0.0, limit
    while noncentral_survival(limit, degrees_of_freedom, high) < 1.0 - miss_probability:
        high *= 2.0
    while high - low > 1e-10 * high:
        middle = 0.5 * (low + high)
        if noncentral_survival(limit, degrees_of_freedom, middle) < 1.0 - miss_probability:
            low = middle
        else:
            high = middle
    return high


def minimal_detectable_bias(precision: FloatArray, noncentrality: float) -> FloatArray:
    """Return (n_d,) sqrt(lambda_0 / P_ii) [m/m], infinite for a gauge that no other checks.

    Source: Baarda (1968); Teunissen, Testing Theory: an Introduction (2000). ``precision`` is P (n_d, n_d)
    [1/(m/m)^2], ``noncentrality`` that of :func:`detectable_noncentrality`.
    """
    with np.errstate(divide="ignore"):
        return np.asarray(np.sqrt(noncentrality / np.diag(precision)))


def minimal_isolable_bias(
    precision: FloatArray, correlation: FloatArray, threshold: float, miss_probability: float
) -> FloatArray:
    """Return (n_d,) bias [m/m] of gauge i that is attributed to gauge i with probability 1 - ``miss_probability``.

    Attributed means: |z_i| > ``threshold`` and |z_i| > |z_j| for all j. With delta = b sqrt(P_ii) and rho the
    correlation of z_i and z_j, z_i -+ z_j is normal of mean delta (1 -+ rho) and variance 2 (1 -+ rho); so a miss
    has at most the probability

        Phi(k - delta) + sum_j Phi(-delta sqrt((1 - rho_ij) / 2)) + Phi(-delta sqrt((1 + rho_ij) / 2)),

    Bonferroni's bound on the events of Teunissen, Distributional theory for the DIA method (2018). Infinite where
    |rho| = 1 or nothing checks the gauge. ``correlation`` is that of
    :func:`strainfmu.estimator.linear.isolation.correlations`.

    Raises
    ------
    InputError
        ``miss_probability`` is not between 0 and 1.
    """
    if not 0.0 < miss_probability < 1.0:
        raise InputError(f"miss probability {miss_probability} found, must be between 0 and 1")
    n = len(precision)
    others = correlation[~np.eye(n, dtype=bool)].reshape(n, n - 1)
    apart = np.sqrt(np.maximum(1.0 - np.concatenate([others, -others], axis=1), 0.0) / 2.0)
    deltas = np.array([_isolable_delta(row, threshold, miss_probability) for row in apart])
    with np.errstate(divide="ignore"):
        return np.asarray(deltas / np.sqrt(np.diag(precision)))


def _isolable_delta(apart: FloatArray, threshold: float, miss_probability: float) -> float:
    """Return delta at which the bound on a miss falls to ``miss_probability``, by bisection."""

    def miss(delta: float) -> float:
        return _normal_tail(delta - threshold) + sum(_normal_tail(delta * one) for one in apart.tolist())

    # Two gauges closer than this differ by round-off alone.
    if apart.size and apart.min() < 1e-7:
        return np.inf
    low, high = 0.0, threshold + 1.0
    while miss(high) > miss_probability:
        high *= 2.0
    while high - low > 1e-9 * high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if miss(middle) > miss_probability else (low, middle)
    return high


def _normal_tail(value: float) -> float:
    """Return 1 - Phi(value)."""
    return 0.5 * erfc(value / sqrt(2.0))
