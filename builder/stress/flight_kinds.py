"""Kinds of error of flight and flow: conditions at the border of the envelope and beyond, other pressure."""

from __future__ import annotations

from builder.inverse.noise.leeward import other_leeward
from builder.stress.flights import (
    FEWER_BEYOND,
    above_mach,
    altitude_is_inside,
    at_altitude,
    at_edge,
    at_incidence,
    below_mach,
    edges_of,
    mirrored,
    mirrored_is_inside,
)
from builder.stress.flows import AnotherEngine, TangentCones, vortex_pairs, windward_bump
from builder.stress.kind import Kind, KindClass, as_stated
from builder.vehicle.file import Vehicle
from strainfmu.flight_condition import ALTITUDE

ALTITUDES_KM = (12.0, 15.0, 25.0, 30.0)

BEYOND = 0.2
"""How far beyond the envelope the conditions are of which 95 % are to be flagged, relative to its bounds."""

FLAGGED = 95.0

NO_NAVIGATION = (
    "Only strain and q_inf are given. The strain differs from the nearest flight's inside, but a linear map "
    "takes part of the difference for another state."
)


def envelope_kinds(vehicle: Vehicle) -> list[Kind]:
    """Return flights of vehicles as built, all errors drawn at their stated sizes."""
    found = [
        Kind(
            error=ALTITUDE,
            size=f"{altitude:g} km",
            group="within" if altitude_is_inside(vehicle, 1e3 * altitude) else "outside",
            what="Strain scales with the pressure level, gauge noise does not.",
            flights=at_altitude(1e3 * altitude),
            build=as_stated,
        )
        for altitude in ALTITUDES_KM
    ]
    if not vehicle.is_of_revolution:
        return found + _shape_kinds(vehicle) + mach_kinds(vehicle)
    found += [
        Kind(
            error="angles mirrored",
            size="the other sign of one or both",
            group="within" if mirrored_is_inside(vehicle) else "outside",
            what="Angle of attack, sideslip or both as listed with the other sign.",
            flights=mirrored,
            build=as_stated,
        ),
        Kind(
            error="incidence near its largest",
            size="70 to 100 % of it",
            group="within",
            what="The border of the envelope, where the fewest snapshots are.",
            flights=at_incidence(0.7, 1.0),
            build=as_stated,
        ),
        Kind(
            error="incidence beyond its largest",
            size="+5 to +20 %",
            group="outside",
            what="Just outside the envelope.",
            flights=at_incidence(1.05, 1.0 + BEYOND),
            build=as_stated,
        ),
        Kind(
            error="incidence beyond its largest",
            size="+20 %",
            group="outside",
            what="Outside the envelope, at any roll angle of the wind.",
            flights=at_incidence(1.0 + BEYOND, 1.0 + BEYOND),
            build=as_stated,
            flagged_target=FLAGGED,
        ),
    ]
    return found + mach_kinds(vehicle)


def _shape_kinds(vehicle: Vehicle) -> list[Kind]:
    """Return flights near the ends of the ranges of both angles and beyond, of another shape than a profile."""
    if not edges_of(vehicle):
        return []
    near, beyond = "angle near its largest", "angle beyond its largest"
    inside = "Angle of attack or sideslip near the end of its range."
    outside = "Angle of attack or sideslip beyond its own range, the other inside."
    listed: tuple[tuple[str, str, KindClass, str, float, float, float | None], ...] = (
        (
            near,
            "70 to 100 % of it",
            "within",
            inside,
            0.7,
            1.0,
            None,
        ),
        (beyond, "+5 to +20 %", "outside", outside, 1.05, 1.0 + BEYOND, None),
        (beyond, "+20 %", "outside", outside, 1.0 + BEYOND, 1.0 + BEYOND, FLAGGED),
    )
    return [
        Kind(
            error=error,
            size=size,
            group=group,
            what=what,
            flights=at_edge(low, high),
            build=as_stated,
            draws=FEWER_BEYOND,
            flagged_target=flagged,
        )
        for error, size, group, what, low, high, flagged in listed
    ]


def mach_kinds(vehicle: Vehicle) -> list[Kind]:
    """Return Mach numbers beyond both ends, with and without navigation."""
    return [
        Kind(
            error=f"Mach number {where}{'' if navigation else ', no navigation'}",
            size=size,
            group="outside",
            what="The Mach number is given." if navigation else NO_NAVIGATION,
            flights=flights,
            build=as_stated,
            navigation=navigation,
            draws=1.0 if vehicle.is_of_revolution else FEWER_BEYOND,
            flagged_target=FLAGGED if navigation else None,
        )
        for where, size, flights in (
            ("below its least", "-20 %", below_mach(1.0 - BEYOND)),
            ("beyond its largest", "+20 %", above_mach(1.0 + BEYOND)),
        )
        for navigation in (True, False)
    ]


def flow_kinds(vehicle: Vehicle) -> list[Kind]:
    """Return pressure that is not the flow's of the map."""
    is_shape = not vehicle.is_of_revolution
    expanded = not is_shape or other_leeward(vehicle) == "prandtl_meyer"
    is_own = is_shape and vehicle.aerodynamics.engine == "newtonian"
    leeward = "Prandtl-Meyer expansion leeward" if expanded else "ambient pressure leeward"
    return [
        Kind(
            error="another engine",
            size="newtonian, another leeward side" if is_own else "newtonian",
            group="outside",
            what=f"Pressure of modified Newtonian theory, {leeward}, on the same body.",
            flow=AnotherEngine(),
        ),
        *(
            [
                Kind(
                    error="another engine",
                    size="tangent cones",
                    group="outside",
                    what="Pressure of the cone that is tangent at each point, Prandtl-Meyer expansion leeward.",
                    flow=TangentCones(),
                )
            ]
            if vehicle.is_of_revolution
            else []
        ),
        Kind(
            error="local pressure, windward",
            size="+10 % of p_inf",
            group="outside",
            what="A bump at mid-body, as of a separation; its loads count as true.",
            flow=windward_bump(0.1),
        ),
        Kind(
            error="local pressure, windward",
            size="+100 % of p_inf",
            group="outside",
            what="The same, ten times as large.",
            flow=windward_bump(1.0),
        ),
        *(
            Kind(
                error="vortex pair, leeward",
                size=f"{100.0 * size:g} % of p_inf at {where}",
                group="outside",
                what="Suction below two vortices that are in no snapshot; its loads count as true.",
                flow=flow,
            )
            for size in (-0.1, -0.3)
            for where, flow in vortex_pairs(size).items()
        ),
    ]
