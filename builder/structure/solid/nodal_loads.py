"""Consistent nodal forces of a pressure, or of nodal forces, on a named surface.

Facets are curved as their elements are; pressure is interpolated by the facets' own shape functions between its
values at the surface's nodes. The integrals are exact on the meshed surface, so forces and moments sum to the
force and moment of the pressure on it.

Facets of a surface cut into triangles, for pressure that another surface carries at its own nodes.
"""

import numpy as np
from scipy.sparse import coo_array, csr_array

from builder.aero.surface.edges import split_at_edges
from builder.aero.surface.mesh import SurfaceMesh
from builder.structure.solid.elements import facet_reference_nodes, facet_shape_functions, reference_facet
from builder.structure.solid.solid_mesh import EXTERNAL, SolidMesh
from builder.structure.solid.swept_mesh import AnyMesh, SweptSector, sector_window
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError

ELEMENT_OF_FACET = {3: "tetrahedron4", 4: "hexahedron8", 6: "tetrahedron10", 8: "hexahedron20"}
"""Kind of element by the nodes of its facets."""


def surface_nodes(mesh: AnyMesh, name: str) -> IntArray:
    """Return (n_p,) nodes of a surface in increasing order; of a sector, those that belong to it."""
    if isinstance(mesh, SolidMesh):
        return np.unique(mesh.named_surface(name))
    return np.unique(sector_window(mesh).named_surface(name) % mesh.n_nodes)


def surface_points(mesh: AnyMesh, name: str) -> FloatArray:
    """Return (n_p, 3) positions [m] of the nodes of a surface, body axes."""
    return mesh.node[surface_nodes(mesh, name)]


def vector_area(element_type: str, position: FloatArray, degree: int | None = None) -> FloatArray:
    """Return the outward vector area of each quadrature point of facets.

    Parameters
    ----------
    element_type : kind of the elements the facets belong to.
    position : (f, n_f, 3) nodes of each facet [m].
    degree : of the quadrature; exact for two shape functions times the vector area by default.

    Returns
    -------
    (f, n_q, 3) weight times normal times area [m2].
    """
    reference = reference_facet(element_type, degree)
    tangent = np.einsum("qad,fac->dfqc", reference.gradient, position)
    area: FloatArray = np.cross(tangent[0], tangent[1]) * reference.weight[:, None]
    return area


def normals_at_nodes(element_type: str, position: FloatArray) -> FloatArray:
    """Return the outward unit normals (f, n_f, 3) of facets (f, n_f, 3) [m] at their nodes."""
    _, gradient = facet_shape_functions(element_type, facet_reference_nodes(element_type))
    tangent = np.einsum("qad,fac->dfqc", gradient, position)
    normal = np.cross(tangent[0], tangent[1])
    length = np.linalg.norm(normal, axis=-1, keepdims=True)
    return np.divide(normal, length, out=np.zeros_like(normal), where=length > 0.0)


def pressure_load(mesh: SolidMesh, surface_name: str, column: IntArray | None = None) -> csr_array:
    """Return nodal forces per nodal pressure, F = -integral of p n dS.

    Parameters
    ----------
    mesh : the mesh.
    surface_name : the loaded surface.
    column : (f, n_f) column of the pressure at each node of each facet, such as one per side of a sharp edge
        (:func:`builder.structure.solid.nodal_loads.split_surface`); by default one per node, in
        the order of :func:`surface_nodes`.

    Returns
    -------
    (n_dof, n_p) [m2].
    """
    if column is None:
        column = np.searchsorted(surface_nodes(mesh, surface_name), mesh.named_surface(surface_name))
    return facet_pressure_load(mesh.node, mesh.named_surface(surface_name), column)


