"""Pressure of a file of flow results at the nodes of the vehicle's surface.

The foreign surface is placed first: its axes, the other half of a half model, the sense of its normals. What
depends on the two surfaces alone (placement, closest points, weights, largest gap) is computed for the first of
the files that share a mesh, and kept.

Values of cells become pressure that is linear over each triangle. Each cell gets the gradient that fits its
neighbours best (weighted least squares), limited so that no corner leaves the range of the neighbours. That is
exact for a field that is linear over a plane; at a shock or an edge of the body the gradient falls to zero rather
than draw the values of one side into the other (T. J. Barth and D. C. Jespersen, "The design and application of
upwind schemes on unstructured meshes", AIAA 89-0366: gradient and limiter).

Values at points without triangles are interpolated in the Delaunay triangle, of the points around a node, that the
node lies in; the points belong to its own smooth piece of the surface, unrolled into its tangent plane. Of all
triangles of points that contain the node, the Delaunay triangle is the one with the smallest sum of lambda_i
|d_i|^2, lambda_i being the barycentric coordinates and d_i the distances (the lifting to a paraboloid: H.
Edelsbrunner and R. Seidel, "Voronoi diagrams and arrangements", Discrete Comput. Geom. 1, 1986). That sum also
bounds the error of the interpolation. A node with points on one side only, as at the rim of a base, is reached by
a straight line through two places among the points.
"""

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from hashlib import sha256
from itertools import combinations
from pathlib import Path
from typing import Generic, TypeVar

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from builder.aero.cfd.surface_field import SurfaceField
from builder.aero.mapping_report import (
    MappingTolerances,
    SurfaceGap,
    check_mapping,
    mapping_report,
    surface_gap,
)
from builder.aero.pressure_map import PressureMap, interpolation_at, pressure_map
from builder.aero.surface.closest_points import closest_points
from builder.aero.surface.edges import part_of_node
from builder.aero.surface.mesh import SurfaceMesh
from strainfmu.arrays import BoolArray, FloatArray, IntArray
from strainfmu.errors import InputError

ON_PLANE = 1e-4
"""A half model may cross its symmetry plane by this fraction of its extent."""


def place(field: SurfaceField, matrix: FloatArray, translation: FloatArray) -> SurfaceField:
    """Return the field in body axes, points x at M x + t; ``matrix`` (3, 3) orthogonal, ``translation`` (3,)."""
    normal = None if field.normal is None else field.normal @ matrix.T
    return replace(field, point=field.point @ matrix.T + translation, normal=normal)


def mirror(file: Path, field: SurfaceField, ratio: FloatArray) -> tuple[SurfaceField, FloatArray]:
    """Return the whole of a half model and its values: the half itself and its image in the plane y = 0.

    Points on the plane are in both halves, so that cells on either side of it are neighbours.

    Raises
    ------
    InputError
        The model has points on both sides.
    """
    y = field.point[:, 1]
    slack = ON_PLANE * float(np.linalg.norm(np.ptp(field.point, axis=0)))
    if y.min() < -slack and y.max() > slack:
        raise InputError(
            f"{file}: mirrored, but points lie on both sides of the symmetry plane: y from {y.min():.4g} to "
            f"{y.max():.4g} m"
        )
    reflected = field.point * np.array([1.0, -1.0, 1.0])
    both = replace(field, point=np.concatenate([field.point, reflected]))
    if field.normal is not None:
        both = replace(both, normal=np.concatenate([field.normal, field.normal * np.array([1.0, -1.0, 1.0])]))
    if field.triangle is not None:
        image = np.where(np.abs(y) <= slack, 0, len(y)) + np.arange(len(y))
        both = replace(both, triangle=np.concatenate([field.triangle, image[field.triangle][:, ::-1]]))
    if field.face is not None:
        both = replace(both, face=np.concatenate([field.face, field.face + len(ratio)]))
    return both, np.concatenate([ratio, ratio])


