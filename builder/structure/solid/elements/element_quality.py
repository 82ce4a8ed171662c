"""Shape of elements: scaled Jacobian, folded elements, and how to unfold them."""

from __future__ import annotations

import numpy as np

from builder.structure.solid.elements.element_faces import CORNERS, element_edges
from builder.structure.solid.elements.elements import reference_nodes, shape_functions
from strainfmu.arrays import FloatArray, IntArray

CHUNK = 20_000  # elements at once, to bound memory
STRAIGHT_BELOW = 0.05  # minimum determinant over the mean, below which an element is made straight


def jacobians(element_type: str, node: FloatArray, element: IntArray, point: FloatArray) -> FloatArray:
    """Return (m, n, 3, 3) the Jacobian dx/dxi [m] of each element at reference points (n, 3)."""
    gradient = shape_functions(element_type, point)[1]
    by_reference = gradient.transpose(1, 0, 2).reshape(gradient.shape[1], -1)
    product = node[element].transpose(0, 2, 1) @ by_reference
    return product.reshape(len(element), 3, len(point), 3).transpose(0, 2, 1, 3)


def _sample_points(element_type: str) -> FloatArray:
    """Return the nodes, the centre, and the points half-way between the two."""
    nodes = reference_nodes(element_type)
    centre = nodes[: CORNERS[element_type]].mean(axis=0)
    return np.concatenate([nodes, 0.5 * (nodes + centre), centre[None]])


def determinant_ratio(element_type: str, node: FloatArray, element: IntArray) -> FloatArray:
    """Return (m,) the minimum determinant of the Jacobian over its mean, by sampling: 1 if constant, folded if
    negative.

    An element without volume, or turned inside out as a whole, gives -1. One that is collapsed to an edge at a
    pointed tip gives 0 there and is sound.
    """
    point = _sample_points(element_type)
    ratio = np.empty(len(element))
    for start in range(0, len(element), CHUNK):
        part = slice(start, start + CHUNK)
        determinant = np.linalg.det(jacobians(element_type, node, element[part], point))
        mean = determinant.mean(axis=1)
        sound = mean > 0.0
        ratio[part] = np.where(sound, determinant.min(axis=1) / np.where(sound, mean, 1.0), -1.0)
    return ratio


def scaled_jacobian(element_type: str, node: FloatArray, element: IntArray) -> FloatArray:
    """Return (m,) the minimum scaled Jacobian over an element's corners, 1 for a cube and a regular tetrahedron.

    Triple product of the unit tangents of the edges that meet in the corner, times sqrt(2) for tetrahedra (Knupp
    and others, The Verdict Geometric Quality Library, SAND2007-1751). Tangents are taken on the curved edges.
    """
    n_corners = CORNERS[element_type]
    corner = reference_nodes(element_type)[:n_corners]
    edge = element_edges(element_type)
    # At each corner the reference directions of its three edges, ordered to be right-handed.
    ends = [[b if a == c else a for a, b in edge.tolist() if c in (a, b)] for c in range(n_corners)]
    direction = corner[np.array(ends)] - corner[:, None, :]
    left = np.linalg.det(direction) < 0.0
    direction[left] = direction[left][:, [1, 0, 2]]
    quality = np.empty(len(element))
    for start in range(0, len(element), CHUNK):
        part = slice(start, start + CHUNK)
        tangent = jacobians(element_type, node, element[part], corner) @ direction.transpose(0, 2, 1)
        length = np.prod(np.linalg.norm(tangent, axis=-2), axis=-1)
        triple = np.linalg.det(tangent)
        value = np.divide(triple, length, out=np.zeros_like(triple), where=length > 0.0)
        quality[part] = value.min(axis=1)
    return quality * (np.sqrt(2.0) if n_corners == 4 else 1.0)


def straighten_folded(element_type: str, node: FloatArray, element: IntArray) -> FloatArray:
    """Return the nodes (n, 3) with the edges of folded or nearly folded elements made straight.

    Elements that share such an edge change too, so this is repeated until all elements pass; in the end all edges
    are straight.
    """
    node = node.copy()
    edge, n_corners = element_edges(element_type), CORNERS[element_type]
    bad = np.zeros(len(element), dtype=bool)
    while True:
        found = (determinant_ratio(element_type, node, element) < STRAIGHT_BELOW) & ~bad
        if not found.any():
            return node
        bad |= found
        worst = element[found]
        node[worst[:, n_corners:]] = node[worst[:, edge]].mean(axis=2)
