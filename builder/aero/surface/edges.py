"""A triangulated surface made fit to carry pressure: checked, turned outward, its nodes doubled at sharp edges.

Connected parts of a triangulated surface, and nodes that lie at one place.
"""

from dataclasses import dataclass
from math import radians

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from builder.aero.surface.mesh import SurfaceMesh
from strainfmu.arrays import BoolArray, FloatArray, IntArray
from strainfmu.errors import InputError


def connected(first: IntArray, second: IntArray, count: int) -> tuple[int, IntArray]:
    """Return the number of parts that ``count`` things fall into, and the part (count,) of each.

    ``here`` and ``there`` (k,) are pairs of things that belong together; parts are numbered by their first thing.
    """
    graph = sparse.coo_array((np.ones(len(first), dtype=bool), (first, second)), shape=(count, count))
    number, part = connected_components(graph, directed=False)
    return int(number), part.astype(np.int64)


def part_of_node(mesh: SurfaceMesh) -> IntArray:
    """Return the part (n_nodes,) of each node; doubled nodes at an edge divide the surface into parts."""
    a, b, c = mesh.triangle.T
    return connected(np.concatenate([a, b]), np.concatenate([b, c]), mesh.n_nodes)[1]


def merge_nodes(mesh: SurfaceMesh, distance: float) -> SurfaceMesh:
    """Return ``mesh`` with one node for those closer than ``distance`` [m].

    Triangles that lose their area by that are left out.
    """
    near = cKDTree(mesh.point).query_pairs(distance, output_type="ndarray")
    _, index = connected(near[:, 0], near[:, 1], mesh.n_nodes)
    first = np.unique(index, return_index=True)[1]
    triangle = index[mesh.triangle]
    proper = (triangle != np.roll(triangle, 1, axis=1)).all(axis=1)
    return SurfaceMesh(mesh.point[first], triangle[proper])


FEATURE_ANGLE = radians(30.0)
"""Angle between neighbouring triangles above which an edge is sharp [rad]."""
SAME_PLACE = 1e-7
"""Nodes closer than this fraction of the surface's extent are one: coordinates in single precision."""
BASE_DEPTH = 1e-3
"""Fraction of the length, at the aft end, within which the rim of an open base must lie."""


@dataclass(frozen=True, eq=False, kw_only=True)
class _Edges:
    """Edges between triangles of a surface without doubled nodes.

    Attributes
    ----------
    left, right : (e,) triangles on both sides of each edge that two triangles share.
    node : (e, 2) its ends.
    turned : (e,) both triangles run through it the same way, so that one of them faces the wrong way.
    free : (f, 2) ends of the edges of one triangle only.
    crowded : (c, 2) ends of the edges that more than two share.
    """

    left: IntArray
    right: IntArray
    node: IntArray
    turned: BoolArray
    free: IntArray
    crowded: IntArray


def prepare_surface(mesh: SurfaceMesh, feature_angle: float) -> tuple[SurfaceMesh, tuple[str, ...]]:
    """Return ``mesh`` facing outward, its nodes doubled at edges sharper than ``feature_angle`` [rad].

    The surface must be closed, or open at the aft end alone (the base, left out). It may have several parts; each
    is the outer shape of a body: no inner surface of a wall, and no part inside another.

    Returns
    -------
    The surface, and notes on what was changed, one sentence each.

    Raises
    ------
    InputError
        The surface is open elsewhere (a half model), more than two triangles share an edge, or it has one side
        only (a Moebius strip).
    """
    merged = _merged(mesh)
    edges = _edges(merged)
    _check_closed(merged, edges)
    outward, turned = turn_outward(merged, edges)
    notes = [] if turned == 0 else [f"{turned} of {len(merged.triangle)} triangles were turned to face outward"]
    return split_at_edges(outward, feature_angle), tuple(notes)


def _merged(mesh: SurfaceMesh) -> SurfaceMesh:
    return merge_nodes(mesh, SAME_PLACE * float(np.ptp(mesh.point, axis=0).max()))


