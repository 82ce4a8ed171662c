"""Strain on a surface from the displacement of its nodes.

The strain along a direction e in the tangent plane is e . du/de, which the facet's own displacement gives: the
derivative is taken within the surface, so the volume element adds nothing to it.

Within a quadratic facet that strain is linear and an order less accurate than displacement, but it is an order
better at the facet's 2 x 2 Gauss points (3 points on triangles). A polynomial of second degree is fitted to those
points of the facets around by least squares and evaluated at the gauge (Zienkiewicz and Zhu, Int. J. Numer. Meth.
Eng. 33, 1992: superconvergent patch recovery). The patch ends where the surface bends sharply, and where the
region changes: strain jumps between materials. A gauge on the line between facets takes the mean of their
patches, so that it reads alike on a mesh and on its mirror image.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from builder.structure.solid.elements.closest_point import CurvedFacets, FootPoint, feet_on, foot_point
from builder.structure.solid.elements.element_faces import FACE_CORNERS
from builder.structure.solid.elements.elements import ReferenceElement, reference_facet
from builder.structure.solid.operators.surface_load import normals_at_nodes
from strainfmu.arrays import FloatArray, IntArray

SAMPLE_DEGREE = {"hexahedron20": 3, "tetrahedron10": 2, "hexahedron8": 1, "tetrahedron4": 1}
"""Quadrature whose points have the better strain."""

SHARPEST_BEND = np.deg2rad(1.0)
"""Angle between the normals of two quadratic facets at a common node above which a patch ends between them."""

SHARPEST_BEND_OF_LINEAR = np.deg2rad(20.0)

ON_THE_LINE = 1e-8
"""Distance [m] between the feet on two facets below which a gauge is on the line between them."""

REACH = 0.5
"""Distance at which the weight of a sample has fallen to exp(-1/2), in lengths of the gauge's facet."""


@dataclass(frozen=True, eq=False)
class SurfacePatches:
    """Facets of a surface and their neighbours.

    Attributes
    ----------
    element_type : kind of the elements the facets belong to.
    node : (n, 3) positions of all nodes [m].
    facet : (f, n_f) node numbers, outward.
    region : (f,) region of the element behind each.
    """

    element_type: str
    node: FloatArray
    facet: IntArray
    region: IntArray

    @cached_property
    def curved(self) -> CurvedFacets:
        """The facets by the positions of their nodes."""
        return CurvedFacets(self.element_type, self.node[self.facet])

    @cached_property
    def _normal(self) -> FloatArray:
        """(f, n_f, 3) unit normals of each facet at its nodes."""
        return normals_at_nodes(self.element_type, self.curved.position)

    @cached_property
    def _facets_of_node(self) -> tuple[IntArray, IntArray, IntArray]:
        """Nodes in order, and the facet and the local number that each belongs to."""
        order = np.argsort(self.facet.ravel(), kind="stable")
        return self.facet.ravel()[order], order // self.facet.shape[1], order % self.facet.shape[1]

    @property
    def _sharpest(self) -> float:
        linear = self.facet.shape[1] == FACE_CORNERS[self.element_type]
        return float(SHARPEST_BEND_OF_LINEAR if linear else SHARPEST_BEND)

    @cached_property
    def _known_feet(self) -> dict[bytes, FootPoint]:
        return {}

    @cached_property
    def _known_sides(self) -> dict[tuple[int, bytes], list[FootPoint]]:
        return {}

    def foot(self, point: FloatArray) -> FootPoint:
        """Return the point closest to ``point`` (3,) [m]; directions at one point share the search."""
        key = point.tobytes()
        if key not in self._known_feet:
            self._known_feet[key] = foot_point(self.curved, point)
        return self._known_feet[key]

    def feet_of_all_sides(self, foot: FootPoint) -> list[FootPoint]:
        """Return the foot on every facet that it lies on and that goes on smoothly there; shared too."""
        key = (foot.facet, foot.point.tobytes())
        if key not in self._known_sides:
            others = feet_on(self.curved, self.around(foot.facet)[1:], foot.point)
            on_the_line = [other for other in others if np.linalg.norm(other.offset) < ON_THE_LINE]
            self._known_sides[key] = [foot, *on_the_line]
        return self._known_sides[key]

    def around(self, facet: int) -> IntArray:
        """Return the facets (k,) that go on smoothly, in one region, at a node of ``facet``, itself first."""
        found = [facet]
        ordered, owner, local = self._facets_of_node
        for a, node in enumerate(self.facet[facet]):
            here = slice(np.searchsorted(ordered, node), np.searchsorted(ordered, node, side="right"))
            cosine = self._normal[owner[here], local[here]] @ self._normal[facet, a]
            alike = self.region[owner[here]] == self.region[facet]
            found += owner[here][alike & (cosine > np.cos(self._sharpest))].tolist()
        return np.array(list(dict.fromkeys(found)))


