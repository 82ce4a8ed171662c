"""Fields and points on the unrolled body: station against roll angle."""

from __future__ import annotations

import numpy as np

from builder.aero.surface.mesh import SurfaceMesh
from strainfmu.arrays import FloatArray, IntArray


def roll_degrees(point: FloatArray) -> FloatArray:
    """Return the roll angle [deg] of points (.., 3) in 0..360; a hair before 360 counts as 0."""
    roll = np.degrees(np.arctan2(point[..., 1], point[..., 2])) % 360.0
    return np.where(roll > 360.0 - 1e-9, 0.0, roll)


def at_roll_angles(values: FloatArray, roll_angle: FloatArray, requested: FloatArray) -> FloatArray:
    """Interpolate (n_x, n_roll) values periodically to roll angles ``requested`` [rad] in 0..2 pi."""
    angle = np.append(roll_angle, 2.0 * np.pi)
    closed = np.concatenate([values, values[:, :1]], axis=1)
    return np.stack([np.interp(requested, angle, row) for row in closed])


def unrolled_triangles(
    surface: SurfaceMesh, values: FloatArray
) -> tuple[FloatArray, FloatArray, IntArray, FloatArray]:
    """Return points, roll angles [deg], triangles and values (n_p,) of a surface cut open at 0 deg.

    Triangles across the cut get nodes of their own beyond 360 deg. Nodes on the axis have no roll angle; their
    triangles are left out.
    """
    point, roll, triangle = surface.point, roll_degrees(surface.point), surface.triangle
    off_axis = np.hypot(point[:, 1], point[:, 2]) > 1e-9 * float(np.ptp(point[:, 0]))
    triangle = triangle[off_axis[triangle].all(axis=1)]
    across = np.ptp(roll[triangle], axis=1) > 180.0
    corner = triangle[across].ravel()
    once_round = np.where(roll[corner] < 180.0, roll[corner] + 360.0, roll[corner])
    added = len(point) + np.arange(len(corner)).reshape(-1, 3)
    return (
        np.concatenate([point, point[corner]]),
        np.concatenate([roll, once_round]),
        np.concatenate([triangle[~across], added]),
        np.concatenate([values, values[corner]]),
    )
