"""Isolation of the gauge that is off: leave-one-out residuals, alarm level, ambiguous groups.

P (n_d, n_d) is the precision of the residual r = d - m. For gauge i, (P r)_i / P_ii is how far it reads from what
all others predict, with variance 1 / P_ii; so z_i = (P r)_i / sqrt(P_ii) is standard normal where all is well, and
a bias b of gauge i shifts it by b sqrt(P_ii). Source: Baarda, A testing procedure for use in geodetic networks
(1968), the w-test of "data snooping"; Rasmussen & Williams, section 5.4.2, for a Gaussian prior.
"""

from __future__ import annotations

from statistics import NormalDist

import numpy as np

from strainfmu.arrays import FloatArray

AMBIGUOUS_CORRELATION = 0.9
"""|correlation| of two z above which a 10 sigma bias of one is taken for the other in more than 1 % of cases."""


def inverse_root(precision_diagonal: FloatArray, min_precision: FloatArray | float = 0.0) -> FloatArray:
    """Return 1 / sqrt(P_ii) (n_d,) [m/m], the deviation of leave-one-out errors.

    It is 0 where P_ii [1/(m/m)^2] <= ``min_precision``: no other gauge checks this one.
    """
    checked = precision_diagonal > min_precision
    return np.where(checked, 1.0 / np.sqrt(np.where(checked, precision_diagonal, 1.0)), 0.0)


def outlier_threshold(n_gauges: int, false_alarm_probability: float) -> float:
    """Return the level that the largest |z| of ``n_gauges`` exceeds with no more than the probability given.

    Two-sided, Bonferroni: each gauge gets 1 / n_gauges of the probability, whatever their correlation.
    """
    return -NormalDist().inv_cdf(0.5 * false_alarm_probability / n_gauges)


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


def suspects_by_gauge(
    n_gauges: int, groups: tuple[tuple[int, ...], ...]
) -> np.ndarray[tuple[int], np.dtype[np.object_]]:
    """Return (n_gauges + 1,) the gauges to suspect where |z| of each is the largest, by index; the last is ().

    They are the gauge itself and its ambiguous group. Right for a single faulty gauge; of several at once the
    worst need not be one of them.
    """
    table = np.empty(n_gauges + 1, dtype=object)
    for gauge in range(n_gauges):
        table[gauge] = (gauge,)
    table[n_gauges] = ()
    for group in groups:
        for gauge in group:
            table[gauge] = group
    return table
