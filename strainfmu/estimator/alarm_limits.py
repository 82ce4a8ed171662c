"""Detection thresholds of an estimator, and the smallest bias of a gauge that they detect.

With P (n_d, n_d) the precision of the residual r = d - m, (P r)_i / P_ii is the difference of gauge i from the
value that all others predict, with variance 1 / P_ii; so z_i = (P r)_i / sqrt(P_ii) is standard normal without a
fault. A bias b of gauge i shifts z_i by b sqrt(P_ii), and gives chi-square the noncentrality b^2 P_ii. Source:
Baarda, A testing procedure for use in geodetic networks (1968), the w-test of "data snooping"; Rasmussen &
Williams, section 5.4.2, for a Gaussian prior.
"""

from __future__ import annotations

from math import erfc, exp, lgamma, log, sqrt
from statistics import NormalDist

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.health import chi_square_limit, chi_square_survival
from strainfmu.estimator.map.nonlinear_map import ManifoldMap

AMBIGUOUS_CORRELATION = 0.9
"""|correlation| of two z above which a 10 sigma bias of one is taken for the other in more than 1 % of cases."""

OUTSIDE_SCORE, OUTSIDE_SCORE_OF_SHAPES = 3.0, 2.0
"""Standard deviations by which the flight state leaves the ranges of the map from which it is outside.

The second holds where angle of attack and sideslip have ranges of their own: these are a few degrees wide, few
standard deviations of the angles. At the very end of a range it takes 1 good flight in 44 for one outside, if
errors are as large as stated.
"""


def outlier_threshold(n_gauges: int, false_alarm_probability: float) -> float:
    """Return the level that the largest |z| of ``n_gauges`` exceeds with no more than the probability given.

    Two-sided, Bonferroni: each gauge gets 1 / n_gauges of the probability, whatever their correlation.
    """
    return -NormalDist().inv_cdf(0.5 * false_alarm_probability / n_gauges)


def shape_limit(manifold: ManifoldMap, alarm_scale: float) -> float:
    """Return the alarm level of the chi-square of the shapes of pressure off the tables."""
    return alarm_scale * manifold.shape_scale * chi_square_limit(max(manifold.discrepancy_shapes.shape[1], 1))


def outside_score(manifold: ManifoldMap) -> float:
    """Return the range score from which a flight is outside."""
    return OUTSIDE_SCORE if manifold.crossflow_range is None else OUTSIDE_SCORE_OF_SHAPES


def inverse_root(precision_diagonal: FloatArray, min_precision: FloatArray | float = 0.0) -> FloatArray:
    """Return 1 / sqrt(P_ii) (n_d,) [m/m], the standard deviation of leave-one-out errors.

    It is 0 where P_ii [1/(m/m)^2] <= ``min_precision``: no other gauge checks this one.
    """
    checked = precision_diagonal > min_precision
    return np.where(checked, 1.0 / np.sqrt(np.where(checked, precision_diagonal, 1.0)), 0.0)


def correlations(precision: FloatArray, min_precision: FloatArray | float = 0.0) -> FloatArray:
    """Return (n_d, n_d) correlations P_ij / sqrt(P_ii P_jj) of z; 0 with gauges that no other checks."""
    scale = inverse_root(np.diag(precision), min_precision)
    return precision * np.outer(scale, scale)


def ambiguous_groups(correlation: FloatArray, limit: float = AMBIGUOUS_CORRELATION) -> tuple[tuple[int, ...], ...]:
    """Return the groups of gauges, by index, that are linked by |correlation| >= ``limit``; each has two or more.

    A bias in one of a group shifts the z of all of it nearly alike (Foerstner 1983; Teunissen 2018 on
    identification): an alarm points to the group.
    """
    linked = np.abs(correlation) >= limit
    np.fill_diagonal(linked, False)
    left = set(np.flatnonzero(linked.any(axis=1)).tolist())
    groups = []
    while left:
        group, new = set(), {min(left)}
        while new:
            group |= new
            new = set(np.flatnonzero(linked[sorted(new)].any(axis=0)).tolist()) - group
        groups.append(tuple(sorted(group)))
        left -= group
    return tuple(groups)


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
    [1/(m/m)^2], ``noncentrality`` comes from :func:`detectable_noncentrality`.
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
    |rho| = 1 or nothing checks the gauge. ``correlation`` comes from
    :func:`correlations`.

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
