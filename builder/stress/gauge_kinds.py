"""Kinds of error of single gauges, of several together, and of temperature: what becomes of the readings."""

from __future__ import annotations

import numpy as np

from builder.stress.hardware_kinds import thinner_middle
from builder.stress.kind import Hardware, Kind, Readings
from builder.vehicle.map.options import Noise
from strainfmu.arrays import FloatArray, IntArray

MICRO = 1e-6

SENSORS = "No stated error: what is not flagged must do no harm."


def some(hardware: Hardware, random: np.random.Generator, count: int) -> IntArray:
    """Return ``count`` gauges, drawn."""
    return random.choice(hardware.n_gauges, size=min(count, hardware.n_gauges), replace=False)


def added(count: int, strain: float) -> Readings:
    """Return ``count`` gauges that read ``strain`` [m/m] more."""

    def readings(d: FloatArray, wind: FloatArray, hardware: Hardware, random: np.random.Generator) -> FloatArray:
        out = d.copy()
        out[:, some(hardware, random, count)] += strain
        return out

    return readings


def shifted(strain: float) -> Readings:
    """Return all gauges, which read ``strain`` [m/m] more."""
    return lambda d, wind, hardware, random: d + strain


def scaled(count: int | None, factor: float) -> Readings:
    """Return ``count`` gauges, or all, that read ``factor`` times the strain."""

    def readings(d: FloatArray, wind: FloatArray, hardware: Hardware, random: np.random.Generator) -> FloatArray:
        out = d.copy()
        which = slice(None) if count is None else some(hardware, random, count)
        out[:, which] *= factor
        return out

    return readings


def frozen(count: int) -> Readings:
    """Return ``count`` gauges that keep what they read in one of the flights."""

    def readings(d: FloatArray, wind: FloatArray, hardware: Hardware, random: np.random.Generator) -> FloatArray:
        out = d.copy()
        which = some(hardware, random, count)
        out[:, which] = d[int(random.integers(len(d))), which]
        return out

    return readings


def lost(count: int) -> Readings:
    """Return ``count`` gauges without a reading."""
    return added(count, float("nan"))


def swapped(d: FloatArray, wind: FloatArray, hardware: Hardware, random: np.random.Generator) -> FloatArray:
    """Return two gauges with each other's readings."""
    out, pair = d.copy(), some(hardware, random, 2)
    out[:, pair] = d[:, pair[::-1]]
    return out


def noisier(d: FloatArray, wind: FloatArray, hardware: Hardware, random: np.random.Generator) -> FloatArray:
    """Return readings with three times the stated gauge noise."""
    return np.asarray(d + np.sqrt(8.0) * hardware.noise_std * random.standard_normal(d.shape))


def warm_windward(d: FloatArray, wind: FloatArray, hardware: Hardware, random: np.random.Generator) -> FloatArray:
    """Return readings with apparent strain of 20 um/m windward and as much less leeward, as a cosine."""
    return np.asarray(d - 20.0 * MICRO * np.cos(hardware.roll_angle - wind))


def warm_tail(d: FloatArray, wind: FloatArray, hardware: Hardware, random: np.random.Generator) -> FloatArray:
    """Return readings with apparent strain from 0 at the first gauge to 30 um/m at the last, linear."""
    low, high = float(hardware.station.min()), float(hardware.station.max())
    return np.asarray(d + 30.0 * MICRO * (hardware.station - low) / (high - low if high > low else 1.0))


_OF_READINGS: tuple[tuple[str, str, str, Readings], ...] = (
    ("bias of one gauge", "+50 um/m", "The gauge is drawn.", added(1, 50.0 * MICRO)),
    ("bias of three gauges", "+20 um/m", "The gauges are drawn.", added(3, 20.0 * MICRO)),
    ("gain of five gauges", "+10 %", "The gauges are drawn.", scaled(5, 1.1)),
    ("two gauges swapped", "one pair", "The pair is drawn.", swapped),
    ("sign of one gauge", "reversed", "The gauge is drawn.", scaled(1, -1.0)),
    ("one gauge frozen", "at another flight's strain", "The gauge and the flight are drawn.", frozen(1)),
    ("three gauges frozen", "at another flight's strain", "The gauges and the flight are drawn.", frozen(3)),
    ("one gauge reads zero", "0 um/m", "The gauge is drawn.", scaled(1, 0.0)),
    ("three gauges lost", "no reading", "Health says DEGRADED and sigma grows.", lost(3)),
    ("noise of all gauges", "three times as stated", "As of a loose connection.", noisier),
    (
        "temperature, windward to leeward",
        "+-20 um/m",
        "Apparent strain as a cosine round the axis.",
        warm_windward,
    ),
    ("temperature, nose to tail", "0 to 30 um/m", "Apparent strain linear along the axis.", warm_tail),
    ("temperature, all over the body", "2 um/m", "Apparent strain of all gauges.", shifted(2.0 * MICRO)),
    ("temperature, all over the body", "10 um/m", "Apparent strain of all gauges.", shifted(10.0 * MICRO)),
    ("temperature, all over the body", "50 um/m", "Apparent strain of all gauges.", shifted(50.0 * MICRO)),
)
"""Error, size, what is done, and how."""


def gauge_kinds(noise: Noise) -> list[Kind]:
    """Return errors of the readings, and a wall that is thinner at some of the gauges."""
    found = [
        Kind(error=error, size=size, group="outside", what=f"{what} {SENSORS}".strip(), readings=readings)
        for error, size, what, readings in _OF_READINGS
    ]
    found += unit_kinds(noise)
    found.append(
        Kind(
            error="wall thinner over the middle third",
            size="-5 %",
            group="outside",
            what=f"Strain there as on a wall that is thinner throughout. {SENSORS}",
            build=thinner_middle,
        )
    )
    return found


LEAST_STRAIN_UM_PER_M = 1.0
"""Strain [um/m] of a slender vehicle without incidence: 0.76 at most on the shipped one at 20 km."""


def unit_kinds(noise: Noise) -> list[Kind]:
    """Return all strains in another unit than is stated.

    Strains that are nearly 0 are as in a flight without incidence where more apparent strain is expected.
    """
    hidden = noise.apparent_strain_um_per_m >= LEAST_STRAIN_UM_PER_M
    return [
        Kind(
            error="unit of all strains",
            size="times 1000",
            group="outside",
            what=f"Readings in um/m taken for mm/m. {SENSORS}",
            readings=scaled(None, 1e3),
            draws=0.2,
        ),
        Kind(
            error="unit of all strains",
            size="times 0.001",
            group="unobservable" if hidden else "outside",
            what="Readings in mm/m taken for um/m, or an amplifier without supply: nearly the strain of a flight "
            f"without incidence, which is small. {SENSORS}",
            readings=scaled(None, 1e-3),
        ),
    ]
