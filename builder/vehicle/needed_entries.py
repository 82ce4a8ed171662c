"""Entries that are required where they apply: cells of a flow solver, elements of a structural model, flights."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from builder.vehicle.model_entries import ELEMENTS, EULER, FOURIER, KNOTS, NODES, NeededBy, Resolution
from strainfmu.errors import InputError

if TYPE_CHECKING:
    from builder.vehicle.file import Vehicle


def missing_entries(vehicle: Vehicle) -> Iterator[str]:
    """Yield a line for each entry of [truth] and [resolution] that the file lacks and its models need."""
    if vehicle.has_flow_table:
        for name in KNOTS:
            if getattr(vehicle.truth, name) is None:
                yield (
                    f"truth.{name}: entry is missing, the flows of the vehicle that flies; alarm levels by "
                    "engine 'euler' need them, unless map.alarm_levels is 'nominal'"
                )
    for level in ("map", "truth"):
        needed, resolution = _needed_by(vehicle, level), getattr(vehicle.resolution, level)
        for name, field in Resolution.model_fields.items():
            by = [one for one in field.metadata if isinstance(one, NeededBy)]
            if name not in resolution.model_fields_set and needed.intersection(by):
                yield f"resolution.{level}.{name}: entry is missing, it is required with {by[0].what}"


def _needed_by(vehicle: Vehicle, level: str) -> set[NeededBy]:
    """Return what the model of a level consists of."""
    kind, flies = vehicle.shape_kind, level == "truth"
    found = set() if kind == "surface" else {NODES}
    if kind == "profile":
        found |= {FOURIER, ELEMENTS}
    if kind == "sections" and flies:
        found.add(ELEMENTS)
    engine: str | None = vehicle.aerodynamics.engine
    if flies and kind == "profile":
        engine = _engine_that_flies(vehicle)
    if engine == "euler":
        found.add(EULER)
    return found


def _engine_that_flies(vehicle: Vehicle) -> str | None:
    """Return the engine of the flow table, None where there is none, or where the body itself is wrong."""
    try:
        return vehicle.truth_engine() if vehicle.has_flow_table else None
    except InputError:
        return None
