"""Quantised noise: how often a gauge at rest repeats its reading, and how much its readings scatter.

A gauge at rest reads round(u + s z): u in -1/2 .. 1/2 is where its strain lies in a quantisation step, s the
standard deviation of its noise in steps, z standard normal and new every cycle. The probability that m + 1
readings in a row are equal is sum_j p_j(u)^(m + 1), p_j(u) the probability of reading j. Of a gauge that
reads exactly zero it is taken at the worst u, the middle of a step: there all unloaded gauges may be. Elsewhere
u is uniform, and the mean over u is taken.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from math import erf, sqrt

import numpy as np

from strainfmu.arrays import FloatArray, IntArray
from strainfmu.estimator.numerics.quantisation import LARGEST_RATIO

LONGEST_RUN = 63
"""Maximum number of repetitions in the table; longer runs count as so many."""

_SMALLEST_RATIO = 0.02
_N_RATIOS, _N_OFFSETS = 60, 25


@dataclass(frozen=True, eq=False, kw_only=True)
class NoiseTable:
    """What follows from s, for the n_s values of ``ratio``.

    Attributes
    ----------
    ratio : (n_s,) s, rising [1].
    log_repeated : (n_s, LONGEST_RUN + 1) natural logarithm of the probability of m repetitions in a row.
    log_repeated_zero : the same of the reading zero.
    variance : (n_s,) variance of the readings about their mean, averaged over u [steps^2].
    """

    ratio: FloatArray
    log_repeated: FloatArray
    log_repeated_zero: FloatArray
    variance: FloatArray

    def row(self, ratio: FloatArray) -> IntArray:
        """Return the row of the largest s that is not above ``ratio``; the first of smaller ones."""
        return np.maximum(np.searchsorted(self.ratio, ratio, side="right") - 1, 0)

    def variance_of(self, ratio: FloatArray) -> FloatArray:
        """Return the variance of readings [steps^2] with noise of ``ratio`` steps; s^2 + 1/12 of large ones."""
        return np.where(ratio >= 1.0, ratio**2 + 1.0 / 12.0, np.interp(ratio, self.ratio, self.variance))

    def ratio_of(self, variance: FloatArray) -> FloatArray:
        """Return the s, at most LARGEST_RATIO, with which readings have ``variance`` [steps^2]."""
        return np.interp(variance, self.variance, self.ratio)


@cache
def noise_table() -> NoiseTable:
    """Return the table; it is made once, in some 10 ms."""
    ratio = np.geomspace(_SMALLEST_RATIO, LARGEST_RATIO, _N_RATIOS)
    offset = np.linspace(0.0, 0.5, _N_OFFSETS)  # symmetric: half of it
    edge = np.arange(-16.0, 18.0) - 0.5
    number = 0.5 * (edge[1:] + edge[:-1])
    normal = np.vectorize(lambda x: 0.5 * (1.0 + erf(x / sqrt(2.0))))
    below = normal((edge[None, None, :] - offset[None, :, None]) / ratio[:, None, None])
    probability = np.diff(below, axis=2)
    mean = probability @ number
    variance = 2.0 * np.trapezoid(probability @ number**2 - mean**2, offset, axis=1)
    log_repeated = np.zeros((_N_RATIOS, LONGEST_RUN + 1))
    log_repeated_zero = np.zeros_like(log_repeated)
    power = probability.copy()
    for m in range(1, LONGEST_RUN + 1):
        power *= probability
        repeated = power.sum(axis=2)
        log_repeated[:, m] = np.log(2.0 * np.trapezoid(repeated, offset, axis=1))
        log_repeated_zero[:, m] = np.log(repeated.max(axis=1))
    return NoiseTable(
        ratio=ratio,
        log_repeated=np.minimum(log_repeated, 0.0),  # round-off must not make it more than certain
        log_repeated_zero=np.minimum(log_repeated_zero, 0.0),
        variance=variance,
    )
