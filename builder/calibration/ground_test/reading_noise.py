"""Noise of a sample in every window: the window's own as far as windows differ, else the gauge's.

A variance of few samples is not exact: with d degrees of freedom log s^2 scatters by trigamma(d / 2). Variances of
one gauge that scatter more from window to window differ in truth. That scatter is taken for scaled inverse
chi-square with d_0 degrees of freedom, the same for all gauges. A window's variance is then

    (d_0 s_0^2 + d s^2) / (d_0 + d - 2),

the mean square of what its samples differ by from their true mean, s_0^2 the gauge's. Windows that are alike have
an infinite d_0: the pooled variance of the gauge. They count as alike where chance leaves such a scatter with a
probability above :data:`ALIKE`.

Source: Smyth, Linear models and empirical Bayes methods, Stat. Appl. Genet. Mol. Biol. 3 (2004), article 3,
section 6.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq
from scipy.special import chdtrc, polygamma, psi

from strainfmu.arrays import BoolArray, FloatArray

ALIKE = 1e-3
"""Probability of the scatter of the variances from which they are taken for the same."""

FEWEST, MOST = 1e-2, 1e4
"""Limits of d_0; above, windows are alike."""


def window_variances(variance: FloatArray, freedom: FloatArray) -> FloatArray:
    """Return the variance of a sample in each window (n_c, n_d) [(m/m)^2].

    Parameters
    ----------
    variance : (n_c, n_d) estimated in each window.
    freedom : (n_c, n_d) degrees of freedom of these; where it is 0 the gauge's variance is returned, and 0 where
        the gauge has none.
    """
    counts: BoolArray = (freedom > 0.0) & (variance > 0.0)
    total = np.where(counts, freedom, 0.0)
    pooled = np.sum(total * variance, axis=0) / np.maximum(total.sum(axis=0), 1.0)
    prior = _prior_freedom(variance, freedom, counts)
    if not np.isfinite(prior):
        return np.broadcast_to(pooled, variance.shape).copy()
    level = _level(variance, freedom, counts)
    start = np.exp(level + psi(0.5 * prior) - np.log(0.5 * prior))
    both = (prior * start + total * variance) / np.maximum(prior + total - 2.0, 1.0)
    return np.asarray(np.where(counts, both, np.where(counts.any(axis=0), pooled, 0.0)))


def _centred_log(variance: FloatArray, freedom: FloatArray, counts: BoolArray) -> FloatArray:
    """Return log s^2 without the bias of few samples, NaN where there is none."""
    half = 0.5 * np.where(counts, freedom, 1.0)
    found = np.log(np.where(counts, variance, 1.0)) - psi(half) + np.log(half)
    return np.asarray(np.where(counts, found, np.nan))


def _level(variance: FloatArray, freedom: FloatArray, counts: BoolArray) -> FloatArray:
    """Return the mean logarithm of every gauge (n_d,)."""
    logs = _centred_log(variance, freedom, counts)
    return np.asarray(np.nansum(logs, axis=0) / np.maximum(counts.sum(axis=0), 1))


def _prior_freedom(variance: FloatArray, freedom: FloatArray, counts: BoolArray) -> float:
    """Return d_0; infinite where windows differ by no more than their samples leave."""
    logs = _centred_log(variance, freedom, counts)
    number = counts.sum(axis=0)
    left = int(np.sum(np.maximum(number - 1, 0)))
    if left < 1:
        return np.inf
    residual = logs - _level(variance, freedom, counts)
    seen = float(np.nansum(residual**2)) / left
    rows = counts & (number > 1)
    expected = float(np.mean(polygamma(1, 0.5 * freedom[rows])))
    alike = float(chdtrc(left, left * seen / expected)) > ALIKE
    if alike or seen - expected <= float(polygamma(1, 0.5 * MOST)):
        return np.inf
    target = min(seen - expected, float(polygamma(1, 0.5 * FEWEST)))
    return float(brentq(lambda d: float(polygamma(1, 0.5 * d)) - target, FEWEST, MOST))
