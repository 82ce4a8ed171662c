"""Closest points on a triangulated surface that face the same way: the basis of mapping in both directions.

Distance alone picks the wrong side where two sides are close: on a thin fin, and at a slope break, where nodes are
doubled and both sides' triangles touch. So each target point brings its outward normal, and a triangle that
faces away is only chosen where no other is near.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from builder.aero.surface.mesh import SurfaceMesh
from strainfmu.arrays import BoolArray, FloatArray, IntArray

MIN_FIT = 0.5
"""Cosine between normals below which a triangle is another side of the body (60 deg)."""
SAME_DISTANCE = 0.01
"""Triangles count as equally near if their distances differ by less than this fraction ..."""
SAME_PLACE = 1e-6
"""... plus this fraction of the source's extent: coordinates in single precision are no better."""
FIT_REACH = 1.0
"""How many edges farther than the nearest triangle one that fits may be."""
FAR = 3.0
"""Distance, in longest edges of the source, beyond which a point is not of this surface."""
_BLOCK = 2048
_FIRST_GUESSES = 4


@dataclass(frozen=True, eq=False, kw_only=True)
class ClosestPoints:
    """Where target points lie on a source surface.

    Attributes
    ----------
    triangle : (n,) source triangle of each target point.
    weight : (n, 3) barycentric weights of its corners, at least 0, sum 1.
    gap : (n,) distance to the point these weights give [m].
    fits : (n,) the triangle's normal is within 60 deg of the target's.
    """

    triangle: IntArray
    weight: FloatArray
    gap: FloatArray
    fits: BoolArray


def closest_points(source: SurfaceMesh, point: FloatArray, normal: FloatArray) -> ClosestPoints:
    """Find the closest point of ``source`` for each target point, on a triangle that faces the same way.

    Of the triangles that are equally near (within 1 % of the distance) the one whose normal fits best is taken.
    Where the nearest triangle does not fit (more than 60 deg), the nearest that does is taken if it is at most an
    edge farther away, otherwise the nearest, marked as not fitting. The search is exact up to three of the
    source's longest edges; farther away, where something is wrong, the best of the four nearest centroids is
    taken.

    Parameters
    ----------
    point : (n, 3) target points [m].
    normal : (n, 3) their outward unit normals; a zero vector fits everywhere.
    """
    search = _Search(source)
    blocks = [search.find(point[block], normal[block]) for block in _blocks(len(point))]
    triangle, weight, gap, fits = (np.concatenate(parts) for parts in zip(*blocks, strict=True))
    return ClosestPoints(triangle=triangle, weight=weight, gap=gap, fits=fits)


