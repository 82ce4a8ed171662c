"""Units of the flow's quantities in a DBC file: the factor and the offset that take a signal to SI."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from strainfmu.can.wire.dbc_lookup import MappedDatabase
from strainfmu.can.wire.frame_layout import (
    is_parameter,
    is_parameter_std,
    is_temperature,
)
from strainfmu.estimator.air_inputs import SAMPLE_INPUTS
from strainfmu.units import READING_UNITS, STRAIN_UNITS, TEMPERATURE_UNITS, UNITS_OF

_OF_UNIT = {
    "Pa": (UNITS_OF["Pa"], "a unit of pressure", ""),
    "1": (UNITS_OF["1"] | {"Mach": 1.0, "Ma": 1.0}, "a number", "1"),
    "m": (UNITS_OF["m"], "a unit of length", ""),
    "K": (UNITS_OF["K"], "K", ""),
    "rad": (UNITS_OF["rad"], "a unit of angle", ""),
    "m/s2": (UNITS_OF["m/s2"], "a unit of acceleration", ""),
    "rad/s": (UNITS_OF["rad/s"], "a unit of angular rate", ""),
    "rad/s2": (UNITS_OF["rad/s2"], "a unit of angular acceleration", ""),
}
_OF_STRAIN = (STRAIN_UNITS, "a unit of strain", "1")
_UNITS_OF = {one.name: _OF_STRAIN if one.shown in STRAIN_UNITS else _OF_UNIT[one.unit] for one in SAMPLE_INPUTS}
"""Units of a quantity of the flow, what they are, and the unit of a signal without one."""


def to_si(
    file: MappedDatabase, message: Any, signal: Any, quantity: str, readings: Mapping[str, str]
) -> tuple[float, float]:
    """Return factor and offset of a signal that holds ``quantity`` of the flow.

    ``readings`` are the units of auxiliary sensors and of thrust by name of the estimator's input.

    Raises
    ------
    InputError
        Its unit is none of the quantity.
    """
    if is_temperature(quantity):
        return TEMPERATURE_UNITS[file.unit(message, signal, tuple(TEMPERATURE_UNITS), "a unit of temperature")]
    if is_parameter(quantity) or is_parameter_std(quantity):
        return 1.0, 0.0  # their unit is that of the vehicle file, which nobody states
    if quantity in readings:
        unit = readings[quantity]
        return file.factor(message, signal, READING_UNITS.get(unit, {unit: 1.0}), f"a unit of {quantity}"), 0.0
    units, what, unless_stated = _UNITS_OF[quantity]
    return file.factor(message, signal, units=units, what=what, unless_stated=unless_stated), 0.0
