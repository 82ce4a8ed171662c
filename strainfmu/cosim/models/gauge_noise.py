"""Gauge noise of the native plant: standard normal numbers that every platform draws alike, to the last bit.

A number belongs to a seed, a sample and a gauge, whatever was drawn before it, so that a run can be resumed or
repeated from anywhere. Bits come from SplitMix64 (Steele, Lea & Flood, OOPSLA 2014); the normal quantile comes
from polynomials, one per octave of the probability, so that no function of a mathematical library is called.
"""

from functools import cache
from statistics import NormalDist

import numpy as np

from strainfmu.arrays import FloatArray

OCTAVES = 53
COEFFICIENTS = 10

_STEP = 0x9E3779B97F4A7C15
_MASK = (1 << 64) - 1
# Decimals kept of the polynomials: far below their error, far above what platforms differ by.
_DECIMALS = 11


@cache
def quantile_table() -> FloatArray:
    """Return (OCTAVES, COEFFICIENTS): octave k holds -quantile(p) for p = 2^-(k+2) to twice that [1].

    Coefficients of the powers of t, which goes from -1 to 1 over the octave; interpolation at Chebyshev points.
    The largest error is below 3e-9.
    """
    normal = NormalDist()
    nodes = np.polynomial.chebyshev.chebpts1(COEFFICIENTS)
    table = np.empty((OCTAVES, COEFFICIENTS))
    for octave in range(OCTAVES):
        low = 2.0 ** -(octave + 2)
        values = [-normal.inv_cdf(low * (1.5 + 0.5 * t)) for t in nodes.tolist()]
        series = np.polynomial.chebyshev.chebfit(nodes, values, COEFFICIENTS - 1)
        table[octave] = np.polynomial.chebyshev.cheb2poly(series)
    # Rounded, so that the table does not depend on the platform that makes it.
    return np.round(table, _DECIMALS)


def gauge_noise(seed: int, sample: int, n_gauges: int) -> FloatArray:
    """Return (n_gauges,) standard normal numbers [1] of one sample, counted from 0."""
    bits = np.array(
        [_mixed(_mixed(_mixed(seed + _STEP) + (sample + 1) * _STEP) + (g + 1) * _STEP) for g in range(n_gauges)],
        dtype=np.uint64,
    )
    probability = ((bits >> np.uint64(12)).astype(float) + 0.5) * 2.0**-53
    fraction, exponent = np.frexp(probability)
    argument = 2.0 * (2.0 * fraction) - 3.0
    coefficient = quantile_table()[-1 - exponent]
    quantile = coefficient[:, -1]
    for k in range(COEFFICIENTS - 2, -1, -1):
        quantile = quantile * argument + coefficient[:, k]
    return np.where(bits & np.uint64(1), -quantile, quantile)


def _mixed(x: int) -> int:
    """Return the finalizer of SplitMix64."""
    x &= _MASK
    x = ((x ^ (x >> 30)) * 0xBF58476D1CE4E5B9) & _MASK
    x = ((x ^ (x >> 27)) * 0x94D049BB133111EB) & _MASK
    return x ^ (x >> 31)
