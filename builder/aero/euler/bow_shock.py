"""The outer boundary: the bow shock, fitted (compiled)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from builder.aero.euler.compiled import compiled
from builder.aero.euler.gas import GAMMA
from builder.aero.euler.grid import norm
from builder.aero.euler.reconstruction import limited

FloatArray = NDArray[np.float64]

SMOOTHING = 0.5
"""Share of the second difference of the boundary's radius that is taken out per unit of ln x."""


@compiled
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
    mach_number: float,
    incidence: float,
    growth: FloatArray,
) -> None:
    """Fill growth (n_rays + 1,) with d(outer)/dx: the outer boundary is the bow shock and moves with it.

    Each face takes the slope of the shock that the pressure behind it needs; free stream crosses it. A ray
    takes the mean of its two faces, and a little smoothing keeps neighbouring rays from parting.
    """
    n_rays = outer.size - 1
    n_r = wave.shape[2]
    at_face = np.empty(n_rays)
    for j in range(n_rays):
        phi = (j + 0.5) * math.pi / n_rays
        ty = vertex[0, j + 1, n_r] - vertex[0, j, n_r]
        tz = vertex[1, j + 1, n_r] - vertex[1, j, n_r]
        length = norm(ty, tz)
        ny, nz = -tz / length, ty / length
        row = wave[0, j + 1]
        pressure = row[n_r - 1] + 0.5 * limited(row[n_r - 1] - row[n_r - 2], row[n_r - 2] - row[n_r - 3])
        slope = shock_slope(pressure, mach_number * math.cos(incidence), mach_number * math.sin(incidence) * nz)
        at_face[j] = slope / (ny * math.sin(phi) + nz * math.cos(phi))
    for j in range(n_rays + 1):
        below, above = max(j - 1, 0), min(j, n_rays - 1)
        left, right = outer[1 if j == 0 else j - 1], outer[n_rays - 1 if j == n_rays else j + 1]
        growth[j] = 0.5 * (at_face[below] + at_face[above]) + SMOOTHING * (left - 2.0 * outer[j] + right) / x
