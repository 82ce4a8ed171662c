"""Ranges that the snapshots of a map cover, as users read them.

A half-space of the envelope is a direction n with the largest n'C over the snapshots. An estimate is outside if
n'C exceeds it by more than its own uncertainty explains, in standard deviations of n'C. Dynamic pressure, Mach
number and altitude have ranges of their own; where all three are known they must agree, q = 0.7 M^2 p(h).

Flow parameters have ranges too: a value that is known and out of range shows that the map does not hold, whatever
strain and coefficients say.
"""

from dataclasses import dataclass
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
    with_unit,
)


@dataclass(frozen=True)
class ValidRange:
    """A quantity from ``minimum`` to ``maximum`` [``unit``]; both are equal where it was constant."""

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


TOTAL_INCIDENCE = "total_incidence"

CONDITION_UNITS = {
    MACH_NUMBER: ("1", "1", 1.0),
    ANGLE_OF_ATTACK: ("deg", "deg", 1.0),
    SIDESLIP_ANGLE: ("deg", "deg", 1.0),
    TOTAL_INCIDENCE: ("deg", "deg", 1.0),
    ALTITUDE: ("m", "km", 1e-3),
    DYNAMIC_PRESSURE: ("Pa", "kPa", 1e-3),
}
"""Quantities of a flight condition: unit in a map's provenance, unit for the reader, factor between them."""

RECORDED_KEYS = {name: with_unit(name, unit) for name, (unit, _, _) in CONDITION_UNITS.items()}
"""The name of each in the provenance: it ends on the unit."""

VALIDITY_LABELS = {quantity.name: quantity.label for quantity in CONDITION_QUANTITIES} | {
    TOTAL_INCIDENCE: "total incidence, at any roll angle",
    DYNAMIC_PRESSURE: "dynamic pressure",
}
"""What the ranges of a map call each quantity."""


def valid_conditions(ranges: dict[str, list[float]]) -> list[ValidRange]:
    """Return the ``ranges`` of flight conditions, by their names in a provenance, for a reader."""
    return [
        ValidRange(
            quantity=VALIDITY_LABELS[name],
            minimum=factor * ranges[key][0],
            maximum=factor * ranges[key][1],
            unit=unit,
        )
        for name, (_, unit, factor) in CONDITION_UNITS.items()
        if (key := RECORDED_KEYS[name]) in ranges
    ]


def valid_parameters(ranges: dict[str, list[float]]) -> list[ValidRange]:
    """Return ``ranges`` of flow parameters by name, for a reader; units are in the names."""
    return [ValidRange(quantity=name, minimum=low, maximum=high, unit="1") for name, (low, high) in ranges.items()]


def valid_ranges(inverse_map: Any) -> list[ValidRange]:
    """Return the flight conditions and strains that ``inverse_map`` holds for.

    With full symmetry it is the disc of total incidence, whatever the signs of the angles that were listed;
    altitude and dynamic pressure are those that the form of the map allows.
    """
    incidence = RECORDED_KEYS[TOTAL_INCIDENCE]
    keys = [key for key in RECORDED_KEYS.values() if key != incidence]
    recorded = {key: inverse_map.provenance[key] for key in keys if key in inverse_map.provenance}
    # Earlier maps have the altitude as one number.
    ranges = {name: value if isinstance(value, list) else [value, value] for name, value in recorded.items()}
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
