"""The moving body-fitted grid (compiled).

A cross-plane has rays j = 0 .. n_phi, evenly spaced in roll angle from +z: over the half body y >= 0, where the
first and last lie in the symmetry plane, or all round, where the last is the first again. On each ray, vertices
i = 0 .. n_r lie between body and outer boundary. Cells are (j, i), i from the wall outward. The side faces of
a step are the quadrilaterals between two planes, with their exact vector areas, so that cells close and a
uniform stream stays uniform to round-off.
"""

import math
from typing import NamedTuple

import numpy as np

from builder.compiled import compiled, inlined
from strainfmu.arrays import FloatArray


class Rays(NamedTuple):
    """Directions of a cross-plane's rays and cells.

    Attributes
    ----------
    sine, cosine : (n_phi + 1,) of the rays' roll angles.
    cell_sine, cell_cosine : (n_phi,) of the roll angles half-way between rays.
    step : roll angle between rays [rad].
    closed : whether the rays go all round; otherwise they end in a plane of symmetry.
    """

    sine: FloatArray
    cosine: FloatArray
    cell_sine: FloatArray
    cell_cosine: FloatArray
    step: float
    closed: bool


def half_body_rays(n_circumferential: int) -> Rays:
    """Return rays over roll angles 0 .. pi with that many cells between them."""
    return _rays(n_circumferential, math.pi / n_circumferential, closed=False)


def full_body_rays(n_circumferential: int) -> Rays:
    """Return rays all round the body with that many cells per half turn."""
    return _rays(2 * n_circumferential, math.pi / n_circumferential, closed=True)


def _rays(n_cells: int, step: float, closed: bool) -> Rays:
    angle = step * np.arange(n_cells + 1)
    middle = step * (np.arange(n_cells) + 0.5)
    sine, cosine = np.sin(angle), np.cos(angle)
    sine[0] = sine[-1] = 0.0  # exactly on the symmetry plane, or on each other
    cosine[-1] = 1.0 if closed else -1.0
    return Rays(
        sine=sine, cosine=cosine, cell_sine=np.sin(middle), cell_cosine=np.cos(middle), step=step, closed=closed
    )


class Wall(NamedTuple):
    """One smooth piece of the body's surface: cubic Hermite tables r(x) along each ray.

    Attributes
    ----------
    x : (n_knots,) stations [m], increasing.
    radius, slope : (n_knots, n_phi + 1) r [m] and dr/dx on the rays.
    """

    x: FloatArray
    radius: FloatArray
    slope: FloatArray


@compiled
def find_wall(x: float, wall: Wall, radius: FloatArray, slope: FloatArray) -> None:
    """Fill radius and slope (n_phi + 1,) with r [m] and dr/dx of the wall at station ``x``."""
    k = 0
    while k < wall.x.size - 2 and x > wall.x[k + 1]:
        k += 1
    length = wall.x[k + 1] - wall.x[k]
    t = (x - wall.x[k]) / length
    s = 1.0 - t
    for j in range(radius.size):
        r0, r1 = wall.radius[k, j], wall.radius[k + 1, j]
        d0, d1 = wall.slope[k, j], wall.slope[k + 1, j]
        near = (1.0 + 2.0 * t) * r0 + t * length * d0
        far = (1.0 + 2.0 * s) * r1 - s * length * d1
        radius[j] = s * s * near + t * t * far
        slope[j] = 6.0 * s * t * (r1 - r0) / length + s * (1.0 - 3.0 * t) * d0 + t * (1.0 - 3.0 * s) * d1


@inlined
def norm(y: float, z: float) -> float:
    """Return the length of (y, z); several times faster than ``math.hypot``, whose guards are not needed here."""
    return math.sqrt(y * y + z * z)


@compiled
def place_vertices(
    radius: FloatArray, outer: FloatArray, spacing: FloatArray, rays: Rays, vertex: FloatArray
) -> None:
    """Fill vertex (2, n_phi + 1, n_r + 1) with y, z of the grid between radius and outer (n_phi + 1,).

    Radii carry the factor that gives a chord polygon the area of its circle.
    """
    swell = math.sqrt(rays.step / math.sin(rays.step))
    for j in range(outer.size):
        for i in range(spacing.size):
            r = swell * (radius[j] + (outer[j] - radius[j]) * spacing[i])
            vertex[0, j, i] = r * rays.sine[j]
            vertex[1, j, i] = r * rays.cosine[j]


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


class Step(NamedTuple):
    """The grid of one marching step, between whose two cross-planes the side faces lie.

    Attributes
    ----------
    before, after : (2, n_phi + 1, n_r + 1) y, z of the vertices at both ends.
    dx : its length.
    """

    before: FloatArray
    after: FloatArray
    dx: float


@inlined
def face_area(step: Step, j: int, i: int, j_next: int, i_next: int) -> tuple[float, float, float]:
    """Return the vector area (x, y, z) that the edge from vertex (j, i) to (j_next, i_next) sweeps in a step.

    It points outward for an edge towards decreasing roll angle, and towards increasing roll angle for an
    outward edge.
    """
    before, after, dx = step.before, step.after, step.dx
    ay = after[0, j_next, i_next] - before[0, j, i]
    az = after[1, j_next, i_next] - before[1, j, i]
    by = after[0, j, i] - before[0, j_next, i_next]
    bz = after[1, j, i] - before[1, j_next, i_next]
    return 0.5 * (ay * bz - az * by), 0.5 * dx * (az - bz), 0.5 * dx * (by - ay)
