"""Closest points on the curved facets of a surface."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from builder.structure.solid.elements.element_faces import FACE_CORNERS
from builder.structure.solid.elements.elements import facet_shape_functions
from strainfmu.arrays import FloatArray, IntArray

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
