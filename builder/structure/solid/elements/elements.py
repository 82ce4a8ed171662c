"""Shape functions and quadrature of the elements and of their facets.

Nodes are numbered as VTK numbers them: corners, then the middles of edges. Reference coordinates run over the unit
cube or square, or over the simplex with corners at the origin and at the unit vectors. Shape functions and
quadrature points are scikit-fem's; its elements number their nodes in another way, so nodes are matched by their
position.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Literal

import numpy as np
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

from builder.structure.solid.elements.element_faces import CORNERS, element_edges
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError

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

    Raises
    ------
    InputError
        ``"thin_wall"`` is requested of an element other than ``hexahedron20``.
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
