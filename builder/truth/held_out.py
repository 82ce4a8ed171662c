"""Random flight conditions inside the envelope of a map, between those of its snapshots."""

from __future__ import annotations

from math import radians

import numpy as np

from builder.truth.revolution.flow_table import FlowTable
from builder.vehicle.file import Vehicle
from strainfmu.flight_condition import FlightCondition

ALTITUDES_KM = (12.0, 30.0)
"""Range [km] of altitudes that are drawn where a map holds at all."""


def largest_incidence(vehicle: Vehicle) -> float:
    """Return the largest total incidence [rad] of the vehicle's flight conditions."""
    return max(condition.total_incidence for condition in vehicle.flight_conditions())


def drawn_altitudes_km(vehicle: Vehicle) -> tuple[float, float]:
    """Return lowest and highest altitude [km] of :data:`ALTITUDES_KM` that the map holds at.

    They are its own where it holds at none of these; in form "absolute" those of the flight conditions.
    """
    if vehicle.map.form != "dynamic_pressure":
        heights = vehicle.conditions.altitudes_km
        return min(heights), max(heights)
    low, high = vehicle.map.valid_altitude_km
    bottom, top = max(ALTITUDES_KM[0], low), min(ALTITUDES_KM[1], high)
    return (bottom, top) if bottom < top else (low, high)


def held_out_conditions(
    vehicle: Vehicle, table: FlowTable, count: int, random: np.random.Generator
) -> list[FlightCondition]:
    """Return ``count`` conditions, uniform in Mach number, altitude and angles, that map and ``table`` both cover.

    With full symmetry the total incidence is uniform from 0 and the roll angle of the wind is any; as listed,
    angle of attack and sideslip are uniform in their ranges.
    """
    entry, incidence = vehicle.conditions, min(largest_incidence(vehicle), float(table.incidence_knots[-1]))
    low = max(min(entry.mach_number), float(table.mach_knots[0]))
    high = min(max(entry.mach_number), float(table.mach_knots[-1]))
    bottom, top = drawn_altitudes_km(vehicle)
    found: list[FlightCondition] = []
    while len(found) < count:
        if vehicle.map.symmetry == "full":
            alpha, beta = wind_angles(
                float(random.uniform(0.0, incidence)), float(random.uniform(0.0, 2.0 * np.pi))
            )
        else:
            alpha, beta = (
                radians(float(random.uniform(min(listed), max(listed))))
                for listed in (entry.angle_of_attack_deg, entry.sideslip_angle_deg)
            )
        condition = FlightCondition(
            mach_number=float(random.uniform(low, high)),
            angle_of_attack=alpha,
            sideslip_angle=beta,
            altitude=1e3 * float(random.uniform(bottom, top)),
        )
        if condition.total_incidence <= incidence:
            found.append(condition)
    return found


def conditions_in_ranges(
    vehicle: Vehicle, altitudes: tuple[float, float], count: int, random: np.random.Generator
) -> list[FlightCondition]:
    """Return ``count`` conditions, uniform in what the file lists: Mach number, both angles, flow parameters.

    ``altitudes`` are the lowest and highest that are drawn [m]. For vehicles of any shape: nothing is rolled.
    """
    entry, found = vehicle.conditions, list[FlightCondition]()
    listed = [entry.mach_number, entry.angle_of_attack_deg, entry.sideslip_angle_deg]
    listed += [one.values for one in entry.parameters.values()]
    low, high = (np.array([side(one) for one in listed]) for side in (min, max))
    for _ in range(count):
        mach, alpha, beta, *parameters = random.uniform(low, high).tolist()
        altitude = float(random.uniform(*altitudes))
        found.append(FlightCondition(mach, radians(alpha), radians(beta), altitude, tuple(parameters)))
    return found


def wind_angles(total_incidence: float, roll_angle: float) -> tuple[float, float]:
    """Return angle of attack and sideslip [rad] of a total incidence whose leeward meridian is at
    ``roll_angle``."""
    across = np.sin(total_incidence)
    beta = -np.arcsin(across * np.sin(roll_angle))
    alpha = np.arctan2(across * np.cos(roll_angle), np.cos(total_incidence))
    return float(alpha), float(beta)
