"""Outputs of an FMU for the loads beside the five: rolling moment and the loads of sections along the body."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from strainfmu.estimator.map.offers import has_other_outputs
from strainfmu.estimator.other_loads import SECTION_LOADS
from strainfmu.interface.fmi_variables import Variable, deviation_of

if TYPE_CHECKING:
    from strainfmu.estimator.estimate import Estimate
    from strainfmu.estimator.map.inverse_map import InverseMap

OTHER_LOAD_ARRAYS = {
    **{f"section.{name}": f"{text}, of every section" for name, (text, _) in SECTION_LOADS.items()},
    **{f"sigma.section.{name}": f"Standard deviations of section.{name}" for name in SECTION_LOADS},
}


def section_stations(inverse_map: InverseMap) -> tuple[float, ...] | None:
    """Return x [m] of the sections whose loads are outputs, with the rolling moment; None where neither is."""
    return tuple(inverse_map.section_station.tolist()) if has_other_outputs(inverse_map) else None


def with_other_load_outputs(interface: Sequence[Variable], inverse_map: InverseMap) -> tuple[Variable, ...]:
    """Return ``interface`` with the other loads behind it; they depend on what the pitching moment does."""
    if not has_other_outputs(inverse_map):
        return tuple(interface)
    known = {variable.name: variable for variable in interface}
    of_coefficient = replace(known["M_P"], array=None, nominal=None)
    of_load = replace(known["moment.pitch"], array=None, nominal=None)
    values = [
        replace(
            of_coefficient, name="M_R", description="Rolling moment coefficient, positive with starboard down"
        ),
        replace(of_load, name="moment.roll", description="Rolling moment, positive with starboard going down"),
    ]
    body = [two for one in values for two in (one, deviation_of(one))]
    body = [_without(one, "moment_station") for one in body]
    sections = [
        replace(
            _without(of_load, "moment_station"),
            name=f"section.{name}[{i}]",
            description=f"{text}, of the part ahead of x = {station:g} m",
            unit=unit,
            display_unit=f"k{unit}",
            array=f"section.{name}",
        )
        for name, (text, unit) in SECTION_LOADS.items()
        for i, station in enumerate(inverse_map.section_station.tolist(), start=1)
    ]
    return (*interface, *body, *sections, *map(deviation_of, sections))


def other_load_outputs(n_sections: int) -> dict[str, str]:
    """Return name and unit of the outputs that :func:`with_other_load_outputs` adds, in its order."""
    sections = {
        f"section.{name}[{i}]": unit for name, (_, unit) in SECTION_LOADS.items() for i in range(1, n_sections + 1)
    }
    return {
        "M_R": "1",
        "sigma.M_R": "1",
        "moment.roll": "N.m",
        "sigma.moment.roll": "N.m",
        **sections,
        **{f"sigma.{name}": unit for name, unit in sections.items()},
    }


def other_load_values(estimate: Estimate) -> list[float]:
    """Return the outputs that :func:`with_other_load_outputs` adds, in its order."""
    body = (
        estimate.other_coefficients[0],
        estimate.other_coefficients_std[0],
        estimate.other_loads[0],
        estimate.other_loads_std[0],
    )
    sections = np.concatenate([estimate.other_loads[1:], estimate.other_loads_std[1:]])
    return [*map(float, body), *sections.tolist()]


def _without(value: Variable, parameter: str) -> Variable:
    return replace(value, initially_depends_on=tuple(n for n in value.initially_depends_on if n != parameter))