def orient(source: SurfaceMesh, surface: SurfaceMesh) -> SurfaceMesh:
    """Return the source with its normals outward, as the normals of the vehicle's ``surface`` are.

    Solvers write patches with normals out of the flow as often as into it. Each connected part is turned as a
    whole, by the majority of its area.
    """
    part = part_of_node(source)[source.triangle[:, 0]]
    middle = source.point[source.triangle].mean(axis=1)
    nearest = cKDTree(surface.point).query(middle)[1]
    agreement = np.einsum("mi,mi->m", source.vector_area, surface.node_normal[nearest])
    turned = np.bincount(part, agreement)[part] < 0.0
    triangle = np.where(turned[:, None], source.triangle[:, ::-1], source.triangle)
    return SurfaceMesh(source.point, triangle)


MIN_COSINE = 0.5
"""Cells whose normals differ by more than 60 deg are no neighbours: a base, a trailing edge."""
_RANK_CUT = 1e-4


def reconstruct(mesh: SurfaceMesh, face: IntArray, values: FloatArray) -> tuple[SurfaceMesh, FloatArray]:
    """Turn values in cells into nodal values of a mesh whose triangles share no nodes.

    Parameters
    ----------
    mesh : the triangles (m), whose shared nodes say which cells are neighbours.
    face : (m,) the cell that each triangle is cut from.
    values : (n_cells,) in cells.

    Returns
    -------
    The mesh of 3 m nodes and their values (3 m,). The area mean over each cell is the cell's value.
    """
    n_cells = len(values)
    weight = mesh.area
    area = np.bincount(face, weight, n_cells)
    corner = mesh.point[mesh.triangle]
    middle = _sum_by(face, weight[:, None] * corner.mean(axis=1), n_cells) / area[:, None]
    normal = _sum_by(face, mesh.vector_area, n_cells)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    cell, neighbour = _neighbours(mesh, face, normal, n_cells)
    gradient = _gradient(middle, normal, values, cell, neighbour)
    step = np.einsum("mki,mi->mk", corner - middle[face][:, None], gradient[face])
    low, high = values.copy(), values.copy()
    np.minimum.at(low, cell, values[neighbour])
    np.maximum.at(high, cell, values[neighbour])
    room = np.where(step > 0.0, (high - values)[face][:, None], (values - low)[face][:, None])
    fraction = np.divide(room, np.abs(step), out=np.ones_like(step), where=np.abs(step) > room)
    limit = np.ones(n_cells)
    np.minimum.at(limit, face, fraction.min(axis=1))
    at_corner = values[face][:, None] + limit[face][:, None] * step
    separate = SurfaceMesh(corner.reshape(-1, 3), np.arange(3 * len(face), dtype=np.int64).reshape(-1, 3))
    return separate, at_corner.ravel()


def _neighbours(mesh: SurfaceMesh, face: IntArray, normal: FloatArray, n_cells: int) -> tuple[IntArray, IntArray]:
    """Return all ordered pairs of cells that share a node and do not turn away from each other."""
    entries = np.ones(mesh.triangle.size)
    index = mesh.triangle.ravel(), np.repeat(face, 3)
    touches = sparse.csr_matrix((entries, index), shape=(mesh.n_nodes, n_cells))
    pairs = (touches.T @ touches).tocoo()
    cell, neighbour = pairs.row.astype(np.int64), pairs.col.astype(np.int64)
    smooth = (cell != neighbour) & (np.einsum("pi,pi->p", normal[cell], normal[neighbour]) > MIN_COSINE)
    return cell[smooth], neighbour[smooth]


def _gradient(
    middle: FloatArray, normal: FloatArray, values: FloatArray, cell: IntArray, neighbour: IntArray
) -> FloatArray:
    """Return the least-squares gradient (n_cells, 3) in each cell's tangent plane, weights 1/distance^2."""
    step = middle[neighbour] - middle[cell]
    length = np.linalg.norm(step, axis=1, keepdims=True)
    flat = step - normal[cell] * np.einsum("pi,pi->p", step, normal[cell])[:, None]
    size = np.linalg.norm(flat, axis=1, keepdims=True)
    # The way along the surface is as long as the way in space; only its direction is the tangent plane's.
    unit = np.divide(flat, size, out=np.zeros_like(flat), where=size > 0.0)
    slope = np.divide(
        (values[neighbour] - values[cell])[:, None], length, out=np.zeros_like(length), where=length > 0.0
    )
    matrix = _sum_by(cell, np.einsum("pi,pj->pij", unit, unit), len(values))
    right = _sum_by(cell, unit * slope, len(values))
    gradient: FloatArray = np.einsum("nij,nj->ni", np.linalg.pinv(matrix, rcond=_RANK_CUT, hermitian=True), right)
    return gradient


