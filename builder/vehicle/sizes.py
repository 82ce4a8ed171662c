"""Sizes that follow from several entries of a vehicle file: what would take days or memory is refused at once."""

from __future__ import annotations

from collections.abc import Iterator
from math import prod
from typing import TYPE_CHECKING

from builder.vehicle.toml.limits import MAX_CONDITIONS, MAX_ELEMENTS, MAX_GAUGES, MAX_PRESSURES, MIN_ELEMENTS
from strainfmu.errors import InputError

if TYPE_CHECKING:
    from builder.vehicle.file import Vehicle
    from builder.vehicle.model_entries import Resolution


def size_faults(vehicle: Vehicle) -> list[str]:
    """Return what is wrong with the body and with sizes that follow from several entries, a line each."""
    faults = [*_flow_faults(vehicle), *_gauge_faults(vehicle)]
    if not vehicle.is_of_revolution:
        return faults
    try:
        body = vehicle.body()
    except InputError as error:
        return [str(error), *faults]
    return [*faults, *_element_faults(vehicle, body.length)]


def _flow_faults(vehicle: Vehicle) -> Iterator[str]:
    """Yield faults of the numbers of conditions, and of their pressures on the surface nodes."""
    entry, truth = vehicle.conditions, vehicle.truth
    lists = [entry.mach_number, entry.angle_of_attack_deg, entry.sideslip_angle_deg, entry.altitudes_km]
    lists += [one.values for one in entry.parameters.values()]
    knots = [truth.mach_number or (), truth.total_incidence_deg or ()]
    own_nodes = vehicle.shape_kind != "surface"
    for where, sizes, name, resolution in (
        ("conditions", [len(values) for values in lists], "map", vehicle.resolution.map),
        ("truth", [len(values) for values in knots], "truth", vehicle.resolution.truth),
    ):
        count, shown = prod(sizes), " x ".join(map(str, sizes))
        if count > MAX_CONDITIONS:
            yield f"{where}: expected at most {MAX_CONDITIONS} conditions, got {shown} = {count}"
        elif own_nodes and count * _nodes(resolution) > MAX_PRESSURES:
            yield (
                f"{where}: expected at most {MAX_PRESSURES} values of pressure, got {count} conditions x "
                f"{_shown_nodes(name, resolution)} = {count * _nodes(resolution)}"
            )


def _gauge_faults(vehicle: Vehicle) -> Iterator[str]:
    """Yield faults of the numbers of gauges in rows, and of their strains per pressure."""
    finest = max(("map", "truth"), key=lambda name: _nodes(getattr(vehicle.resolution, name)))
    resolution = getattr(vehicle.resolution, finest)
    for layout, entry in vehicle.gauges.layouts.items():
        count = sum(
            len(row.directions) * (len(row.x_m) if row.x_m is not None else row.count or 0)
            for row in entry.rows or ()
        )
        if count > MAX_GAUGES:
            yield f"gauges.layouts.{layout}: expected at most {MAX_GAUGES} gauges, got {count}"
        elif vehicle.shape_kind != "surface" and count * _nodes(resolution) > MAX_PRESSURES:
            yield (
                f"gauges.layouts.{layout}: expected at most {MAX_PRESSURES} strains per pressure, got {count} "
                f"gauges x {_shown_nodes(finest, resolution)} = {count * _nodes(resolution)}"
            )


def _element_faults(vehicle: Vehicle, length: float) -> Iterator[str]:
    """Yield faults of the elements along the meridian; ``length`` of the body [m]."""
    for name in ("map", "truth"):
        resolution: Resolution = getattr(vehicle.resolution, name)
        element = 1e-3 * resolution.element_length_mm
        if element > length / MIN_ELEMENTS:
            yield (
                f"resolution.{name}.element_length_mm: expected at most {1e3 * length / MIN_ELEMENTS:g}, 1/"
                f"{MIN_ELEMENTS} of the body's length, got {resolution.element_length_mm:g}"
            )
        count = round(length / element) * resolution.wall_layers
        if count > MAX_ELEMENTS:
            yield (
                f"resolution.{name}: expected at most {MAX_ELEMENTS} elements, got {length:g} m / "
                f"{resolution.element_length_mm:g} mm x {resolution.wall_layers} wall_layers = {count}"
            )


def _nodes(resolution: Resolution) -> int:
    return resolution.surface_stations * resolution.surface_roll_angles


def _shown_nodes(name: str, resolution: Resolution) -> str:
    return f"{resolution.surface_stations} x {resolution.surface_roll_angles} nodes of resolution.{name}"
