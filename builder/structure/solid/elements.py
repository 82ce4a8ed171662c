"""Faces and edges of elements, and the boundary of a mesh.

Local node numbers are VTK's: corners, then the middles of edges in the order of :data:`EDGES`. Faces turn
anticlockwise seen from outside, corners first, then middles, so their normal points outward (VTK User's Guide,
figures of cell types; vtkQuadraticTetra, vtkQuadraticHexahedron).

Shape functions and quadrature of the elements and of their facets.

Nodes are numbered as VTK numbers them: corners, then the middles of edges. Reference coordinates run over the unit
cube or square, or over the simplex with corners at the origin and at the unit vectors. Shape functions and
quadrature points are scikit-fem's; its elements number their nodes in another way, so nodes are matched by their
position.

Shape of elements: scaled Jacobian, folded elements, and how to unfold them.

Closest points on the curved facets of a surface.
"""

from dataclasses import dataclass
from functools import cache, cached_property
from typing import Literal

import numpy as np
from scipy.spatial import cKDTree
from skfem.element import (
    Element,
    ElementHex1,
    ElementHexS2,
    ElementQuad1,
    ElementQuadS2,
    ElementTetP1,
    ElementTetP2,
    ElementTriP1,
    ElementTriP2,
)
from skfem.quadrature import get_quadrature

from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError

_TETRAHEDRON_EDGES = ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))
_HEXAHEDRON_EDGES = (
    *((0, 1), (1, 2), (2, 3), (3, 0)),
    *((4, 5), (5, 6), (6, 7), (7, 4)),
    *((0, 4), (1, 5), (2, 6), (3, 7)),
)
_TETRAHEDRON_FACES = ((0, 1, 3), (1, 2, 3), (2, 0, 3), (0, 2, 1))
_HEXAHEDRON_FACES = ((0, 4, 7, 3), (1, 2, 6, 5), (0, 1, 5, 4), (3, 7, 6, 2), (0, 3, 2, 1), (4, 5, 6, 7))

CORNERS = {"hexahedron20": 8, "tetrahedron10": 4, "hexahedron8": 8, "tetrahedron4": 4}
FACE_CORNERS = {"hexahedron20": 4, "tetrahedron10": 3, "hexahedron8": 4, "tetrahedron4": 3}


def element_edges(element_type: str) -> IntArray:
    """Return (n_edges, 2) local corners of each edge, in the order of the middle nodes."""
    return np.array(_TETRAHEDRON_EDGES if CORNERS[element_type] == 4 else _HEXAHEDRON_EDGES, dtype=np.int64)


def element_faces(element_type: str) -> IntArray:
    """Return (n_faces, n_f) local nodes of each face, outward."""
    corners = _TETRAHEDRON_FACES if CORNERS[element_type] == 4 else _HEXAHEDRON_FACES
    if element_type in ("tetrahedron4", "hexahedron8"):
        return np.array(corners, dtype=np.int64)
    first_middle = CORNERS[element_type]
    middle = {frozenset(edge): first_middle + i for i, edge in enumerate(element_edges(element_type).tolist())}
    faces = [
        [*face, *(middle[frozenset((a, b))] for a, b in zip(face, (*face[1:], face[0]), strict=True))]
        for face in corners
    ]
    return np.array(faces, dtype=np.int64)


def all_faces(element_type: str, element: IntArray) -> IntArray:
    """Return (m * n_faces, n_f) the faces of elements (m, n_e), element by element."""
    local = element_faces(element_type)
    return element[:, local].reshape(-1, local.shape[1])


def face_keys(element_type: str, facet: IntArray) -> IntArray:
    """Return (f, n_corners) sorted corners of facets: equal for one face seen from both of its elements."""
    return np.sort(facet[:, : FACE_CORNERS[element_type]], axis=1)


def boundary_facets(element_type: str, element: IntArray) -> tuple[IntArray, IntArray]:
    """Return the faces that belong to one element alone.

    Parameters
    ----------
    element_type : kind of the elements.
    element : (m, n_e) node numbers.

    Returns
    -------
    facet : (f, n_f) node numbers, outward.
    owner : (f,) the element of each.
    """
    faces = all_faces(element_type, element)
    _, first, count = np.unique(face_keys(element_type, faces), axis=0, return_index=True, return_counts=True)
    alone = np.sort(first[count == 1])
    return faces[alone], alone // len(element_faces(element_type))