def _sum_by(index: IntArray, rows: FloatArray, count: int) -> FloatArray:
    """Return the sums (count, ...) of ``rows`` that share an index."""
    total = np.zeros((count, *rows.shape[1:]))
    np.add.at(total, index, rows)
    return total


FARTHEST = 2e-3
"""Points may lie off the surface by this fraction of its extent."""
WIDEST_GAP = 0.05
"""A node farther than this fraction of the surface's extent from every point is not covered."""
_SAME_PLACE = 1e-9
_ON_EDGE = 0.02
"""A point nearer to an edge than this fraction of the triangle it lies in may belong to either side."""
_CURVATURE_SCALE = 0.1
"""Fraction of the extent that a turn of the normal by 1 rad counts as: points across the body are far."""
_MIN_COSINE = 0.5
_CANDIDATES = (48, 384)
_SECTORS, _PER_SECTOR = 8, 2
_CHUNK = 1000


@dataclass(frozen=True, eq=False)
class _Cloud:
    """Points (n, 3) [m] of one smooth piece with their unit normals (n, 3); ``scale`` [m] per rad of turn."""

    point: FloatArray
    normal: FloatArray
    scale: float

    @cached_property
    def tree(self) -> cKDTree:
        return cKDTree(np.hstack([self.point, self.scale * self.normal]))

    def near(self, place: FloatArray, normal: FloatArray, count: int) -> IntArray:
        """Return the ``count`` points (t, k) nearest to places (t, 3) with normals (t, 3): distance and turn."""
        nearest = self.tree.query(np.hstack([place, self.scale * normal]), k=min(count, len(self.point)))[1]
        return np.asarray(nearest, dtype=np.int64).reshape(len(place), -1)


def cloud_map(point: FloatArray, normal: FloatArray | None, surface: SurfaceMesh) -> sparse.csr_array:
    """Return the weights (n_nodes, n) that take values at ``point`` (n, 3) [m] to the nodes of ``surface``.

    ``normal`` (n, 3), outward, settles which side of an edge a point on the edge belongs to. Without it, points
    where the surface has several nodes at one place, an edge or the tip, are left out: either may be meant.

    Raises
    ------
    InputError
        A point is off the surface by more than 0.2 % of its extent, or a node has no point within 5 % of it.
    """
    extent = float(np.linalg.norm(np.ptp(surface.point, axis=0)))
    piece = part_of_node(surface)
    nearest = cKDTree(surface.point).query(point)[1]
    closest = closest_points(surface, point, surface.node_normal[nearest] if normal is None else _unit(normal))
    _check_distance(point, closest.gap, extent)
    onto = interpolation_at(surface, closest)
    corner = surface.triangle[closest.triangle]
    if normal is None:
        settled = np.einsum("nk,nk->n", closest.weight, 1.0 - _is_doubled(surface, extent)[corner]) > _ON_EDGE
        normal = onto @ surface.node_normal
    else:
        settled = np.ones(len(point), dtype=bool)
    of_piece = piece[corner[:, 0]]
    total = sparse.csr_array((surface.n_nodes, len(point)))
    for number in np.unique(piece):
        target = np.flatnonzero(piece == number)
        source = np.flatnonzero((of_piece == number) & settled)
        if not len(source):
            raise _uncovered(surface.point[target[0]], extent)
        cloud = _Cloud(point[source], _unit(normal[source]), _CURVATURE_SCALE * extent)
        weight = _interpolate(cloud, surface.point[target], surface.node_normal[target], extent)
        total = total + _pick(target, surface.n_nodes).T @ weight @ _pick(source, len(point))
    return sparse.csr_array(total)


