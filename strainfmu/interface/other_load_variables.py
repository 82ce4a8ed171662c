"""Outputs of an FMU for the loads behind the five, as :mod:`strainfmu.estimator.other_loads` lists them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from strainfmu.estimator.map.inverse_map import groups_of_outputs
from strainfmu.estimator.other_loads import FAMILIES, LoadArray, LoadKind, load_arrays
from strainfmu.estimator.settings import OF_STATION
from strainfmu.interface.fmi_variables import Variable, deviation_of

if TYPE_CHECKING:
    from strainfmu.estimator.estimate import Estimate
    from strainfmu.estimator.map.inverse_map import InverseMap

_VALUES = {
    name: f"{text}, of every {family.singular}"
    for family in FAMILIES
    for load in family.loads
    for name, text in ((load.coefficient, load.coefficient_text), (load.output, load.text))
    if name and family.is_listed
}
OTHER_LOAD_ARRAYS = {**_VALUES, **{f"sigma.{name}": f"Standard deviations of {name}" for name in _VALUES}}
"""Descriptions of the arrays of FMI 3.0."""


def with_other_load_outputs(interface: Sequence[Variable], inverse_map: InverseMap) -> tuple[Variable, ...]:
    """Return ``interface`` with the other loads behind it; they depend on what the pitching moment does.

    The moment point of the settings is not theirs.
    """
    known = {variable.name: variable for variable in interface}
    arrays = load_arrays(groups_of_outputs(inverse_map))
    return (*interface, *(variable for array in arrays for variable in _variables(array, known)))


def other_load_values(estimate: Estimate) -> list[float]:
    """Return the outputs that :func:`with_other_load_outputs` adds, in its order."""
    values = (
        estimate.other_loads,
        estimate.other_loads_std,
        estimate.other_coefficients,
        estimate.other_coefficients_std,
    )
    arrays = load_arrays(estimate.load_groups)
    return [number for array in arrays for number in values[array.value][array.group.rows].tolist()]


def _variables(array: LoadArray, known: dict[str, Variable]) -> list[Variable]:
    """Return the outputs of ``array``; the interface so far by name is ``known``."""
    if array.is_std:
        return [deviation_of(value) for value in _variables(replace(array, is_std=False), known)]
    like, load, of_map = known["M_P" if array.is_coefficient else "moment.pitch"], array.group.load, array.group
    texts = of_map.described(load.coefficient_text if array.is_coefficient else load.text)
    settings = tuple(name for name in like.initially_depends_on if name != OF_STATION)
    return [
        replace(
            like,
            name=name,
            description=text,
            unit=array.unit,
            display_unit=like.display_unit if array.is_coefficient else _shown(load),
            nominal=None,
            array=array.name if of_map.family.is_listed else None,
            initially_depends_on=settings,
        )
        for name, text in zip(array.outputs, texts, strict=True)
    ]


def _shown(load: LoadKind) -> str | None:
    """Return the unit that people read, None where it is the load's own."""
    return None if load.shown == load.unit else load.shown
