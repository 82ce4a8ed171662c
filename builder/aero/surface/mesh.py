"""A triangulated surface that carries pressure at its nodes.

The common form of every aerodynamic surface: pressure is linear over each triangle. Where the surface has an
edge and the pressure may jump, nodes are doubled: two nodes at one place, each belonging to one side.
"""

from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256

import numpy as np

from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError


@dataclass(frozen=True, eq=False)
class SurfaceMesh:
    """Nodes and triangles.

    Attributes
    ----------
    point : (n, 3) nodes in body axes [m].
    triangle : (m, 3) node numbers, anticlockwise seen from the flow: the normal points outward.

    Raises
    ------
    InputError
        Shapes are wrong, a coordinate is not finite, or a triangle names a node that does not exist.
    """

    point: FloatArray
    triangle: IntArray

    def __post_init__(self) -> None:
        if self.point.ndim != 2 or self.point.shape[1] != 3 or self.triangle.ndim != 2:
            raise InputError(f"surface: points {self.point.shape}, triangles {self.triangle.shape}, must be n x 3")
        if self.triangle.shape[1] != 3 or not len(self.triangle):
            raise InputError(f"surface: {self.triangle.shape} found, must be at least one triangle of 3 nodes")
        if not np.isfinite(self.point).all():
            node = int(np.flatnonzero(~np.isfinite(self.point).all(axis=1))[0])
            raise InputError(f"surface: node {node} has a coordinate that is not finite")
        low, high = int(self.triangle.min()), int(self.triangle.max())
        if low < 0 or high >= len(self.point):
            raise InputError(f"surface: a triangle names node {low if low < 0 else high} of {len(self.point)}")

    @property
    def n_nodes(self) -> int:
        return len(self.point)

    def digest(self) -> str:
        """Return the SHA-256 of the nodes and triangles: equal surfaces have equal digests."""
        digest = sha256(np.ascontiguousarray(self.point, dtype="<f8").tobytes())
        digest.update(np.ascontiguousarray(self.triangle, dtype="<i8").tobytes())
        return digest.hexdigest()

    @cached_property
    def vector_area(self) -> FloatArray:
        """(m, 3) area times outward normal of each triangle [m2]."""
        a, b, c = (self.point[self.triangle[:, k]] for k in range(3))
        area: FloatArray = 0.5 * np.cross(b - a, c - a)
        return area

    @cached_property
    def area(self) -> FloatArray:
        """(m,) area of each triangle [m2]."""
        size: FloatArray = np.linalg.norm(self.vector_area, axis=1)
        return size

    @cached_property
    def node_normal(self) -> FloatArray:
        """(n, 3) unit normals at the nodes, 0 where there is no triangle.

        The mean of the triangles' normals, weighted with their angle at the node, so that it does not depend on
        how quadrilaterals were cut (Thuermer and Wuethrich, J. Graphics Tools 3, 1998).
        """
        size = self.area[:, None]
        unit = np.divide(self.vector_area, size, out=np.zeros_like(self.vector_area), where=size > 0.0)
        corner = self.point[self.triangle]
        total = np.zeros_like(self.point)
        for k in range(3):
            a, b = corner[:, k - 1] - corner[:, k], corner[:, k - 2] - corner[:, k]
            angle = np.arctan2(2.0 * self.area, np.sum(a * b, axis=1))
            np.add.at(total, self.triangle[:, k], angle[:, None] * unit)
        length = np.linalg.norm(total, axis=1, keepdims=True)
        return np.divide(total, length, out=np.zeros_like(total), where=length > 0.0)

    @cached_property
    def node_area(self) -> FloatArray:
        """(n,) a third of the area of the triangles at each node [m2]."""
        total = np.zeros(self.n_nodes)
        for k in range(3):
            np.add.at(total, self.triangle[:, k], self.area / 3.0)
        return total


def mesh_of_grid(grid: SurfaceGrid) -> SurfaceMesh:
    """Return the nodes of a body of revolution as a triangulated surface, open at the base; same node numbers.

    Between two stations each quadrilateral is cut in two; behind the tip, a ring without radius, one is left.
    """
    n_x, n_roll = len(grid.x), grid.n_roll
    roll = grid.roll_angle
    point = np.stack(
        [
            np.repeat(grid.x, n_roll),
            np.outer(grid.radius, np.sin(roll)).ravel(),
            np.outer(grid.radius, np.cos(roll)).ravel(),
        ],
        axis=1,
    )
    station, around = np.meshgrid(np.arange(n_x - 1), np.arange(n_roll), indexing="ij")
    keep = (np.diff(grid.x) > 0.0)[station]
    station, around = station[keep], around[keep]
    ring, next_ring = station * n_roll, (station + 1) * n_roll
    after = (around + 1) % n_roll
    low = np.stack([ring + around, next_ring + around, next_ring + after], axis=1)
    high = np.stack([ring + around, next_ring + after, ring + after], axis=1)[grid.radius[station] > 0.0]
    return SurfaceMesh(point, np.concatenate([low, high]).astype(np.int64))


Surface = SurfaceGrid | SurfaceMesh
"""Carries pressure at its nodes: stations times roll angles of a body of revolution, or triangles of any shape."""


def grid_of(surface: Surface) -> SurfaceGrid | None:
    """Return the stations and roll angles of a body of revolution; None of triangles."""
    return surface if isinstance(surface, SurfaceGrid) else None


def mesh_of(surface: Surface) -> SurfaceMesh:
    """Return the triangles of a grid; a mesh as it is."""
    return mesh_of_grid(surface) if isinstance(surface, SurfaceGrid) else surface


def mesh_load_operator(mesh: SurfaceMesh, moment_station: float) -> FloatArray:
    """Return the loads per nodal pressure, (5, n) [m2, m2, m2, m3, m3].

    Rows as in :func:`builder.aero.load_operator.load_operator`: axial, normal, side force, pitching moment
    (nose-up), yawing moment (nose to starboard) about (moment_station, 0, 0), of F = integral of -p n dS. Exact
    for pressure linear over each triangle: integral of N_i N_j over a triangle is A (1 + delta_ij)/12.
    """
    force = np.zeros((3, mesh.n_nodes))
    moment = np.zeros((3, mesh.n_nodes))
    corner = mesh.point[mesh.triangle] - np.array([moment_station, 0.0, 0.0])
    for k in range(3):
        arm = (corner.sum(axis=1) + corner[:, k]) / 12.0
        np.add.at(force.T, mesh.triangle[:, k], -mesh.vector_area / 3.0)
        np.add.at(moment.T, mesh.triangle[:, k], -np.cross(arm, mesh.vector_area))
    # Nose-up: the nose at -x goes to +z, a rotation about +y. Nose to starboard: -x to +y, a rotation about -z.
    return np.stack([force[0], force[2], force[1], moment[1], -moment[2]])


def roll_moment_operator(mesh: SurfaceMesh) -> FloatArray:
    """Return the moment about the x axis per nodal pressure, (n,) [m3], of F = integral of -p n dS.

    Positive from +y to +z; exact for pressure linear over each triangle, as :func:`mesh_load_operator`.
    """
    row = np.zeros(mesh.n_nodes)
    corner = mesh.point[mesh.triangle]
    for k in range(3):
        arm = (corner.sum(axis=1) + corner[:, k]) / 12.0
        np.add.at(row, mesh.triangle[:, k], -np.cross(arm, mesh.vector_area)[:, 0])
    return row
