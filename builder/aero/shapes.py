"""The outer surface of a vehicle, however its file gives the shape: triangles whose nodes carry pressure.

Places where a triangulated surface cuts itself: an edge that pierces a triangle it does not belong to.
"""

from __future__ import annotations

from itertools import chain, pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from builder.aero.cfd.formats.surface_files import read_surface
from builder.aero.cfd.units import METRES
from builder.aero.surface.edges import FEATURE_ANGLE, prepare_surface
from builder.aero.surface.mesh import SurfaceMesh, mesh_of_grid
from builder.vehicle.shape.geometry import SurfaceGrid, surface_grid
from builder.vehicle.shape.sectioned_body import SectionedBody
from strainfmu.arrays import BoolArray, FloatArray, IntArray
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
    if vehicle.has_meridian:
        grid = surface_grid(vehicle.body(), *resolution.surface_nodes)
        return mesh_of_grid(grid), ()
    assert vehicle.shape is not None
    if vehicle.shape.surface is None:
        body = vehicle.sectioned_body()
        return sections_mesh(body, *resolution.surface_nodes), ()
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


INSIDE = 1e-6
"""Barycentric margin and share of an edge within which it only touches."""
LARGEST = 400_000
"""Triangles above which the search, which takes minutes, is left out."""
_CLASSES = 1e-4


def refuse_self_intersections(mesh: SurfaceMesh) -> None:
    """Refuse a surface that cuts itself.

    Raises
    ------
    InputError
        Names how many edges pierce a triangle, and the first place.
    """
    if len(mesh.triangle) > LARGEST:
        return
    place = pierced_places(mesh)
    if len(place):
        where = ", ".join(f"{value:.4g}" for value in place[0])
        raise InputError(
            f"surface: it cuts itself, {len(place)} edges pierce a triangle, the first at ({where}) m; join its "
            "parts in the program it comes from"
        )


def pierced_places(mesh: SurfaceMesh) -> FloatArray:
    """Return (k, 3) places [m] where an edge goes through a triangle without a common node."""
    place = np.unique(mesh.point, axis=0, return_inverse=True)[1].reshape(-1)
    corner_place = place[mesh.triangle]
    ends = np.sort(np.concatenate([mesh.triangle[:, [k, (k + 1) % 3]] for k in range(3)]), axis=1)
    edge = np.unique(ends, axis=0)
    middle = mesh.point[edge].mean(axis=1)
    half = 0.5 * np.linalg.norm(mesh.point[edge[:, 1]] - mesh.point[edge[:, 0]], axis=1)
    corner = mesh.point[mesh.triangle]
    centroid = corner.mean(axis=1)
    reach = np.linalg.norm(corner - centroid[:, None], axis=2).max(axis=1)
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    size_class = np.floor(np.log2(np.maximum(reach / reach.max(), _CLASSES))).astype(int)
    places = []
    for which in np.unique(size_class):
        member = np.flatnonzero(size_class == which)
        tree = cKDTree(centroid[member])
        near = tree.query_ball_point(middle, half + float(reach[member].max()))
        owner = np.repeat(np.arange(len(edge)), [len(triangles) for triangles in near])
        triangle: IntArray = member[np.fromiter(chain.from_iterable(near), dtype=np.int64, count=len(owner))]
        height = [
            np.einsum("ni,ni->n", mesh.point[edge[owner, end]] - corner[triangle, 0], normal[triangle])
            for end in (0, 1)
        ]
        between = np.flatnonzero(height[0] * height[1] < 0.0)  # an end on either side of the triangle's plane
        owner, triangle = owner[between], triangle[between]
        apart = ~_share_a_node(place[edge[owner]], corner_place[triangle])
        places.append(_crossings(mesh.point[edge[owner[apart]]], corner[triangle[apart]]))
    return np.concatenate(places)


def _share_a_node(edge: IntArray, triangle: IntArray) -> BoolArray:
    return np.asarray((edge[:, :, None] == triangle[:, None, :]).any(axis=(1, 2)))


def _crossings(edge: FloatArray, corner: FloatArray) -> FloatArray:
    """Return the places (k, 3) where edges (n, 2, 3) go through the inside of triangles (n, 3, 3)."""
    start, along = edge[:, 0], edge[:, 1] - edge[:, 0]
    a, u, v = corner[:, 0], corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    normal = np.cross(u, v)
    across = np.einsum("ni,ni->n", along, normal)
    size = np.linalg.norm(along, axis=1) * np.linalg.norm(normal, axis=1)
    steep = np.abs(across) > 1e-9 * size  # others run in the triangle's plane
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.einsum("ni,ni->n", a - start, normal) / across
        point = start + t[:, None] * along
        square = np.einsum("ni,ni->n", normal, normal)
        p = np.einsum("ni,ni->n", np.cross(point - a, v), normal) / square
        q = np.einsum("ni,ni->n", np.cross(u, point - a), normal) / square
        inside = (p > INSIDE) & (q > INSIDE) & (p + q < 1.0 - INSIDE) & (t > INSIDE) & (t < 1.0 - INSIDE)
    return np.asarray(point[steep & inside])
