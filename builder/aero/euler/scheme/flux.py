"""Fluxes through the side faces between two marching planes (compiled).

A face is described in the plane of the axis and its in-plane normal n: it moves outward with slope s = dn/dx.
Per unit of x and of face length the flux is F_n - s E, with
F_n = (rho v_n, rho u v_n, rho v_n^2 + p, rho v_n v_t) and E = (rho u, rho u^2 + p, rho u v_n, rho u v_t).

Second part: all of them in one step.
"""

import math

import numpy as np

from builder.aero.euler.scheme.gas import GAMMA, wall_pressure
from builder.aero.euler.scheme.grid import Rays, Step, face_area, norm
from builder.aero.euler.scheme.reconstruction import (
    State,
    Stream,
    circumferential_slopes,
    limited,
    radial_slopes,
    reconstruct,
)
from builder.compiled import compiled, inlined
from strainfmu.arrays import FloatArray, IntArray

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


@inlined
def _flow_through(left: State, right: State, sx: float, sy: float, sz: float) -> tuple[float, float, float, float]:
    """Return the flow through the vector area (sx, sy, sz) from left to right."""
    length = norm(sy, sz)
    shrink = 1.0 / length
    ny, nz = sy * shrink, sz * shrink
    slope = -sx * shrink
    pl, rl, ul, vl, wl = left
    pr, rr, ur, vr, wr = right
    nl, tl = vl * ny + wl * nz, wl * ny - vl * nz
    nr, tr = vr * ny + wr * nz, wr * ny - vr * nz
    f0, f1, fn, ft = hll((pl, rl, ul, nl, tl), (pr, rr, ur, nr, tr), slope)
    return f0 * length, f1 * length, (fn * ny - ft * nz) * length, (fn * nz + ft * ny) * length


@compiled
def _turned_pressure(cell: FloatArray, j: int, i: int, sx: float, sy: float, sz: float) -> float:
    """Return the pressure of cell (j, i) once its flow is turned parallel to the wall of normal (sx, sy, sz)."""
    p, rho, u, v, w = cell[0, j, i], cell[1, j, i], cell[2, j, i], cell[3, j, i], cell[4, j, i]
    speed = math.sqrt(u * u + v * v + w * w)
    outflow = math.asin((u * sx + v * sy + w * sz) / (speed * math.sqrt(sx * sx + sy * sy + sz * sz)))
    return wall_pressure(p, rho, speed, outflow)


@compiled
def add_wall_fluxes(
    step: Step, cell: FloatArray, change: FloatArray, pressure_at_wall: FloatArray, repairs: IntArray
) -> bool:
    """Add to change (4, n_phi, n_r) the wall's pressure, left in pressure_at_wall (n_phi,).

    The flow of a cell is turned parallel to the wall; its waves towards the wall set the pressure.
    Pressures of the first three cells are extrapolated to the wall: behind a corner they are equal, whatever the
    fan looks like on the grid. False if a wall shock detaches.
    """
    for j in range(pressure_at_wall.size):
        sx, sy, sz = face_area(step, j + 1, 0, j, 0)
        p = _turned_pressure(cell, j, 0, sx, sy, sz)
        if not p > 0.0:
            return False
        p1, p2 = _turned_pressure(cell, j, 1, sx, sy, sz), _turned_pressure(cell, j, 2, sx, sy, sz)
        extrapolated = p - 0.5 * limited(p1 - p, p2 - p1)
        if p1 > 0.0 and p2 > 0.0 and extrapolated > 0.0:
            p = extrapolated
        else:
            repairs[0] += 1
        pressure_at_wall[j] = p
        change[1, j, 0] += p * sx
        change[2, j, 0] += p * sy
        change[3, j, 0] += p * sz
    return True


@compiled
def add_radial_fluxes(
    step: Step,
    wave: FloatArray,
    rays: Rays,
    stream: Stream,
    change: FloatArray,
    repairs: IntArray,
) -> None:
    """Add to change (4, n_phi, n_r) the flow through the faces beyond the wall; the outermost take free stream."""
    n_phi, n_r = change.shape[1], change.shape[2]
    half = np.empty(change.shape)
    radial_slopes(wave, half)
    flux = np.empty((4, n_r + 1))
    flux[0, 0] = flux[1, 0] = flux[2, 0] = flux[3, 0] = 0.0
    unfit = 0
    for j in range(n_phi):
        ray = (rays.cell_sine[j], rays.cell_cosine[j])
        for i in range(1, n_r):
            sx, sy, sz = face_area(step, j + 1, i, j, i)
            left, unfit_left = reconstruct(wave, half, j, i - 1, side=1.0, ray=ray, stream=stream)
            right, unfit_right = reconstruct(wave, half, j, i, side=-1.0, ray=ray, stream=stream)
            unfit += unfit_left + unfit_right
            flux[0, i], flux[1, i], flux[2, i], flux[3, i] = _flow_through(left, right, sx, sy, sz)
        sx, sy, sz = face_area(step, j + 1, n_r, j, n_r)
        through, p = stream.u * sx + stream.v * sy + stream.w * sz, 1.0 / GAMMA
        flux[0, n_r], flux[1, n_r] = through, through * stream.u + p * sx
        flux[2, n_r], flux[3, n_r] = through * stream.v + p * sy, through * stream.w + p * sz
        for k in range(4):
            for i in range(n_r):
                change[k, j, i] += flux[k, i] - flux[k, i + 1]
    repairs[0] += unfit


@compiled
def add_circumferential_fluxes(
    step: Step,
    wave: FloatArray,
    rays: Rays,
    stream: Stream,
    change: FloatArray,
    repairs: IntArray,
) -> None:
    """Add to change (4, n_phi, n_r) the flow through the faces between rays."""
    n_phi, n_r = change.shape[1], change.shape[2]
    half = np.empty(change.shape)
    circumferential_slopes(wave, rays.step, half)
    flux = np.empty((4, n_r))
    unfit = 0
    for j in range(n_phi if rays.closed else n_phi + 1):
        ray = (rays.sine[j], rays.cosine[j])
        previous, following = j - 1, j
        if rays.closed and j == 0:
            previous = n_phi - 1
        # Across the symmetry plane (y = 0) lies the mirror image.
        left_cell, left_side, left_y = (previous, 1.0, 1.0) if previous >= 0 else (following, -1.0, -1.0)
        right_cell, right_side, right_y = (following, -1.0, 1.0) if following < n_phi else (previous, 1.0, -1.0)
        for i in range(n_r):
            sx, sy, sz = face_area(step, j, i, j, i + 1)
            (pl, rl, ul, vl, wl), unfit_left = reconstruct(
                wave, half, left_cell, i, side=left_side, ray=ray, stream=stream
            )
            (pr, rr, ur, vr, wr), unfit_right = reconstruct(
                wave, half, right_cell, i, side=right_side, ray=ray, stream=stream
            )
            unfit += (unfit_left if left_y > 0.0 else 0) + (unfit_right if right_y > 0.0 else 0)
            left, right = (pl, rl, ul, left_y * vl, wl), (pr, rr, ur, right_y * vr, wr)
            flux[0, i], flux[1, i], flux[2, i], flux[3, i] = _flow_through(left, right, sx, sy, sz)
        for k in range(4):
            for i in range(n_r):
                if previous >= 0:
                    change[k, previous, i] -= flux[k, i]
                if following < n_phi:
                    change[k, following, i] += flux[k, i]
    repairs[0] += unfit
