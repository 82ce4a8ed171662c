"""The moving body-fitted grid (compiled).

A cross-plane of the half body y >= 0 has rays j = 0 .. n_phi at roll angle pi j / n_phi from +z (leeward); on
each ray, vertices i = 0 .. n_r lie between body and outer boundary. Cells are (j, i), i from the wall outward.
The side faces of a step are the quadrilaterals between two planes, with their exact vector areas, so that
cells close and a uniform stream stays uniform to round-off.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from builder.aero.euler.compiled import compiled

FloatArray = NDArray[np.float64]


@compiled
def body_radius(x: float, segment: FloatArray) -> float:
    """Return r(x) of a segment (start_x, start_radius, start_angle, end_angle, end_x)."""
    rise = x - segment[0]
    if segment[2] == segment[3]:
        return segment[1] + rise * math.tan(segment[2])
    arc_radius = (segment[4] - segment[0]) / (math.sin(segment[2]) - math.sin(segment[3]))
    angle = math.asin(math.sin(segment[2]) - rise / arc_radius)
    return segment[1] + arc_radius * (math.cos(angle) - math.cos(segment[2]))


@compiled
def norm(y: float, z: float) -> float:
    """Return the length of (y, z); several times faster than ``math.hypot``, whose guards are not needed here."""
    return math.sqrt(y * y + z * z)


@compiled
def place_vertices(radius: float, outer: FloatArray, spacing: FloatArray, vertex: FloatArray) -> None:
    """Fill vertex (2, n_phi + 1, n_r + 1) with y, z of the grid in one plane.

    Radii carry the factor that gives a chord polygon the area of its circle.
    """
    n_rays, n_r = outer.size - 1, spacing.size - 1
    step = math.pi / n_rays
    swell = math.sqrt(step / math.sin(step))
    for j in range(n_rays + 1):
        sine, cosine = math.sin(j * step), math.cos(j * step)
        if j == 0 or j == n_rays:
            sine = 0.0  # exactly on the symmetry plane
        for i in range(n_r + 1):
            r = swell * (radius + (outer[j] - radius) * spacing[i])
            vertex[0, j, i] = r * sine
            vertex[1, j, i] = r * cosine


@compiled
def cell_areas(vertex: FloatArray, area: FloatArray) -> None:
    """Fill area (n_phi, n_r) with the cells' areas."""
    for j in range(area.shape[0]):
        for i in range(area.shape[1]):
            ay = vertex[0, j + 1, i + 1] - vertex[0, j, i]
            az = vertex[1, j + 1, i + 1] - vertex[1, j, i]
            by = vertex[0, j, i + 1] - vertex[0, j + 1, i]
            bz = vertex[1, j, i + 1] - vertex[1, j + 1, i]
            area[j, i] = 0.5 * abs(ay * bz - az * by)


@compiled
def face_area(
    before: FloatArray, after: FloatArray, dx: float, j: int, i: int, j_next: int, i_next: int
) -> tuple[float, float, float]:
    """Return the vector area (x, y, z) that the edge from vertex (j, i) to (j_next, i_next) sweeps in a step.

    It points outward for an edge towards decreasing roll angle, and towards increasing roll angle for an
    outward edge.
    """
    ay = after[0, j_next, i_next] - before[0, j, i]
    az = after[1, j_next, i_next] - before[1, j, i]
    by = after[0, j, i] - before[0, j_next, i_next]
    bz = after[1, j, i] - before[1, j_next, i_next]
    return 0.5 * (ay * bz - az * by), 0.5 * dx * (az - bz), 0.5 * dx * (by - ay)