def _check_distance(point: FloatArray, gap: FloatArray, extent: float) -> None:
    worst = int(np.argmax(gap))
    if gap[worst] > FARTHEST * extent:
        where = ", ".join(f"{x:.4g}" for x in point[worst])
        off = int((gap > FARTHEST * extent).sum())
        raise InputError(
            f"{off} of {len(point)} points are off the vehicle's surface, the farthest, at ({where}) m, by "
            f"{gap[worst]:.3g} m; at most {FARTHEST * extent:.3g} m is allowed: wrong length_unit, axes or "
            "vehicle, or points of the base?"
        )


def _is_doubled(surface: SurfaceMesh, extent: float) -> FloatArray:
    """Return 1 for nodes (n_nodes,) that lie where another one does, else 0."""
    pairs = cKDTree(surface.point).query_pairs(_SAME_PLACE * extent, output_type="ndarray")
    doubled = np.zeros(surface.n_nodes)
    doubled[pairs.ravel()] = 1.0
    return doubled


def _interpolate(cloud: _Cloud, target: FloatArray, normal: FloatArray, extent: float) -> sparse.csr_array:
    """Return the weights (t, n) for all targets (t, 3) of one piece, carried on where no triangle holds them."""
    distance, nearest = cKDTree(cloud.point).query(target)
    if distance.max() > WIDEST_GAP * extent:
        raise _uncovered(target[int(np.argmax(distance))], extent)
    weight, inside = _triangle_weights(cloud, target, normal)
    outside = np.flatnonzero(~inside)
    if not len(outside):
        return weight
    step = _inward(cloud, target[outside], normal[outside])
    first_weight, first = _triangle_weights(cloud, target[outside] + step, normal[outside])
    second_weight, second = _triangle_weights(cloud, target[outside] + 2.0 * step, normal[outside])
    both = first & second
    carried = sparse.diags_array(np.where(both, 2.0, np.where(first, 1.0, 0.0))) @ first_weight
    carried = carried - sparse.diags_array(np.where(both, 1.0, 0.0)) @ second_weight
    carried = carried + sparse.diags_array(np.where(first, 0.0, 1.0)) @ _pick(nearest[outside], len(cloud.point))
    return sparse.csr_array(weight + _pick(outside, len(target)).T @ carried)


