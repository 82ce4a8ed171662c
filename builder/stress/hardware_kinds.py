"""Kinds of error of the whole vehicle: each stated error alone, at sizes within what is stated and beyond."""

from __future__ import annotations

import numpy as np

from builder.stress.kind import Build, Filtered, Hardware, Kind, KindClass, as_stated, exact
from builder.structure.as_built.vehicle import AsBuilt
from builder.structure.as_built_kinds import IN_NOISE, KINDS, UNIT
from builder.truth.as_built import drawn
from builder.vehicle.map.options import Noise
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE

MANY = 5
"""Draws of the vehicles as stated, times the draws of the other kinds: their false alarms are rare."""


DEGREE = UNIT["deg"]


def stated_class(size: float, stated: float) -> KindClass:
    """Return the class of an error of ``size`` whose stated standard deviation is ``stated``."""
    return "within" if abs(size) <= 2.0 * stated + 1e-9 else "outside"


def with_error(name: str, value: float, sign: bool = False) -> Build:
    """Return vehicles with one error alone: ``value`` [SI] of all that have it, or a ``sign`` drawn for each."""
    kind = KINDS[name]

    def build(hardware: Hardware, random: np.random.Generator) -> AsBuilt:
        size = hardware.counts.in_flight(kind)
        return exact(hardware, random).changed(
            **{name: value * (random.choice([-1.0, 1.0], size=size) if sign else np.ones(size))}
        )

    return build


def twice_stated(hardware: Hardware, random: np.random.Generator) -> AsBuilt:
    """Return a vehicle with all errors drawn at twice their stated sizes."""
    return drawn(hardware.noise, hardware.counts, random, 2.0)


def nominal_kinds() -> list[Kind]:
    """Return the vehicle without errors, and with all of them drawn."""
    return [
        Kind(
            error="nothing wrong",
            size="vehicle of the file",
            group="within",
            what="The independent model without installation errors, with gauge noise.",
            outside_target=0.1,
        ),
        Kind(
            error="all installation errors",
            size="drawn at their stated sizes",
            group="within",
            what="Vehicles as built; every sigma is meant for these.",
            build=as_stated,
            draws=MANY,
            outside_target=0.1,
        ),
        Kind(
            error="all installation errors",
            size="drawn at twice their stated sizes",
            group="outside",
            what="Vehicles built worse than stated: a third of their errors is beyond twice the stated size.",
            build=twice_stated,
        ),
    ]


def stated_kinds(noise: Noise) -> list[Kind]:
    """Return each stated error alone at twice its size, where it is stated at all."""
    found = []
    for one in IN_NOISE:
        size = 2.0 * float(getattr(noise, one.noise))
        if size == 0.0:
            continue
        whose = "the sign drawn" if one.is_one_in_flight else "each with its own sign"
        unit = f"{one.unit} of {one.relative_to}" if one.relative_to else one.unit
        found.append(
            Kind(
                error=one.error,
                size=f"+-{size:g} {unit}",
                group="within",
                what=f"Twice the size that {one.noise} states, {whose}; all else exact.",
                build=with_error(one.name, size * one.scale, sign=True),
            )
        )
    return found


def fixed_kinds(noise: Noise) -> list[Kind]:
    """Return errors of fixed sizes, whatever the vehicle states; the class follows from what it states."""
    listed = (
        ("Young's modulus", "+1 %", "common_gain", 1.0 / 1.01 - 1.0, noise.common_gain_percent * 0.01),
        ("dynamic pressure", "+1 %", DYNAMIC_PRESSURE, 0.01, noise.dynamic_pressure_percent * 0.01),
        ("wall thickness", "+2 %", "wall_thickness", 0.02, noise.wall_thickness_percent * 0.01),
        ("roll of the layout", "+1 deg", "layout_roll", DEGREE, noise.layout_roll_deg * DEGREE),
        ("internal pressure", "+20 % of p_inf", "internal_pressure", 0.2, noise.internal_pressure_percent * 0.01),
    )
    return [
        Kind(
            error=error,
            size=size,
            group=stated_class(value, stated),
            what="One error alone, of a fixed size.",
            build=with_error(field, value),
        )
        for error, size, field, value, stated in listed
    ]


def beyond_kinds(noise: Noise) -> list[Kind]:
    """Return gain of all gauges and dynamic pressure beyond their stated sizes."""
    gain = max(5.0, 5.0 * noise.common_gain_percent)
    q = max(10.0, 5.0 * noise.dynamic_pressure_percent)
    return [
        Kind(
            error="gain of all gauges",
            size=f"+{gain:g} %",
            group="unobservable",
            what="All strains in proportion: a flight at more incidence reads the same.",
            build=with_error("common_gain", 0.01 * gain),
        ),
        Kind(
            error="dynamic pressure, no navigation",
            size=f"+{q:g} %",
            group="unobservable",
            what="The strain is right, its scale is not: a flight at less incidence reads the same.",
            build=with_error(DYNAMIC_PRESSURE, 0.01 * q),
            navigation=False,
        ),
        Kind(
            error="dynamic pressure",
            size=f"+{q:g} %",
            group="outside",
            what="The same with Mach number and altitude known: q_inf contradicts 0.7 M^2 p(h).",
            build=with_error(DYNAMIC_PRESSURE, 0.01 * q),
        ),
    ]


def thinner_middle(hardware: Hardware, random: np.random.Generator) -> AsBuilt:
    """Return a vehicle whose wall is 5 % thinner at the gauges of the middle third."""
    low, high = float(hardware.station.min()), float(hardware.station.max())
    third = (high - low) / 3.0
    there = (hardware.station >= low + third) & (hardware.station <= high - third)
    return exact(hardware, random).changed(wall_thickness=np.where(there, -0.05, 0.0))


def filter_kinds() -> list[Kind]:
    """Return vehicles as built whose samples are filtered over time, zeros known exactly and with errors drawn."""
    listed = (("exactly known", 0.0, 0.0), ("wrong by 5 sigma of the noise", 5.0, 0.0))
    return [
        Kind(
            error="filter over time, zeros",
            size=size,
            group="within",
            what="The zeros are wrong by their stated standard deviations for the whole flight, of 2 s.",
            build=as_stated,
            filtered=Filtered(zero=zero, common=common),
        )
        for size, zero, common in (*listed, ("wrong in common by 5 sigma of the noise", 0.0, 5.0))
    ]
