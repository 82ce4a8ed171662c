"""Reconstruction of cell values as pressure that is linear over each triangle, without smearing jumps.

Each cell gets the gradient that fits its neighbours best (weighted least squares), limited so that no corner
leaves the range of the neighbours. That is exact for a field that is linear over a plane; at a shock or an edge of
the body the gradient falls to zero rather than draw one side's values into the other.

Source: T. J. Barth and D. C. Jespersen, "The design and application of upwind schemes on unstructured meshes",
AIAA 89-0366: gradient and limiter.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from builder.aero.surface.mesh import SurfaceMesh
from strainfmu.arrays import FloatArray, IntArray

MIN_COSINE = 0.5
"""Cells whose normals differ by more than 60 deg are no neighbours: a base, a trailing edge."""
_RANK_CUT = 1e-4


def reconstruct(mesh: SurfaceMesh, face: IntArray, values: FloatArray) -> tuple[SurfaceMesh, FloatArray]:
    """Turn values in cells into nodal values of a mesh whose triangles share no nodes.

    Parameters
    ----------
    mesh : the triangles (m), whose shared nodes say which cells are neighbours.
    face : (m,) the cell that each triangle is cut from.
    values : (n_cells,) in cells.

    Returns
    -------
    The mesh of 3 m nodes and their values (3 m,). The area mean over each cell is the cell's value.
    """
    n_cells = len(values)
    weight = mesh.area
    area = np.bincount(face, weight, n_cells)
    corner = mesh.point[mesh.triangle]
    middle = _sum_by(face, weight[:, None] * corner.mean(axis=1), n_cells) / area[:, None]
    normal = _sum_by(face, mesh.vector_area, n_cells)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    here, there = _neighbours(mesh, face, normal, n_cells)
    gradient = _gradient(middle, normal, values, here, there)
    step = np.einsum("mki,mi->mk", corner - middle[face][:, None], gradient[face])
    low, high = values.copy(), values.copy()
    np.minimum.at(low, here, values[there])
    np.maximum.at(high, here, values[there])
    room = np.where(step > 0.0, (high - values)[face][:, None], (values - low)[face][:, None])
    fraction = np.divide(room, np.abs(step), out=np.ones_like(step), where=np.abs(step) > room)
    limit = np.ones(n_cells)
    np.minimum.at(limit, face, fraction.min(axis=1))
    at_corner = values[face][:, None] + limit[face][:, None] * step
    separate = SurfaceMesh(corner.reshape(-1, 3), np.arange(3 * len(face), dtype=np.int64).reshape(-1, 3))
    return separate, at_corner.ravel()


def _neighbours(mesh: SurfaceMesh, face: IntArray, normal: FloatArray, n_cells: int) -> tuple[IntArray, IntArray]:
    """Return all ordered pairs of cells that share a node and do not turn away from each other."""
    entries = np.ones(mesh.triangle.size)
    index = mesh.triangle.ravel(), np.repeat(face, 3)
    touches = sparse.csr_matrix((entries, index), shape=(mesh.n_nodes, n_cells))
    pairs = (touches.T @ touches).tocoo()
    here, there = pairs.row.astype(np.int64), pairs.col.astype(np.int64)
    kept = (here != there) & (np.einsum("pi,pi->p", normal[here], normal[there]) > MIN_COSINE)
    return here[kept], there[kept]


def _gradient(
    middle: FloatArray, normal: FloatArray, values: FloatArray, here: IntArray, there: IntArray
) -> FloatArray:
    """Return the least-squares gradient (n_cells, 3) in each cell's tangent plane, weights 1/distance^2."""
    step = middle[there] - middle[here]
    length = np.linalg.norm(step, axis=1, keepdims=True)
    flat = step - normal[here] * np.einsum("pi,pi->p", step, normal[here])[:, None]
    size = np.linalg.norm(flat, axis=1, keepdims=True)
    # The way along the surface is as long as the way in space; only its direction is the tangent plane's.
    unit = np.divide(flat, size, out=np.zeros_like(flat), where=size > 0.0)
    slope = np.divide(
        (values[there] - values[here])[:, None], length, out=np.zeros_like(length), where=length > 0.0
    )
    matrix = _sum_by(here, np.einsum("pi,pj->pij", unit, unit), len(values))
    right = _sum_by(here, unit * slope, len(values))
    gradient: FloatArray = np.einsum("nij,nj->ni", np.linalg.pinv(matrix, rcond=_RANK_CUT, hermitian=True), right)
    return gradient


def _sum_by(index: IntArray, rows: FloatArray, count: int) -> FloatArray:
    """Return the sums (count, ...) of ``rows`` that share an index."""
    total = np.zeros((count, *rows.shape[1:]))
    np.add.at(total, index, rows)
    return total
