"""Connected parts of a triangulated surface, and nodes that lie at one place."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from builder.aero.surface.mesh import SurfaceMesh
from strainfmu.arrays import IntArray


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
