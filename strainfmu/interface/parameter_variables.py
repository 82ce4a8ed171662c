"""Inputs of an FMU for flow parameters, and outputs that state which of them leaves its range.

A map whose tables follow them has their standard deviations as inputs besides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from strainfmu.estimator.map.validity import PARAMETER_TOLERANCE, flow_parameters, parameter_names_of
from strainfmu.interface.fmi_variables import Variable
from strainfmu.interface.health_names import STATE
from strainfmu.interface.input_names import NAVIGATION_INPUTS, NOT_GIVEN, NOT_KNOWN

if TYPE_CHECKING:
    from strainfmu.estimator.map.inverse_map import InverseMap

PREFIX = "parameter."
STD_PREFIX = "parameter_std."
OUTSIDE_PREFIX = "health.outside."


def parameter_names(inverse_map: InverseMap) -> tuple[str, ...]:
    """Return the names of the inputs, ``parameter.NAME`` by the names of the vehicle file."""
    return tuple(f"{PREFIX}{name}" for name in parameter_names_of(inverse_map))


def parameter_std_names(inverse_map: InverseMap) -> tuple[str, ...]:
    """Return the names of the inputs for their standard deviations; none where the estimate takes none."""
    names = parameter_names_of(inverse_map) if follows_parameters(inverse_map) else ()
    return tuple(f"{STD_PREFIX}{name}" for name in names)


def follows_parameters(inverse_map: InverseMap) -> bool:
    """Return whether the estimate follows parameters that are stated with a standard deviation."""
    return inverse_map.manifold is not None and inverse_map.manifold.parameters is not None


def with_parameter_inputs(interface: Sequence[Variable], inverse_map: InverseMap) -> tuple[Variable, ...]:
    """Return ``interface`` with the parameters behind it, then their scores, then their standard deviations.

    Health depends on the parameters, and all that is estimated where standard deviations are inputs.
    """
    known = flow_parameters(inverse_map)
    if not known.names:
        return tuple(interface)
    ranges = [
        f"{low:g} to {high:g}" for low, high in zip(known.minimum.tolist(), known.maximum.tolist(), strict=True)
    ]
    named = list(zip(known.names, ranges, strict=True))
    before = (_depending(variable, inverse_map) for variable in interface)
    deviations = [_deviation(name) for name in known.names] if follows_parameters(inverse_map) else []
    use = "sharpens the estimate where its sigma is stated" if deviations else "for health alone"
    values = [_value(name, f"{use}, {bounds} in the map") for name, bounds in named]
    return (*before, *values, *(_score(name, bounds) for name, bounds in named), *deviations)


def _depending(variable: Variable, inverse_map: InverseMap) -> Variable:
    """Return ``variable`` with what it depends on of the parameters."""
    stds = parameter_std_names(inverse_map)
    of_estimate = bool(stds) and NAVIGATION_INPUTS[0] in variable.depends_on
    if variable.name != STATE and not of_estimate:
        return variable
    return replace(variable, depends_on=(*variable.depends_on, *parameter_names(inverse_map), *stds))


def _value(name: str, text: str) -> Variable:
    return Variable(
        name=f"{PREFIX}{name}",
        description=f"{name} of the flow, unit of the vehicle file, {text}; {NOT_KNOWN:g} or NaN where not known",
        causality="input",
        kind="air data",
        start=NOT_KNOWN,
    )


def _score(name: str, bounds: str) -> Variable:
    return Variable(
        name=f"{OUTSIDE_PREFIX}{name}",
        description=f"Part of its range, {bounds}, by which {name} leaves it, 0 inside or not known; "
        f"OUTSIDE above {PARAMETER_TOLERANCE:g}",
        causality="output",
        kind="health",
        unit="1",
        minimum=0.0,
        depends_on=(f"{PREFIX}{name}",),
    )


def _deviation(name: str) -> Variable:
    return Variable(
        name=f"{STD_PREFIX}{name}",
        description=f"Standard deviation of {PREFIX}{name}; {NOT_GIVEN} where not stated, "
        "and the value is for health alone",
        causality="input",
        kind="air data",
        minimum=0.0,
        start=0.0,
    )
