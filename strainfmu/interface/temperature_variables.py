"""Inputs of an FMU for the temperature sensors of a map that knows what the wall's temperature strains."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from strainfmu.estimator.map.temperature import ThermalMap
from strainfmu.interface.fmi_variables import Variable
from strainfmu.interface.input_names import NOT_GIVEN

TEMPERATURE_ARRAYS = {
    "temperature": f"Temperature of each sensor; {NOT_GIVEN} where not known; names in the documentation"
}


def temperature_names(thermal: ThermalMap | None) -> tuple[str, ...]:
    """Return ``temperature[1]`` .. of the sensors; none without modes."""
    count = 0 if thermal is None else thermal.n_sensors
    return tuple(f"temperature[{i}]" for i in range(1, count + 1))


def with_temperature_inputs(interface: Sequence[Variable], thermal: ThermalMap | None) -> tuple[Variable, ...]:
    """Return ``interface`` with the temperatures behind it, on which all outputs depend but one.

    The number of gauges in use follows from the readings as they come.
    """
    names = temperature_names(thermal)
    if thermal is None or not names:
        return tuple(interface)
    outputs = (
        replace(one, depends_on=(*one.depends_on, *names))
        if one.causality == "output" and one.name != "health.valid_gauges"
        else one
        for one in interface
    )
    inputs = (
        Variable(
            name=name,
            description=f"Temperature of sensor {sensor}; {NOT_GIVEN} where not known",
            causality="input",
            unit="K",
            nominal=thermal.reference_temperature,
            minimum=0.0,
            start=0.0,
            array="temperature",
        )
        for name, sensor in zip(names, thermal.sensor_names, strict=True)
    )
    return (*outputs, *inputs)
