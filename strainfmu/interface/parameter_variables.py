"""Inputs of an FMU for further parameters of the flow, and outputs that state which of them leaves its range."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from strainfmu.estimator.flow_parameters import PARAMETER_TOLERANCE, flow_parameters
from strainfmu.interface.fmi_variables import Variable
from strainfmu.interface.input_names import NOT_KNOWN

if TYPE_CHECKING:
    from strainfmu.estimator.inverse_map import InverseMap

PREFIX = "parameter."
OUTSIDE_PREFIX = "health.outside."


def parameter_names(inverse_map: InverseMap) -> tuple[str, ...]:
    """Return the names of the inputs, ``parameter.NAME`` by the names of the vehicle file."""
    return tuple(f"{PREFIX}{name}" for name in flow_parameters(inverse_map).names)


def with_parameter_inputs(interface: Sequence[Variable], inverse_map: InverseMap) -> tuple[Variable, ...]:
    """Return ``interface`` with the parameters behind it, then their scores; health depends on them."""
    known = flow_parameters(inverse_map)
    if not known.names:
        return tuple(interface)
    inputs = parameter_names(inverse_map)
    before = (
        replace(one, depends_on=(*one.depends_on, *inputs)) if one.name == "health.state" else one
        for one in interface
    )
    ranges = [
        f"{low:g} to {high:g}" for low, high in zip(known.minimum.tolist(), known.maximum.tolist(), strict=True)
    ]
    values = (
        Variable(
            name=f"{PREFIX}{name}",
            description=f"{name} of the flow, unit of the vehicle file, for health alone, {held} in the map; "
            f"{NOT_KNOWN:g} or NaN where not known",
            causality="input",
            start=NOT_KNOWN,
        )
        for name, held in zip(known.names, ranges, strict=True)
    )
    scores = (
        Variable(
            name=f"{OUTSIDE_PREFIX}{name}",
            description=f"Part of its range, {held}, by which {name} leaves it, 0 inside or not known; "
            f"OUTSIDE above {PARAMETER_TOLERANCE:g}",
            causality="output",
            unit="1",
            minimum=0.0,
            depends_on=(f"{PREFIX}{name}",),
        )
        for name, held in zip(known.names, ranges, strict=True)
    )
    return (*before, *values, *scores)
