"""The solid model's input, made from a vehicle file: wall, support, mesh and gauges."""

from __future__ import annotations

from builder.structure.gauge_placement import gauge_mesh
from builder.structure.solid.displaced_gauges import displaced_gauges
from builder.structure.solid.gauge_layouts import solid_gauges
from builder.structure.solid.mesh_choice import MeshChoice
from builder.structure.solid.model import SolidCase
from builder.structure.solid.solid_mesh import SUPPORT
from builder.structure.solid.supports import Clamped, Foundation, Support
from builder.structure.wall import wall_of
from builder.vehicle.file import Vehicle
from strainfmu.errors import InputError


def solid_case(
    vehicle: Vehicle,
    layouts: list[str],
    mesh: MeshChoice | None = None,
    solver: str | None = None,
    allow_locking: bool = False,
) -> SolidCase:
    """Return what the three-dimensional model of a vehicle is made of, by default on a swept mesh.

    Where the section [noise] has position or orientation errors, the layout in use is there displaced as well.

    Raises
    ------
    InputError
        A layout does not exist or is wrong, or the wall does not fit the body.
    """
    known = vehicle.gauges.layouts
    for name in layouts:
        if name not in known:
            raise InputError(f"layout '{name}' found, must be one of {', '.join(known)}")
    rows_on = gauge_mesh(vehicle)
    gauges = {name: solid_gauges(vehicle, name, rows_on) for name in dict.fromkeys(layouts)}
    in_use = vehicle.gauges.layout
    if vehicle.noise.moves_gauges and in_use in gauges:
        gauges |= displaced_gauges(in_use, gauges[in_use], vehicle.body())
    return SolidCase(
        vehicle=vehicle.name,
        body=vehicle.body(),
        wall=wall_of(vehicle),
        density=vehicle.material.density_kg_per_m3,
        support=support_of(vehicle),
        mesh=mesh or MeshChoice(resolution=vehicle.structure.resolution),
        layouts=gauges,
        solver=solver,
        allow_locking=allow_locking,
    )


def support_of(vehicle: Vehicle) -> Support | None:
    """Return what holds the vehicle, None in free flight."""
    entry = vehicle.structure
    if entry.support == "free_flight":
        return None
    if entry.support == "clamped_aft":
        return Clamped(SUPPORT)
    assert entry.foundation_normal_N_per_m3 is not None
    assert entry.foundation_tangential_N_per_m3 is not None
    return Foundation(SUPPORT, entry.foundation_normal_N_per_m3, entry.foundation_tangential_N_per_m3)
