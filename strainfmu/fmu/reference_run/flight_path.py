"""Flight condition of the reference run: a shallow dive and climb within the ranges of a map, and its air data."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from strainfmu.arrays import FloatArray
from strainfmu.atmosphere import HEAT_CAPACITY_RATIO, LAYERS, pressure_and_temperature
from strainfmu.estimator.air_inputs import ALTITUDE, DYNAMIC_PRESSURE, MACH_NUMBER
from strainfmu.estimator.map.inverse_map import InverseMap

_DEPTH, _GAIN = 150.0, 0.05
"""Depth of the dive [m], rise of the Mach number [1]: in 10 s they take 3 g across the path, 0.5 g along it."""

_PART_OF_RANGE = 0.1
"""Part of the range of Mach number or altitude that the flight uses, where that is less."""

_READING_ERROR = 0.5
"""Error of each air-data input, of its standard deviation."""


@dataclass(frozen=True, eq=False, kw_only=True)
class FlightPath:
    """Flight condition over time, true, and as the air-data inputs give it.

    Attributes
    ----------
    mach_number, static_pressure, dynamic_pressure : (n,) true [1, Pa, Pa]; NaN where the map does not state the
        ranges of Mach number and altitude.
    air_data : (n,) readings by name of the input.
    """

    mach_number: FloatArray
    static_pressure: FloatArray
    dynamic_pressure: FloatArray
    air_data: dict[str, FloatArray]


def flight_path(inverse_map: InverseMap, n_rows: int) -> FlightPath:
    """Return a flight of ``n_rows`` that ends where it begins, near the middle of what ``inverse_map`` covers.

    A map without ranges of Mach number and altitude has a flight at its nominal dynamic pressure, one in form
    "absolute" a flight at one condition.
    """
    mach_range, altitude_range, nominal = _covered(inverse_map)
    if not np.all(np.isfinite([mach_range, altitude_range])):
        unknown, q = np.full(n_rows, np.nan), np.full(n_rows, nominal)
        return FlightPath(
            mach_number=unknown,
            static_pressure=unknown,
            dynamic_pressure=q,
            air_data=_readings(inverse_map, q, unknown, unknown),
        )
    altitude_range = np.clip(altitude_range, LAYERS[0][0], LAYERS[-1][0])
    moves = inverse_map.manifold is not None or inverse_map.follows_pressure
    depth = moves * min(_DEPTH, _PART_OF_RANGE * float(np.ptp(altitude_range)))
    gain = moves * min(_GAIN, _PART_OF_RANGE * float(np.ptp(mach_range)))
    top = altitude_of(float(nominal / _dynamic_pressure(np.mean(mach_range), 1.0)))
    top = float(np.clip(top, altitude_range[0] + depth, altitude_range[1]))
    slowest = float(np.sqrt(nominal / _dynamic_pressure(1.0, pressure_and_temperature(top)[0])))
    slowest = float(np.clip(slowest, mach_range[0], mach_range[1] - gain))
    swell = 0.5 * (1.0 - np.cos(2.0 * np.pi * np.arange(n_rows) / (n_rows - 1)))
    mach = slowest + gain * swell
    pressure = np.array([pressure_and_temperature(altitude)[0] for altitude in (top - depth * swell).tolist()])
    q = _dynamic_pressure(mach, pressure)
    return FlightPath(
        mach_number=mach,
        static_pressure=pressure,
        dynamic_pressure=q,
        air_data=_readings(inverse_map, q, mach, pressure),
    )


def _covered(inverse_map: InverseMap) -> tuple[FloatArray, FloatArray, float]:
    """Return (2,) Mach number and altitude [m] that the map covers, and a dynamic pressure [Pa] amid them."""
    manifold = inverse_map.manifold
    if manifold is None:
        return inverse_map.mach_number_range, inverse_map.altitude_range, inverse_map.nominal_dynamic_pressure
    low, high = manifold.pressure_range.tolist()
    middle = float(_dynamic_pressure(np.mean(manifold.mach_range), np.sqrt(low * high)))
    return manifold.mach_range, np.array([altitude_of(high), altitude_of(low)]), middle


def _readings(
    inverse_map: InverseMap, q: FloatArray, mach: FloatArray, pressure: FloatArray
) -> dict[str, FloatArray]:
    """Return the air-data inputs (n,) of 9 digits, each wrong by half its sigma, inside the map's ranges.

    NaN is not known. A linear map states no standard deviation of Mach number and altitude: these are right.
    """
    manifold, mach_range = inverse_map.manifold, inverse_map.mach_number_range
    of_q, of_mach, of_pressure = inverse_map.dynamic_pressure_error, 0.0, 0.0
    if manifold is not None:
        mach_range, of_q = manifold.mach_range, manifold.dynamic_pressure_error
        of_mach, of_pressure = manifold.mach_number_error, manifold.altitude_error
    readings = {DYNAMIC_PRESSURE: (q * (1.0 + _READING_ERROR * of_q), inverse_map.dynamic_pressure_range)}
    if not np.isnan(mach).any():
        altitude = [altitude_of(value) for value in (pressure * (1.0 + _READING_ERROR * of_pressure)).tolist()]
        readings |= {
            MACH_NUMBER: (mach + _READING_ERROR * of_mach, mach_range),
            ALTITUDE: (np.array(altitude), inverse_map.altitude_range),
        }
    return {name: np.clip(rounded(values), *allowed) for name, (values, allowed) in readings.items()}


def rounded(values: FloatArray) -> FloatArray:
    """Return ``values`` with 9 digits, which files hold as they are."""
    return np.array([float(f"{value:.9g}") for value in values.ravel().tolist()]).reshape(values.shape)


def altitude_of(pressure: float) -> float:
    """Return the geopotential altitude [m] of ``pressure`` [Pa] in the standard atmosphere, within 0 to 71 km."""
    low, high = LAYERS[0][0], LAYERS[-1][0]
    while high - low > 1e-6:
        middle = 0.5 * (low + high)
        if pressure_and_temperature(middle)[0] > pressure:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


def _dynamic_pressure(mach: ArrayLike, pressure: ArrayLike) -> FloatArray:
    """Return q_inf [Pa] of Mach numbers and static pressures [Pa]."""
    return np.asarray(0.5 * HEAT_CAPACITY_RATIO * np.square(mach) * np.asarray(pressure))
