"""Pressure and forces from one surface of a body to another surface of the same body.

Consistent: each target node takes the source's pressure at its closest point. Pressures are right point by point;
loads are as accurate as the two meshes agree. Conservative: loads are the source's, exactly, however coarse either
mesh is and however wide the gap between them.

Values in cells (finite-volume results) have no nodes to interpolate between. First-order reconstruction
(:func:`builder.aero.cfd.surface_transfer.reconstruct`) makes them linear over each triangle, on a mesh whose
triangles share no nodes; that mesh is a source as any other.

Source: C. Farhat, M. Lesoinne, P. Le Tallec, "Load and motion transfer algorithms for fluid/structure interaction
problems with non-matching discrete interfaces", Comput. Methods Appl. Mech. Engrg. 157 (1998): closest points.

Mirror images of pressure on surfaces that have no grid.
"""

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from builder.aero.load_operator import load_operator
from builder.aero.surface.closest_points import ClosestPoints, closest_points
from builder.aero.surface.mesh import SurfaceMesh, mesh_load_operator, roll_moment_operator
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

_RANK_CUT = 1e-10
_LOST_LOAD = 1e-8
LEAST_ROLL = 0.05
"""Rolling moment over lateral force times span, of random pressure: below it a surface is one of revolution."""
LOAD_NAMES = (
    "axial force",
    "normal force",
    "side force",
    "pitching moment",
    "yawing moment",
    "rolling moment",
)


def consistent_map(source: SurfaceMesh, target_point: FloatArray, target_normal: FloatArray) -> sparse.csr_array:
    """Return the interpolation of nodal pressure, sparse (n_target, n_source).

    Barycentric at the closest fitting point (:func:`builder.aero.surface.closest_points.closest_points`). Rows sum
    to 1 and hold no negative weight: a constant is kept, and no value leaves the source's range.

    Parameters
    ----------
    target_point : (n_target, 3) [m].
    target_normal : (n_target, 3) outward unit normals, such as ``SurfaceMesh.node_normal``.
    """
    return interpolation_at(source, closest_points(source, target_point, target_normal))


def interpolation_at(source: SurfaceMesh, closest: ClosestPoints) -> sparse.csr_array:
    """Return the interpolation of nodal values of ``source`` at points found before, sparse (n, n_source)."""
    rows = np.repeat(np.arange(len(closest.gap)), 3)
    columns = source.triangle[closest.triangle].ravel()
    return sparse.csr_array((closest.weight.ravel(), (rows, columns)), shape=(len(closest.gap), source.n_nodes))


def nodal_force_operator(mesh: SurfaceMesh) -> sparse.csr_array:
    """Return nodal forces per nodal pressure, sparse (3 n, n) [m2]; row 3 i + k is component k at node i.

    Consistent with pressure linear over each triangle: f_i = -sum_j p_j n A (1 + delta_ij)/12. Their sum and
    moment are as in :func:`builder.aero.surface.mesh.mesh_load_operator`.
    """
    m = len(mesh.triangle)
    weight = (np.ones((3, 3)) + np.eye(3)) / 12.0
    entries = -np.einsum("ij,mk->mijk", weight, mesh.vector_area)
    rows = 3 * mesh.triangle[:, :, None, None] + np.arange(3)
    columns = mesh.triangle[:, None, :, None]
    shape = (m, 3, 3, 3)
    index = (np.broadcast_to(rows, shape).ravel(), np.broadcast_to(columns, shape).ravel())
    return sparse.csr_array((entries.ravel(), index), shape=(3 * mesh.n_nodes, mesh.n_nodes))