def strain_weights(patches: SurfacePatches, foot: FootPoint, direction: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return the strain along ``direction`` (3,), a unit vector in the tangent plane, per displacement.

    Returns
    -------
    node : (k,) nodes, a node of several facets several times.
    weight : (k, 3) strain per displacement [1/m].
    """
    feet = patches.feet_of_all_sides(foot)
    parts = [_weights_of_patch(patches, one, direction) for one in feet]
    node, weight = (np.concatenate(part) for part in zip(*parts, strict=True))
    return node, weight / len(feet)


def _weights_of_patch(
    patches: SurfacePatches, foot: FootPoint, direction: FloatArray
) -> tuple[IntArray, FloatArray]:
    """Return nodes and weights as :func:`strain_weights`, from the patch round the foot's own facet."""
    reference = reference_facet(patches.element_type, SAMPLE_DEGREE[patches.element_type])
    around = patches.around(foot.facet)
    point, weight = _sampled_strain(reference, patches.curved.position[around], direction)
    fit = _fit(foot, point.reshape(-1, 3)).reshape(point.shape[:2])
    return patches.facet[around].ravel(), np.einsum("fq,fqac->fac", fit, weight).reshape(-1, 3)


def _sampled_strain(
    reference: ReferenceElement, position: FloatArray, direction: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return sample points (f, n_q, 3) [m] and strain there per displacement of nodes (f, n_q, n_f, 3) [1/m].

    The direction is projected onto the tangent plane of each sample.
    """
    point = np.einsum("qa,fac->fqc", reference.shape, position)
    tangent = np.einsum("qad,fac->fqcd", reference.gradient, position)
    metric = np.einsum("fqcd,fqce->fqde", tangent, tangent)
    along = np.linalg.solve(metric, np.einsum("fqcd,c->fqd", tangent, direction)[..., None])[..., 0]
    local = np.einsum("fqcd,fqd->fqc", tangent, along)
    length = np.linalg.norm(local, axis=-1)
    by_arc = np.einsum("qad,fqd->fqa", reference.gradient, along / length[..., None])
    return point, by_arc[..., None] * (local / length[..., None])[:, :, None, :]


def _fit(foot: FootPoint, point: FloatArray) -> FloatArray:
    """Return the weight (k,) of each sample in the fitted polynomial's value at the gauge."""
    s, t = np.linalg.lstsq(foot.tangent, (point - foot.point).T, rcond=None)[0]
    closeness = np.exp(-0.25 * (s**2 + t**2) / REACH**2)  # square root of the weight
    basis = np.column_stack([np.ones_like(s), s, t, s**2, s * t, t**2])
    if len(point) < 12:
        basis = basis[:, :3] if len(point) >= 4 else basis[:, :1]
    solution: FloatArray = np.linalg.pinv(basis * closeness[:, None], rcond=1e-8)[0] * closeness
    return solution
