"""Forces on fewer nodes: how much strain depends on the number of nodes that are loaded."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from builder.aero.surface.mesh import SurfaceMesh
from strainfmu.arrays import FloatArray, IntArray

NEIGHBOURS = 6
"""Kept nodes that a force is spread over."""

MOMENT = 1e6
"""Weight of the force's place against the weight of small weights."""


@dataclass(frozen=True, eq=False)
class ThinnedNodes:
    """Forces carried over to some of the nodes.

    Attributes
    ----------
    spread : (n, n) the part of the force at node i (row) that node j takes; columns of nodes left out are empty.
    kept : number of nodes that take forces.
    factor : error of all nodes over the difference of the two, for an error in proportion to the spacing's square.
    """

    spread: csr_array
    kept: int
    factor: float

    def on_kept(self, strain_per_force: FloatArray) -> FloatArray:
        """Return (k, n, 3) strain per force [1/N] at each node, carried over to the kept ones first."""
        return np.stack([(self.spread @ strain_per_force[:, :, axis].T).T for axis in range(3)], axis=2)


def thinned(surface: SurfaceMesh) -> ThinnedNodes:
    """Return the forces of all nodes of ``surface`` on a third of them, no two of which are neighbours.

    Every force keeps its size, and its moment as far as the kept nodes round it span its place.
    """
    kept = _apart(surface)
    n, m = surface.n_nodes, min(NEIGHBOURS, len(kept))
    distance, nearest = cKDTree(surface.point[kept]).query(surface.point, k=m)
    distance, nearest = distance.reshape(n, m), nearest.reshape(n, m)
    scale = distance[:, -1:] + 1e-300
    arm = (surface.point[kept[nearest]] - surface.point[:, None]) / scale[:, :, None]
    near = 1.0 / ((distance / scale) ** 2 + 1e-6)  # weights are dear far away
    rows = np.concatenate([np.ones((n, 1, m)), arm.transpose(0, 2, 1)], axis=1)  # sum of weights, and place
    gram = np.einsum("nim,nm,njm->nij", rows, near, rows) + np.eye(4) / MOMENT
    wanted = np.zeros((n, 4, 1))
    wanted[:, 0] = 1.0
    weight = near * np.einsum("nim,ni->nm", rows, np.linalg.solve(gram, wanted)[:, :, 0])
    weight /= weight.sum(axis=1, keepdims=True)
    weight[kept], nearest[kept] = np.eye(m)[0], np.arange(len(kept))[:, None]
    place = (np.repeat(np.arange(n), m), kept[nearest].ravel())
    spread = csr_array((weight.ravel(), place), shape=(n, n))
    return ThinnedNodes(spread, len(kept), 1.0 / max(n / len(kept) - 1.0, 1e-3))


def _apart(surface: SurfaceMesh) -> IntArray:
    """Return nodes of which no two share a triangle, as many as fit in one pass; all others are next to one."""
    corner = surface.triangle
    row, column = corner[:, [0, 1, 2, 1, 2, 0]].ravel(), corner[:, [1, 2, 0, 0, 1, 2]].ravel()
    n = surface.n_nodes
    graph = csr_array((np.ones(len(row), dtype=np.int8), (row, column)), shape=(n, n))
    taken, blocked = [], np.zeros(n, dtype=bool)
    for node in range(n):
        if not blocked[node]:
            taken.append(node)
            blocked[graph.indices[graph.indptr[node] : graph.indptr[node + 1]]] = True
    return np.array(taken, dtype=np.int64)
