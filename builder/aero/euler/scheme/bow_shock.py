"""The outer boundary: the bow shock, fitted (compiled)."""

import math

import numpy as np

from builder.aero.euler.scheme.gas import GAMMA
from builder.aero.euler.scheme.grid import Rays, norm
from builder.aero.euler.scheme.reconstruction import Stream, limited
from builder.compiled import compiled, inlined
from strainfmu.arrays import FloatArray

SMOOTHING = 0.5
"""Fraction of the second difference of the boundary's radius that is taken out per unit of ln x."""


@inlined
def shock_slope(pressure: float, axial: float, normal: float) -> float:
    """Return the slope dn/dx of the shock that raises the free stream to ``pressure``, a Mach wave at least.

    ``axial`` and ``normal`` are the free stream's velocities along x and the in-plane normal. The normal Mach
    number of the shock follows from its pressure ratio (NACA Report 1135, eq. 128 inverted), its slope s from
    (u s - v_n)^2 = M_n^2 (1 + s^2).
    """
    strength = max(GAMMA * pressure - 1.0, 0.0)
    mach2 = 1.0 + 0.5 * (GAMMA + 1.0) / GAMMA * strength
    a = axial * axial - mach2
    b = axial * normal
    c = normal * normal - mach2
    return (b + math.sqrt(max(b * b - a * c, 0.0))) / a


@compiled
def outer_boundary_growth(
    x: float,
    vertex: FloatArray,
    outer: FloatArray,
    wave: FloatArray,
    rays: Rays,
    stream: Stream,
    growth: FloatArray,
) -> None:
    """Fill growth (n_phi + 1,) with d(outer)/dx: the outer boundary is the bow shock and moves with it.

    Each face takes the slope of the shock that the pressure behind it needs; free stream crosses it. A ray
    takes the mean of its two faces, and a little smoothing keeps neighbouring rays from parting.
    """
    n_phi = outer.size - 1
    n_r = wave.shape[2]
    at_face = np.empty(n_phi)
    for j in range(n_phi):
        ty = vertex[0, j + 1, n_r] - vertex[0, j, n_r]
        tz = vertex[1, j + 1, n_r] - vertex[1, j, n_r]
        length = norm(ty, tz)
        ny, nz = -tz / length, ty / length
        row = wave[0, j + 1]
        pressure = row[n_r - 1] + 0.5 * limited(row[n_r - 1] - row[n_r - 2], row[n_r - 2] - row[n_r - 3])
        slope = shock_slope(pressure, stream.u, stream.v * ny + stream.w * nz)
        at_face[j] = slope / (ny * rays.cell_sine[j] + nz * rays.cell_cosine[j])
    for j in range(n_phi + 1):
        previous, following, left, right = j - 1, j, j - 1, j + 1
        if j == 0:
            previous, left = (n_phi - 1, n_phi - 1) if rays.closed else (0, 1)
        if j == n_phi:
            following, right = (0, 1) if rays.closed else (n_phi - 1, n_phi - 1)
        unevenness = outer[left] - 2.0 * outer[j] + outer[right]
        growth[j] = 0.5 * (at_face[previous] + at_face[following]) + SMOOTHING * unevenness / x