def split_at_edges(mesh: SurfaceMesh, angle: float) -> SurfaceMesh:
    """Return ``mesh`` with its nodes doubled where neighbouring triangles differ by more than ``angle`` [rad].

    So a node's normal and pressure belong to one side of an edge. At a pointed tip, where no single edge is sharp
    but the normals all round differ by more than the angle from their mean, each triangle gets a node of its own.
    """
    merged = _merged(mesh)
    edges = _edges(merged)
    unit = merged.vector_area / np.maximum(merged.area, np.finfo(float).tiny)[:, None]
    flat = np.einsum("ei,ei->e", unit[edges.left], unit[edges.right]) >= np.cos(angle)
    smooth = flat & ~edges.turned
    corner = 3 * np.arange(len(merged.triangle))[:, None] + np.arange(3)
    ends = []
    for k in range(2):
        node = edges.node[smooth, k][:, None]
        left, right = edges.left[smooth], edges.right[smooth]
        ends.append(
            (corner[left][merged.triangle[left] == node], corner[right][merged.triangle[right] == node]),
        )
    first_end, second_end = (np.concatenate(side) for side in zip(*ends, strict=True))
    count, fan = connected(first_end, second_end, corner.size)
    corners_normal = np.repeat(unit, 3, axis=0)
    mean = np.zeros((count, 3))
    np.add.at(mean, fan, corners_normal)
    mean /= np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), np.finfo(float).tiny)
    apart = np.einsum("ci,ci->c", corners_normal, mean[fan]) < np.cos(angle)
    pointed = np.zeros(count, dtype=bool)
    pointed[fan[apart]] = True
    alone = pointed[fan]
    fan[alone] = count + np.arange(np.count_nonzero(alone))
    _, first, number = np.unique(fan, return_index=True, return_inverse=True)
    return SurfaceMesh(merged.point[merged.triangle.ravel()[first]], number.reshape(-1, 3).astype(np.int64))


def turn_outward(mesh: SurfaceMesh, edges: _Edges | None = None) -> tuple[SurfaceMesh, int]:
    """Return ``mesh`` with its triangles facing outward, and how many were turned.

    Neighbours are made to agree; then each part whose enclosed volume is negative is turned over. An open base
    counts as closed by the plane at the aft end.

    Raises
    ------
    InputError
        A part has one side only.
    """
    edges = _edges(mesh) if edges is None else edges
    m = len(mesh.triangle)
    # Two copies of every triangle, as it is (t) and turned over (m + t). Neighbours that agree join equal copies.
    opposite = np.where(edges.turned, m, 0)
    first_copy = np.concatenate([edges.left, edges.left + m])
    second_copy = np.concatenate([edges.right + opposite, edges.right + m - opposite])
    count, copy = connected(first_copy, second_copy, 2 * m)
    if (copy[:m] == copy[m:]).any():
        where = mesh.point[mesh.triangle[int(np.flatnonzero(copy[:m] == copy[m:])[0]), 0]]
        raise InputError(f"surface: the part at {_place(where)} has one side only, like a Moebius strip")
    corner = mesh.point[mesh.triangle] - np.array([mesh.point[:, 0].max(), 0.0, 0.0])
    volume = np.einsum("mi,mi->m", mesh.vector_area, corner.mean(axis=1)) / 3.0
    enclosed = np.bincount(copy, np.concatenate([volume, -volume]), count)
    turned = enclosed[copy[:m]] < enclosed[copy[m:]]
    triangle = np.where(turned[:, None], mesh.triangle[:, ::-1], mesh.triangle)
    return SurfaceMesh(mesh.point, triangle), int(turned.sum())


def _edges(mesh: SurfaceMesh) -> _Edges:
    m = len(mesh.triangle)
    start, end = mesh.triangle.T.ravel(), np.roll(mesh.triangle, -1, axis=1).T.ravel()
    owner = np.tile(np.arange(m), 3)
    ends = np.stack([np.minimum(start, end), np.maximum(start, end)], axis=1)
    node, number, uses = np.unique(ends, axis=0, return_inverse=True, return_counts=True)
    number = number.reshape(-1)
    shared = np.flatnonzero(uses[number] == 2)
    pair = shared[np.argsort(number[shared], kind="stable")].reshape(-1, 2)
    return _Edges(
        left=owner[pair[:, 0]],
        right=owner[pair[:, 1]],
        node=node[number[pair[:, 0]]],
        turned=start[pair[:, 0]] == start[pair[:, 1]],
        free=node[uses == 1],
        crowded=node[uses > 2],
    )


def _check_closed(mesh: SurfaceMesh, edges: _Edges) -> None:
    """Refuse a surface with holes other than the base, or with edges of three triangles."""
    if len(edges.crowded):
        where = _place(mesh.point[edges.crowded[0]].mean(axis=0))
        raise InputError(f"surface: more than two triangles share the edge at {where}")
    aft, length = mesh.point[:, 0].max(), np.ptp(mesh.point[:, 0])
    ahead = mesh.point[edges.free, 0].min(axis=1) < aft - BASE_DEPTH * length
    if ahead.any():
        where = _place(mesh.point[edges.free[int(np.flatnonzero(ahead)[0])]].mean(axis=0))
        raise InputError(
            f"surface: {np.count_nonzero(ahead)} edges have one triangle only, the first at {where}; it must be"
            f" closed, or open at its base x = {aft:.6g} m alone (a half model must be mirrored first)"
        )


def _place(point: FloatArray) -> str:
    return "(" + ", ".join(f"{value:.6g}" for value in point) + ") m"
