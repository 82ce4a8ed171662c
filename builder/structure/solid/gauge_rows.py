"""Strain on a surface from the displacement of its nodes.

The strain along a direction e in the tangent plane is e . du/de, which the facet's own displacement gives: the
derivative is taken within the surface, so the volume element adds nothing to it.

Within a quadratic facet that strain is linear and an order less accurate than displacement, but it is an order
better at the facet's 2 x 2 Gauss points (3 points on triangles). A polynomial of second degree is fitted to those
points of the facets around by least squares and evaluated at the gauge (Zienkiewicz and Zhu, Int. J. Numer. Meth.
Eng. 33, 1992: superconvergent patch recovery). The patch ends where the surface bends sharply, and where the
region changes: strain jumps between materials. A gauge on the line between facets takes the mean of their
patches, so that it reads alike on a mesh and on its mirror image.

Strain gauges on a surface of the mesh, and the rows B that give their strain.

A gauge has a position on a named surface, a direction in its tangent plane and a length, over which strain is
averaged along the direction; length 0 is a point. Gauges need not be on nodes. A position or direction that misses
the surface by little is moved onto it; one that misses it by more is refused.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import coo_array, csr_array

from builder.reporting import Progress
from builder.structure.fourier.inner_surface import LARGEST_DISTANCE, LARGEST_TILT
from builder.structure.solid.elements import (
    FACE_CORNERS,
    CurvedFacets,
    FootPoint,
    ReferenceElement,
    boundary_facets,
    feet_on,
    foot_point,
    reference_facet,
)
from builder.structure.solid.mesh_checks import match_facets
from builder.structure.solid.nodal_loads import normals_at_nodes
from builder.structure.solid.solid_mesh import EXTERNAL, INTERNAL, SolidMesh
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError

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
            neighbours = feet_on(self.curved, self.around(foot.facet)[1:], foot.point)
            on_the_line = [neighbour for neighbour in neighbours if np.linalg.norm(neighbour.offset) < ON_THE_LINE]
            self._known_sides[key] = [foot, *on_the_line]
        return self._known_sides[key]

    def around(self, facet: int) -> IntArray:
        """Return the facets (k,) that go on smoothly, in one region, at a node of ``facet``, itself first."""
        facets = [facet]
        ordered, owner, local = self._facets_of_node
        for a, node in enumerate(self.facet[facet]):
            span = slice(np.searchsorted(ordered, node), np.searchsorted(ordered, node, side="right"))
            cosine = self._normal[owner[span], local[span]] @ self._normal[facet, a]
            alike = self.region[owner[span]] == self.region[facet]
            facets += owner[span][alike & (cosine > np.cos(self._sharpest))].tolist()
        return np.array(list(dict.fromkeys(facets)))


def strain_weights(patches: SurfacePatches, foot: FootPoint, direction: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return the strain along ``direction`` (3,), a unit vector in the tangent plane, per displacement.

    Returns
    -------
    node : (k,) nodes, a node of several facets several times.
    weight : (k, 3) strain per displacement [1/m].
    """
    feet = patches.feet_of_all_sides(foot)
    parts = [_weights_of_patch(patches, side, direction) for side in feet]
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


SAME_PLACE = 1e-6  # m
SAME_DIRECTION = 1e-6  # rad
POINTS_ALONG_GAUGE = 5


@dataclass(frozen=True, eq=False, kw_only=True)
class Gauges:
    """Strain gauges in body axes.

    Attributes
    ----------
    name : (n,) names, for messages.
    position : (n, 3) [m].
    direction : (n, 3) of any length.
    length : (n,) gauge length [m]; 0 for strain at a point.
    surface : (n,) name of the surface each is bonded to.
    """

    name: tuple[str, ...]
    position: FloatArray
    direction: FloatArray
    length: FloatArray
    surface: tuple[str, ...]

    def __post_init__(self) -> None:
        n = len(self.name)
        if not (self.position.shape == self.direction.shape == (n, 3)) or len(self.surface) != n:
            raise InputError(
                f"gauge positions {self.position.shape} and directions {self.direction.shape} must be ({n}, 3)"
            )
        if self.length.shape != (n,):
            raise InputError(f"gauge lengths {self.length.shape} must be ({n},)")
        for i in range(n):
            if not (np.isfinite(self.position[i]).all() and np.isfinite(self.direction[i]).all()):
                raise InputError(f"{self.name[i]}: a coordinate or direction is not finite")
            if not 0.0 <= self.length[i] < np.inf:
                raise InputError(f"{self.name[i]}: gauge length {self.length[i]:g} m must be at least 0")

    def some(self, chosen: IntArray) -> Gauges:
        """Return the gauges of numbers ``chosen`` (k,)."""
        return Gauges(
            name=tuple(self.name[i] for i in chosen),
            position=self.position[chosen],
            direction=self.direction[chosen],
            length=self.length[chosen],
            surface=tuple(self.surface[i] for i in chosen),
        )


