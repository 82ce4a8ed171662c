"""Checks of a vehicle's gauge layouts against its wall, before anything is solved."""

from collections.abc import Iterator

import numpy as np

from builder.structure.fourier.fourier_model import place_layouts
from builder.structure.fourier.wall_layup import TOUCHES, change_stations
from builder.structure.gauge_placement import gauge_mesh
from builder.structure.solid.case import structure_case
from builder.structure.solid.gauge_layouts import solid_gauges
from builder.structure.solid.gauge_rows import Gauges
from builder.structure.solid.mesh_choice import MeshChoice, make_mesh
from builder.structure.solid.strain_solution import layout_rows
from builder.structure.wall import wall_of
from builder.vehicle.file import Vehicle
from strainfmu.arrays import FloatArray


def check_gauges(vehicle: Vehicle) -> dict[str, int]:
    """Place the gauges of every layout on a coarse mesh and return their number per layout.

    Raises
    ------
    InputError
        The wall does not fit the body, a gauge is not on its surface, or the model cannot do what is requested.
    """
    names = list(vehicle.gauges.layouts)
    if not vehicle.has_meridian:
        layouts = structure_case(vehicle, names).layouts
        return {name: len(layouts[name].name) for name in names}
    mesh = gauge_mesh(vehicle)
    if vehicle.structure.model == "solid":
        gauges = {name: solid_gauges(vehicle, name, mesh) for name in names}
        layout_rows(make_mesh(vehicle.body(), wall_of(vehicle), MeshChoice(resolution="coarse")), gauges)
        return {name: len(gauges_of_layout.name) for name, gauges_of_layout in gauges.items()}
    placed, _ = place_layouts(vehicle, mesh, names)
    return {name: len(layout.names) for name, layout in placed.items()}


def gauges_in_use(vehicle: Vehicle) -> Gauges:
    """Return the gauges in use, each on its surface; errors as :func:`check_gauges`."""
    name = vehicle.gauges.layout
    if vehicle.has_meridian:
        return solid_gauges(vehicle, name, gauge_mesh(vehicle))
    return structure_case(vehicle, [name]).layouts[name]


def gauge_roll_angles(vehicle: Vehicle) -> FloatArray:
    """Return (n_d,) the roll angles of the gauges in use [rad]; errors as :func:`check_gauges`."""
    name = vehicle.gauges.layout
    if vehicle.has_meridian and vehicle.structure.model != "solid":
        return place_layouts(vehicle, gauge_mesh(vehicle), [name])[1][name].roll_angle
    position = gauges_in_use(vehicle).position
    return np.arctan2(position[:, 1], position[:, 2])


def gauges_at_breaks(vehicle: Vehicle) -> Iterator[str]:
    """Yield a line for each change of slope or thickness that gauges in use are within one element of.

    Strain changes there within millimetres. Of bodies of revolution; errors as :func:`check_gauges`.
    """
    if not vehicle.has_meridian:
        return
    name, length = vehicle.gauges.layout, vehicle.resolution.map.element_length_mm
    wall, gauges = wall_of(vehicle), gauges_in_use(vehicle)
    for station, cause in sorted(change_stations(vehicle.body(), wall).items()):
        near = np.abs(gauges.position[:, 0] - station) <= 1e-3 * length + TOUCHES
        if near.any():
            names = ", ".join(gauge for gauge, is_near in zip(gauges.name, near, strict=True) if is_near)
            yield (
                f"gauges.layouts.{name}: {names}: within one element ({length:g} mm) of the change of {cause} at "
                f"{station:g} m, where strain changes within millimetres; move them at least {length:g} mm away"
            )
