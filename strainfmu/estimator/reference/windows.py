"""Means and straight lines over the last samples: the longest windows that agree with all shorter ones.

A window holds the sample at hand and those before it. A mean leaves 1 / n of the variance of the noise of n
samples, a line at its end more, but it follows what moves. The interval of a fit is twice its standard deviation
wide to both sides; windows agree while the intervals of all up to them have points in common, in every channel.
The window in use is at most half as long: one that only just agrees may be off by its own interval.
Source: Goldenshluger and Nemirovski, On spatially adaptive estimation of nonparametric regression, Mathematical
Methods of Statistics 6 (1997).
"""

from typing import NamedTuple

import numpy as np

from strainfmu.arrays import FloatArray, IntArray

SAME_COUNT = 2
"""Spans of one number of samples, which are powers of two; of a third, the two oldest become one."""

WIDTH = 2.0
"""Half of an interval, in standard deviations of its noise."""

PART = 0.5
"""Samples of the window in use over the samples of the longest one that agrees."""


class Fit(NamedTuple):
    """A fit to a window of ``samples``: ``value`` (m,) at its end, ``noise_part`` [1] of its ``noise``."""

    samples: int
    value: FloatArray
    noise_part: float
    noise: FloatArray


class Averaged(NamedTuple):
    """A sample with those before it: ``value`` (m,), variances of the ``noise`` (m,) in it, and ``noise_part``,
    the part of them [1]."""

    value: FloatArray
    noise: FloatArray
    noise_part: float


def span_counts(samples: int) -> list[int]:
    """Return the numbers of samples of the spans that ``samples`` lie in, the oldest first."""
    counts: list[int] = []
    for _ in range(samples):
        counts.append(1)
        size = 1
        while counts.count(size) > SAME_COUNT:
            first = counts.index(size)
            counts[first : first + 2] = [2 * size]
            size *= 2
    return counts


def windows(time: FloatArray, longest: float) -> list[IntArray]:
    """Return the samples of each window of the last of ``time`` (k,) [s], the shortest first.

    The mean time of a span is at most ``longest`` [s] ago.
    """
    samples = np.array([len(time) - 1])
    by_length, end = [samples], len(time) - 1
    for count in span_counts(end)[::-1]:
        span = np.arange(end - count, end)
        if time[-1] - np.mean(time[span]) > longest:
            break
        samples, end = np.append(span, samples), end - count
        by_length.append(samples)
    return by_length


def averaged(time: FloatArray, value: FloatArray, noise: FloatArray, longest: float) -> Averaged:
    """Return the last of k samples averaged with those before it.

    ``time`` (k,) [s], ``value`` (k, m), variances of their ``noise`` (k, m), ``longest`` window [s].
    """
    samples = windows(time, longest)
    chosen = [
        _chosen([_fit(time[rows] - time[-1], value[rows], noise[rows], degree) for rows in samples])
        for degree in (0, 1)
    ]
    best = min(chosen, key=lambda fit: fit.noise_part)
    takes = best.noise_part * best.noise < noise[-1]
    if best.samples == 1:
        return Averaged(value[-1], noise[-1], 1.0)
    return Averaged(
        np.where(takes, best.value, value[-1]),
        np.where(takes, best.noise_part * best.noise, noise[-1]),
        best.noise_part,
    )


def _fit(age: FloatArray, value: FloatArray, noise: FloatArray, degree: int) -> Fit:
    """Return the polynomial of ``degree`` through a window at its end, where ``age`` (n,) is 0; a line needs three
    samples at two times."""
    count, mean_noise = len(age), np.mean(noise, axis=0)
    if degree == 1 and (count < 3 or np.ptp(age) == 0.0):
        return Fit(count, value[-1], 1.0, noise[-1])
    powers = np.vander(age, degree + 1, increasing=True)
    weight = np.linalg.pinv(powers)[0]
    return Fit(count, weight @ value, float(weight @ weight), mean_noise)


def _chosen(fits: list[Fit]) -> Fit:
    """Return the longest of ``fits`` of at most half of the samples of the longest that agrees."""
    low, high, agreed = np.array(-np.inf), np.array(np.inf), 1
    for fit in fits:
        half = WIDTH * np.sqrt(fit.noise_part * fit.noise)
        low, high = np.maximum(low, fit.value - half), np.minimum(high, fit.value + half)
        if np.any(low > high):
            break
        agreed = fit.samples
    return [fit for fit in fits if fit.samples <= max(PART * agreed, 1)][-1]
