"""Columns of what an estimator FMU states in addition to coefficients and health, named as for its map."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from strainfmu.estimator.other_loads import SIGMA, column_of
from strainfmu.interface.health_names import LINEAR_LOADS
from strainfmu.interface.parameter_variables import OUTSIDE_PREFIX

_PREFIXES = (
    "air_data.",
    "sigma.air_data.",
    "identified.air_data.",
    "navigation_used.",
    LINEAR_LOADS,
    OUTSIDE_PREFIX,
)
"""What the names of such outputs begin with, but for loads behind the five."""

_RENAMED = {LINEAR_LOADS: "linear_loads"}
"""Columns whose name is not the name of the output."""


@dataclass(frozen=True)
class OtherOutput:
    """An output of an FMU, its column, and the column's unit."""

    output: str
    column: str
    unit: str


def other_outputs_of(outputs: Iterable[tuple[str, str]]) -> tuple[OtherOutput, ...]:
    """Return the others among ``outputs``, names and units, in the order of the columns of a map.

    Loads stand ahead of their standard deviations; air data have that order already.
    """
    found = [
        OtherOutput(output=name, column=column_of(name) or _RENAMED.get(name, name), unit=unit.replace(".", " "))
        for name, unit in outputs
        if column_of(name) or name.startswith(_PREFIXES)
    ]
    if any(column_of(one.output) for one in found):
        found.sort(key=lambda one: one.output.startswith(SIGMA))
    return tuple(found)
