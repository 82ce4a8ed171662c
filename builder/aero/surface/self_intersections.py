"""Places where a triangulated surface cuts itself: an edge that pierces a triangle it does not belong to."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from builder.aero.surface.mesh import SurfaceMesh
from strainfmu.arrays import BoolArray, FloatArray, IntArray
from strainfmu.errors import InputError

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
    size_class = np.floor(np.log2(np.maximum(reach / reach.max(), _CLASSES))).astype(int)
    places = []
    for which in np.unique(size_class):
        member = np.flatnonzero(size_class == which)
        tree = cKDTree(centroid[member])
        near = tree.query_ball_point(middle, half + float(reach[member].max()))
        owner = np.repeat(np.arange(len(edge)), [len(triangles) for triangles in near])
        flat = np.fromiter((k for triangles in near for k in triangles), dtype=np.int64, count=len(owner))
        triangle: IntArray = member[flat]
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
