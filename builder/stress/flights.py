"""Flights of the stress test: sets of conditions inside the envelope of a vehicle's map and beyond it.

The envelope is the vehicle file's: Mach number and altitude from smallest to largest, and the total incidence
up to the largest of the conditions, at any roll angle of the wind where the map has full symmetry.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import pi, radians
from typing import Any

import numpy as np

from builder.trial.conditions import (
    conditions_in_ranges,
    drawn_altitudes_km,
    held_out_conditions,
    largest_incidence,
    listed_altitudes_km,
    wind_angles,
)
from builder.truth.revolution.flow_table import FlowTable
from builder.vehicle.file import Vehicle
from strainfmu.arrays import FloatArray
from strainfmu.errors import FlowReachError
from strainfmu.flight_condition import FlightCondition

MACH_REACH, INCIDENCE_REACH = 0.22, 0.3
"""How far the flows of the stress test go beyond the envelope, relative to its bounds."""

MACH_KNOTS, INCIDENCE_KNOTS = 7, 8
"""Knots of the flows. On the shipped vehicle each harmonic of the pressure between them differs from the
same of flows at 108 knots by 0.004 p_inf rms at most, and the undetected fractions by 0.1 %."""

LEAST_INCIDENCE = radians(1.0)
"""Taken as the largest total incidence [rad] of a vehicle that has none."""

DrawConditions = Callable[[Vehicle, FlowTable | None, int, np.random.Generator], list[FlightCondition]]
"""Takes the vehicle, its flows, a number and a generator; returns as many conditions.