def _triangle_weights(cloud: _Cloud, target: FloatArray, normal: FloatArray) -> tuple[sparse.csr_array, BoolArray]:
    """Return weights (t, n) of linear interpolation, and whether a triangle of points holds the target (t,)."""
    rows, columns, weights = [], [], []
    pending = np.arange(len(target))
    for count in _CANDIDATES:
        waiting = [pending[:0]]
        for chunk in np.array_split(pending, -(-len(pending) // _CHUNK)) if len(pending) else []:
            near = cloud.near(target[chunk], normal[chunk], count)
            flat, usable = _unroll(cloud, near, target[chunk], normal[chunk])
            chosen, usable = _spread(flat, usable)
            near, flat = np.take_along_axis(near, chosen, 1), np.take_along_axis(flat, chosen[:, :, None], 1)
            weight = _delaunay(flat, usable)
            row, column = np.nonzero(weight)
            rows.append(chunk[row])
            columns.append(near[row, column])
            weights.append(weight[row, column])
            waiting.append(chunk[~weight.any(axis=1)])
        pending = np.concatenate(waiting)
    inside = np.ones(len(target), dtype=bool)
    inside[pending] = False
    entries = np.concatenate(weights), (np.concatenate(rows), np.concatenate(columns))
    return sparse.csr_array(entries, shape=(len(target), len(cloud.point))), inside


def _frame(normal: FloatArray) -> FloatArray:
    """Return two unit vectors (t, 2, 3) across each normal (t, 3)."""
    helper = np.where(np.abs(normal[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    first = _unit(np.cross(normal, helper))
    return np.stack([first, np.cross(normal, first)], axis=1)


def _unroll(cloud: _Cloud, near: IntArray, target: FloatArray, normal: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return places (t, k, 2) of the near points in the targets' tangent planes, and whether they face alike.

    A point keeps its distance, and its direction as seen along the normal.
    """
    step = cloud.point[near] - target[:, None]
    length = np.linalg.norm(step, axis=2, keepdims=True)
    flat = np.einsum("tij,tkj->tki", _frame(normal), step)
    size = np.linalg.norm(flat, axis=2, keepdims=True)
    flat *= np.divide(length, size, out=np.zeros_like(length), where=size > 0.0)
    return flat, np.einsum("tkj,tj->tk", cloud.normal[near], normal) > _MIN_COSINE


def _spread(flat: FloatArray, usable: BoolArray) -> tuple[IntArray, BoolArray]:
    """Choose the first two usable points of each eighth around the targets: (t, 16) indices, and which hold.

    Points often stand much closer in one direction than in the other; the nearest alone would all lie in a row.
    """
    angle = np.arctan2(flat[:, :, 1], flat[:, :, 0])
    sector = np.minimum((angle + np.pi) * (_SECTORS / (2.0 * np.pi)), _SECTORS - 1).astype(np.int64)
    distance = np.where(usable, np.linalg.norm(flat, axis=2), np.inf)
    order = np.argsort(distance, axis=1, kind="stable")
    sorted_sector = np.take_along_axis(np.where(usable, sector, -1), order, 1)
    chosen = np.zeros((len(flat), _SECTORS * _PER_SECTOR), dtype=np.int64)
    holds = np.zeros(chosen.shape, dtype=bool)
    for number in range(_SECTORS):
        of_sector = sorted_sector == number
        rank = np.cumsum(of_sector, axis=1)
        for which in range(_PER_SECTOR):
            slot = number * _PER_SECTOR + which
            hit = of_sector & (rank == which + 1)
            holds[:, slot] = hit.any(axis=1)
            chosen[:, slot] = np.take_along_axis(order, hit.argmax(axis=1)[:, None], 1)[:, 0]
    return chosen, holds


def _delaunay(flat: FloatArray, usable: BoolArray) -> FloatArray:
    """Return weights (t, k) of the best triangle of places (t, k, 2) around the origin; 0 where there is none."""
    triple = np.array(list(combinations(range(flat.shape[1]), 3)))
    x, y = flat[:, :, 0], flat[:, :, 1]
    a, b, c = triple.T
    # Twice the areas that the origin cuts off: barycentric coordinates, once divided by their sum.
    part = np.stack([x[:, i] * y[:, j] - x[:, j] * y[:, i] for i, j in ((b, c), (c, a), (a, b))], axis=2)
    double_area = part.sum(axis=2)
    square = np.square(flat).sum(axis=2)
    reach = np.stack([square[:, i] for i in (a, b, c)], axis=2)
    thin = np.abs(double_area) <= 1e-9 * reach.sum(axis=2)
    barycentric = np.divide(part, double_area[:, :, None], out=np.full_like(part, -1.0), where=~thin[:, :, None])
    good = (barycentric > -1e-9).all(axis=2) & usable[:, a] & usable[:, b] & usable[:, c]
    cost = np.where(good, np.einsum("tnk,tnk->tn", barycentric, reach), np.inf)
    best = cost.argmin(axis=1)
    row = np.flatnonzero(np.isfinite(cost.min(axis=1)))
    weight = np.zeros(flat.shape[:2])
    for corner in range(3):
        weight[row, triple[best[row], corner]] = barycentric[row, best[row], corner]
    # A point at the target itself settles it, whatever triangles can be made.
    at_target = usable & (square <= 1e-12 * square.max(axis=1, keepdims=True))
    coincident = at_target.any(axis=1)
    weight[coincident] = 0.0
    weight[coincident, at_target[coincident].argmax(axis=1)] = 1.0
    return weight


def _inward(cloud: _Cloud, target: FloatArray, normal: FloatArray) -> FloatArray:
    """Return the way (t, 3) [m] from targets at a rim to among the points: about the points' spacing long."""
    near = cloud.near(target, normal, _CANDIDATES[0])
    flat, usable = _unroll(cloud, near, target, normal)
    distance = np.where(usable, np.linalg.norm(flat, axis=2), np.inf)
    third = np.sort(distance, axis=1)[:, min(2, distance.shape[1] - 1)]
    length = np.where(np.isfinite(third), 1.02 * third, 0.0)
    toward = np.where(usable[:, :, None], _unit(flat), 0.0).sum(axis=1)
    step: FloatArray = np.einsum("tij,ti->tj", _frame(normal), _unit(toward)) * length[:, None]
    return step


def _unit(vector: FloatArray) -> FloatArray:
    """Return vectors (..., i) made one long; zero vectors stay."""
    size = np.linalg.norm(vector, axis=-1, keepdims=True)
    return np.divide(vector, size, out=np.zeros_like(vector), where=size > 0.0)


def _pick(index: IntArray, count: int) -> sparse.csr_array:
    """Return the matrix (k, count) that takes the entries ``index`` (k,) out of a vector."""
    return sparse.csr_array((np.ones(len(index)), (np.arange(len(index)), index)), shape=(len(index), count))


def _uncovered(place: FloatArray, extent: float) -> InputError:
    where = ", ".join(f"{x:.4g}" for x in place)
    return InputError(
        f"no point within {WIDEST_GAP * extent:.3g} m of the surface's node at ({where}) m: the points do not "
        "cover the whole surface"
    )


T = TypeVar("T", SurfaceMesh, SurfaceField)

KEPT = 2
"""Meshes whose geometry is kept: a case on a mesh of its own among others does not drive theirs out."""


class _Known(Generic[T]):
    """A mesh or a field that equals another one of the same digest, for what is kept."""

    def __init__(self, digest: str, value: T) -> None:
        self.digest = digest
        self.value: T = value

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Known) and self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.digest)


def on_surface(field: SurfaceField, ratio: FloatArray, surface: SurfaceMesh) -> FloatArray:
    """Return p/p_inf (n_nodes,) at the nodes of ``surface`` of the field's values ``ratio`` (n,).

    Raises
    ------
    InputError
        The field does not lie on the surface, or does not cover it.
    """
    target = _known(surface)
    if field.triangle is None:
        # Where one-sided points are carried on, the line may leave what the file holds.
        return np.clip(_cloud(_points(field), target) @ ratio, ratio.min(), ratio.max())
    mesh = SurfaceMesh(field.point, field.triangle)
    source = _oriented(_known(mesh), target)
    if field.face is not None:
        source, ratio = reconstruct(source, field.face, ratio)
    transfer, gap = _transfer(_known(source), target)
    check_mapping(mapping_report(transfer, source, surface, ratio - 1.0, gap), MappingTolerances())
    return transfer.consistent(ratio)


def _known(mesh: SurfaceMesh) -> _Known[SurfaceMesh]:
    return _Known(mesh.digest(), mesh)


def _points(field: SurfaceField) -> _Known[SurfaceField]:
    digest = sha256(np.ascontiguousarray(field.point, dtype="<f8").tobytes())
    if field.normal is not None:
        digest.update(np.ascontiguousarray(field.normal, dtype="<f8").tobytes())
    return _Known(digest.hexdigest(), field)


@lru_cache(maxsize=KEPT)
def _cloud(source: _Known[SurfaceField], target: _Known[SurfaceMesh]) -> sparse.csr_array:
    return cloud_map(source.value.point, source.value.normal, target.value)


@lru_cache(maxsize=KEPT)
def _oriented(source: _Known[SurfaceMesh], target: _Known[SurfaceMesh]) -> SurfaceMesh:
    return orient(source.value, target.value)


@lru_cache(maxsize=KEPT)
def _transfer(source: _Known[SurfaceMesh], target: _Known[SurfaceMesh]) -> tuple[PressureMap, SurfaceGap]:
    transfer = pressure_map(source.value, target.value)
    return transfer, surface_gap(transfer, source.value, target.value)
