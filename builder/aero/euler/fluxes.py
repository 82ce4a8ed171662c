"""Fluxes through the side faces in one step (compiled)."""

from __future__ import annotations

import math

import numpy as np

from builder.aero.euler.compiled import compiled
from builder.aero.euler.flux import hll
from builder.aero.euler.gas import GAMMA, wall_pressure
from builder.aero.euler.grid import Rays, Step, face_area, norm
from builder.aero.euler.reconstruction import (
    State,
    Stream,
    circumferential_slopes,
    limited,
    radial_slopes,
    reconstruct,
)
from strainfmu.arrays import FloatArray, IntArray


@compiled
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

    Turned parallel to the wall, the flow of a cell has the pressure that its waves towards the wall bring there.
    Those of the first three cells are extrapolated to the wall: behind a corner they are equal, whatever the
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
    free_stream = (1.0 / GAMMA, 1.0, stream.u, stream.v, stream.w)
    for j in range(n_phi):
        ray = (rays.cell_sine[j], rays.cell_cosine[j])
        for i in range(1, n_r + 1):
            sx, sy, sz = face_area(step, j + 1, i, j, i)
            if i < n_r:
                left = reconstruct(wave, half, j, i - 1, side=1.0, ray=ray, stream=stream, repairs=repairs)
                right = reconstruct(wave, half, j, i, side=-1.0, ray=ray, stream=stream, repairs=repairs)
            else:
                left = right = free_stream
            flux = _flow_through(left, right, sx, sy, sz)
            for k in range(4):
                change[k, j, i - 1] -= flux[k]
                if i < n_r:
                    change[k, j, i] += flux[k]


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
    for j in range(n_phi if rays.closed else n_phi + 1):
        ray = (rays.sine[j], rays.cosine[j])
        behind, ahead = j - 1, j
        if rays.closed and j == 0:
            behind = n_phi - 1
        for i in range(n_r):
            sx, sy, sz = face_area(step, j, i, j, i + 1)
            # Across the symmetry plane (y = 0) lies the mirror image.
            if behind >= 0:
                left = reconstruct(wave, half, behind, i, side=1.0, ray=ray, stream=stream, repairs=repairs)
            if ahead < n_phi:
                right = reconstruct(wave, half, ahead, i, side=-1.0, ray=ray, stream=stream, repairs=repairs)
            else:
                right = (left[0], left[1], left[2], -left[3], left[4])
            if behind < 0:
                left = (right[0], right[1], right[2], -right[3], right[4])
            flux = _flow_through(left, right, sx, sy, sz)
            for k in range(4):
                if behind >= 0:
                    change[k, behind, i] -= flux[k]
                if ahead < n_phi:
                    change[k, ahead, i] += flux[k]
