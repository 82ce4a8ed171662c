"""Quantised readings: the step of their values, and how long noise may repeat one."""

from __future__ import annotations

from math import erf, inf, log, sqrt

from strainfmu.arrays import FloatArray

LARGEST_RATIO = 4.0
"""Noise in steps above which more makes no difference: of steps so fine hardly a reading is repeated."""

_ROUND_OFF = 1e-9


def longest_repetition(ratio: float, probability: float) -> float:
    """Return how many equal readings in a row are less probable than ``probability``, at the worst strain.

    That is the middle of a quantisation step, as exactly zero is; infinite where the noise never leaves it.

    Parameters
    ----------
    ratio : standard deviation of the noise in quantisation steps.
    """
    inside = erf(0.5 / (ratio * sqrt(2.0)))
    return inf if inside >= 1.0 else log(probability) / log(inside)


def common_step(values: FloatArray) -> float:
    """Return the largest step of which all ``values`` (n,) are multiples; round-off of the largest if none is.

    It is their greatest common divisor by Euclid's algorithm: the resolution of what was written with few digits,
    or in counts of a converter.
    """
    sizes = [abs(value) for value in values.tolist()]
    smallest = _ROUND_OFF * max(sizes, default=0.0)
    step = 0.0
    for size in sizes:
        rest = step
        step = size
        while rest > smallest:
            step, rest = rest, abs(step - rest * round(step / rest))
        if 0.0 < step <= 2.0 * smallest:
            return smallest
    return max(step, smallest)
