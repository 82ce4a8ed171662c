"""Validity of a map: the ranges that its snapshots cover, as users read them, and when a flight is outside.

A half-space of the envelope is a direction n with the largest n'C over the snapshots. An estimate is outside if
n'C exceeds it by more than its own uncertainty explains, in standard deviations of n'C. Dynamic pressure, Mach
number and altitude have ranges of their own; where all three are known they must agree, q = 0.7 M^2 p(h).

Flow parameters, such as deflections of controls, have ranges too. The linear estimate does not use them: the prior
holds all values of the snapshots. The nonlinear one does where their standard deviation is stated
(:mod:`strainfmu.estimator.map.nonlinear_map`). A value that is known and out of range shows that the map does not
hold, whatever strain and coefficients say.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import radians
from typing import Any

import numpy as np

from strainfmu.arrays import FloatArray
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

PARAMETER_TOLERANCE = 0.01
"""Part of its range by which a parameter may leave it: errors of a sensor of deflection, and of rounding."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FlowParameters:
    """The n_p parameters of a map, in units of the vehicle file.

    Attributes
    ----------
    names : n_p names, as in the vehicle file.
    minimum, maximum : (n_p,) over the snapshots.
    """

    names: tuple[str, ...]
    minimum: FloatArray
    maximum: FloatArray

    @property
    def span(self) -> FloatArray:
        """(n_p,) width of each range; of a value that the snapshots hold fixed its size, at least 1."""
        width = self.maximum - self.minimum
        return np.asarray(np.where(width > 0.0, width, np.maximum(np.abs(self.maximum), 1.0)))

    def outside(self, score: FloatArray) -> tuple[str, ...]:
        """Return the names of those that leave their range, by their ``score`` (n_p,)."""
        return tuple(name for name, excess in zip(self.names, score, strict=True) if excess > PARAMETER_TOLERANCE)


def flow_parameters(inverse_map: Any) -> FlowParameters:
    """Return the parameters of ``inverse_map``, none of one whose snapshots have none."""
    ranges: dict[str, list[float]] = inverse_map.provenance.get("parameters", {})
    bounds = np.array([*ranges.values()], dtype=float).reshape(-1, 2)
    return FlowParameters(names=tuple(ranges), minimum=bounds[:, 0], maximum=bounds[:, 1])


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


def incidence_per_force(inverse_map: Any) -> float:
    """Return the largest total incidence of the snapshots over the largest lateral coefficient [rad].

    The lateral force of a slender body grows at least in proportion to the incidence, so that no smaller incidence
    gives a coefficient. 0 where nothing is known of it: for maps without full symmetry, whose lateral force need
    not be 0 without incidence.
    """
    stated = inverse_map.provenance.get("total_incidence_deg")
    if inverse_map.provenance.get("symmetry") != "full" or not isinstance(stated, list) or not stated:
        return 0.0
    incidence, force = radians(max(stated)), float(np.abs(inverse_map.coefficient_range[1:3]).max())
    return incidence / force if incidence > 0.0 and force > 0.0 else 0.0