def gauges_of_layout(parts: Sequence[Gauges], where: str) -> Gauges:
    """Return the gauges of ``parts`` as one layout; ``where`` is its entry in the vehicle file."""
    names = [name for part in parts for name in part.name]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"{where}: expected each gauge name once, got '{name}' twice")
    return joined_gauges(parts)


def joined_gauges(parts: Sequence[Gauges]) -> Gauges:
    """Return the gauges of ``parts``, one after another."""
    return Gauges(
        name=tuple(name for part in parts for name in part.name),
        position=np.concatenate([part.position for part in parts]),
        direction=np.concatenate([part.direction for part in parts]),
        length=np.concatenate([part.length for part in parts]),
        surface=tuple(surface for part in parts for surface in part.surface),
    )


def gauge_fields(layouts: Mapping[str, Gauges]) -> dict[str, Any]:
    """Return the entries of a structure that describe its gauges, of all ``layouts`` one after the other.

    See :class:`builder.structure.structure_file.Structure`; directions are made unit vectors.
    """
    gauges = layouts.values()
    direction = np.concatenate([layout.direction for layout in gauges])
    return {
        "gauge_names": tuple(name for layout in gauges for name in layout.name),
        "layout": tuple(name for name, layout in layouts.items() for _ in layout.name),
        "gauge_position": np.concatenate([layout.position for layout in gauges]),
        "gauge_direction": direction / np.linalg.norm(direction, axis=1, keepdims=True),
        "gauge_length": np.concatenate([layout.length for layout in gauges]),
        "gauge_surface": tuple(name for layout in gauges for name in layout.surface),
    }


def gauges_at(
    position: FloatArray,
    direction: FloatArray,
    name: Sequence[str] | None = None,
    length: float = 0.0,
    surface: str = INTERNAL,
) -> Gauges:
    """Return gauges of one length on one surface; names are ``"gauge 1"`` onwards by default."""
    position, direction = np.asarray(position, dtype=float), np.asarray(direction, dtype=float)
    names = tuple(name) if name is not None else tuple(f"gauge {i + 1}" for i in range(len(position)))
    return Gauges(
        name=names,
        position=position,
        direction=direction,
        length=np.full(len(names), length),
        surface=(surface,) * len(names),
    )


class PlacedGauge(NamedTuple):
    """A gauge's point on its surface, and its direction (3,), a unit vector in the tangent plane there."""

    foot: FootPoint
    direction: FloatArray


def gauge_rows(
    mesh: SolidMesh,
    gauges: Gauges,
    near_surface: bool = False,
    progress: Progress | None = None,
) -> csr_array:
    """Return B, the strain of each gauge per displacement.

    Parameters
    ----------
    mesh : the mesh.
    gauges : the gauges.
    near_surface : gauges are moved onto the mesh however far it is from them, for meshes that only come near the
        true surface, as linear elements do.
    progress : called with (done, in all).

    Returns
    -------
    (n_gauges, n_dof) [1/m].

    Raises
    ------
    InputError
        A surface does not exist; or the first gauge that is more than 0.5 mm off its surface or beyond its edge,
        or whose direction has no length or leans out of the tangent plane by more than 5 degrees.
    """
    patches = {name: _patches(mesh, name) for name in dict.fromkeys(gauges.surface)}
    placed = _placed(mesh, gauges, patches, near_surface)
    row, column, entry = [], [], []
    for i, gauge in enumerate(placed):
        surface = patches[gauges.surface[i]]
        for point, weight_of_point in _points_along(surface, gauge, float(gauges.length[i]), gauges.name[i]):
            node, weight = strain_weights(surface, point.foot, point.direction)
            row.append(np.full(weight.size, i))
            column.append((3 * node[:, None] + np.arange(3)).ravel())
            entry.append(weight_of_point * weight.ravel())
        if progress is not None:
            progress(i + 1, len(placed))
    index = (np.concatenate(row), np.concatenate(column))
    return csr_array(coo_array((np.concatenate(entry), index), shape=(len(placed), mesh.n_dof)))


