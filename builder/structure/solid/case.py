"""The solid model's input, made from a vehicle file: wall, support, mesh and gauges."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from builder.structure.gauge_placement import gauge_mesh
from builder.structure.solid.checks.wall_layers import layers_needed
from builder.structure.solid.free_case import free_case
from builder.structure.solid.gauges.displaced_gauges import displaced_gauges
from builder.structure.solid.gauges.gauge_layouts import solid_gauges
from builder.structure.solid.gauges.gauge_rows import Gauges
from builder.structure.solid.mesh.solid_mesh import SUPPORT
from builder.structure.solid.mesh.swept_mesh import RESOLUTIONS
from builder.structure.solid.mesh_choice import SWEPT, MeshChoice
from builder.structure.solid.model import AnyCase, SolidCase
from builder.structure.solid.operators.supports import Clamped, Foundation, Support
from builder.structure.wall import Wall, wall_of
from builder.vehicle.file import Vehicle
from builder.vehicle.shape.geometry import BodyOfRevolution
from strainfmu.errors import InputError


def structure_case(
    vehicle: Vehicle,
    layouts: list[str],
    mesh: MeshChoice | None = None,
    solver: str | None = None,
    allow_locking: bool = False,
) -> AnyCase:
    """Return what the three-dimensional model of a vehicle of any shape is made of.

    For a body of revolution it is the case of :func:`solid_case`; the mesh of another shape is named by the file,
    or follows from its sections.

    Raises
    ------
    InputError
        A layout does not exist or is wrong, the wall does not fit the body, or a mesh is chosen where the file has
        one.
    """
    if vehicle.is_of_revolution:
        return solid_case(vehicle, layouts, mesh, solver, allow_locking)
    if mesh is not None and (mesh.source != SWEPT or mesh.unit != 1.0):
        kind = vehicle.shape_kind
        raise InputError(f"--model: expected none with shape.{kind}, got '{mesh.source}'; structure.mesh names it")
    _check_layouts(vehicle, layouts)
    resolution = None if mesh is None else mesh.resolution
    return free_case(vehicle, layouts, support_of(vehicle), resolution, solver, allow_locking)


def _check_layouts(vehicle: Vehicle, layouts: list[str]) -> None:
    known = vehicle.gauges.layouts
    for name in layouts:
        if name not in known:
            raise InputError(f"layout '{name}' found, must be one of {', '.join(known)}")


def solid_case(
    vehicle: Vehicle,
    layouts: list[str],
    mesh: MeshChoice | None = None,
    solver: str | None = None,
    allow_locking: bool = False,
) -> SolidCase:
    """Return what the three-dimensional model of a vehicle is made of, by default on a swept mesh.

    A swept mesh gets as many elements through the wall as the
    locking check needs at the base and at the gauges.
    The second mesh, of ``structure.checked_by``, is in the unit of the first and names its surfaces likewise.
    Where the section [noise] has position or orientation errors, the layout in use is there displaced as well.

    Raises
    ------
    InputError
        A layout does not exist or is wrong, the wall does not fit the body, or that is none of revolution.
    """
    _check_layouts(vehicle, layouts)
    rows_on = gauge_mesh(vehicle)
    gauges = {name: solid_gauges(vehicle, name, rows_on) for name in dict.fromkeys(layouts)}
    body, wall = vehicle.body(), wall_of(vehicle)
    second = None
    if vehicle.structure.checked_by is not None:
        own = mesh is None or mesh.file is None
        second = MeshChoice(
            source=str(vehicle.beside(vehicle.structure.checked_by)),
            unit=1.0 if mesh is None or own else mesh.unit,
            by_position=False if mesh is None or own else mesh.by_position,
        )
    mesh = _with_layers(mesh or MeshChoice(resolution=vehicle.structure.resolution), body, wall, gauges)
    in_use = vehicle.gauges.layout
    if vehicle.noise.moves_gauges and in_use in gauges:
        gauges |= displaced_gauges(in_use, gauges[in_use], body)
    return SolidCase(
        vehicle=vehicle.name,
        body=body,
        wall=wall,
        density=vehicle.material.density_kg_per_m3,
        support=support_of(vehicle),
        mesh=mesh,
        layouts=gauges,
        solver=solver,
        allow_locking=allow_locking,
        checked_by=second,
    )


def _with_layers(mesh: MeshChoice, body: BodyOfRevolution, wall: Wall, gauges: Mapping[str, Gauges]) -> MeshChoice:
    """Return the choice with its layers through the wall, where it states none.

    Other meshes have the layers of the swept one that the mesh is compared with.
    """
    if mesh.layers is not None:
        return mesh
    at_gauges = [
        float(r) for one in gauges.values() for r in body.radius(one.position[:, 0].clip(0.0, body.length))
    ]
    resolution = RESOLUTIONS[mesh.resolution]
    radius = np.array([body.base_radius, *at_gauges])
    return replace(mesh, layers=layers_needed(wall, radius, resolution.n_sectors, resolution.n_layers))


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
