"""The manoeuvre of a demonstration against the conditions of the snapshots."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from strainfmu.cosim.trajectory import Trajectory
from strainfmu.flight_condition import FlightCondition

ROUND_OFF = 1e-9
"""By which a manoeuvre may exceed the range of the snapshots, in the unit of each quantity."""


def manoeuvre_warnings(trajectory: Trajectory, conditions: Sequence[FlightCondition]) -> list[str]:
    """Return, a line each, where a manoeuvre leaves what the snapshots cover: there the sigmas may not hold."""
    flown = [FlightCondition(*row) for row in trajectory.conditions.tolist()]
    found = []
    for name, attribute, scale, unit in (
        ("Mach number", "mach_number", 1.0, ""),
        ("angle of attack", "angle_of_attack", np.rad2deg(1.0), " deg"),
        ("sideslip angle", "sideslip_angle", np.rad2deg(1.0), " deg"),
        ("total incidence", "total_incidence", np.rad2deg(1.0), " deg"),
        ("altitude", "altitude", 1e-3, " km"),
    ):
        covered = scale * np.array([getattr(condition, attribute) for condition in conditions])
        values = scale * np.array([getattr(condition, attribute) for condition in flown])
        beyond_low = attribute != "total_incidence" and values.min() < covered.min() - ROUND_OFF
        if beyond_low or values.max() > covered.max() + ROUND_OFF:
            found.append(
                f"warning: the manoeuvre flies {name} {values.min():.4g} to {values.max():.4g}{unit}, the "
                f"snapshots cover {covered.min():.4g} to {covered.max():.4g}{unit}: outside, sigmas may not hold"
            )
    return found
