"""The manoeuvre of a demonstration against what its map covers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import degrees
from pathlib import Path

from builder.vehicle.doubtful_entries import is_in_radians
from builder.vehicle.file import Vehicle
from strainfmu.cosim.models.trajectory import Trajectory
from strainfmu.errors import FaultsError
from strainfmu.flight_condition import ALTITUDE, FlightCondition

ROUND_OFF = 1e-9
"""By which a manoeuvre may exceed a range, in the unit of each quantity."""

Covered = tuple[str, str, list[float], list[float]]
"""Quantity, unit, what is flown, what is covered."""


def check_parameters(
    vehicle: Vehicle, trajectory: Trajectory, conditions: Sequence[FlightCondition], path: Path
) -> None:
    """Refuse a manoeuvre that takes a flow parameter out of the range of ``conditions``, the snapshots'.

    Health would be OUTSIDE there, as the parameters are inputs of the estimator. Mach number and incidence beyond
    the snapshots' get a warning.

    Raises
    ------
    FaultsError
        A line per parameter, with the worst value and its time.
    """
    faults = []
    for i, name in enumerate(vehicle.conditions.parameters):
        known = [c.parameters[i] for c in conditions]
        flown = [FlightCondition.of_row(row).parameters[i] for row in trajectory.conditions.tolist()]
        beyond = [max(min(known) - value, value - max(known)) for value in flown]
        worst = max(range(len(flown)), key=beyond.__getitem__)
        if beyond[worst] > ROUND_OFF:
            faults.append(
                f"{path}: {name}: expected {min(known):g} .. {max(known):g}, the range of the snapshots, got "
                f"{flown[worst]:g} at {trajectory.time[worst]:g} s"
            )
    if faults:
        raise FaultsError("\n".join(faults))


def manoeuvre_warnings(
    vehicle: Vehicle, trajectory: Trajectory, conditions: Sequence[FlightCondition], of_revolution: bool
) -> list[str]:
    """Return, a line each, where a manoeuvre leaves what the map covers: there the sigmas may not hold.

    The first line is a question where its angles look like radians.

    Parameters
    ----------
    conditions : conditions of the snapshots.
    of_revolution : whether the snapshots are of a body of revolution, whose flows hold at every roll angle.
    """
    flown = [FlightCondition.of_row(row) for row in trajectory.conditions.tolist()]
    largest, held = (degrees(max(one.total_incidence for one in some)) for some in (flown, conditions))
    radians = f"warning: the manoeuvre flies {largest:.4g} deg at most, the map covers {held:.4g} deg: in radians?"
    return [radians] * is_in_radians(largest, held) + [
        f"warning: the manoeuvre flies {name} {min(values):.4g} to {max(values):.4g}{unit}, the map covers "
        f"{min(covered):.4g} to {max(covered):.4g}{unit}: outside, sigmas may not hold"
        for name, unit, values, covered in _ranges(vehicle, flown, conditions, of_revolution)
        if min(values) < min(covered) - ROUND_OFF or max(values) > max(covered) + ROUND_OFF
    ]


def _ranges(
    vehicle: Vehicle, flown: Sequence[FlightCondition], held: Sequence[FlightCondition], of_revolution: bool
) -> Iterator[Covered]:
    """Yield the quantities that bound a map of this form and symmetry."""
    yield "Mach number", "", [c.mach_number for c in flown], [c.mach_number for c in held]
    if not (of_revolution and vehicle.map.symmetry == "full"):
        yield (
            "angle of attack",
            " deg",
            [degrees(c.angle_of_attack) for c in flown],
            [degrees(c.angle_of_attack) for c in held],
        )
        yield (
            "sideslip angle",
            " deg",
            [degrees(c.sideslip_angle) for c in flown],
            [degrees(c.sideslip_angle) for c in held],
        )
    total = [degrees(c.total_incidence) for c in held]
    yield "total incidence", " deg", [degrees(c.total_incidence) for c in flown], [0.0, *total]
    heights = [1e-3 * c.altitude for c in held]
    if vehicle.map.follows_pressure:
        heights = list(vehicle.map.valid_altitude_km)
    yield ALTITUDE, " km", [1e-3 * c.altitude for c in flown], heights
