"""The outer surface of a vehicle, however its file gives the shape: triangles whose nodes carry pressure."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from builder.aero.cfd.formats.surface_files import read_surface
from builder.aero.cfd.units import METRES
from builder.aero.surface.edges import FEATURE_ANGLE, prepare_surface
from builder.aero.surface.mesh import SurfaceMesh, mesh_of_grid
from builder.aero.surface.self_intersections import refuse_self_intersections
from builder.vehicle.shape.geometry import SurfaceGrid, surface_grid
from builder.vehicle.shape.sectioned_body import SectionedBody
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

if TYPE_CHECKING:
    from builder.vehicle.file import Vehicle
    from builder.vehicle.model_entries import Resolution

SAME_LENGTH = 0.02
"""Relative difference up to which a length in some unit is the one stated."""
BASE_PLANE = 1e-5
"""Of the length: how far the nodes of the base may lie ahead of the last one."""
BASE_NORMAL = 0.99
NOSE_AT_ORIGIN = 0.02
"""Of the length: how far the foremost node may lie from x = 0."""


def outer_surface(vehicle: Vehicle, resolution: Resolution) -> tuple[SurfaceMesh, tuple[str, ...]]:
    """Return the vehicle's surface without its base, and notes on what was changed on the surface of a file.

    Raises
    ------
    InputError
        The shape, or the file that it names, is wrong.
    """
    if vehicle.is_of_revolution:
        grid = surface_grid(vehicle.body(), resolution.surface_stations, resolution.surface_roll_angles)
        return mesh_of_grid(grid), ()
    if vehicle.shape_kind == "sections":
        body = vehicle.sectioned_body()
        return sections_mesh(body, resolution.surface_stations, resolution.surface_roll_angles), ()
    assert vehicle.shape is not None
    assert vehicle.shape.surface is not None
    return surface_of_file(vehicle.beside(vehicle.shape.surface), vehicle.shape.unit, vehicle.shape.length_m)


def sections_grid(body: SectionedBody, n_x: int, n_roll: int) -> SurfaceGrid:
    """Return stations, doubled at slope breaks, and roll angles of a body of sections; radii are those at +z."""
    stations = []
    for start, end in pairwise([0.0, *body.slope_breaks.tolist(), body.length]):
        stations.append(np.linspace(start, end, max(3, round(n_x * (end - start) / body.length))))
    x = np.concatenate(stations)
    return SurfaceGrid(x=x, radius=body.radius(x, np.zeros(1)), angle=np.zeros(len(x)), n_roll=n_roll)


def sections_mesh(body: SectionedBody, n_x: int, n_roll: int) -> SurfaceMesh:
    """Return the surface of a body of sections, open at its base; nodes are as in :func:`sections_grid`."""
    grid = sections_grid(body, n_x, n_roll)
    point = body.point(grid.x[:, None], node_roll_angles(body, grid)).reshape(-1, 3)
    return SurfaceMesh(point, mesh_of_grid(grid).triangle)


def node_roll_angles(body: SectionedBody, grid: SurfaceGrid) -> FloatArray:
    """Return the roll angles (n_x, n_roll) [rad] of the nodes of :func:`sections_mesh`, denser at narrow edges."""
    return body.spread_roll_angle(grid.x[:, None], grid.roll_angle)


def surface_of_file(path: Path, unit: str | None, length: float | None) -> tuple[SurfaceMesh, tuple[str, ...]]:
    """Return the surface of a file in metres, facing outward, split at sharp edges, without its base.

    Parameters
    ----------
    path : the file, one that :func:`builder.aero.cfd.formats.surface_files.read_surface` knows.
    unit : of the file, or None where ``length`` states the scale.
    length : of the vehicle [m], or None.

    Raises
    ------
    InputError
        The file is missing or damaged, the unit does not give the length, the nose is not at the origin, or the
        surface has a hole, more than two triangles at an edge, or cuts itself; the message gives the place.
    """
    mesh = read_surface(path)
    extent = float(np.ptp(mesh.point[:, 0]))
    scale = file_scale(path, extent, unit, length)
    if length is not None and abs(scale * extent / length - 1.0) > SAME_LENGTH:
        fitting = [name for name, metres in METRES.items() if abs(metres * extent / length - 1.0) <= SAME_LENGTH]
        hint = f"; in {fitting[0]} it is {METRES[fitting[0]] * extent:.4g} m" if fitting else ""
        raise InputError(f"{path}: expected a length of {length:g} m, got {scale * extent:.4g} m in {unit}{hint}")
    mesh = SurfaceMesh(scale * mesh.point, mesh.triangle)
    nose = float(mesh.point[:, 0].min())
    if abs(nose) > NOSE_AT_ORIGIN * scale * extent:
        raise InputError(f"{path}: expected the nose at x = 0, x aft, got the foremost node at x = {nose:.4g} m")
    try:
        prepared, notes = prepare_surface(mesh, FEATURE_ANGLE)
        refuse_self_intersections(prepared)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    return without_base(prepared), tuple(f"{path.name}: {note}" for note in notes)


def without_base(mesh: SurfaceMesh) -> SurfaceMesh:
    """Return ``mesh`` without the triangles that lie in the plane of greatest x and face aft."""
    x = mesh.point[:, 0]
    at_end = (x[mesh.triangle] > x.max() - BASE_PLANE * np.ptp(x)).all(axis=1)
    aft = mesh.vector_area[:, 0] > BASE_NORMAL * mesh.area
    sides = mesh.triangle[~(at_end & aft)]
    used, number = np.unique(sides, return_inverse=True)
    return SurfaceMesh(mesh.point[used], number.reshape(-1, 3).astype(np.int64))


def file_scale(path: Path, extent: float, unit: str | None, length: float | None) -> float:
    """Return the metres of a file's unit of length, from the unit or, without one, from the vehicle's length [m].

    Raises
    ------
    InputError
        No unit makes the file's ``extent`` along x the length.
    """
    if unit is not None:
        return METRES[unit]
    assert length is not None
    for scale in METRES.values():
        if abs(scale * extent / length - 1.0) <= SAME_LENGTH:
            return scale
    raise InputError(
        f"{path}: shape.length_m: got {length:g} m, expected the file's {extent:.6g} in one of {', '.join(METRES)}"
    )
