"""The envelope of a map: half-spaces of the coefficients and ranges of the flight state that its snapshots cover.

A half-space is a direction n with the largest n'C over the snapshots. An estimate is outside if n'C exceeds it by
more than its own uncertainty explains, in standard deviations of n'C. Dynamic pressure, Mach number and altitude
have ranges of their own; where all three are known they must agree, q = 0.7 M^2 p(h).
"""

from __future__ import annotations

from dataclasses import dataclass

from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.inverse_map import InverseMap

MIN_DYNAMIC_PRESSURE, MAX_DYNAMIC_PRESSURE = 1e-6, 1e7
"""q_inf [Pa] below which there is no flow, and above which no vehicle flies (M 10 at sea level: 7.1e6)."""

MACH_TOLERANCE = 0.025
"""Relative error of a measured Mach number that the range allows: three standard deviations of 0.05 at M 6.

A flight at the end of the range is inside it. At 0.01 one flight in twelve there was outside by its measured M.
"""

RANGE_DEVIATIONS = 3.0
"""Stated standard deviations by which M may leave its range in addition, and of q_inf behind the next entry."""

PRESSURE_TOLERANCE = 0.05
"""Relative difference of dynamic pressure and 0.7 M^2 p(h) that errors of navigation and weather explain."""


@dataclass(frozen=True, kw_only=True, eq=False)
class HalfSpaces:
    """The coefficients that the snapshots of a map cover: n'C <= limit for every direction n.

    Attributes
    ----------
    direction : (m, 5) n, over the coefficients at the references of the map [1].
    limit : (m,) largest n'C over the snapshots [1].
    """

    direction: FloatArray
    limit: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class FlightRanges:
    """Least and largest dynamic pressure [Pa], Mach number [1] and geopotential altitude [m] of a map, (2,)
    each."""

    dynamic_pressure: FloatArray
    mach_number: FloatArray
    altitude: FloatArray


def half_spaces(inverse_map: InverseMap) -> HalfSpaces:
    """Return the half-spaces of ``inverse_map``."""
    return HalfSpaces(direction=inverse_map.envelope_direction, limit=inverse_map.envelope_limit)


def flight_ranges(inverse_map: InverseMap) -> FlightRanges:
    """Return the ranges of ``inverse_map``."""
    return FlightRanges(
        dynamic_pressure=inverse_map.dynamic_pressure_range,
        mach_number=inverse_map.mach_number_range,
        altitude=inverse_map.altitude_range,
    )
