"""Quantile far in the tail of a sample, by a generalised Pareto distribution of what exceeds a high level."""

from __future__ import annotations

import numpy as np

from strainfmu.arrays import FloatArray

TAIL = 0.01
"""Fraction of the sample that the tail is fitted to."""


def tail_quantile(values: FloatArray, probability: float) -> float:
    """Return the value that is exceeded with ``probability``.

    Below ``TAIL`` it is the value of the generalised Pareto distribution with the probability-weighted moments of
    the exceedances (Hosking and Wallis, Technometrics 29, 1987): its error is a fraction of the error of the one
    or two largest values of a sample.
    """
    ordered = np.sort(values)
    n = len(ordered)
    count = int(TAIL * n)
    if probability >= TAIL or count < 20:
        return float(np.quantile(ordered, 1.0 - probability))
    level, exceedances = float(ordered[-count - 1]), ordered[-count:] - ordered[-count - 1]
    mean = float(exceedances.mean())
    rank = (np.arange(count) + 0.65) / count
    weighted = float(np.mean((1.0 - rank) * exceedances))
    if not mean > 2.0 * weighted > 0.0:
        return float(np.quantile(ordered, 1.0 - probability))
    shape = 2.0 - mean / (mean - 2.0 * weighted)
    size = 2.0 * mean * weighted / (mean - 2.0 * weighted)
    ratio = probability * n / count
    if abs(shape) < 1e-9:
        return level - size * float(np.log(ratio))
    return level + size / shape * (ratio**-shape - 1.0)