def closest_on_triangles(point: FloatArray, corner: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the barycentric weights (n, 3) of the closest point of each triangle, and its distance (n,).

    Point by point: ``point`` (n, 3), ``corner`` (n, 3 corners, 3). Inside the triangle that is the foot of the
    perpendicular, otherwise the closest of the three edges' closest points.
    """
    a, b, c = corner[:, 0], corner[:, 1], corner[:, 2]
    across = np.cross(b - a, c - a)
    square = np.einsum("ni,ni->n", across, across)
    weight = np.empty((len(point), 3))
    # Of a triangle without area the quotients are not finite, which the next test counts as outside.
    with np.errstate(divide="ignore", invalid="ignore"):
        weight[:, 1] = np.einsum("ni,ni->n", np.cross(point - a, c - a), across) / square
        weight[:, 2] = np.einsum("ni,ni->n", np.cross(b - a, point - a), across) / square
        weight[:, 0] = 1.0 - weight[:, 1] - weight[:, 2]
        inside = weight.min(axis=1) >= 0.0
    outside = np.flatnonzero(~inside)
    if len(outside):
        weight[outside] = _closest_on_edges(point[outside], corner[outside])
    distance = np.linalg.norm(point - np.einsum("nk,nki->ni", weight, corner), axis=1)
    return weight, distance


def _closest_on_edges(point: FloatArray, corner: FloatArray) -> FloatArray:
    """Return the barycentric weights (n, 3) of the closest point on each triangle's edges."""
    weight = np.zeros((len(point), 3))
    nearest = np.full(len(point), np.inf)
    for k in range(3):
        start, along = corner[:, k], corner[:, (k + 1) % 3] - corner[:, k]
        square = np.einsum("ni,ni->n", along, along)
        fraction = np.einsum("ni,ni->n", point - start, along)
        fraction = np.clip(np.divide(fraction, square, out=np.zeros_like(fraction), where=square > 0.0), 0.0, 1.0)
        distance = np.linalg.norm(point - start - fraction[:, None] * along, axis=1)
        nearer = np.flatnonzero(distance < nearest)
        nearest[nearer] = distance[nearer]
        weight[nearer] = 0.0
        weight[nearer, k] = 1.0 - fraction[nearer]
        weight[nearer, (k + 1) % 3] = fraction[nearer]
    return weight


def _blocks(count: int) -> Iterator[slice]:
    return (slice(start, start + _BLOCK) for start in range(0, max(count, 1), _BLOCK))


def _put(where: IntArray, into: tuple[NDArray[Any], ...], values: tuple[NDArray[Any], ...]) -> None:
    for old, new in zip(into, values, strict=True):
        old[where] = new


class _Search:
    """The source's triangles, ordered for search: one tree of centroids per class of size.

    A triangle is nearer than d only if its centroid is nearer than d plus the triangle's reach from its centroid;
    classes keep that bound tight where a mesh holds large and small triangles.
    """

    def __init__(self, source: SurfaceMesh) -> None:
        self.corner = source.point[source.triangle]
        centroid = self.corner.mean(axis=1)
        reach = np.linalg.norm(self.corner - centroid[:, None], axis=2).max(axis=1)
        edge = np.linalg.norm(self.corner - np.roll(self.corner, 1, axis=1), axis=2)
        self.longest_edge = edge.max(axis=1)
        self.same_place = SAME_PLACE * float(np.ptp(source.point, axis=0).max())
        area = source.area[:, None]
        self.normal = np.divide(source.vector_area, area, out=np.zeros_like(source.vector_area), where=area > 0.0)
        self.everything = cKDTree(centroid)
        size_class = np.floor(np.log2(np.maximum(reach / reach.max(), 1e-9))).astype(int)
        self.classes = []
        for which in np.unique(size_class):
            member = np.flatnonzero(size_class == which)
            self.classes.append((member, cKDTree(centroid[member]), float(reach[member].max())))

    def find(self, point: FloatArray, normal: FloatArray) -> tuple[IntArray, FloatArray, FloatArray, BoolArray]:
        """Return triangle, weight, gap and fit of a block of target points."""
        guesses = min(_FIRST_GUESSES, len(self.corner))
        guess = self.everything.query(point, k=guesses)[1].reshape(len(point), guesses)
        owner = np.repeat(np.arange(len(point)), guesses)
        every = closest_on_triangles(point[owner], self.corner[guess.ravel()])
        best = every[1].reshape(guess.shape).argmin(axis=1) + guesses * np.arange(len(point))
        triangle, weight, gap = guess.ravel()[best], every[0][best], every[1][best]
        fits = self._fit(normal, triangle) >= MIN_FIT
        near = np.flatnonzero(gap <= FAR * self.longest_edge.max())
        chosen = self._choose(point[near], normal[near], self._equally_near(gap[near]))
        _put(near, (triangle, weight, gap, fits), chosen)
        reach = FIT_REACH * self.longest_edge[triangle]
        lost = near[~fits[near]]
        _put(lost, (triangle, weight, gap, fits), self._choose(point[lost], normal[lost], (gap + reach)[lost]))
        return triangle, weight, gap, fits

    def _fit(self, normal: FloatArray, triangle: IntArray) -> FloatArray:
        """Return the cosine (n,) between normals and triangles; 1 where there is no normal."""
        free: BoolArray = np.linalg.norm(normal, axis=1) == 0.0
        return np.where(free, 1.0, np.einsum("pi,pi->p", normal, self.normal[triangle]))

    def _choose(
        self, point: FloatArray, normal: FloatArray, radius: FloatArray
    ) -> tuple[IntArray, FloatArray, FloatArray, BoolArray]:
        """Return the best triangle within ``radius`` (n,) of each point; at least one must be there."""
        owner, triangle = self._within(point, radius)
        weight, distance = closest_on_triangles(point[owner], self.corner[triangle])
        fit = self._fit(normal[owner], triangle)
        fits = fit >= MIN_FIT
        # Nearest first among those that fit, then among the others.
        order = np.lexsort((distance, ~fits, owner))
        first = order[np.searchsorted(owner[order], np.arange(len(point)))]
        limit = self._equally_near(distance[first])
        equal = (fits == fits[first][owner]) & (distance <= limit[owner])
        pair = np.flatnonzero(equal)
        # Rounded, so that of triangles in one plane the nearest is taken, not the one rounding favours.
        order = pair[np.lexsort((distance[pair], -np.round(fit[pair], 9), owner[pair]))]
        best = order[np.searchsorted(owner[order], np.arange(len(point)))]
        return triangle[best], weight[best], distance[best], fits[best]

    def _equally_near(self, distance: FloatArray) -> FloatArray:
        """Return up to which distance (n,) a triangle counts as near as one at ``distance``."""
        return (1.0 + SAME_DISTANCE) * distance + self.same_place

    def _within(self, point: FloatArray, radius: FloatArray) -> tuple[IntArray, IntArray]:
        """Return pairs (point, triangle) that hold every triangle nearer than ``radius`` (n,) to its point."""
        owners, triangles = [], []
        for member, tree, reach in self.classes:
            # Slightly more than the bound, so that rounding cannot lose the nearest triangle.
            near = tree.query_ball_point(point, (radius + reach) * (1.0 + 1e-9), return_sorted=False)
            count = np.fromiter(map(len, near), dtype=np.int64, count=len(near))
            flat = np.fromiter(chain.from_iterable(near), dtype=np.int64, count=int(count.sum()))
            owners.append(np.repeat(np.arange(len(point)), count))
            triangles.append(member[flat])
        return np.concatenate(owners), np.concatenate(triangles)
