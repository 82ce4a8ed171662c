"""Fluxes through the side faces between two marching planes (compiled).

A face is described in the plane of the axis and its in-plane normal n: it moves outward with slope s = dn/dx.
Per unit of x and of face length the flux is F_n - s E, with
F_n = (rho v_n, rho u v_n, rho v_n^2 + p, rho v_n v_t) and E = (rho u, rho u^2 + p, rho u v_n, rho u v_t).
"""

from __future__ import annotations

import math

from builder.aero.euler.scheme.gas import GAMMA
from builder.compiled import inlined

FaceState = tuple[float, float, float, float, float]
"""p, rho, u and the velocity normal and tangential to a face: v_n, v_t."""


@inlined
def characteristic_slopes(
    pressure: float, density: float, u: float, normal_velocity: float
) -> tuple[float, float]:
    """Return the slopes dn/dx of the two acoustic characteristics; needs u greater than c."""
    c2 = GAMMA * (pressure / density)
    middle = u * normal_velocity
    spread = math.sqrt(c2 * max(u * u + normal_velocity * normal_velocity - c2, 0.0))
    inverse = 1.0 / (u * u - c2)
    return (middle - spread) * inverse, (middle + spread) * inverse


@inlined
def _side(state: FaceState, s: float) -> tuple[float, float, float, float, float, float, float, float]:
    """Return E (4 values) and F_n - s E (4 values) of one state."""
    p, rho, u, v, t = state
    mass, through = rho * u, rho * (v - s * u)
    return mass, mass * u + p, mass * v, mass * t, through, through * u - s * p, through * v + p, through * t


@inlined
def hll(left: FaceState, right: FaceState, s: float) -> tuple[float, float, float, float]:
    """Return the two-wave flux of Harten, Lax and van Leer (SIAM Review 25, 1983) with steady slopes.

    ``s`` is the slope dn/dx of the face between the two states. Waves that do not reach the other side have slope
    0 instead of their own, which leaves the flux of one state: one formula for all cases, without a branch.
    """
    l0, l1, l2, l3, f0, f1, f2, f3 = _side(left, s)
    r0, r1, r2, r3, g0, g1, g2, g3 = _side(right, s)
    lower_left, upper_left = characteristic_slopes(left[0], left[1], left[2], left[3])
    lower_right, upper_right = characteristic_slopes(right[0], right[1], right[2], right[3])
    low = min(min(lower_left, lower_right) - s, 0.0)
    high = max(max(upper_left, upper_right) - s, 0.0)
    inverse = 1.0 / (high - low)
    both = low * high
    return (
        (high * f0 - low * g0 + both * (r0 - l0)) * inverse,
        (high * f1 - low * g1 + both * (r1 - l1)) * inverse,
        (high * f2 - low * g2 + both * (r2 - l2)) * inverse,
        (high * f3 - low * g3 + both * (r3 - l3)) * inverse,
    )
