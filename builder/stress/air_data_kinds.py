"""Kinds of error of air data: computed quantities, consistent errors, and exchanged rows that angles detect."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from math import radians
from typing import Any, Literal

import numpy as np

from builder.stress.flights import DrawConditions, at_incidence, envelope_incidence, inside
from builder.stress.gauge_kinds import scaled
from builder.stress.hardware_kinds import with_error
from builder.stress.kind import Hardware, Kind, KindClass, Readings, as_stated
from builder.vehicle.file import Vehicle
from builder.vehicle.map.options import Noise
from strainfmu.arrays import FloatArray
from strainfmu.atmosphere import HEAT_CAPACITY_RATIO, LAYERS, static_pressure_at
from strainfmu.estimator.air_inputs import (
    ALTITUDE,
    ANGLE_ERROR,
    DYNAMIC_PRESSURE,
    MACH_NUMBER,
    MEASURED_ANGLES,
    STATIC_PRESSURE,
)
from strainfmu.flight_condition import FlightCondition

LEAST_ANGLE = radians(3.0)
"""Total angle of attack [rad] from which angles have to resolve mirror images and exchanged rows."""

CLOCKING_DEG = 5.0


@dataclass(frozen=True, kw_only=True)
class GivenAirData:
    """Air data of which q_inf is computed, or angles in addition to independent air data.

    Mach number and static pressure have errors of the sizes of the vehicle file, each drawn for itself.

    Attributes
    ----------
    source : what q_inf is computed from besides the Mach number; None for the exact q_inf, M and p_inf.
    mach_off : error of the Mach number in all inputs [1].
    altitude_off : error of the altitude in all inputs [m].
    day : the day's pressure over the pressure of the standard atmosphere [1].
    angles : whether angle of attack and sideslip are given, with errors of the default standard deviation.
    """

    source: Literal["pressure", "altitude"] | None = None
    mach_off: float = 0.0
    altitude_off: float = 0.0
    day: float = 1.0
    angles: bool = False

    def known(
        self, conditions: Sequence[FlightCondition], noise: Noise, random: np.random.Generator
    ) -> dict[str, Any]:
        """Return the arguments of the estimator for flights at ``conditions``."""
        found: dict[str, Any] = {}
        if self.source is not None:
            found = self._computed(conditions, noise, random)
        if self.angles:
            for name, of in zip(MEASURED_ANGLES, ("angle_of_attack", "sideslip_angle"), strict=True):
                true = np.array([getattr(one, of) for one in conditions])
                found[name] = true + ANGLE_ERROR * random.standard_normal(len(true))
        return found

    def _computed(
        self, conditions: Sequence[FlightCondition], noise: Noise, random: np.random.Generator
    ) -> dict[str, Any]:
        pressure = np.array([one.ambient_pressure for one in conditions])
        error = random.standard_normal((2, len(pressure)))
        mach = np.array([one.mach_number for one in conditions])
        mach = mach + self.mach_off + noise.navigation_mach_number * error[0]
        altitude = altitude_at(pressure / self.day) + self.altitude_off
        stated = static_pressure_at(altitude)
        if self.source == "pressure":
            stated = stated * (1.0 + 0.01 * noise.navigation_static_pressure_percent * error[1])
        last = {STATIC_PRESSURE: stated} if self.source == "pressure" else {ALTITUDE: altitude}
        q = 0.5 * HEAT_CAPACITY_RATIO * mach**2 * stated
        return {MACH_NUMBER: mach, DYNAMIC_PRESSURE: q, **last}


def altitude_at(pressure: FloatArray) -> FloatArray:
    """Return the altitude [m] (k,) at which the standard atmosphere has ``pressure`` [Pa]."""
    height = np.arange(0.0, LAYERS[-1][0], 5.0)
    return np.interp(-np.log(pressure), -np.log(static_pressure_at(height)), height)


def computed_kinds() -> list[Kind]:
    """Return flights whose q_inf is computed from other air data, right and wrong ones."""
    listed: tuple[tuple[str, str, KindClass, str, GivenAirData], ...] = (
        (
            "dynamic pressure computed",
            "from M and p_inf",
            "within",
            "M and p_inf have errors of their stated sizes, and q_inf with them.",
            GivenAirData(source="pressure"),
        ),
        *(
            (
                "dynamic pressure computed",
                f"from M and altitude, a day {percent:+g} % off",
                "within" if percent <= 10.0 else "outside",
                "q_inf and p_inf are computed by the standard atmosphere; the day's differ.",
                GivenAirData(source="altitude", day=1.0 + 0.01 * percent),
            )
            for percent in (7.0, 10.0, -10.0)
        ),
        (
            "Mach number in all inputs",
            "+0.3",
            "outside",
            "M and q_inf, computed from it, agree; p_inf is right.",
            GivenAirData(source="pressure", mach_off=0.3),
        ),
        (
            "altitude in all inputs",
            "+5 km",
            "outside",
            "Altitude and q_inf, computed from it, agree; M is right.",
            GivenAirData(source="altitude", altitude_off=5e3),
        ),
        (
            "altitude in all inputs",
            "+5 km, as static pressure",
            "outside",
            "p_inf and q_inf, computed from it, agree; M is right.",
            GivenAirData(source="pressure", altitude_off=5e3),
        ),
    )
    return [
        Kind(error=error, size=size, group=group, what=what, build=as_stated, air_data=air_data)
        for error, size, group, what, air_data in listed
    ]


def row_kinds(vehicle: Vehicle) -> list[Kind]:
    """Return layouts that are connected or placed wrongly, with and without angles."""
    flights = _at_angles(vehicle)
    turned = Kind(
        error="layout turned",
        size=f"{CLOCKING_DEG:g} deg",
        group="unobservable",
        what="Clocking error: the strain of the flow turned as much. A ground test with a load of known "
        "direction shows it.",
        flights=flights,
        build=with_error("layout_roll", radians(CLOCKING_DEG)),
    )
    listed: tuple[tuple[str, str, Readings, KindClass], ...] = (
        ("opposite rows exchanged", "all pairs", partial(exchanged_rows, all_pairs=True), "unobservable"),
        ("opposite rows exchanged", "pair in the plane of the flow", exchanged_rows, "unobservable"),
        ("signs of all strains", "reversed", scaled(None, -1.0), "unobservable"),
    )
    cure = "The strain of the mirrored flow: measured angles show it."
    return [
        turned,
        *(
            Kind(
                error=error,
                size=f"{size}, {'with' if angles else 'no'} angles",
                group="outside" if angles else group,
                what=f"{cure} Angles are wrong by 1 deg." if angles else cure,
                flights=flights,
                readings=readings,
                air_data=GivenAirData(angles=True) if angles else None,
                flagged_target=95.0 if angles else None,
            )
            for error, size, readings, group in listed
            for angles in (False, True)
        ),
    ]


def _at_angles(vehicle: Vehicle) -> DrawConditions:
    """Return flights from :data:`LEAST_ANGLE` on, inside the envelope; all of another shape than of revolution."""
    largest = envelope_incidence(vehicle)
    if not vehicle.is_of_revolution or largest <= LEAST_ANGLE:
        return inside
    return at_incidence(LEAST_ANGLE / largest, 1.0)


def exchanged_rows(
    d: FloatArray, wind: FloatArray, hardware: Hardware, random: np.random.Generator, all_pairs: bool = False
) -> FloatArray:
    """Return readings with opposite rows exchanged, as by two connectors: in each flight the pair of rows that is
    nearest to the plane of the flow direction, or all pairs.

    A row is the gauges of one roll angle. Without a pair of rows of equal stations nothing is exchanged.
    """
    roll = np.mod(np.round(np.degrees(hardware.roll_angle), 3), 360.0)
    pairs = []
    for angle in np.unique(roll[roll < 180.0]):
        one, other = np.flatnonzero(roll == angle), np.flatnonzero(roll == angle + 180.0)
        if len(one) == len(other) and np.allclose(hardware.station[one], hardware.station[other]):
            pairs.append((radians(angle), one, other))
    out = d.copy()
    if all_pairs:
        for _, one, other in pairs:
            out[:, one], out[:, other] = d[:, other], d[:, one]
        return out
    nearest = np.argmax(np.abs([np.cos(wind[:, 0] - angle) for angle, _, _ in pairs]), axis=0) if pairs else []
    for flight, which in enumerate(nearest):
        _, one, other = pairs[which]
        out[flight, one], out[flight, other] = d[flight, other], d[flight, one]
    return out