def facet_pressure_load(node: FloatArray, facet: IntArray, column: IntArray | None = None) -> csr_array:
    """Return :func:`pressure_load` (3 n, n_p) [m2] of facets (f, 3, 4, 6 or 8) between nodes (n, 3) [m].

    ``column`` (f, n_f) is by default the nodes' own number.
    """
    force = _facet_forces(ELEMENT_OF_FACET[facet.shape[1]], node[facet])
    row = np.broadcast_to(3 * facet[:, None, :, None] + np.arange(3)[:, None, None], force.shape)
    n_p = len(node) if column is None else int(column.max()) + 1
    pressure_column = np.broadcast_to((facet if column is None else column)[:, None, None, :], force.shape)
    return csr_array(
        coo_array((force.ravel(), (row.ravel(), pressure_column.ravel())), shape=(3 * len(node), n_p))
    )


def _facet_forces(element_type: str, position: FloatArray) -> FloatArray:
    """Return (f, component, node, pressure node) forces per pressure [m2] of facets (f, n_f, 3) [m]."""
    shape = reference_facet(element_type).shape
    n_q, n_f = shape.shape
    pairs = (shape[:, :, None] * shape[:, None, :]).reshape(n_q, n_f**2)
    area = vector_area(element_type, position)
    return np.asarray(-(area.transpose(0, 2, 1) @ pairs).reshape(-1, 3, n_f, n_f))


def nodal_force_load(mesh: AnyMesh, surface_name: str) -> csr_array:
    """Return nodal forces (n_dof, 3 n_p) per force at the nodes of a surface, column = 3 * node + component [-].

    Nodes are in the order of :func:`surface_nodes`; of a sector, forces and displacements are in its frame.
    """
    row = (3 * surface_nodes(mesh, surface_name)[:, None] + np.arange(3)).ravel()
    return csr_array((np.ones(len(row)), (row, np.arange(len(row)))), shape=(mesh.n_dof, len(row)))


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
    """Return a surface as triangles over all its nodes, in the order of :func:`surface_nodes`."""
    facet = mesh.named_surface(name)
    node = surface_nodes(mesh, name)
    return SurfaceMesh(mesh.node[node], np.searchsorted(node, facet_triangles(facet)))


def facet_triangles(facet: IntArray) -> IntArray:
    """Return facets (f, 3, 4, 6 or 8) cut into triangles (t, 3) over all their nodes."""
    return facet[:, np.array(_TRIANGLES[facet.shape[1]])].reshape(-1, 3)


def split_surface(mesh: SolidMesh, name: str) -> tuple[SurfaceMesh, IntArray]:
    """Return :func:`split_facets` of a named surface of a mesh."""
    facet, node = mesh.named_surface(name), surface_nodes(mesh, name)
    try:
        return split_facets(mesh.node[node], np.searchsorted(node, facet))
    except InputError as error:
        raise InputError(f"surface '{name}': {error}") from error


def loaded_surface(mesh: AnyMesh) -> tuple[SurfaceMesh, IntArray | None]:
    """Return the external surface as triangles, in the order of the columns of Z_p, and those columns for
    :func:`pressure_load`: of a swept mesh one per node, of others one per side of a sharp edge."""
    if isinstance(mesh, SweptSector):
        return triangulated_surface(mesh.full, EXTERNAL), None
    return split_surface(mesh, EXTERNAL)


def split_facets(node: FloatArray, facet: IntArray, angle: float = SHARP_EDGE) -> tuple[SurfaceMesh, IntArray]:
    """Return facets (f, n_f) of nodes (n, 3) [m] as triangles, nodes doubled at edges sharper than ``angle``.

    At such an edge, of a fin or a wing, the mean normal of a node is the normal of none of its sides, so that no
    pressure of another surface fits it. Split, every side has a node with its own normal.

    Returns
    -------
    surface : triangles over the split nodes.
    column : (f, n_f) split node of each node of each facet, for :func:`pressure_load`.
    """
    surface = SurfaceMesh(node, facet_triangles(facet))
    split = split_at_edges(surface, angle)
    if len(split.triangle) != len(surface.triangle):
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
