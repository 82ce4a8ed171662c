"""The marching step on a moving body-fitted grid (compiled).

Cross-plane grid of the half body y >= 0: ``outer``[j] is the outer boundary at ray j (roll angle pi j / n_rays,
0 = +z = leeward), ``spacing``[i] in 0..1 places the vertices between body and outer boundary. Cells are
(j, i), i from the wall outward. Side faces are the quadrilaterals between two planes with their exact
vector areas, so that a uniform stream stays uniform to round-off.

Arrays: conserved (4, n_phi, n_r) E per unit area; cell (5, n_phi, n_r) holds p, rho, u, v, w.
Reconstruction: minmod-limited slopes of p, rho and of the cross-flow velocity's cylindrical components
less the free stream's; u follows from total enthalpy. Time-like integration: Heun.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from builder.aero.euler.flux import characteristic_slopes, hll
from builder.aero.euler.gas import GAMMA, axial_velocity, primitive, total_enthalpy, wall_pressure

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

REACHED_END = 0
AXIAL_SONIC = 1
WALL_DETACHED = 2
OUT_OF_STEPS = 3

_COMPILE = {"cache": True, "nogil": True, "error_model": "numpy"}

SMOOTHING = 0.5
"""Share of the second difference of the outer boundary's radius that is taken out per unit of ln x."""


@njit(**_COMPILE)
def body_radius(x: float, segment: FloatArray) -> float:
    """Return r(x) of a segment (start_x, start_radius, start_angle, end_angle, end_x)."""
    rise = x - segment[0]
    if segment[2] == segment[3]:
        return segment[1] + rise * math.tan(segment[2])
    arc_radius = (segment[4] - segment[0]) / (math.sin(segment[2]) - math.sin(segment[3]))
    angle = math.asin(math.sin(segment[2]) - rise / arc_radius)
    return segment[1] + arc_radius * (math.cos(angle) - math.cos(segment[2]))


@njit(**_COMPILE)
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


@njit(**_COMPILE)
def cell_areas(vertex: FloatArray, area: FloatArray) -> None:
    """Fill area (n_phi, n_r) with the cells' areas."""
    for j in range(area.shape[0]):
        for i in range(area.shape[1]):
            ay = vertex[0, j + 1, i + 1] - vertex[0, j, i]
            az = vertex[1, j + 1, i + 1] - vertex[1, j, i]
            by = vertex[0, j, i + 1] - vertex[0, j + 1, i]
            bz = vertex[1, j, i + 1] - vertex[1, j + 1, i]
            area[j, i] = 0.5 * abs(ay * bz - az * by)


@njit(**_COMPILE)
def decode(conserved: FloatArray, mach_number: float, incidence: float, cell: FloatArray, wave: FloatArray) -> bool:
    """Fill ``cell`` from ``conserved`` and ``wave`` with what slopes are taken of; False if a cell is not axially supersonic.

    wave (4, n_phi + 2, n_r): p, rho, and v', w' in the cylindrical directions of the cell's ray; its first
    and last rows are mirror images across the symmetry plane.
    """
    enthalpy = total_enthalpy(mach_number)
    cross_flow = mach_number * math.sin(incidence)
    n_phi, n_r = conserved.shape[1], conserved.shape[2]
    for j in range(n_phi):
        phi = (j + 0.5) * math.pi / n_phi
        sine, cosine = math.sin(phi), math.cos(phi)
        for i in range(n_r):
            p, rho, u, v, w = primitive(
                conserved[0, j, i], conserved[1, j, i], conserved[2, j, i], conserved[3, j, i], enthalpy
            )
            if not p > 0.0 or not u * u > 1.0001 * GAMMA * p / rho:
                return False
            cell[0, j, i] = p
            cell[1, j, i] = rho
            cell[2, j, i] = u
            cell[3, j, i] = v
            cell[4, j, i] = w
            wave[0, j + 1, i] = p
            wave[1, j + 1, i] = rho
            wave[2, j + 1, i] = v * sine + (w - cross_flow) * cosine
            wave[3, j + 1, i] = v * cosine - (w - cross_flow) * sine
    for k in range(4):
        sign = -1.0 if k == 3 else 1.0
        for i in range(n_r):
            wave[k, 0, i] = sign * wave[k, 1, i]
            wave[k, n_phi + 1, i] = sign * wave[k, n_phi, i]
    return True


