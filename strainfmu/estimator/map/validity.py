"""Validity of a map: the ranges that its snapshots cover, each with its unit as a user reads it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import degrees, radians
from typing import Any

import numpy as np

from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE
from strainfmu.estimator.signal_names import COEFFICIENT_NAMES
from strainfmu.flight_condition import (
    ALTITUDE,
    ANGLE_OF_ATTACK,
    CONDITION_QUANTITIES,
    MACH_NUMBER,
    SIDESLIP_ANGLE,
    FlightCondition,
    with_unit,
)


@dataclass(frozen=True)
class ValidRange:
    """A quantity from ``minimum`` to ``maximum`` [``unit``]; they are equal where it was held."""

    quantity: str
    minimum: float
    maximum: float
    unit: str

    @property
    def text(self) -> str:
        """The range as one text, with its unit."""
        low, high = f"{self.minimum:.6g}", f"{self.maximum:.6g}"
        numbers = low if low == high else f"{low} to {high}"
        return numbers if self.unit == "1" else f"{numbers} {self.unit}"


_TOTAL_INCIDENCE = "total_incidence"

_RECORDED = {
    MACH_NUMBER: "1",
    ANGLE_OF_ATTACK: "deg",
    SIDESLIP_ANGLE: "deg",
    _TOTAL_INCIDENCE: "deg",
    ALTITUDE: "m",
    DYNAMIC_PRESSURE: "Pa",
}
"""Quantities of a flight condition in a map's provenance, and their units there."""

RECORDED_KEYS = {name: with_unit(name, unit) for name, unit in _RECORDED.items()}
"""The name of each in the provenance: it ends on the unit."""

_SHOWN = {
    MACH_NUMBER: ("1", 1.0),
    ANGLE_OF_ATTACK: ("deg", 1.0),
    SIDESLIP_ANGLE: ("deg", 1.0),
    _TOTAL_INCIDENCE: ("deg", 1.0),
    ALTITUDE: ("km", 1e-3),
    DYNAMIC_PRESSURE: ("kPa", 1e-3),
}
"""Unit of each for the reader, factor to that unit."""

VALIDITY_LABELS = {one.name: one.label for one in CONDITION_QUANTITIES} | {
    _TOTAL_INCIDENCE: "total incidence, at any roll angle",
    DYNAMIC_PRESSURE: "dynamic pressure",
}
"""What the ranges of a map call each quantity."""


def condition_ranges(conditions: Sequence[FlightCondition]) -> dict[str, list[float]]:
    """Return minimum and maximum of each quantity over ``conditions``, by its name in a map's provenance."""
    ranges = {}
    for name, unit in _RECORDED.items():
        if name != _TOTAL_INCIDENCE:
            found = [getattr(one, name) for one in conditions]
            values = [degrees(one) for one in found] if unit == "deg" else found
            ranges[RECORDED_KEYS[name]] = [min(values), max(values)]
    return ranges


def valid_conditions(ranges: dict[str, list[float]]) -> list[ValidRange]:
    """Return what :func:`condition_ranges` found, for a reader; quantities that are not there are left out."""
    return [
        ValidRange(
            quantity=VALIDITY_LABELS[name],
            minimum=factor * ranges[key][0],
            maximum=factor * ranges[key][1],
            unit=unit,
        )
        for name, (unit, factor) in _SHOWN.items()
        if (key := RECORDED_KEYS[name]) in ranges
    ]


def parameter_ranges(names: Sequence[str], conditions: Sequence[FlightCondition]) -> dict[str, list[float]]:
    """Return minimum and maximum of each flow parameter over ``conditions``, by its name."""
    values = zip(*(one.parameters for one in conditions), strict=True)
    return {name: [min(found), max(found)] for name, found in zip(names, values, strict=True)}


def valid_parameters(ranges: dict[str, list[float]]) -> list[ValidRange]:
    """Return what :func:`parameter_ranges` found, for a reader; units are in the names."""
    return [ValidRange(quantity=name, minimum=low, maximum=high, unit="1") for name, (low, high) in ranges.items()]


def valid_ranges(inverse_map: Any) -> list[ValidRange]:
    """Return the flight conditions and strains that ``inverse_map`` holds for.

    With full symmetry it is the disc of total incidence, whatever the signs of the angles that were listed;
    altitude and dynamic pressure are those that the form of the map allows.
    """
    incidence = RECORDED_KEYS[_TOTAL_INCIDENCE]
    keys = [key for key in RECORDED_KEYS.values() if key != incidence]
    held = {key: inverse_map.provenance[key] for key in keys if key in inverse_map.provenance}
    # Earlier maps hold the altitude as one number.
    ranges = {name: value if isinstance(value, list) else [value, value] for name, value in held.items()}
    stated = {
        MACH_NUMBER: inverse_map.mach_number_range,
        ALTITUDE: inverse_map.altitude_range,
        DYNAMIC_PRESSURE: inverse_map.dynamic_pressure_range,
    }
    ranges |= {RECORDED_KEYS[name]: value.tolist() for name, value in stated.items() if np.all(np.isfinite(value))}
    if inverse_map.provenance.get("symmetry") == "full":
        listed = [RECORDED_KEYS[name] for name in (ANGLE_OF_ATTACK, SIDESLIP_ANGLE)]
        ranges = {key: value for key, value in ranges.items() if key not in listed}
        ranges[incidence] = inverse_map.provenance[incidence]
    strain = 1e6 * float(np.max(inverse_map.strain_range[: inverse_map.n_strain_gauges]))
    return [
        *valid_conditions(ranges),
        *valid_parameters(inverse_map.provenance.get("parameters", {})),
        ValidRange(quantity="|strain| of the gauge that strains most", minimum=0.0, maximum=strain, unit="um/m"),
    ]


def all_ranges(inverse_map: Any) -> list[ValidRange]:
    """Return what the snapshots cover: flight conditions, strains and coefficients."""
    rounded = inverse_map.coefficient_range.round(6) + 0.0  # + 0.0: no negative zeros
    coefficients = zip(COEFFICIENT_NAMES, rounded.tolist(), strict=True)
    return [
        *valid_ranges(inverse_map),
        *(ValidRange(quantity=name, minimum=low, maximum=high, unit="1") for name, (low, high) in coefficients),
    ]


LEAST_PART_OF_SLOPE = 0.8
"""Of the smallest incidence per lateral force over that at the largest incidence: curves over Mach number and roll
angle differ."""


def incidence_per_force(inverse_map: Any) -> float:
    """Return the largest total incidence of the snapshots over the largest lateral coefficient [rad].

    The lateral force of a slender body grows at least in proportion to the incidence, so that no smaller incidence
    gives a coefficient. 0 where nothing is known of it: for maps without full symmetry, whose lateral force need
    not be 0 without incidence.
    """
    held = inverse_map.provenance
    stated = held.get("total_incidence_deg")
    if held.get("symmetry") != "full" or not isinstance(stated, list) or not stated:
        return 0.0
    incidence, force = radians(max(stated)), float(np.abs(inverse_map.coefficient_range[1:3]).max())
    return incidence / force if incidence > 0.0 and force > 0.0 else 0.0
