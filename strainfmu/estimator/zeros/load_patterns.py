"""Whether readings of a tare look like load: the strain of flights, and how much of random zeros lies along it.

The strain of every flow of the map is a sum of a few patterns: the mean flow's and one for each pressure mode. Own
weight has three more.
Zeros are random from gauge to gauge. With k orthonormal patterns of n gauges, the part b of their sum of squares
that lies along the patterns has the distribution Beta(k/2, (n - k)/2) for normal zeros, whatever their size.
Source: the F test of a linear model, Rao, *Linear Statistical Inference and its Applications*, section 4b.2.
"""

from __future__ import annotations

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.estimator.health import FALSE_ALARM_PROBABILITY
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.sensors import SPECIFIC_FORCE

GAUGES_PER_PATTERN = 4
"""Gauges that read for each pattern, at least: with fewer any zeros look like load."""

_HALVINGS = 60
"""Of the interval that a limit is searched in: to the precision of a double."""


def load_patterns(inverse_map: InverseMap) -> FloatArray:
    """Return (k, n_d) strain of loads, to any scale.

    Of the mean flow; of own weight along each axis, if the map knows masses; then of pressure modes in order.
    """
    n, inertia = inverse_map.n_strain_gauges, inverse_map.inertia
    weight = np.zeros((inverse_map.n_gauges, 0)) if inertia is None else inertia.mode_strain[:, SPECIFIC_FORCE]
    columns = np.column_stack([inverse_map.mean_strain, weight, inverse_map.state_operator])[:n]
    return np.ascontiguousarray(columns[:, : max(1, n // GAUGES_PER_PATTERN)].T)


def load_odds(inverse_map: InverseMap) -> FloatArray:
    """Return (n_d + 1,) limits of b / (1 - b) by the number of gauges that read; 0 where no pattern is judged.

    Random zeros exceed them with :data:`FALSE_ALARM_PROBABILITY`.
    """
    n_patterns = len(load_patterns(inverse_map))
    odds = np.zeros(inverse_map.n_strain_gauges + 1)
    for n in range(GAUGES_PER_PATTERN, len(odds)):
        part = largest_part(min(n_patterns, n // GAUGES_PER_PATTERN), n, FALSE_ALARM_PROBABILITY)
        odds[n] = part / (1.0 - part)
    return odds


def largest_part(n_patterns: int, n_gauges: int, probability: float) -> float:
    """Return the part of the sum of squares along patterns that random zeros exceed with ``probability``.

    An odd number of patterns counts as the next even one, whose limit is a little higher.
    """
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        part = 0.5 * (low + high)
        if part_survival(part, n_patterns + n_patterns % 2, n_gauges) > probability:
            low = part
        else:
            high = part
    return high


def part_survival(part: float, n_patterns: int, n_gauges: int) -> float:
    """Return the probability that a Beta(k/2, (n - k)/2) variable exceeds ``part``, k = ``n_patterns`` even.

    Source: (1 - b)^m sum_{i < k/2} (m)_i b^i / i! with m = (n - k)/2, repeated integration by parts of the beta
    function (Abramowitz & Stegun, 26.5.7).
    """
    half_left = 0.5 * (n_gauges - n_patterns)
    term = total = 1.0
    for i in range(1, n_patterns // 2):
        term *= part * (half_left + i - 1.0) / i
        total += term
    return float((1.0 - part) ** half_left * total)
