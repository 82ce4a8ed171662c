"""Inputs of an FMU for the temperature sensors of a map that knows what the wall's temperature strains."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from strainfmu.estimator.map.sensors import ThermalMap
from strainfmu.estimator.signal_names import TEMPERATURE
from strainfmu.interface.fmi_variables import Variable
from strainfmu.interface.health_names import VALID_GAUGES
from strainfmu.interface.input_names import NOT_GIVEN

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
    if not names:
        return tuple(interface)
    outputs = (
        replace(variable, depends_on=(*variable.depends_on, *names))
        if variable.causality == "output" and variable.name != VALID_GAUGES
        else variable
        for variable in interface
    )
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
    return (*outputs, *inputs)