@dataclass(frozen=True, eq=False, kw_only=True)
class PressureMap:
    """Transfer of nodal pressure from a source surface to a target surface, made once for many fields.

    The loads are as in :func:`builder.aero.surface.mesh.mesh_load_operator`: axial, normal and side force,
    pitching and yawing moment; equal about one point of the x axis, they are equal about every one. To a surface
    that is not of revolution the rolling moment is the sixth.

    Attributes
    ----------
    closest : where the target's nodes lie on the source.
    interpolation : sparse (n_target, n_source), consistent.
    source_loads, target_loads : (5 or 6, n) loads per nodal pressure, about the middle of the target's length.
    correction : (n_target, 5 or 6) pressure per missing load.
    """

    closest: ClosestPoints
    interpolation: sparse.csr_array
    source_loads: FloatArray
    target_loads: FloatArray
    correction: FloatArray

    def consistent(self, pressure: FloatArray) -> FloatArray:
        """Return the interpolated pressure (..., n_target) of ``pressure`` (..., n_source)."""
        mapped: FloatArray = (self.interpolation @ pressure.reshape(-1, pressure.shape[-1]).T).T
        return mapped.reshape(*pressure.shape[:-1], -1)

    def conservative(self, pressure: FloatArray) -> FloatArray:
        """Return the pressure (..., n_target) closest to the interpolated one that has the source's loads.

        "Closest" is least squares weighted with nodal area. ``pressure`` (..., n_source) must be the net one, that
        is less its reference (p - p_inf, or p/p_inf - 1): over a surface that is open at the base a constant has
        an axial load of its own, as large as the meshes' bases differ.

        Raises
        ------
        InputError
            The target cannot carry the loads by pressure at all (a plate has no axial force).
        """
        mapped = self.consistent(pressure)
        expected = pressure @ self.source_loads.T
        mapped = mapped + (expected - mapped @ self.target_loads.T) @ self.correction.T
        size = np.abs(pressure) @ np.abs(self.source_loads).T
        lost = np.abs(expected - mapped @ self.target_loads.T) > _LOST_LOAD * size.max(axis=-1, keepdims=True)
        if lost.any():
            which = LOAD_NAMES[int(np.argwhere(lost)[0][-1])]
            raise InputError(f"mapping: the target surface cannot carry the {which} of the source by pressure")
        return mapped


def pressure_map(source: SurfaceMesh, target: SurfaceMesh, grid: SurfaceGrid | None = None) -> PressureMap:
    """Return the transfer of nodal pressure from ``source`` to ``target``.

    Where ``grid`` has the target's nodes, its loads are
    :func:`builder.aero.load_operator.load_operator`'s, not the loads of the chords between its nodes.

    The conservative correction A^-1 L^T (L A^-1 L^T)^-1, with nodal areas A and the target's load operator L,
    minimises sum_i A_i (q_i - p_i)^2 under L q = the source's loads.
    """
    closest = closest_points(source, target.point, target.node_normal)
    middle = float(0.5 * (target.point[:, 0].min() + target.point[:, 0].max()))
    own_loads = mesh_load_operator(source, middle)
    loads = mesh_load_operator(target, middle) if grid is None else load_operator(grid, middle)
    if grid is None and _carries_roll(target, loads):
        own_loads = np.vstack([own_loads, roll_moment_operator(source)])
        loads = np.vstack([loads, roll_moment_operator(target)])
    area = target.node_area
    per_area = np.divide(loads, area, out=np.zeros_like(loads), where=area > 0.0)
    # A moment is measured by the body's length, so that the rank is judged in one unit.
    length = float(np.ptp(target.point, axis=0).max())
    scale = np.array([1.0, 1.0, 1.0, *[1.0 / length] * (len(loads) - 3)])
    gram = (scale[:, None] * loads) @ (scale[:, None] * per_area).T
    inverse = np.linalg.pinv(gram, rcond=_RANK_CUT, hermitian=True)
    correction = per_area.T @ (scale[:, None] * inverse * scale)
    return PressureMap(
        closest=closest,
        interpolation=interpolation_at(source, closest),
        source_loads=own_loads,
        target_loads=loads,
        correction=correction,
    )


def _carries_roll(mesh: SurfaceMesh, loads: FloatArray) -> bool:
    """Return whether pressure on ``mesh`` has a rolling moment worth the name.

    On a body of revolution it has only the moment of flat facets, which vanishes with their size. ``loads`` (5, n)
    are the mesh's own.
    """
    area = mesh.node_area
    used = area > 0.0
    size = np.sqrt(np.sum(np.vstack([loads[1:3], roll_moment_operator(mesh)])[:, used] ** 2 / area[used], axis=1))
    span = float(np.hypot(mesh.point[:, 1], mesh.point[:, 2]).max())
    return bool(size[2] > LEAST_ROLL * span * size[:2].max())


MAX_GAP = 2e-3
"""Gap between a surface and its mirror image, over the body's length, above which it has no such symmetry."""


def mirror_operator(surface: SurfaceMesh, axis: int) -> sparse.csr_array | None:
    """Return sparse (n_p, n_p) M: (M p)(x) = p at the mirror image of x in the plane through the origin across
    ``axis``; None where the surface is not symmetric. The value is taken at the closest point."""
    flip = np.ones(3)
    flip[axis] = -1.0
    closest = closest_points(surface, surface.point * flip, surface.node_normal * flip)
    if closest.gap.max() > MAX_GAP * float(np.ptp(surface.point, axis=0).max()):
        return None
    return interpolation_at(surface, closest)
