"""Names for the surfaces of a hollow body whose mesh carries none."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from builder.structure.solid.elements.element_faces import FACE_CORNERS, boundary_facets
from builder.structure.solid.mesh.solid_mesh import EXTERNAL, INTERNAL, SUPPORT
from strainfmu.arrays import FloatArray, IntArray

PLANE_TOLERANCE = 1e-6  # of the body's length: how far the base may be from a plane


def surfaces_of_hollow_body(element_type: str, node: FloatArray, element: IntArray) -> dict[str, IntArray]:
    """Name the boundary of a body with its nose ahead and its base in a plane across the x axis.

    The support is the boundary in the plane of greatest x. Without it the rest falls into connected parts: the
    one that reaches furthest forward is external, the others are internal (of a wall open aft: the wall's inner
    face and the cavity's front). A body without a cavity has no internal surface.

    Parameters
    ----------
    element_type : kind of the elements.
    node : (n, 3) positions in body axes [m].
    element : (m, n_e) node numbers.

    Returns
    -------
    Facets (f, n_f) per name, outward; names without facets are left out.
    """
    facet, _ = boundary_facets(element_type, element)
    corner = facet[:, : FACE_CORNERS[element_type]]
    x = node[:, 0]
    at_base = (x[corner] > x.max() - PLANE_TOLERANCE * np.ptp(x)).all(axis=1)
    rest = facet[~at_base]
    part = _connected_parts(corner[~at_base], len(node))
    if not len(rest):
        return {SUPPORT: facet}
    foremost = part[np.argmin(x[corner[~at_base]].min(axis=1))]
    named = {EXTERNAL: rest[part == foremost], INTERNAL: rest[part != foremost], SUPPORT: facet[at_base]}
    return {name: facets for name, facets in named.items() if len(facets)}


def _connected_parts(corner: IntArray, n_nodes: int) -> IntArray:
    """Return the part (f,) that each facet is of; facets are joined by an edge, a common corner is not enough."""
    edge = np.sort(np.stack([corner, np.roll(corner, -1, axis=1)], axis=-1), axis=-1)
    key = (edge[..., 0] * n_nodes + edge[..., 1]).ravel()
    _, number = np.unique(key, return_inverse=True)
    owner = np.repeat(np.arange(len(corner)), corner.shape[1])
    incidence = csr_array((np.ones(len(owner)), (owner, number)))
    return connected_components(incidence @ incidence.T, directed=False)[1].astype(np.int64)