Quadrature = int | Literal["full", "thin_wall"]

_CUBE = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
_TETRAHEDRON = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
_SQUARE, _TRIANGLE = [(0, 0), (1, 0), (1, 1), (0, 1)], [(0, 0), (1, 0), (0, 1)]

_VOLUME: dict[str, Element] = {
    "hexahedron20": ElementHexS2(),
    "tetrahedron10": ElementTetP2(),
    "hexahedron8": ElementHex1(),
    "tetrahedron4": ElementTetP1(),
}
_FACET: dict[str, Element] = {
    "hexahedron20": ElementQuadS2(),
    "tetrahedron10": ElementTriP2(),
    "hexahedron8": ElementQuad1(),
    "tetrahedron4": ElementTriP1(),
}

STIFFNESS_DEGREE = {"hexahedron20": 5, "tetrahedron10": 2, "hexahedron8": 3, "tetrahedron4": 1}
"""Degree of the quadrature of the stiffness: 3 x 3 x 3, 4, 2 x 2 x 2 and 1 points.

The lowest that leaves no motion without strain but the rigid ones and keeps the order of convergence
(Zienkiewicz and Taylor, The Finite Element Method, vol. 1 (5th ed.), sections 9.11 and 12.5): 2 x 2 x 2 points on
20 nodes would leave six.
"""

THIN_WALL_POINTS = (3, 2, 3)
"""Points of ``hexahedron20`` along, round and through the wall of a swept mesh.

A curved element that ovalises stretches round the axis by a quadratic, which is zero at two Gauss points but not
at three: with three, the wall is too stiff in bending unless elements are shorter than sqrt(R t) (membrane
locking; Stolarski and Belytschko, J. Appl. Mech. 49, 1982). Two round and three in the other directions leave no
motion but the rigid ones without strain; two along as well would leave one.
"""

MASS_DEGREE = {"hexahedron20": 5, "tetrahedron10": 5, "hexahedron8": 3, "tetrahedron4": 2}
"""Degree of the quadrature of a shape function times a linear field."""

FACET_DEGREE = {"hexahedron20": 7, "tetrahedron10": 6, "hexahedron8": 3, "tetrahedron4": 2}
"""Degree at which two shape functions times the vector area of a curved facet are integrated exactly.

The vector area is of degree 3 in each coordinate on the quadratic quadrilateral (1 on the linear one), two shape
functions are of degree 4 (2); on the quadratic triangle 2 and 4 in all.
"""


@dataclass(frozen=True, eq=False, kw_only=True)
class ReferenceElement:
    """Shape functions and their gradients at the quadrature points of a reference element or facet.

    Attributes
    ----------
    point : (n_q, d) quadrature points, d = 3 for elements and 2 for facets.
    weight : (n_q,) weights; their sum is the size of the reference element.
    shape : (n_q, n_e) shape functions [-].
    gradient : (n_q, n_e, d) their derivatives by the reference coordinates [-].
    """

    point: FloatArray
    weight: FloatArray
    shape: FloatArray
    gradient: FloatArray


def reference_nodes(element_type: str) -> FloatArray:
    """Return (n_e, 3) reference coordinates of an element's nodes."""
    corner = np.array(_CUBE if CORNERS[element_type] == 8 else _TETRAHEDRON, dtype=float)
    if element_type in ("hexahedron8", "tetrahedron4"):
        return corner
    return np.concatenate([corner, corner[element_edges(element_type)].mean(axis=1)])


def facet_reference_nodes(element_type: str) -> FloatArray:
    """Return (n_f, 2) reference coordinates of the nodes of an element's facets."""
    corner = np.array(_SQUARE if CORNERS[element_type] == 8 else _TRIANGLE, dtype=float)
    if element_type in ("hexahedron8", "tetrahedron4"):
        return corner
    return np.concatenate([corner, 0.5 * (corner + np.roll(corner, -1, axis=0))])


@cache
def scikit_fem_order(element_type: str) -> IntArray:
    """Return (n_e,) the scikit-fem number of each node of an element."""
    return _matching(_VOLUME[element_type], reference_nodes(element_type))


@cache
def _facet_order(element_type: str) -> IntArray:
    return _matching(_FACET[element_type], facet_reference_nodes(element_type))


