"""Linear tetrahedra of a swept mesh: the wall in a structural model of constant-strain elements.

For comparison alone. Linear elements lose most of a thin wall's ovalisation, and their strain is constant in each
element; published models are nevertheless made of them. Every sector is cut in the same way, so the mesh stays
cyclic and the cyclic solver serves. The cut runs the same way round everywhere: the mesh has no plane of symmetry,
as meshes of free tetrahedra have none.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations

import numpy as np
from scipy.sparse import coo_array, csr_array

from builder.structure.solid.elements import CurvedFacets, boundary_facets, foot_point
from builder.structure.solid.gauge_rows import Gauges
from builder.structure.solid.solid_mesh import SolidMesh
from builder.structure.solid.swept_mesh import HEXAHEDRON, SweptSector
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError

TETRAHEDRON = "tetrahedron4"

# Corners of a hexahedron by their index along, round and through (0 or 1), in VTK's order.
_CORNER = {
    (0, 0, 0): 0,
    (1, 0, 0): 1,
    (1, 1, 0): 2,
    (0, 1, 0): 3,
    (0, 0, 1): 4,
    (1, 0, 1): 5,
    (1, 1, 1): 6,
    (0, 1, 1): 7,
}


def tetrahedral_sector(sector: SweptSector) -> SweptSector:
    """Return the corners of a sector of hexahedra, each cut into six linear tetrahedra round one diagonal.

    Kuhn's cut: one tetrahedron per order in which the three axes are walked from the first corner to the last.
    Faces of neighbours are cut alike, because the reference axes of all elements run the same way.

    Raises
    ------
    InputError
        The sector is not of quadratic hexahedra.
    """
    if sector.element_type != HEXAHEDRON:
        raise InputError(f"mesh: element type '{sector.element_type}' found, must be {HEXAHEDRON}")
    corner = sector.element[:, :8]
    used = np.unique(corner % sector.n_nodes)
    number = np.full(sector.n_nodes, -1)
    number[used] = np.arange(len(used))

    def renumbered(nodes: IntArray) -> IntArray:
        return number[nodes % sector.n_nodes] + len(used) * (nodes // sector.n_nodes)

    element = renumbered(corner[:, _kuhn_tetrahedra()].reshape(-1, 4))
    outside, _ = boundary_facets(TETRAHEDRON, element)
    surface = {name: _cut(renumbered(facet[:, :4]), outside) for name, facet in sector.surface.items()}
    return replace(sector, node=sector.node[used], element=element, surface=surface, element_type=TETRAHEDRON)


def _kuhn_tetrahedra() -> IntArray:
    """Return (6, 4) local corners of the tetrahedra, each of positive volume."""
    found = []
    for order in permutations(range(3)):
        corner, path = [0, 0, 0], [_CORNER[0, 0, 0]]
        for axis in order:
            corner[axis] = 1
            path.append(_CORNER[corner[0], corner[1], corner[2]])
        # An odd order of the axes turns the tetrahedron inside out.
        odd = sum(a > b for i, a in enumerate(order) for b in order[i + 1 :]) % 2
        found.append([path[0], path[2], path[1], path[3]] if odd else path)
    return np.array(found, dtype=np.int64)


def _cut(quadrilaterals: IntArray, triangles: IntArray) -> IntArray:
    """Return the rows of ``triangles`` (t, 3) that are halves of ``quadrilaterals`` (f, 4)."""
    halves = {frozenset(four) - {one} for four in quadrilaterals.tolist() for one in four}
    kept = [frozenset(three) in halves for three in triangles.tolist()]
    return triangles[np.array(kept, dtype=bool)]


def element_strain_rows(mesh: SolidMesh, gauges: Gauges) -> csr_array:
    """Return B (n_gauges, n_dof) [1/m]: the constant strain of the one facet that a gauge lies on.

    What point-wise evaluation of the strain of linear elements gives. The strain is that at the facet's middle,
    wherever on the facet the gauge is, so the readings of mirrored gauges are not mirrored. A gauge on the line
    between facets is read from one of them. Gauges are moved onto the facets, which lie on chords of the circle.

    Raises
    ------
    InputError
        The mesh is not of linear tetrahedra, or a surface does not exist.
    """
    if mesh.element_type != TETRAHEDRON:
        raise InputError(f"mesh: element type '{mesh.element_type}' found, must be {TETRAHEDRON}")
    row, column, entry = [], [], []
    facets = {name: mesh.named_surface(name) for name in dict.fromkeys(gauges.surface)}
    curved = {name: CurvedFacets(mesh.element_type, mesh.node[facet]) for name, facet in facets.items()}
    for i, (name, position) in enumerate(zip(gauges.surface, gauges.position, strict=True)):
        node = facets[name][foot_point(curved[name], position).facet]
        weight = _strain_of_triangle(mesh.node[node], gauges.direction[i])
        row.append(np.full(9, i))
        column.append((3 * node[:, None] + np.arange(3)).ravel())
        entry.append(weight.ravel())
    index = (np.concatenate(row), np.concatenate(column))
    return csr_array(coo_array((np.concatenate(entry), index), shape=(len(gauges.name), mesh.n_dof)))


def _strain_of_triangle(corner: FloatArray, direction: FloatArray) -> FloatArray:
    """Return (3, 3) strain per displacement [1/m] of a triangle (3, 3) [m] along ``direction`` (3,) in it."""
    edge = (corner[1:] - corner[0]).T
    part = np.linalg.lstsq(edge, direction, rcond=None)[0]  # the direction, projected onto the plane
    along = edge @ part
    length = float(np.linalg.norm(along))
    by_arc = np.array([-part.sum(), *part]) / length
    weight: FloatArray = np.outer(by_arc, along / length)
    return weight
