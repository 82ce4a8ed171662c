"""The sets of flight conditions that snapshots are taken at."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import product
from math import radians

from strainfmu.flight_condition import FlightCondition


def condition_grid(
    mach_numbers: Iterable[float],
    angles_of_attack_deg: Iterable[float],
    sideslip_angles_deg: Iterable[float],
    altitude: float,
) -> list[FlightCondition]:
    """Return all combinations, sideslip running fastest. Angles in degrees, altitude in metres.

    The paper's set P1 is M {5, 5.5, 6, 6.5, 7} x alpha {0, 2, .., 10} x beta {0, 5, 10} at 20 km.
    """
    return [
        FlightCondition(mach, radians(alpha), radians(beta), altitude)
        for mach, alpha, beta in product(mach_numbers, angles_of_attack_deg, sideslip_angles_deg)
    ]


def flow_key(condition: FlightCondition) -> tuple[float, float]:
    """Return (M, a_T [rad]), rounded: on a body of revolution conditions that share it share one flow."""
    return round(condition.mach_number, 9), round(condition.total_incidence, 9)