def _matching(element: Element, node: FloatArray) -> IntArray:
    """Return the index into the element's own nodes of each of ``node``."""
    distance = np.abs(node[:, None] - element.doflocs[None]).sum(axis=-1)
    order: IntArray = distance.argmin(axis=1)
    return order


def _evaluate(element: Element, order: IntArray, point: FloatArray) -> tuple[FloatArray, FloatArray]:
    pairs = [element.lbasis(point.T.copy(), int(i)) for i in order]
    shape = np.stack([np.broadcast_to(value, len(point)) for value, _ in pairs], axis=1)
    gradient = np.stack([slope.T for _, slope in pairs], axis=1)
    return shape.astype(np.float64), gradient.astype(np.float64)


def shape_functions(element_type: str, point: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return shape functions (n, n_e) of an element and gradients (n, n_e, 3) at reference points (n, 3)."""
    return _evaluate(_VOLUME[element_type], scikit_fem_order(element_type), point)


def facet_shape_functions(element_type: str, point: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return shape functions (n, n_f) of a facet and gradients (n, n_f, 2) at reference points (n, 2)."""
    return _evaluate(_FACET[element_type], _facet_order(element_type), point)


@cache
def reference_element(element_type: str, quadrature: Quadrature = "full") -> ReferenceElement:
    """Return an element's shape functions at the points of a quadrature.

    Parameters
    ----------
    element_type : key of :data:`STIFFNESS_DEGREE`.
    quadrature : ``"full"`` for :data:`STIFFNESS_DEGREE`, ``"thin_wall"`` for :data:`THIN_WALL_POINTS`, or the
        polynomial degree to be integrated exactly.
    """
    if quadrature == "thin_wall":
        point, weight = _thin_wall_points(element_type)
    else:
        degree = STIFFNESS_DEGREE[element_type] if quadrature == "full" else quadrature
        rule = get_quadrature(_VOLUME[element_type], degree)
        point, weight = rule[0].T, rule[1]
    shape, gradient = shape_functions(element_type, point)
    return ReferenceElement(point=point, weight=weight, shape=shape, gradient=gradient)


def _thin_wall_points(element_type: str) -> tuple[FloatArray, FloatArray]:
    if element_type != "hexahedron20":
        raise InputError(f"quadrature 'thin_wall' is for hexahedron20, {element_type} found")
    rules = [np.polynomial.legendre.leggauss(n) for n in THIN_WALL_POINTS]
    point = np.stack(np.meshgrid(*(rule[0] for rule in rules), indexing="ij"), axis=-1).reshape(-1, 3)
    weight = np.einsum("i,j,k->ijk", *(rule[1] for rule in rules)).ravel()
    return 0.5 * (point + 1.0), 0.125 * weight


@cache
def reference_facet(element_type: str, degree: int | None = None) -> ReferenceElement:
    """Return the shape functions of an element's facets at the points of a quadrature.

    Parameters
    ----------
    element_type : key of :data:`FACET_DEGREE`: of the element, not of the facet.
    degree : polynomial degree integrated exactly; :data:`FACET_DEGREE` by default.
    """
    point, weight = get_quadrature(_FACET[element_type], degree or FACET_DEGREE[element_type])
    shape, gradient = facet_shape_functions(element_type, point.T)
    return ReferenceElement(point=point.T, weight=weight, shape=shape, gradient=gradient)


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
    is_left_handed = np.linalg.det(direction) < 0.0
    direction[is_left_handed] = direction[is_left_handed][:, [1, 0, 2]]
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
        newly_folded = (determinant_ratio(element_type, node, element) < STRAIGHT_BELOW) & ~bad
        if not newly_folded.any():
            return node
        bad |= newly_folded
        worst = element[newly_folded]
        node[worst[:, n_corners:]] = node[worst[:, edge]].mean(axis=2)


MAX_CANDIDATES = 64
MAX_STEPS = 40
CONVERGED = 1e-13  # of a facet's reference length
BULGE = 0.25  # how far a curved facet may leave the box of its nodes, over the box's diagonal


@dataclass(frozen=True, eq=False)
class CurvedFacets:
    """Facets by the positions of their nodes, with what a search needs.

    Attributes
    ----------
    element_type : kind of the elements the facets belong to.
    position : (f, n_f, 3) nodes of each facet [m].
    """

    element_type: str
    position: FloatArray

    @cached_property
    def _boxes(self) -> tuple[FloatArray, FloatArray]:
        """(f, 3) lowest and highest coordinates [m] that a facet may reach."""
        low, high = self.position.min(axis=1), self.position.max(axis=1)
        slack = BULGE * np.linalg.norm(high - low, axis=1, keepdims=True)
        return low - slack, high + slack

    @cached_property
    def _nodes(self) -> cKDTree:
        return cKDTree(self.position.reshape(-1, 3))

    def candidates(self, point: FloatArray) -> IntArray:
        """Return the facets (k,) whose box is nearer to ``point`` (3,) than the nearest node, nearest first."""
        low, high = self._boxes
        nearest, _ = self._nodes.query(point)
        gap = np.square(np.maximum(np.maximum(low - point, point - high), 0.0)).sum(axis=1)
        near = np.flatnonzero(gap <= nearest**2)
        chosen: IntArray = near[np.argsort(gap[near], kind="stable")[:MAX_CANDIDATES]]
        return chosen


@dataclass(frozen=True, eq=False, kw_only=True)
class FootPoint:
    """The point of a surface closest to a given one.

    Attributes
    ----------
    facet : index of its facet.
    reference : (2,) reference coordinates on it.
    point : (3,) position [m].
    tangent : (3, 2) derivative of the position by the reference coordinates [m].
    normal : (3,) unit normal, out of the material.
    offset : (3,) given point minus foot [m].
    """

    facet: int
    reference: FloatArray
    point: FloatArray
    tangent: FloatArray
    normal: FloatArray
    offset: FloatArray

    @property
    def height(self) -> float:
        """Distance along the normal [m], positive out of the material."""
        return float(self.offset @ self.normal)

    @property
    def beyond_edge(self) -> float:
        """Distance across the normal [m]; greater than 0 for points beyond the edge of the surface only."""
        return float(np.linalg.norm(self.offset - self.height * self.normal))


def foot_point(facets: CurvedFacets, point: FloatArray) -> FootPoint:
    """Find the point of facets closest to ``point``.

    Facets whose box is nearer than the nearest node are candidates; Gauss-Newton steps on each, kept within the
    facet, end at the foot of the normal or on an edge. The normal's foot is found to round-off, because the
    residual of points near the surface is small.

    Parameters
    ----------
    facets : the surface.
    point : (3,) [m].
    """
    feet = feet_on(facets, facets.candidates(point), point)
    return min(feet, key=lambda foot: float(np.linalg.norm(foot.offset)))


def feet_on(facets: CurvedFacets, candidate: IntArray, point: FloatArray) -> list[FootPoint]:
    """Return the point closest to ``point`` (3,) [m] on each of the facets ``candidate`` (k,)."""
    element_type, position = facets.element_type, facets.position
    corners = FACE_CORNERS[element_type]
    reference = np.full((len(candidate), 2), 0.5 if corners == 4 else 1.0 / 3.0)
    for _ in range(MAX_STEPS):
        mapped, tangent = _map(element_type, position[candidate], reference)
        metric = np.einsum("fcd,fce->fde", tangent, tangent)
        pull = np.einsum("fcd,fc->fd", tangent, point - mapped)
        step = _within(corners, reference + np.linalg.solve(metric, pull[..., None])[..., 0]) - reference
        reference = reference + step
        if np.abs(step).max() < CONVERGED:
            break
    mapped, tangent = _map(element_type, position[candidate], reference)
    normal = np.cross(tangent[:, :, 0], tangent[:, :, 1])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return [
        FootPoint(
            facet=int(facet),
            reference=reference[i],
            point=mapped[i],
            tangent=tangent[i],
            normal=normal[i],
            offset=point - mapped[i],
        )
        for i, facet in enumerate(candidate)
    ]


def _map(element_type: str, position: FloatArray, reference: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return positions (k, 3) and tangents (k, 3, 2) at one reference point on each of k facets."""
    shape, gradient = facet_shape_functions(element_type, reference)
    return np.einsum("fa,fac->fc", shape, position), np.einsum("fad,fac->fcd", gradient, position)


def _within(corners: int, reference: FloatArray) -> FloatArray:
    """Move reference points (k, 2) into the unit square or triangle."""
    inside = np.clip(reference, 0.0, 1.0)
    if corners == 3:
        excess = np.maximum(inside.sum(axis=1) - 1.0, 0.0)[:, None]
        inside = np.clip(inside - 0.5 * excess, 0.0, 1.0)
    return inside