@njit(**_COMPILE)
def marching_step(vertex: FloatArray, cell: FloatArray, growth: FloatArray) -> float:
    """Return the largest dx for which no acoustic wave crosses a cell (Courant number 1, both directions).

    growth (n_phi + 1,): slopes d(outer)/dx of the outer boundary, for the motion of the grid.
    """
    n_phi, n_r = cell.shape[1], cell.shape[2]
    fastest = 0.0
    for j in range(n_phi):
        phi = (j + 0.5) * math.pi / n_phi
        sine, cosine = math.sin(phi), math.cos(phi)
        for i in range(n_r):
            p, rho, u = cell[0, j, i], cell[1, j, i], cell[2, j, i]
            v, w = cell[3, j, i], cell[4, j, i]
            y = vertex[0, j, i] + vertex[0, j + 1, i]
            z = vertex[1, j, i] + vertex[1, j + 1, i]
            height = 0.5 * math.hypot(
                vertex[0, j, i + 1] + vertex[0, j + 1, i + 1] - y, vertex[1, j, i + 1] + vertex[1, j + 1, i + 1] - z
            )
            width = math.hypot(vertex[0, j + 1, i] - vertex[0, j, i], vertex[1, j + 1, i] - vertex[1, j, i])
            low, high = characteristic_slopes(p, rho, u, v * sine + w * cosine)
            slope = growth[j, i]
            radial = max(high - slope, slope - low) / height
            low, high = characteristic_slopes(p, rho, u, v * cosine - w * sine)
            fastest = max(fastest, radial + max(high, -low) / width)
    return 1.0 / fastest


@njit(**_COMPILE)
def _limited(a: float, b: float) -> float:
    """Return the smaller of two differences, or 0 where they disagree in sign (minmod).

    Sharper limiters leave the bow shock, which lies along the grid, unsteady on the windward side at
    high Mach number (wall pressure +-1 %) and change C_N by less than 0.5 %.
    """
    if a * b <= 0.0:
        return 0.0
    return a if abs(a) < abs(b) else b


@njit(**_COMPILE)
def _face_state(
    p: float, rho: float, radial: float, around: float,
    sine: float, cosine: float, cross_flow: float, enthalpy: float,
) -> tuple[float, float, float, float, float]:
    """Return (p, rho, u, v, w) of the given values at a face whose ray has (sine, cosine)."""
    v = radial * sine + around * cosine
    w = radial * cosine - around * sine + cross_flow
    return p, rho, axial_velocity(p, rho, v, w, enthalpy), v, w


@njit(**_COMPILE)
def _reconstruct(
    p: float, rho: float, radial: float, around: float,
    half: FloatArray, side: float, sine: float, cosine: float, cross_flow: float, enthalpy: float,
    repairs: IntArray,
) -> tuple[float, float, float, float, float]:
    """Return the state at a face: the cell's values plus ``side`` times the half slopes (4,).

    Where that state has no supersonic axial flow left, the cell's own values serve, and ``repairs`` counts it.
    """
    state = _face_state(
        p + side * half[0], rho + side * half[1], radial + side * half[2], around + side * half[3],
        sine, cosine, cross_flow, enthalpy,
    )
    if state[0] > 0.0 and state[2] * state[2] * state[1] > GAMMA * state[0]:
        return state
    repairs[0] += 1
    return _face_state(p, rho, radial, around, sine, cosine, cross_flow, enthalpy)


@njit(**_COMPILE)
def _add_flux(
    left: tuple[float, float, float, float, float], right: tuple[float, float, float, float, float],
    sx: float, sy: float, sz: float,
    flux: FloatArray,
) -> None:
    """Fill flux (4,) with the flow through the vector area (sx, sy, sz) from left to right."""
    length = math.hypot(sy, sz)
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


@njit(**_COMPILE)
def add_radial_fluxes(
    before: FloatArray, after: FloatArray, dx: float, wave: FloatArray,
    mach_number: float, incidence: float, change: FloatArray, pressure_at_wall: FloatArray, repairs: IntArray,
) -> bool:
    """Add to change (4, n_phi, n_r) the flow through the faces parallel to the wall; False if a wall shock detaches."""
    enthalpy = total_enthalpy(mach_number)
    cross_flow = mach_number * math.sin(incidence)
    n_phi, n_r = change.shape[1], change.shape[2]
    half = np.empty((n_r, 4))
    flux = np.empty(4)
    free_stream = _face_state(1.0 / GAMMA, 1.0, 0.0, 0.0, 0.0, 1.0, cross_flow, enthalpy)
    for j in range(n_phi):
        phi = (j + 0.5) * math.pi / n_phi
        sine, cosine = math.sin(phi), math.cos(phi)
        for k in range(4):
            row = wave[k, j + 1]
            half[0, k] = 0.5 * _limited(row[1] - row[0], row[2] - row[1])
            for i in range(1, n_r - 1):
                half[i, k] = 0.5 * _limited(row[i] - row[i - 1], row[i + 1] - row[i])
            half[n_r - 1, k] = 0.0
        for i in range(n_r + 1):
            ay = after[0, j + 1, i] - before[0, j, i]
            az = after[1, j + 1, i] - before[1, j, i]
            by = after[0, j, i] - before[0, j + 1, i]
            bz = after[1, j, i] - before[1, j + 1, i]
            sx = 0.5 * (az * by - ay * bz)
            sy = 0.5 * dx * (bz - az)
            sz = 0.5 * dx * (ay - by)
            if i > 0:
                left = _reconstruct(
                    wave[0, j + 1, i - 1], wave[1, j + 1, i - 1], wave[2, j + 1, i - 1], wave[3, j + 1, i - 1],
                    half[i - 1], 1.0, sine, cosine, cross_flow, enthalpy, repairs,
                )
            if i < n_r:
                right = _reconstruct(
                    wave[0, j + 1, i], wave[1, j + 1, i], wave[2, j + 1, i], wave[3, j + 1, i],
                    half[i], -1.0, sine, cosine, cross_flow, enthalpy, repairs,
                )
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
            _add_flux(left, right, sx, sy, sz, flux)
            for k in range(4):
                change[k, j, i - 1] -= flux[k]
                if i < n_r:
                    change[k, j, i] += flux[k]
    return True


