"""Triangulated shapes with closed-form loads."""

from math import cos, pi, sin

import numpy as np
from numpy.typing import ArrayLike

from builder.aero.surface.mesh import SurfaceMesh


def sphere(n: int) -> SurfaceMesh:
    """Return the unit sphere: a cube's faces, n by n squares each, blown up; nodes doubled along its edges."""
    t = np.tan(np.linspace(-pi / 4, pi / 4, n + 1))
    a, b = (axis.ravel() for axis in np.meshgrid(t, t, indexing="ij"))
    i, j = (axis.ravel() for axis in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    p, q, r, s = i * (n + 1) + j, (i + 1) * (n + 1) + j, (i + 1) * (n + 1) + j + 1, i * (n + 1) + j + 1
    quarter = np.concatenate([np.stack([p, q, r], axis=1), np.stack([p, r, s], axis=1)])
    point, triangle = [], []
    for axis in range(3):
        for side in (1.0, -1.0):
            face = np.empty((len(a), 3))
            face[:, axis], face[:, axis - 2], face[:, axis - 1] = side, a * side, b
            triangle.append(quarter + len(a) * len(point))
            point.append(face / np.linalg.norm(face, axis=1, keepdims=True))
    return SurfaceMesh(np.concatenate(point), np.concatenate(triangle).astype(np.int64))


def cone(half_angle: float, n: int, closed: bool = False) -> SurfaceMesh:
    """Return a cone of length 1 m: one node at the tip, n round the base; with ``closed``, its base."""
    roll = 2.0 * pi * np.arange(n) / n
    radius = np.tan(half_angle)
    rim = np.stack([np.ones(n), radius * np.sin(roll), radius * np.cos(roll)], axis=1)
    point = np.concatenate([[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]], rim])
    here, there = 2 + np.arange(n), 2 + (np.arange(n) + 1) % n
    side = np.stack([np.zeros(n), here, there], axis=1)
    base = np.stack([np.ones(n), there, here], axis=1)
    if not closed:
        return SurfaceMesh(np.delete(point, 1, axis=0), np.where(side > 0, side - 1, 0).astype(np.int64))
    return SurfaceMesh(point, np.concatenate([side, base]).astype(np.int64))


def box(low: ArrayLike, high: ArrayLike, cells: tuple[int, int, int] = (1, 1, 1)) -> SurfaceMesh:
    """Return a closed box between two corners, its faces cut into cells; nodes shared by its faces."""
    low, high = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    point, triangle, count = [], [], 0
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        a, b = (
            line.ravel()
            for line in np.meshgrid(
                np.linspace(0.0, 1.0, cells[u] + 1), np.linspace(0.0, 1.0, cells[v] + 1), indexing="ij"
            )
        )
        i, j = (line.ravel() for line in np.meshgrid(np.arange(cells[u]), np.arange(cells[v]), indexing="ij"))
        width = cells[v] + 1
        p, q, r, s = i * width + j, (i + 1) * width + j, (i + 1) * width + j + 1, i * width + j + 1
        face = np.concatenate([np.stack([p, q, r], axis=1), np.stack([p, r, s], axis=1)])
        for side in (0.0, 1.0):
            unit = np.empty((len(a), 3))
            unit[:, axis], unit[:, u], unit[:, v] = side, a, b
            point.append(low + unit * (high - low))
            triangle.append(count + (face if side else face[:, ::-1]))
            count += len(a)
    return SurfaceMesh(np.concatenate(point), np.concatenate(triangle).astype(np.int64))


def together(*meshes: SurfaceMesh) -> SurfaceMesh:
    """Return several surfaces as one."""
    start = np.cumsum([0, *(mesh.n_nodes for mesh in meshes)])
    triangle = [mesh.triangle + first for mesh, first in zip(meshes, start[:-1], strict=True)]
    return SurfaceMesh(np.concatenate([mesh.point for mesh in meshes]), np.concatenate(triangle))


def rolled(mesh: SurfaceMesh, angle: float) -> SurfaceMesh:
    """Return ``mesh`` turned round the x axis by ``angle`` [rad]."""
    c, s = cos(angle), sin(angle)
    return SurfaceMesh(mesh.point @ np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]]).T, mesh.triangle)
