"""What flows through the side faces in one step (compiled)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from builder.aero.euler.compiled import compiled
from builder.aero.euler.flux import hll
from builder.aero.euler.gas import GAMMA, total_enthalpy, wall_pressure
from builder.aero.euler.grid import face_area, norm
from builder.aero.euler.reconstruction import State, face_state, limited, reconstruct

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@compiled
def _flow_through(
    left: State,
    right: State,
    sx: float,
    sy: float,
    sz: float,
    flux: FloatArray,
) -> None:
    """Fill flux (4,) with the flow through the vector area (sx, sy, sz) from left to right."""
    length = norm(sy, sz)
    ny, nz = sy / length, sz / length
    slope = -sx / length
    pl, rl, ul, vl, wl = left
    pr, rr, ur, vr, wr = right
    nl, tl = vl * ny + wl * nz, wl * ny - vl * nz
    nr, tr = vr * ny + wr * nz, wr * ny - vr * nz
    f0, f1, fn, ft = hll(pl, rl, ul, nl, tl, pr, rr, ur, nr, tr, slope)
    flux[0] = f0 * length
    flux[1] = f1 * length
    flux[2] = (fn * ny - ft * nz) * length
    flux[3] = (fn * nz + ft * ny) * length


@compiled
def add_radial_fluxes(
    before: FloatArray,
    after: FloatArray,
    dx: float,
    wave: FloatArray,
    mach_number: float,
    incidence: float,
    change: FloatArray,
    pressure_at_wall: FloatArray,
    repairs: IntArray,
) -> bool:
    """Add to change (4, n_phi, n_r) the flow through the faces parallel to the wall.

    The wall itself takes the pressure that turns the flow parallel to it, left in pressure_at_wall (n_phi,); the
    outer boundary takes free stream. False if a wall shock detaches.
    """
    enthalpy = total_enthalpy(mach_number)
    cross_flow = mach_number * math.sin(incidence)
    n_phi, n_r = change.shape[1], change.shape[2]
    half = np.empty((n_r, 4))
    flat = np.zeros(4)  # a one-sided slope towards the next cell would make the first cell oscillate
    flux = np.empty(4)
    free_stream = face_state(1.0 / GAMMA, 1.0, 0.0, 0.0, 0.0, 1.0, cross_flow, enthalpy)
    for j in range(n_phi):
        phi = (j + 0.5) * math.pi / n_phi
        sine, cosine = math.sin(phi), math.cos(phi)
        for k in range(4):
            row = wave[k, j + 1]
            half[0, k] = 0.5 * limited(row[1] - row[0], row[2] - row[1])
            for i in range(1, n_r - 1):
                half[i, k] = 0.5 * limited(row[i] - row[i - 1], row[i + 1] - row[i])
            half[n_r - 1, k] = 0.0
        for i in range(n_r + 1):
            sx, sy, sz = face_area(before, after, dx, j + 1, i, j, i)
            if i > 0:
                left = reconstruct(
                    wave,
                    j + 1,
                    i - 1,
                    half[i - 1] if i > 1 else flat,
                    1.0,
                    sine,
                    cosine,
                    cross_flow,
                    enthalpy,
                    repairs,
                )
            if i < n_r:
                right = reconstruct(wave, j + 1, i, half[i], -1.0, sine, cosine, cross_flow, enthalpy, repairs)
            if i == 0:
                p, rho, u, v, w = right
                speed = math.sqrt(u * u + v * v + w * w)
                outflow = math.asin((u * sx + v * sy + w * sz) / (speed * math.sqrt(sx * sx + sy * sy + sz * sz)))
                p = wall_pressure(p, rho, speed, outflow)
                if not p > 0.0:
                    return False
                pressure_at_wall[j] = p
                change[1, j, 0] += p * sx
                change[2, j, 0] += p * sy
                change[3, j, 0] += p * sz
                continue
            if i == n_r:
                right = free_stream
                left = free_stream
            _flow_through(left, right, sx, sy, sz, flux)
            for k in range(4):
                change[k, j, i - 1] -= flux[k]
                if i < n_r:
                    change[k, j, i] += flux[k]
    return True


@compiled
def add_circumferential_fluxes(
    before: FloatArray,
    after: FloatArray,
    dx: float,
    wave: FloatArray,
    mach_number: float,
    incidence: float,
    change: FloatArray,
    repairs: IntArray,
) -> None:
    """Add to change (4, n_phi, n_r) the flow through the faces between rays."""
    enthalpy = total_enthalpy(mach_number)
    cross_flow = mach_number * math.sin(incidence)
    n_phi, n_r = change.shape[1], change.shape[2]
    flux = np.empty(4)
    half_left = np.empty(4)
    half_right = np.empty(4)
    for j in range(n_phi + 1):
        sine, cosine = math.sin(j * math.pi / n_phi), math.cos(j * math.pi / n_phi)
        for i in range(n_r):
            sx, sy, sz = face_area(before, after, dx, j, i, j, i + 1)
            for k in range(4):
                step = wave[k, j + 1, i] - wave[k, j, i]
                half_left[k] = 0.5 * limited(wave[k, j, i] - wave[k, j - 1, i], step) if j > 0 else 0.0
                half_right[k] = 0.5 * limited(step, wave[k, j + 2, i] - wave[k, j + 1, i]) if j < n_phi else 0.0
            if j > 0:
                left = reconstruct(wave, j, i, half_left, 1.0, sine, cosine, cross_flow, enthalpy, repairs)
            if j < n_phi:
                right = reconstruct(wave, j + 1, i, half_right, -1.0, sine, cosine, cross_flow, enthalpy, repairs)
            # Across the symmetry plane (y = 0) lies the mirror image.
            if j == 0:
                left = (right[0], right[1], right[2], -right[3], right[4])
            if j == n_phi:
                right = (left[0], left[1], left[2], -left[3], left[4])
            _flow_through(left, right, sx, sy, sz, flux)
            for k in range(4):
                if j > 0:
                    change[k, j - 1, i] -= flux[k]
                if j < n_phi:
                    change[k, j, i] += flux[k]