@njit(**_COMPILE)
def add_circumferential_fluxes(
    before: FloatArray, after: FloatArray, dx: float, wave: FloatArray,
    mach_number: float, incidence: float, change: FloatArray, repairs: IntArray,
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
            ay = after[0, j, i + 1] - before[0, j, i]
            az = after[1, j, i + 1] - before[1, j, i]
            by = after[0, j, i] - before[0, j, i + 1]
            bz = after[1, j, i] - before[1, j, i + 1]
            sx = 0.5 * (ay * bz - az * by)
            sy = 0.5 * dx * (az - bz)
            sz = 0.5 * dx * (by - ay)
            for k in range(4):
                step = wave[k, j + 1, i] - wave[k, j, i]
                half_left[k] = 0.5 * _limited(wave[k, j, i] - wave[k, j - 1, i], step) if j > 0 else 0.0
                half_right[k] = 0.5 * _limited(step, wave[k, j + 2, i] - wave[k, j + 1, i]) if j < n_phi else 0.0
            if j > 0:
                left = _reconstruct(
                    wave[0, j, i], wave[1, j, i], wave[2, j, i], wave[3, j, i],
                    half_left, 1.0, sine, cosine, cross_flow, enthalpy, repairs,
                )
            if j < n_phi:
                right = _reconstruct(
                    wave[0, j + 1, i], wave[1, j + 1, i], wave[2, j + 1, i], wave[3, j + 1, i],
                    half_right, -1.0, sine, cosine, cross_flow, enthalpy, repairs,
                )
            # Across the symmetry plane (y = 0) lies the mirror image.
            if j == 0:
                left = (right[0], right[1], right[2], -right[3], right[4])
            if j == n_phi:
                right = (left[0], left[1], left[2], -left[3], left[4])
            _add_flux(left, right, sx, sy, sz, flux)
            for k in range(4):
                if j > 0:
                    change[k, j - 1, i] -= flux[k]
                if j < n_phi:
                    change[k, j, i] += flux[k]


@njit(**_COMPILE)
def add_wall_force(
    before: FloatArray, after: FloatArray, dx: float, pressure: FloatArray, force: FloatArray
) -> None:
    """Add to force (2,) the axial and normal force of one step's wall pressure (n_phi,), over p_inf, both halves."""
    for j in range(pressure.size):
        ay = after[0, j + 1, 0] - before[0, j, 0]
        az = after[1, j + 1, 0] - before[1, j, 0]
        by = after[0, j, 0] - before[0, j + 1, 0]
        bz = after[1, j, 0] - before[1, j + 1, 0]
        excess = GAMMA * pressure[j] - 1.0
        force[0] -= excess * (az * by - ay * bz)
        force[1] -= excess * dx * (ay - by)


@njit(**_COMPILE)
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


@njit(**_COMPILE)
def outer_boundary_growth(
    x: float, vertex: FloatArray, outer: FloatArray, wave: FloatArray,
    mach_number: float, incidence: float, growth: FloatArray,
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
        length = math.hypot(ty, tz)
        ny, nz = -tz / length, ty / length
        row = wave[0, j + 1]
        pressure = row[n_r - 1] + 0.5 * _limited(row[n_r - 1] - row[n_r - 2], row[n_r - 2] - row[n_r - 3])
        slope = shock_slope(
            pressure, mach_number * math.cos(incidence), mach_number * math.sin(incidence) * nz
        )
        at_face[j] = slope / (ny * math.sin(phi) + nz * math.cos(phi))
    for j in range(n_rays + 1):
        below, above = max(j - 1, 0), min(j, n_rays - 1)
        left, right = outer[1 if j == 0 else j - 1], outer[n_rays - 1 if j == n_rays else j + 1]
        growth[j] = 0.5 * (at_face[below] + at_face[above]) + SMOOTHING * (left - 2.0 * outer[j] + right) / x


@njit(**_COMPILE)
def march(
    conserved: FloatArray, outer: FloatArray, spacing: FloatArray, segment: FloatArray,
    x_start: float, x_end: float, mach_number: float, incidence: float,
    courant: float, stations: FloatArray, pressures: FloatArray, force: FloatArray,
    repairs: IntArray,
) -> tuple[int, int, float]:
    """March from x_start to x_end along one segment of the meridian; ``conserved`` and ``outer`` are updated.

    Parameters
    ----------
    stations : (max_steps,) filled with the middle of each step.
    pressures : (max_steps, n_phi) filled with the wall pressure there.
    force : (2,) axial and normal force of p - p_inf on the whole body, over p_inf [m2]; added to.
    repairs : (1,) number of face states that had to fall back to their cell's; added to.

    Returns
    -------
    status, number of steps, last station.
    """
    n_phi, n_r = conserved.shape[1], conserved.shape[2]
    cell = np.empty((5, n_phi, n_r))
    wave = np.empty((4, n_phi + 2, n_r))
    before = np.empty((2, n_phi + 1, n_r + 1))
    after = np.empty((2, n_phi + 1, n_r + 1))
    area_before = np.empty((n_phi, n_r))
    area_after = np.empty((n_phi, n_r))
    first = np.empty((4, n_phi, n_r))
    second = np.empty((4, n_phi, n_r))
    guess = np.empty((4, n_phi, n_r))
    growth = np.empty(n_phi + 1)
    motion = np.empty((n_phi, n_r))
    wall_first = np.empty(n_phi)
    wall_second = np.empty(n_phi)
    next_outer = np.empty(n_phi + 1)
    x = x_start
    place_vertices(body_radius(x, segment), outer, spacing, before)
    cell_areas(before, area_before)
    for step in range(stations.size):
        if not decode(conserved, mach_number, incidence, cell, wave):
            return AXIAL_SONIC, step, x
        radius = body_radius(x, segment)
        outer_boundary_growth(x, before, outer, wave, mach_number, incidence, growth)
        wall_slope = (body_radius(x * (1.0 + 1e-6), segment) - radius) / (x * 1e-6)
        for j in range(n_phi):
            for i in range(n_r):
                share = 0.5 * (spacing[i] + spacing[i + 1])
                motion[j, i] = wall_slope + share * (0.5 * (growth[j] + growth[j + 1]) - wall_slope)
        dx = courant * marching_step(before, cell, motion)
        last = x + dx >= x_end * (1.0 - 1e-12)
        if last:
            dx = x_end - x
        for j in range(n_phi + 1):
            next_outer[j] = outer[j] + dx * growth[j]
        place_vertices(body_radius(x + dx, segment), next_outer, spacing, after)
        cell_areas(after, area_after)
        first[:] = 0.0
        second[:] = 0.0
        if not add_radial_fluxes(before, after, dx, wave, mach_number, incidence, first, wall_first, repairs):
            return WALL_DETACHED, step, x
        add_circumferential_fluxes(before, after, dx, wave, mach_number, incidence, first, repairs)
        for k in range(4):
            for j in range(n_phi):
                for i in range(n_r):
                    guess[k, j, i] = (conserved[k, j, i] * area_before[j, i] + first[k, j, i]) / area_after[j, i]
        if not decode(guess, mach_number, incidence, cell, wave):
            return AXIAL_SONIC, step, x
        if not add_radial_fluxes(before, after, dx, wave, mach_number, incidence, second, wall_second, repairs):
            return WALL_DETACHED, step, x
        add_circumferential_fluxes(before, after, dx, wave, mach_number, incidence, second, repairs)
        for k in range(4):
            for j in range(n_phi):
                for i in range(n_r):
                    conserved[k, j, i] = (
                        conserved[k, j, i] * area_before[j, i] + 0.5 * (first[k, j, i] + second[k, j, i])
                    ) / area_after[j, i]
        for j in range(n_phi):
            pressures[step, j] = 0.5 * (wall_first[j] + wall_second[j])
        add_wall_force(before, after, dx, pressures[step], force)
        stations[step] = x + 0.5 * dx
        outer[:] = next_outer
        before, after = after, before
        area_before, area_after = area_after, area_before
        x = x + dx
        if last:
            return REACHED_END, step + 1, x_end
    return OUT_OF_STEPS, stations.size, x
