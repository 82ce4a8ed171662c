"""Validity of a map: the ranges that its snapshots cover, each with its unit as a user reads it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import degrees
from typing import TYPE_CHECKING

import numpy as np

from strainfmu.flight_condition import FlightCondition

if TYPE_CHECKING:
    from strainfmu.estimator.map.inverse_map import InverseMap


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


_OF_CONDITIONS = (
    ("Mach number", "mach_number", "1", 1.0),
    ("angle of attack", "angle_of_attack_deg", "deg", 1.0),
    ("sideslip angle", "sideslip_angle_deg", "deg", 1.0),
    ("total incidence, at any roll angle", "total_incidence_deg", "deg", 1.0),
    ("altitude", "altitude_m", "km", 1e-3),
    ("dynamic pressure", "dynamic_pressure_Pa", "kPa", 1e-3),
)
"""Quantity, its name in a map's provenance, unit for the reader, factor to that unit."""


_LISTED_ANGLES = ("angle_of_attack_deg", "sideslip_angle_deg")


def condition_ranges(conditions: Sequence[FlightCondition]) -> dict[str, list[float]]:
    """Return minimum and maximum of each quantity over ``conditions``, by its name in a map's provenance."""
    values = {
        "mach_number": [c.mach_number for c in conditions],
        "angle_of_attack_deg": [degrees(c.angle_of_attack) for c in conditions],
        "sideslip_angle_deg": [degrees(c.sideslip_angle) for c in conditions],
        "altitude_m": [c.altitude for c in conditions],
        "dynamic_pressure_Pa": [c.dynamic_pressure for c in conditions],
    }
    return {name: [min(found), max(found)] for name, found in values.items()}


def valid_conditions(ranges: dict[str, list[float]]) -> list[ValidRange]:
    """Return what :func:`condition_ranges` found, for a reader; quantities that are not there are left out."""
    return [
        ValidRange(
            quantity=quantity, minimum=factor * ranges[name][0], maximum=factor * ranges[name][1], unit=unit
        )
        for quantity, name, unit, factor in _OF_CONDITIONS
        if name in ranges
    ]


def parameter_ranges(names: Sequence[str], conditions: Sequence[FlightCondition]) -> dict[str, list[float]]:
    """Return minimum and maximum of each flow parameter over ``conditions``, by its name."""
    values = zip(*(one.parameters for one in conditions), strict=True)
    return {name: [min(found), max(found)] for name, found in zip(names, values, strict=True)}


def valid_parameters(ranges: dict[str, list[float]]) -> list[ValidRange]:
    """Return what :func:`parameter_ranges` found, for a reader; units are in the names."""
    return [ValidRange(quantity=name, minimum=low, maximum=high, unit="1") for name, (low, high) in ranges.items()]


def valid_ranges(inverse_map: InverseMap) -> list[ValidRange]:
    """Return the flight conditions and strains that ``inverse_map`` holds for.

    With full symmetry it is the disc of total incidence, whatever the signs of the angles that were listed;
    altitude and dynamic pressure are those that the form of the map allows.
    """
    names = [name for _, name, _, _ in _OF_CONDITIONS if name != "total_incidence_deg"]
    held = {name: inverse_map.provenance[name] for name in names if name in inverse_map.provenance}
    # Earlier maps hold the altitude as one number.
    ranges = {name: value if isinstance(value, list) else [value, value] for name, value in held.items()}
    stated = {
        "mach_number": inverse_map.mach_number_range,
        "altitude_m": inverse_map.altitude_range,
        "dynamic_pressure_Pa": inverse_map.dynamic_pressure_range,
    }
    ranges |= {name: value.tolist() for name, value in stated.items() if np.all(np.isfinite(value))}
    if inverse_map.provenance.get("symmetry") == "full":
        ranges = {name: value for name, value in ranges.items() if name not in _LISTED_ANGLES}
        ranges["total_incidence_deg"] = inverse_map.provenance["total_incidence_deg"]
    strain = 1e6 * float(np.max(inverse_map.strain_range[: inverse_map.n_strain_gauges]))
    return [
        *valid_conditions(ranges),
        *valid_parameters(inverse_map.provenance.get("parameters", {})),
        ValidRange(quantity="|strain| of the gauge that strains most", minimum=0.0, maximum=strain, unit="um/m"),
    ]


def all_ranges(inverse_map: InverseMap) -> list[ValidRange]:
    """Return what the snapshots cover: flight conditions, strains and coefficients."""
    from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES

    rounded = inverse_map.coefficient_range.round(6) + 0.0  # + 0.0: no negative zeros
    coefficients = zip(COEFFICIENT_NAMES, rounded.tolist(), strict=True)
    return [
        *valid_ranges(inverse_map),
        *(ValidRange(quantity=name, minimum=low, maximum=high, unit="1") for name, (low, high) in coefficients),
    ]