def _placed(
    mesh: SolidMesh,
    gauges: Gauges,
    patches: Mapping[str, SurfacePatches],
    near_surface: bool = False,
) -> list[PlacedGauge]:
    if not gauges.name:
        raise InputError("no gauges: at least one is needed")
    placed = []
    for i, name in enumerate(gauges.name):
        unit = _unit(gauges.direction[i], name)
        foot = patches[gauges.surface[i]].foot(gauges.position[i])
        if not near_surface:
            _refuse_off_surface(mesh, gauges.position[i], foot, gauges.surface[i], name)
        tilt = float(np.arcsin(min(abs(float(unit @ foot.normal)), 1.0)))
        if tilt > LARGEST_TILT and not near_surface:
            raise InputError(
                f"{name}: direction leans {np.rad2deg(tilt):.1f} deg out of surface '{gauges.surface[i]}', "
                f"at most {np.rad2deg(LARGEST_TILT):g} deg is allowed"
            )
        placed.append(PlacedGauge(foot, _in_plane(unit, foot.normal)))
    return placed


def _patches(mesh: SolidMesh, surface: str) -> SurfacePatches:
    facet = mesh.named_surface(surface)
    return SurfacePatches(mesh.element_type, mesh.node, facet, _regions_behind(mesh, facet))


def _regions_behind(mesh: SolidMesh, facet: IntArray) -> IntArray:
    """Return the region (f,) of the element of each facet."""
    if len(mesh.region_names) == 1:
        return np.zeros(len(facet), dtype=np.int64)
    boundary, owner = boundary_facets(mesh.element_type, mesh.element)
    return np.asarray(mesh.region[owner[match_facets(mesh.element_type, boundary, facet)]])


def _unit(direction: FloatArray, name: str) -> FloatArray:
    length = float(np.linalg.norm(direction))
    if length == 0.0:
        raise InputError(f"{name}: direction has no length")
    unit: FloatArray = direction / length
    return unit


def _in_plane(direction: FloatArray, normal: FloatArray) -> FloatArray:
    flat = direction - (direction @ normal) * normal
    unit: FloatArray = flat / np.linalg.norm(flat)
    return unit


def _refuse_off_surface(mesh: SolidMesh, position: FloatArray, foot: FootPoint, surface: str, name: str) -> None:
    distance = float(np.linalg.norm(foot.offset))
    if distance <= LARGEST_DISTANCE:
        return
    if foot.beyond_edge > abs(foot.height):
        place = f"{1e3 * foot.beyond_edge:.2f} mm beyond the edge of surface '{surface}'"
    else:
        side = "away from" if foot.height > 0.0 else "into"
        place = f"{1e3 * distance:.2f} mm off surface '{surface}', {side} the material"
    for other in (EXTERNAL, INTERNAL, *mesh.surface):
        if other != surface and len(mesh.surface.get(other, ())):
            nearest = _patches(mesh, other).foot(position)
            if np.linalg.norm(nearest.offset) <= LARGEST_DISTANCE:
                place += f" and on surface '{other}'"
                break
    raise InputError(f"{name}: position is {place}, at most {1e3 * LARGEST_DISTANCE:g} mm is allowed")


def refuse_twins(gauges: Gauges) -> None:
    """Refuse the first two gauges of a layout at one position with the same direction."""
    length = np.linalg.norm(gauges.direction, axis=1, keepdims=True)
    direction = gauges.direction / np.where(length > 0.0, length, 1.0)
    for i in range(1, len(direction)):
        near = np.linalg.norm(gauges.position[:i] - gauges.position[i], axis=1) <= SAME_PLACE
        # Strain along a direction is that against it.
        turned = np.linalg.norm(np.cross(direction[:i], direction[i]), axis=1)
        for j in np.flatnonzero(near & (turned <= SAME_DIRECTION)):
            raise InputError(f"{gauges.name[i]}: same position and direction as {gauges.name[j]}")


def _points_along(
    surface: SurfacePatches, gauge: PlacedGauge, length: float, name: str
) -> list[tuple[PlacedGauge, float]]:
    """Return the points at which a gauge's strain is averaged and their weights; Gauss's rule along its length.

    Points are spaced along the tangent and moved onto the surface: to second order in length over the surface's
    radius of curvature that is the arc.
    """
    if length == 0.0:
        return [(gauge, 1.0)]
    position, weight = np.polynomial.legendre.leggauss(POINTS_ALONG_GAUGE)
    points = []
    for s, w in zip(0.5 * length * position, 0.5 * weight, strict=True):
        foot = surface.foot(gauge.foot.point + s * gauge.direction)
        if foot.beyond_edge > LARGEST_DISTANCE:
            raise InputError(f"{name}: its length of {1e3 * length:g} mm reaches beyond the edge of its surface")
        points.append((PlacedGauge(foot, _in_plane(gauge.direction, foot.normal)), float(w)))
    return points
