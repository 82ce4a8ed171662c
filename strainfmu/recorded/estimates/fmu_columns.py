"""Columns of what an estimator FMU states beside coefficients and health, named as those of its map."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from strainfmu.interface.parameter_variables import OUTSIDE_PREFIX

_PREFIXES = (
    "M_R",
    "sigma.M_R",
    "moment.roll",
    "sigma.moment.roll",
    "section.",
    "sigma.section.",
    "air_data.",
    "sigma.air_data.",
    "identified.air_data.",
    "navigation_used.",
    "health.linear_loads",
    OUTSIDE_PREFIX,
)
"""What the names of such outputs begin with."""

_RENAMED = {
    "moment.roll": "rolling_moment",
    "sigma.moment.roll": "sigma.rolling_moment",
    "health.linear_loads": "linear_loads",
}
"""Columns whose name is not that of the output."""


@dataclass(frozen=True)
class OtherOutput:
    """An output of an FMU, its column, and the column's unit."""

    output: str
    column: str
    unit: str


def other_outputs_of(outputs: Iterable[tuple[str, str]]) -> tuple[OtherOutput, ...]:
    """Return the others among ``outputs``, names and units, in the order of the columns of a map.

    Loads stand ahead of their deviations; air data have that order already.
    """
    found = [
        OtherOutput(output=name, column=_RENAMED.get(name, name), unit=unit.replace(".", " "))
        for name, unit in outputs
        if name.startswith(_PREFIXES)
    ]
    if any(one.output == "M_R" for one in found):
        found.sort(key=lambda one: one.output.startswith("sigma."))
    return tuple(found)
