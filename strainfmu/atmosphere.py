"""US Standard Atmosphere 1976 below 71 km geopotential altitude.

Source: U.S. Standard Atmosphere, 1976 (NOAA-S/T 76-1562), tables 2 and 4. With R = 287.053 J/(kg K),
gamma = 1.4: 20 km gives 5474.9 Pa, 216.65 K.
"""

from __future__ import annotations

from functools import cache
from itertools import pairwise
from math import exp, sqrt
from typing import TYPE_CHECKING

from strainfmu.errors import InputError

if TYPE_CHECKING:
    from strainfmu.arrays import FloatArray

GAS_CONSTANT = 287.053
"""Specific gas constant R of air [J/(kg K)]."""
HEAT_CAPACITY_RATIO = 1.4
"""Ratio of specific heats gamma [1]."""

DEVIATION_OF_AIR = 0.07
"""Standard deviation of the pressure at an altitude about the pressure of the standard atmosphere, relative [1].

Over latitudes and seasons it is 0.06 to 0.08 from 10 to 25 km and 0.10 at 30 km, by NRLMSIS 2.1 (area-weighted
rms, 75 degrees south to north)."""

_GRAVITY = 9.80665

LAYERS = (
    (0.0, -6.5e-3),
    (11e3, 0.0),
    (20e3, 1.0e-3),
    (32e3, 2.8e-3),
    (47e3, 0.0),
    (51e3, -2.8e-3),
    (71e3, 0.0),
)
"""Geopotential base altitude [m] and temperature gradient [K/m] of each layer; the last ends the atmosphere."""


def pressure_and_temperature(altitude: float) -> tuple[float, float]:
    """Return pressure [Pa] and temperature [K] at a geopotential altitude [m].

    Raises
    ------
    InputError
        The altitude is outside 0 to 71 km.

    Example
    -------
    >>> pressure, temperature = pressure_and_temperature(20e3)
    >>> print(f"{pressure:.1f} Pa, {temperature:.2f} K")
    5474.9 Pa, 216.65 K
    """
    if not 0.0 <= altitude <= LAYERS[-1][0]:
        raise InputError(f"altitude: {altitude:g} m found, 0 to {LAYERS[-1][0]:g} m allowed")
    pressure, temperature = 101325.0, 288.15
    for (base, gradient), (top, _) in pairwise(LAYERS):
        rise = min(altitude, top) - base
        if gradient == 0.0:
            pressure *= exp(-_GRAVITY * rise / (GAS_CONSTANT * temperature))
        else:
            above = temperature + gradient * rise
            pressure *= (above / temperature) ** (-_GRAVITY / (GAS_CONSTANT * gradient))
            temperature = above
        if altitude <= top:
            break
    return pressure, temperature


@cache
def layer_table() -> FloatArray:
    """Return (6, 5) base, top [m], gradient [K/m] of each layer; pressure [Pa], temperature [K] at its base."""
    import numpy as np

    return np.array(
        [(base, top, gradient, *pressure_and_temperature(base)) for (base, gradient), (top, _) in pairwise(LAYERS)]
    )


def static_pressure_at(altitude: FloatArray) -> FloatArray:
    """Return the pressure [Pa] at geopotential altitudes (k,) [m]; NaN outside 0 to 71 km, and for NaN.

    The closed form of :func:`pressure_and_temperature`; its derivative by the altitude, -g p/(R T), has no jumps.
    """
    import numpy as np

    table = layer_table()
    inside = (altitude >= 0.0) & (altitude <= LAYERS[-1][0])
    height = np.where(inside, altitude, 0.0)
    layer = np.searchsorted(table[1:, 0], height)  # at a boundary the one below it
    base, _, gradient, pressure, temperature = table[layer].T
    rise, graded = height - base, gradient != 0.0
    of_gradient = np.where(graded, gradient, 1.0)
    exponent = np.where(
        graded,
        -_GRAVITY / (GAS_CONSTANT * of_gradient) * np.log((temperature + gradient * rise) / temperature),
        -_GRAVITY * rise / (GAS_CONSTANT * temperature),
    )
    return np.asarray(np.where(inside, pressure * np.exp(exponent), np.nan))


def speed_of_sound(altitude: float) -> float:
    """Return the speed of sound [m/s] at a geopotential altitude [m]."""
    return sqrt(HEAT_CAPACITY_RATIO * GAS_CONSTANT * pressure_and_temperature(altitude)[1])


def dynamic_pressure(mach_number: float, altitude: float) -> float:
    """Return q_inf = gamma/2 p_inf M^2 [Pa] at a Mach number [1] and geopotential altitude [m]."""
    return 0.5 * HEAT_CAPACITY_RATIO * pressure_and_temperature(altitude)[0] * mach_number**2
