"""Facets of a surface cut into triangles, for pressure that another surface carries at its own nodes."""

from __future__ import annotations

import numpy as np

from builder.aero.surface.edges import split_at_edges
from builder.aero.surface.mesh import SurfaceMesh
from builder.structure.solid.mesh.solid_mesh import SolidMesh
from builder.structure.solid.operators.surface_load import surface_nodes
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError

SHARP_EDGE = np.deg2rad(30.0)
"""Angle between neighbouring triangles from which an edge has a pressure of its own on each side."""

# Local nodes of the triangles by number of nodes of a facet; corners first, then the middles of its edges.
_TRIANGLES = {
    3: ((0, 1, 2),),
    4: ((0, 1, 2), (0, 2, 3)),
    6: ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)),
    8: ((0, 4, 7), (4, 1, 5), (5, 2, 6), (6, 3, 7), (4, 5, 6), (4, 6, 7)),
}


def triangulated_surface(mesh: SolidMesh, name: str) -> SurfaceMesh:
    """Return a surface as triangles over all its nodes, in the order of :func:`surface_nodes`.

    Raises
    ------
    InputError
        The mesh has no surface of that name.
    """
    facet = mesh.named_surface(name)
    node = surface_nodes(mesh, name)
    return SurfaceMesh(mesh.node[node], np.searchsorted(node, facet_triangles(facet)))


def facet_triangles(facet: IntArray) -> IntArray:
    """Return facets (f, 3, 4, 6 or 8) cut into triangles (t, 3) over all their nodes."""
    return facet[:, np.array(_TRIANGLES[facet.shape[1]])].reshape(-1, 3)


def split_surface(mesh: SolidMesh, name: str, angle: float = SHARP_EDGE) -> tuple[SurfaceMesh, IntArray]:
    """Return :func:`split_facets` of a named surface of a mesh.

    Raises
    ------
    InputError
        The mesh has no surface of that name, or two of its nodes lie at one place.
    """
    facet, node = mesh.named_surface(name), surface_nodes(mesh, name)
    try:
        return split_facets(mesh.node[node], np.searchsorted(node, facet), angle)
    except InputError as error:
        raise InputError(f"surface '{name}': {error}") from error


def split_facets(node: FloatArray, facet: IntArray, angle: float = SHARP_EDGE) -> tuple[SurfaceMesh, IntArray]:
    """Return facets (f, n_f) of nodes (n, 3) [m] as triangles, nodes doubled at edges sharper than ``angle``.

    At such an edge, of a fin or a wing, the mean normal of a node is the normal of none of its sides, so that no
    pressure of another surface fits it. Split, every side has a node with its own normal.

    Returns
    -------
    surface : triangles over the split nodes.
    column : (f, n_f) split node of each node of each facet, for :func:`pressure_load`.

    Raises
    ------
    InputError
        Two of the nodes lie at one place.
    """
    whole = SurfaceMesh(node, facet_triangles(facet))
    split = split_at_edges(whole, angle)
    if len(split.triangle) != len(whole.triangle):
        raise InputError("two nodes lie at one place")
    pattern = np.array(_TRIANGLES[facet.shape[1]])
    of_facet = split.triangle.reshape(len(facet), len(pattern), 3)
    column = np.empty(facet.shape, dtype=np.int64)
    for local in range(facet.shape[1]):
        which, corner = np.argwhere(pattern == local)[0]
        column[:, local] = of_facet[:, which, corner]
    # The triangles of a facet share its nodes, so that none is left without a load.
    used, numbered = np.unique(column, return_inverse=True)
    numbered = numbered.reshape(column.shape)
    return SurfaceMesh(split.point[used], numbered[:, pattern].reshape(-1, 3)), numbered
