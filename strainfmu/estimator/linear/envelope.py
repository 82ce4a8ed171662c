"""Whether an estimate is inside the envelope of its map, and how far it is outside."""

from __future__ import annotations

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.atmosphere import HEAT_CAPACITY_RATIO, static_pressure_at
from strainfmu.estimator.map.envelope import MACH_TOLERANCE, PRESSURE_TOLERANCE, FlightRanges, HalfSpaces
from strainfmu.estimator.map.envelope import flight_ranges as flight_ranges
from strainfmu.estimator.map.envelope import half_spaces as half_spaces


def envelope_score(envelope: HalfSpaces, coefficients: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return (k,) the largest (n'C - limit) / sigma of n'C over the half-spaces, 0 where C is inside all [1].

    ``coefficients`` is (k, 5), ``covariance`` theirs (k, 5, 5), both for the references of the map.
    """
    excess = coefficients @ envelope.direction.T - envelope.limit
    score = np.zeros(len(coefficients))
    for sample in np.flatnonzero(np.any(excess > 0.0, axis=1)):
        beyond = excess[sample] > 0.0
        direction = envelope.direction[beyond]
        variance = np.sum((direction @ covariance[sample]) * direction, axis=1)
        score[sample] = np.max(excess[sample, beyond] / np.sqrt(variance))
    return score


def outside_by_navigation(
    ranges: FlightRanges,
    *,
    dynamic_pressure: FloatArray,
    dynamic_pressure_std: FloatArray,
    mach_number: FloatArray,
    altitude: FloatArray,
) -> BoolArray:
    """Return (k,) whether q_inf [Pa], M or h [m] leave the ranges or contradict each other; NaN is not known."""
    q, mach = dynamic_pressure, mach_number
    low, high = ranges.mach_number * np.array([1.0 - MACH_TOLERANCE, 1.0 + MACH_TOLERANCE])
    outside = (q < ranges.dynamic_pressure[0]) | (q > ranges.dynamic_pressure[1])
    outside |= (mach < low) | (mach > high)
    outside |= (altitude < ranges.altitude[0]) | (altitude > ranges.altitude[1])
    if np.all(np.isnan(mach) | np.isnan(altitude)):  # nothing to compare the dynamic pressure with
        return np.asarray(outside)
    with np.errstate(over="ignore", invalid="ignore"):  # of values out of range, which are outside already
        expected = 0.5 * HEAT_CAPACITY_RATIO * mach * mach * static_pressure_at(altitude)
        allowed = PRESSURE_TOLERANCE * expected + 3.0 * dynamic_pressure_std
        return np.asarray(outside | (np.abs(q - expected) > allowed))
