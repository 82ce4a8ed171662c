"""Where vehicles fly in a trial: random conditions inside the envelope of a map, between its snapshots.

Every program draws by the same rules: Mach number and altitude uniform in their ranges, angles of a body of
revolution by :func:`drawn_conditions`, of any other shape by :func:`conditions_in_ranges`. What differs between
programs is the ranges of altitudes and angles that each wants.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import radians

import numpy as np

from builder.truth.revolution.flow_table import FlowTable, flow_states
from builder.vehicle.file import Vehicle
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.flight_condition import FlightCondition

ALTITUDES_KM = (12.0, 30.0)
"""Range [km] of altitudes that are drawn where a map holds at all."""


def largest_incidence(vehicle: Vehicle) -> float:
    """Return the largest total incidence [rad] of the vehicle's flight conditions."""
    return max(condition.total_incidence for condition in vehicle.flight_conditions())


def listed_altitudes_km(vehicle: Vehicle) -> tuple[float, float]:
    """Return lowest and highest altitude [km] of the flight conditions."""
    return min(vehicle.conditions.altitudes_km), max(vehicle.conditions.altitudes_km)


def drawn_altitudes_km(vehicle: Vehicle, wanted_km: tuple[float, float] = ALTITUDES_KM) -> tuple[float, float]:
    """Return lowest and highest altitude [km] of ``wanted_km`` that the map holds at.

    They are its own where it holds at none of these; in form "absolute" the altitudes of the flight conditions.
    """
    if not vehicle.map.follows_pressure:
        return listed_altitudes_km(vehicle)
    low, high = vehicle.map.valid_altitude_km
    bottom, top = max(wanted_km[0], low), min(wanted_km[1], high)
    return (bottom, top) if bottom <= top else (low, high)


def drawn_conditions(
    count: int,
    random: np.random.Generator,
    *,
    angles: Callable[[], tuple[float, float]],
    mach_numbers: tuple[float, float],
    altitudes_km: tuple[float, float],
    is_inside: Callable[[FlightCondition], bool],
) -> list[FlightCondition]:
    """Return ``count`` conditions, uniform in Mach number and altitude.

    ``angles`` draws angle of attack and sideslip [rad]; a condition that is not inside is drawn again.
    """
    found: list[FlightCondition] = []
    while len(found) < count:
        alpha, beta = angles()
        condition = FlightCondition(
            mach_number=float(random.uniform(*mach_numbers)),
            angle_of_attack=alpha,
            sideslip_angle=beta,
            altitude=1e3 * float(random.uniform(*altitudes_km)),
        )
        if is_inside(condition):
            found.append(condition)
    return found


def held_out_conditions(
    vehicle: Vehicle, table: FlowTable, count: int, random: np.random.Generator
) -> list[FlightCondition]:
    """Return ``count`` conditions that map and ``table`` both cover.

    With full symmetry the total incidence is uniform from 0 and the roll angle of the wind is any; as listed,
    angle of attack and sideslip are uniform in their ranges.

    Raises
    ------
    InputError
        They have no Mach number in common.
    """
    entry, incidence = vehicle.conditions, min(largest_incidence(vehicle), float(table.incidence_knots[-1]))

    def angles() -> tuple[float, float]:
        if vehicle.map.symmetry == "full":
            total = float(random.uniform(0.0, incidence))
            return wind_angles(total, float(random.uniform(0.0, 2.0 * np.pi)))
        alpha, beta = (
            radians(float(random.uniform(min(listed), max(listed))))
            for listed in (entry.angle_of_attack_deg, entry.sideslip_angle_deg)
        )
        return alpha, beta

    lowest = max(min(entry.mach_number), float(table.mach_knots[0]))
    highest = min(max(entry.mach_number), float(table.mach_knots[-1]))
    if lowest > highest:
        known = f"{table.mach_knots[0]:g} .. {table.mach_knots[-1]:g}, of the flows of the independent model"
        raise InputError(f"conditions.mach_number: expected some within {known}, got {entry.mach_number}")
    return drawn_conditions(
        count,
        random,
        angles=angles,
        mach_numbers=(lowest, highest),
        altitudes_km=drawn_altitudes_km(vehicle),
        is_inside=lambda one: one.total_incidence <= incidence,
    )


def conditions_in_ranges(
    vehicle: Vehicle, altitudes_km: tuple[float, float], count: int, random: np.random.Generator
) -> list[FlightCondition]:
    """Return ``count`` conditions, uniform in what the file lists: Mach number, both angles, flow parameters.

    For vehicles of any shape: nothing is rolled.
    """
    entry, found = vehicle.conditions, list[FlightCondition]()
    listed = [entry.mach_number, entry.angle_of_attack_deg, entry.sideslip_angle_deg]
    listed += [one.values for one in entry.parameters.values()]
    low, high = (np.array([side(one) for one in listed]) for side in (min, max))
    bottom, top = altitudes_km
    for _ in range(count):
        mach, alpha, beta, *parameters = random.uniform(low, high).tolist()
        altitude = float(random.uniform(1e3 * bottom, 1e3 * top))
        found.append(FlightCondition(mach, radians(alpha), radians(beta), altitude, tuple(parameters)))
    return found


def flight_states(conditions: Sequence[FlightCondition]) -> FloatArray:
    """Return (k, 4) the flight states of ``conditions``: M, u, w [rad] and ln p_inf, as tables over them have."""
    mach, incidence, roll = flow_states(conditions)
    pressure = np.array([one.ambient_pressure for one in conditions])
    return np.column_stack([mach, incidence * np.cos(roll), incidence * np.sin(roll), np.log(pressure)])


def wind_angles(total_incidence: float, roll_angle: float) -> tuple[float, float]:
    """Return angle of attack and sideslip [rad] of a total incidence whose leeward meridian is at
    ``roll_angle``."""
    across = np.sin(total_incidence)
    beta = -np.arcsin(across * np.sin(roll_angle))
    alpha = np.arctan2(across * np.cos(roll_angle), np.cos(total_incidence))
    return float(alpha), float(beta)
