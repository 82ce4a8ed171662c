"""Kinds of error of auxiliary sensors, and of flow parameters that are given as known."""

from __future__ import annotations

import numpy as np

from builder.stress.gauge_kinds import SENSORS, frozen, lost, scaled, some
from builder.stress.kind import Filtered, Hardware, Kind, KnownParameters, Readings, as_stated
from builder.vehicle.file import Vehicle
from strainfmu.arrays import FloatArray

KNOWN_PERCENT = 2.0
"""Standard deviation of flow parameters that are given as known, of their range [%]."""

WRONG_SIGMAS = 5.0
"""By how many of these standard deviations wrong ones are off."""


def off_by(sigmas: float) -> Readings:
    """Return one sensor that reads ``sigmas`` standard deviations of its noise more."""

    def readings(d: FloatArray, wind: FloatArray, hardware: Hardware, random: np.random.Generator) -> FloatArray:
        out, which = d.copy(), some(hardware, random, 1)
        out[:, which] += sigmas * hardware.noise_std[which]
        return out

    return readings


_OF_ONE: tuple[tuple[str, str, Readings], ...] = (
    ("gain of one auxiliary sensor", "+20 %", scaled(1, 1.2)),
    ("bias of one auxiliary sensor", "+20 sigma of its noise", off_by(20.0)),
    ("one auxiliary sensor frozen", "at another flight's reading", frozen(1)),
    ("one auxiliary sensor lost", "no reading", lost(1)),
)


def sensor_kinds(vehicle: Vehicle) -> list[Kind]:
    """Return errors of auxiliary sensors, none of a vehicle without."""
    if vehicle.sensors is None:
        return []
    stated = Kind(
        error="auxiliary sensors",
        size="drawn at their stated sizes",
        group="within",
        what="Gains, mass, inertia, centre of mass, drifts, base pressure, friction and thrust; gauges too.",
        build=as_stated,
    )
    return [
        stated,
        *(
            Kind(
                error=error,
                size=size,
                group="outside",
                what=f"The sensor is drawn. {SENSORS}",
                sensor_readings=readings,
            )
            for error, size, readings in _OF_ONE
        ),
    ]


def parameter_kinds(vehicle: Vehicle) -> list[Kind]:
    """Return flow parameters that are given as known, right and wrong; none of a vehicle without parameters."""
    if not vehicle.conditions.parameters:
        return []
    std = 0.01 * KNOWN_PERCENT
    right, wrong = KnownParameters(std=std), KnownParameters(std=std, off=WRONG_SIGMAS)
    what = f"Given with a standard deviation of {KNOWN_PERCENT:g} % of their range, by which they err."
    more = f"{what} Every one is {WRONG_SIGMAS:g} of these off besides."
    found = [
        Kind(error="flow parameters known", size="as stated", group="within", what=what, parameters=right),
        Kind(
            error="flow parameters known",
            size=f"wrong by {WRONG_SIGMAS:g} sigma",
            group="outside",
            what=more,
            parameters=wrong,
        ),
    ]
    if vehicle.map.follows_pressure:
        found.append(
            Kind(
                error="filter over time, flow parameters known",
                size=f"wrong by {WRONG_SIGMAS:g} sigma",
                group="outside",
                what=more,
                parameters=wrong,
                filtered=Filtered(),
            )
        )
    return found
