"""Facets of a surface cut into triangles, for pressure that another surface carries at its own nodes."""

from __future__ import annotations

import numpy as np

from builder.aero.surface_mesh import SurfaceMesh
from builder.structure.solid.solid_mesh import SolidMesh
from builder.structure.solid.surface_load import surface_nodes

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
    triangle = facet[:, np.array(_TRIANGLES[facet.shape[1]])].reshape(-1, 3)
    return SurfaceMesh(mesh.node[node], np.searchsorted(node, triangle))
