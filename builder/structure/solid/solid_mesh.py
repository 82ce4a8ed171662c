"""A volume mesh with named surfaces and material regions.

Names for the surfaces of a hollow body whose mesh carries none.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from builder.structure.solid.elements import FACE_CORNERS, Quadrature, boundary_facets
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError

NODES_PER_ELEMENT = {"hexahedron20": 20, "tetrahedron10": 10, "hexahedron8": 8, "tetrahedron4": 4}
QUADRATIC = ("hexahedron20", "tetrahedron10")
"""Results are taken from these alone: linear elements lock under the bending of a thin wall."""

HEXAHEDRON = "hexahedron20"
"""Elements of swept meshes."""

EXTERNAL, INTERNAL, SUPPORT = "external", "internal", "support"
"""Names of the surfaces that carry the air load, the gauges, and the support."""


@dataclass(frozen=True, eq=False, kw_only=True)
class SolidMesh:
    """Nodes, elements of one kind, and the names of their faces.

    Attributes
    ----------
    element_type : key of :data:`NODES_PER_ELEMENT`; nodes within an element and a facet in VTK's order (corners,
        then middles of edges).
    node : (n, 3) positions in body axes [m].
    element : (m, n_e) node numbers.
    region : (m,) index into ``region_names``: which material an element is of.
    region_names : names of the regions.
    surface : per name the facets (f, n_f) node numbers, outward normal by the right-hand rule.
    is_swept : whether reference axes of the elements run along, round and through the wall.
    """

    element_type: str
    node: FloatArray
    element: IntArray
    region: IntArray
    region_names: tuple[str, ...]
    surface: Mapping[str, IntArray]
    is_swept: bool = False

    def __post_init__(self) -> None:
        if self.element_type not in NODES_PER_ELEMENT:
            raise InputError(
                f"mesh: element type '{self.element_type}' found, must be one of {sorted(NODES_PER_ELEMENT)}"
            )
        n_nodes = NODES_PER_ELEMENT[self.element_type]
        if self.element.ndim != 2 or self.element.shape[1] != n_nodes or not len(self.element):
            raise InputError(f"mesh: elements {self.element.shape} found, {self.element_type} has {n_nodes} nodes")
        if not np.isfinite(self.node).all():
            raise InputError("mesh: a node has a coordinate that is not finite")
        for name, numbers in (("elements", self.element), *self.surface.items()):
            if numbers.size and not 0 <= numbers.min() <= numbers.max() < len(self.node):
                raise InputError(f"mesh: {name} name a node that does not exist ({len(self.node)} nodes)")

    @property
    def n_nodes(self) -> int:
        return len(self.node)

    @property
    def n_dof(self) -> int:
        """Displacement components: dof = 3 * node + component."""
        return 3 * len(self.node)

    @property
    def quadrature(self) -> Quadrature:
        """How the stiffness is integrated; long swept hexahedra are too stiff by the full quadrature."""
        return "thin_wall" if self.is_swept and self.element_type == HEXAHEDRON else "full"

    @property
    def full(self) -> SolidMesh:
        """The mesh itself; of a sector all of them."""
        return self

    def named_surface(self, name: str) -> IntArray:
        """Return the facets (f, n_f) of a surface."""
        if name not in self.surface or not len(self.surface[name]):
            raise InputError(f"mesh: no surface '{name}', found {sorted(self.surface) or 'none'}")
        return self.surface[name]


def same_elements(first: SolidMesh, second: SolidMesh) -> bool:
    """Return whether two meshes hold the same elements at the same places, in whatever order."""
    if first.element_type != second.element_type or first.element.shape != second.element.shape:
        return False
    return bool(np.array_equal(_elements_in_order(first), _elements_in_order(second)))


def _elements_in_order(mesh: SolidMesh) -> FloatArray:
    """Return the nodes' positions (m * n_e, 3) [m], sorted within each element, and elements by these."""
    position, number = np.unique(mesh.node, axis=0, return_inverse=True)
    element = np.sort(number.reshape(-1)[mesh.element], axis=1)
    return np.asarray(position[element[np.lexsort(element.T)]].reshape(-1, 3))


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