Without flows, of another shape than a body of revolution, every condition needs one of its own: beyond the
envelope they are fewer by :data:`FEWER_BEYOND`.
"""

FEWER_BEYOND = 4


def envelope_incidence(vehicle: Vehicle) -> float:
    """Return the largest total incidence [rad] of the envelope."""
    return max(largest_incidence(vehicle), LEAST_INCIDENCE)


def stress_knots(vehicle: Vehicle) -> tuple[FloatArray, FloatArray]:
    """Return Mach numbers (n_M,) and positive total incidences (n_a,) [rad] of the flows, beyond the envelope."""
    listed = vehicle.conditions.mach_number
    mach = np.linspace((1.0 - MACH_REACH) * min(listed), (1.0 + MACH_REACH) * max(listed), MACH_KNOTS)
    largest = (1.0 + INCIDENCE_REACH) * envelope_incidence(vehicle)
    incidence = largest * np.arange(1, INCIDENCE_KNOTS + 1) / INCIDENCE_KNOTS
    return np.round(mach, 9), np.round(incidence, 9)


def inside(
    vehicle: Vehicle, table: FlowTable | None, count: int, random: np.random.Generator
) -> list[FlightCondition]:
    """Return conditions inside the envelope, at the altitudes of the file, between the snapshots."""
    heights = listed_altitudes_km(vehicle)
    if table is None:
        return conditions_in_ranges(vehicle, heights, count, random)
    return [
        replace(one, altitude=1e3 * float(random.uniform(*heights)))
        for one in held_out_conditions(vehicle, table, count, random)
    ]


def at_altitude(altitude: float) -> DrawConditions:
    """Return conditions inside the envelope, all at ``altitude`` [m]."""

    def flights(
        vehicle: Vehicle, table: FlowTable | None, count: int, random: np.random.Generator
    ) -> list[FlightCondition]:
        return [replace(one, altitude=altitude) for one in inside(vehicle, table, count, random)]

    return flights


def at_incidence(low: float, high: float) -> DrawConditions:
    """Return conditions whose total incidence is ``low`` to ``high`` times the largest of the envelope.

    The roll angle of the wind is any: beyond the largest incidence every one is outside.

    Raises
    ------
    FlowReachError
        By the flights, where the flows do not go as far.
    """

    def flights(
        vehicle: Vehicle, table: FlowTable | None, count: int, random: np.random.Generator
    ) -> list[FlightCondition]:
        largest = envelope_incidence(vehicle)
        if table is not None:
            _refuse_beyond(high * largest, table.incidence_knots[-1], "total incidence [rad]")
        found = []
        for one in inside(vehicle, table, count, random):
            total = float(random.uniform(low, high)) * largest
            alpha, beta = wind_angles(total, float(random.uniform(0.0, 2.0 * pi)))
            found.append(replace(one, angle_of_attack=alpha, sideslip_angle=beta))
        return found

    return flights


def fewer_beyond(table: FlowTable | None, count: int) -> int:
    """Return how many of ``count`` conditions are drawn beyond the envelope."""
    return count if table is not None else max(1, count // FEWER_BEYOND)


def at_edge(low: float, high: float) -> DrawConditions:
    """Return conditions of which one angle, of attack or sideslip, is ``low`` to ``high`` times half its range off
    its middle.

    For shapes whose two angles have ranges of their own. An end of a range at 0 is no edge: a symmetric body has
    mirror images there.
    """

    def flights(
        vehicle: Vehicle, table: FlowTable | None, count: int, random: np.random.Generator
    ) -> list[FlightCondition]:
        edges, found = edges_of(vehicle), list[FlightCondition]()
        for one in inside(vehicle, table, fewer_beyond(table, count), random):
            name, middle, reach = edges[int(random.integers(len(edges)))]
            angle = middle + float(random.uniform(low, high)) * reach
            changed: dict[str, Any] = {name: radians(angle)}
            found.append(replace(one, **changed))
        return found

    return flights


def edges_of(vehicle: Vehicle) -> list[tuple[str, float, float]]:
    """Return the ends of the ranges of both angles: the angle's name, the middle [deg], and from there to the end
    [deg]."""
    entry = vehicle.conditions
    both = (("angle_of_attack", entry.angle_of_attack_deg), ("sideslip_angle", entry.sideslip_angle_deg))
    return [
        (name, 0.5 * (min(listed) + max(listed)), end - 0.5 * (min(listed) + max(listed)))
        for name, listed in both
        for end in (min(listed), max(listed))
        if max(listed) > min(listed) and end != 0.0
    ]


def below_mach(factor: float) -> DrawConditions:
    """Return conditions at ``factor`` times the smallest Mach number; errors as :func:`at_incidence`."""

    def flights(
        vehicle: Vehicle, table: FlowTable | None, count: int, random: np.random.Generator
    ) -> list[FlightCondition]:
        mach = factor * min(vehicle.conditions.mach_number)
        if table is not None:
            _refuse_beyond(-mach, -table.mach_knots[0], "-Mach number")
        number = fewer_beyond(table, count)
        return [replace(one, mach_number=mach) for one in inside(vehicle, table, number, random)]

    return flights


def above_mach(factor: float) -> DrawConditions:
    """Return conditions at ``factor`` times the largest Mach number; errors as :func:`at_incidence`."""

    def flights(
        vehicle: Vehicle, table: FlowTable | None, count: int, random: np.random.Generator
    ) -> list[FlightCondition]:
        mach = factor * max(vehicle.conditions.mach_number)
        if table is not None:
            _refuse_beyond(mach, table.mach_knots[-1], "Mach number")
        number = fewer_beyond(table, count)
        return [replace(one, mach_number=mach) for one in inside(vehicle, table, number, random)]

    return flights


def mirrored(
    vehicle: Vehicle, table: FlowTable | None, count: int, random: np.random.Generator
) -> list[FlightCondition]:
    """Return conditions of the listed ranges whose angle of attack, sideslip or both have the other sign."""
    entry, incidence = vehicle.conditions, envelope_incidence(vehicle)
    found: list[FlightCondition] = []
    for one in inside(vehicle, table, count, random):
        sign = ((-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0))[int(random.integers(3))]
        while True:
            angles = [
                side * radians(float(random.uniform(min(listed), max(listed))))
                for side, listed in zip(sign, (entry.angle_of_attack_deg, entry.sideslip_angle_deg), strict=True)
            ]
            turned = replace(one, angle_of_attack=angles[0], sideslip_angle=angles[1])
            if turned.total_incidence <= incidence:
                found.append(turned)
                break
    return found


def mirrored_is_inside(vehicle: Vehicle) -> bool:
    """Return whether conditions with the other sign belong to the envelope of the map."""
    entry = vehicle.conditions
    both = (entry.angle_of_attack_deg, entry.sideslip_angle_deg)
    return vehicle.map.symmetry == "full" or all(np.isclose(min(one), -max(one)) for one in both)


def altitude_is_inside(vehicle: Vehicle, altitude: float) -> bool:
    """Return whether ``altitude`` [m] belongs to the envelope of the map."""
    low, high = drawn_altitudes_km(vehicle, vehicle.map.valid_altitude_km)
    return low <= 1e-3 * altitude <= high


def _refuse_beyond(needed: float, known: float, what: str) -> None:
    if needed > known + 1e-9:
        raise FlowReachError(f"{what}: {needed:.6g} needed, the flows go up to {known:.6g}")
