"""Inputs of an FMU for sensors that are no strain gauges, for the thrust that some read, and for temperatures."""

from __future__ import annotations

import re
from collections.abc import Sequence
from math import atan2, degrees
from typing import TYPE_CHECKING, Protocol

from strainfmu.estimator.signal_names import TEMPERATURE
from strainfmu.estimator.signal_names import THRUST as THRUST
from strainfmu.interface.fmi_variables import Variable, depending_on, strain_names
from strainfmu.interface.health_names import VALID_GAUGES
from strainfmu.interface.input_names import NOT_GIVEN, NOT_KNOWN

if TYPE_CHECKING:
    from strainfmu.estimator.map.inverse_map import InverseMap
    from strainfmu.estimator.map.sensors import SensorRows, ThermalMap

PREFIX = "sensor."

_UNITS = {"m/m": "1", "N m": "N.m"}
"""Units of a map that FMI writes otherwise."""

_DISPLAY_UNITS = {"1": "um/m", "Pa": "kPa", "N": "kN", "N.m": "kN.m", "m": "mm"}


class SensedVehicle(Protocol):
    """A map, or the vehicle that flies: names of its strain gauges, then of its auxiliary sensors."""

    @property
    def gauge_names(self) -> tuple[str, ...]: ...
    @property
    def n_strain_gauges(self) -> int: ...


def sensor_names(vehicle: SensedVehicle) -> tuple[str, ...]:
    """Return ``sensor.NAME`` of each sensor by its name in the map; none of a map of strain gauges alone.

    What an identifier cannot hold is an underscore there; of two names that are the same then, the later one ends
    by the number of its row.
    """
    names: dict[str, None] = {}
    first = vehicle.n_strain_gauges
    for number, name in enumerate(vehicle.gauge_names[first:], start=first + 1):
        known = PREFIX + identifier(name)
        while known in names:
            known = f"{known}_{number}"
        names[known] = None
    return tuple(names)


def identifier(name: str) -> str:
    """Return ``name`` with an underscore for what an identifier cannot hold."""
    return re.sub(r"[^A-Za-z0-9_]|^(?=[0-9])", "_", name)


def reading_units(inverse_map: InverseMap) -> dict[str, str]:
    """Return the unit, as FMI has it, of each auxiliary sensor and of thrust by name of the input."""
    units = fmi_units(inverse_map.sensors)[inverse_map.n_strain_gauges :]
    unit_of_sensor = dict(zip(sensor_names(inverse_map), units, strict=True))
    return unit_of_sensor | ({THRUST: "N"} if has_thrust(inverse_map) else {})


def reading_names(vehicle: SensedVehicle) -> tuple[str, ...]:
    """Return the names of all rows of a map, or of a vehicle that flies: strains, then auxiliary sensors."""
    return (*strain_names(vehicle.n_strain_gauges), *sensor_names(vehicle))


def fmi_units(sensors: SensorRows) -> list[str]:
    """Return the unit of each row as FMI has it."""
    return [_UNITS.get(unit, unit) for unit in sensors.unit]


def display_unit(unit: str) -> str | None:
    """Return the unit in which tools show a reading of ``unit``, None for that itself."""
    return _DISPLAY_UNITS.get(unit)


def has_thrust(inverse_map: InverseMap) -> bool:
    """Return whether thrust moves a reading of the map."""
    return bool(inverse_map.sensors.follows_thrust.any())


def sensor_inputs(inverse_map: InverseMap) -> list[Variable]:
    """Return the inputs of the auxiliary sensors.

    They have no minimum and no maximum: what lies beyond the range of a sensor is left out, and health states it.
    """
    sensors, first = inverse_map.sensors, inverse_map.n_strain_gauges
    units = fmi_units(sensors)
    size = sensors.scale * inverse_map.strain_range
    return [
        Variable(
            name=name,
            description=f"{sensors.kind[i].capitalize()} of sensor {inverse_map.gauge_names[i]} at "
            f"{place_text(*inverse_map.gauge_position[i])}; left out beyond {sensors.largest[i]:g} {units[i]}",
            causality="input",
            kind="reading",
            unit=units[i],
            display_unit=display_unit(units[i]),
            nominal=float(size[i]) if size[i] > 0.0 else None,
            start=0.0,
        )
        for i, name in enumerate(sensor_names(inverse_map), start=first)
    ]


def place_text(x: float, y: float, z: float) -> str:
    """Return in words where x, y, z [m] in body axes is."""
    return f"x = {x:.4g} m, roll angle {degrees(atan2(y, z)) % 360.0:.4g} deg"


def with_thrust_input(interface: Sequence[Variable], inverse_map: InverseMap) -> tuple[Variable, ...]:
    """Return ``interface`` with the thrust behind it, on which every output depends; as it is without sensors
    that thrust moves."""
    if not has_thrust(inverse_map):
        return tuple(interface)
    thrust = Variable(
        name=THRUST,
        description="Thrust, forward along the axis, taken off what accelerometers and load cells read; "
        f"{NOT_KNOWN:g} or NaN where not known: they are left out then",
        causality="input",
        kind="reading",
        unit="N",
        display_unit="kN",
        start=0.0,
    )
    return (*depending_on(interface, (THRUST,)), thrust)


TEMPERATURE_ARRAYS = {
    TEMPERATURE: f"Temperature of each sensor; {NOT_GIVEN} where not known; names in the documentation"
}


def temperature_names(thermal: ThermalMap) -> tuple[str, ...]:
    """Return ``temperature[1]`` .. of the sensors."""
    return tuple(f"temperature[{i}]" for i in range(1, thermal.n_sensors + 1))


def with_temperature_inputs(interface: Sequence[Variable], thermal: ThermalMap) -> tuple[Variable, ...]:
    """Return ``interface`` with the temperatures behind it, on which all outputs depend but one.

    The number of gauges in use follows from the readings as they come.
    """
    names = temperature_names(thermal)
    inputs = (
        Variable(
            name=name,
            description=f"Temperature of sensor {sensor}; {NOT_GIVEN} where not known",
            causality="input",
            kind="reading",
            unit="K",
            nominal=thermal.reference_temperature,
            minimum=0.0,
            start=0.0,
            array=TEMPERATURE,
        )
        for name, sensor in zip(names, thermal.sensor_names, strict=True)
    )
    return (*depending_on(interface, names, but=(VALID_GAUGES,)), *inputs)
