"""A ring about the x axis meshed with any kind of element: the body the locking check is run on."""

from __future__ import annotations

from itertools import permutations

import numpy as np

from builder.structure.solid.elements.element_faces import CORNERS, FACE_CORNERS, boundary_facets, element_edges
from builder.structure.solid.elements.elements import reference_nodes
from builder.structure.solid.mesh.solid_mesh import (
    EXTERNAL,
    INTERNAL,
    NODES_PER_ELEMENT,
    QUADRATIC,
    SUPPORT,
    SolidMesh,
)
from strainfmu.arrays import IntArray
from strainfmu.errors import InputError

REGION, FRONT = "wall", "front"
MIN_AROUND = 6


def ring_mesh(
    element_type: str,
    inner_radius: float,
    outer_radius: float,
    width: float,
    counts: tuple[int, int, int],
) -> SolidMesh:
    """Mesh a tube piece with x from 0 to ``width``; nodes lie on true circles.

    Tetrahedra are cut from hexahedral cells, six along the diagonals of each in the same way (Kuhn's division).

    Parameters
    ----------
    element_type : kind of the elements.
    inner_radius, outer_radius, width : of the ring [m].
    counts : cells along x, round the axis and through the wall.

    Returns
    -------
    SolidMesh
        Surfaces external, internal, front (x = 0) and support (x = width).

    Raises
    ------
    InputError
        The kind of element is unknown, a length is not positive or a count too small.
    """
    if element_type not in NODES_PER_ELEMENT:
        raise InputError(f"element type '{element_type}' found, must be one of {sorted(NODES_PER_ELEMENT)}")
    if not (0.0 < inner_radius < outer_radius < np.inf and 0.0 < width < np.inf):
        raise InputError(
            f"ring: inner radius {inner_radius:g} m, outer radius {outer_radius:g} m, width {width:g} m found, "
            "must be positive and increase from inside out"
        )
    if min(counts) < 1 or counts[1] < MIN_AROUND:
        raise InputError(f"ring: {counts} cells found, must be at least (1, {MIN_AROUND}, 1)")
    node, element = _lattice(element_type, counts)
    x = width * node[:, 0] / (2 * counts[0])
    roll = 2.0 * np.pi * node[:, 1] / (2 * counts[1])
    r = inner_radius + (outer_radius - inner_radius) * node[:, 2] / (2 * counts[2])
    position = np.column_stack([x, r * np.sin(roll), r * np.cos(roll)])
    facet, _ = boundary_facets(element_type, element)
    corner = node[facet[:, : FACE_CORNERS[element_type]]]
    sides = {
        EXTERNAL: (corner[..., 2] == 2 * counts[2]).all(axis=1),
        INTERNAL: (corner[..., 2] == 0).all(axis=1),
        FRONT: (corner[..., 0] == 0).all(axis=1),
        SUPPORT: (corner[..., 0] == 2 * counts[0]).all(axis=1),
    }
    surface = {name: facet[here] for name, here in sides.items()}
    return SolidMesh(
        element_type=element_type,
        node=position,
        element=element,
        region=np.zeros(len(element), dtype=np.int64),
        region_names=(REGION,),
        surface=surface,
    )


def _lattice(element_type: str, counts: tuple[int, int, int]) -> tuple[IntArray, IntArray]:
    """Return nodes (n, 3) as points of a lattice of half cells, and elements (m, n_e); closed round the axis."""
    cells = np.stack(np.meshgrid(*(np.arange(count) for count in counts), indexing="ij"), axis=-1).reshape(
        -1, 1, 3
    )
    point = np.concatenate([2 * cells + local for local in _local_points(element_type)])
    point[..., 1] %= 2 * counts[1]
    size = np.array([2 * count + 1 for count in counts])
    key = (point[..., 0] * size[1] + point[..., 1]) * size[2] + point[..., 2]
    used, element = np.unique(key, return_inverse=True)
    node = np.stack([used // (size[1] * size[2]), used // size[2] % size[1], used % size[2]], axis=-1)
    return node.astype(np.int64), element.reshape(key.shape).astype(np.int64)


def _local_points(element_type: str) -> list[IntArray]:
    """Return the points (n_e, 3) on a cell's lattice of half cells of the nodes of each element in it."""
    if CORNERS[element_type] == 8:
        # Reference axes along x, round, outward: right-handed, because roll goes from +z towards +y.
        return [np.rint(2.0 * reference_nodes(element_type)).astype(np.int64)]
    points = []
    for order in permutations(range(3)):
        corner = np.zeros((4, 3), dtype=np.int64)
        for step, axis in enumerate(order):
            corner[step + 1 :, axis] = 2
        if np.linalg.det(corner[1:] - corner[0]) < 0.0:
            corner = corner[[0, 2, 1, 3]]
        middle = corner[element_edges(element_type)].sum(axis=1) // 2
        points.append(np.concatenate([corner, middle]) if element_type in QUADRATIC else corner)
    return points
