"""The march from one cross-plane to the next (compiled).

Arrays: conserved (4, n_phi, n_r) holds E per unit area; cell (5, n_phi, n_r) holds p, rho, u, v, w; vertex
(2, n_phi + 1, n_r + 1) holds y, z. One step is Heun's: fluxes of the present state, a guess, fluxes of the guess,
and the mean of both over the same faces.
"""

import numpy as np

from builder.aero.euler.scheme.bow_shock import outer_boundary_growth
from builder.aero.euler.scheme.flux import (
    add_circumferential_fluxes,
    add_radial_fluxes,
    add_wall_fluxes,
    characteristic_slopes,
)
from builder.aero.euler.scheme.gas import GAMMA, primitive
from builder.aero.euler.scheme.grid import Rays, Step, Wall, cell_areas, face_area, find_wall, norm, place_vertices
from builder.aero.euler.scheme.reconstruction import Stream
from builder.compiled import compiled
from strainfmu.arrays import FloatArray, IntArray

REACHED_END = 0
AXIAL_SONIC = 1
WALL_DETACHED = 2
OUT_OF_STEPS = 3
NEAR_VACUUM = 4

MIN_AXIAL_MACH_NUMBER = 1.00005
VACUUM_PRESSURE = 2e-3
"""Pressure over p_inf of a cell below which a march that cannot go on has come too near to vacuum."""


@compiled
def decode(conserved: FloatArray, rays: Rays, stream: Stream, cell: FloatArray, wave: FloatArray) -> bool:
    """Fill ``cell`` and ``wave`` from ``conserved``; False if a cell is not axially supersonic.

    wave (4, n_phi + 2, n_r): what slopes are taken of: p, rho, and the cross-flow velocity less the free
    stream's in the radial and circumferential directions of the cell. Its first and last rows are the cells
    beyond the first and last ray: mirror images across the symmetry plane, or the cells at the other end.
    """
    n_phi, n_r = conserved.shape[1], conserved.shape[2]
    subsonic = 0
    for j in range(n_phi):
        sine, cosine = rays.cell_sine[j], rays.cell_cosine[j]
        for i in range(n_r):
            p, rho, u, v, w = primitive(
                conserved[0, j, i], conserved[1, j, i], conserved[2, j, i], conserved[3, j, i], stream.enthalpy
            )
            subsonic += 0 if (p > 0.0) & (u * u * rho > MIN_AXIAL_MACH_NUMBER**2 * GAMMA * p) else 1
            cell[0, j, i] = p
            cell[1, j, i] = rho
            cell[2, j, i] = u
            cell[3, j, i] = v
            cell[4, j, i] = w
            wave[0, j + 1, i] = p
            wave[1, j + 1, i] = rho
            wave[2, j + 1, i] = (v - stream.v) * sine + (w - stream.w) * cosine
            wave[3, j + 1, i] = (v - stream.v) * cosine - (w - stream.w) * sine
    if subsonic:
        return False
    for k in range(4):
        sign = -1.0 if k == 3 and not rays.closed else 1.0
        for i in range(n_r):
            wave[k, 0, i] = sign * wave[k, n_phi if rays.closed else 1, i]
            wave[k, n_phi + 1, i] = sign * wave[k, 1 if rays.closed else n_phi, i]
    return True


@compiled
def cause_of_end(conserved: FloatArray, enthalpy: float, status: int) -> int:
    """Return NEAR_VACUUM where an expansion has left a cell of ``conserved`` hardly any pressure, else ``status``.

    The axial flow of such a cell is far from sonic: it is the pressure, a small difference of momentum and mass
    flux times velocity, that is lost.
    """
    for j in range(conserved.shape[1]):
        for i in range(conserved.shape[2]):
            mass, momentum = conserved[0, j, i], conserved[1, j, i]
            p, _, u, _, _ = primitive(mass, momentum, conserved[2, j, i], conserved[3, j, i], enthalpy)
            if not mass > 0.0 or (u > 0.0 and GAMMA * p < VACUUM_PRESSURE):
                return NEAR_VACUUM
    return status


@compiled
def crossing_steps(
    vertex: FloatArray,
    cell: FloatArray,
    spacing: FloatArray,
    rays: Rays,
    wall_slope: FloatArray,
    growth: FloatArray,
    step: FloatArray,
) -> None:
    """Fill step (n_phi, n_r) with the dx in which an acoustic wave crosses a cell (both directions together).

    wall_slope dr/dx and growth d(outer)/dx (n_phi + 1,) are the motion of the grid's ends.
    """
    n_phi, n_r = cell.shape[1], cell.shape[2]
    for j in range(n_phi):
        sine, cosine = rays.cell_sine[j], rays.cell_cosine[j]
        inner = 0.5 * (wall_slope[j] + wall_slope[j + 1])
        outer = 0.5 * (growth[j] + growth[j + 1])
        for i in range(n_r):
            p, rho, u = cell[0, j, i], cell[1, j, i], cell[2, j, i]
            v, w = cell[3, j, i], cell[4, j, i]
            y = vertex[0, j, i] + vertex[0, j + 1, i]
            z = vertex[1, j, i] + vertex[1, j + 1, i]
            height = 0.5 * norm(
                vertex[0, j, i + 1] + vertex[0, j + 1, i + 1] - y,
                vertex[1, j, i + 1] + vertex[1, j + 1, i + 1] - z,
            )
            width = norm(vertex[0, j + 1, i] - vertex[0, j, i], vertex[1, j + 1, i] - vertex[1, j, i])
            low, high = characteristic_slopes(p, rho, u, v * sine + w * cosine)
            slope = inner + 0.5 * (spacing[i] + spacing[i + 1]) * (outer - inner)
            radial = max(high - slope, slope - low) / height
            low, high = characteristic_slopes(p, rho, u, v * cosine - w * sine)
            step[j, i] = 1.0 / (radial + max(high, -low) / width)


@compiled
def shortest(step: FloatArray) -> float:
    """Return the smallest value of step (n_phi, n_r)."""
    least = step[0, 0]
    for j in range(step.shape[0]):
        for i in range(step.shape[1]):
            least = min(least, step[j, i])
    return least


@compiled
def add_wall_force(step: Step, pressure: FloatArray, force: FloatArray) -> None:
    """Add to force (3,) the force of p - p_inf on the wall of one step, over p_inf, from pressure (n_phi,)."""
    for j in range(pressure.size):
        sx, sy, sz = face_area(step, j + 1, 0, j, 0)
        excess = GAMMA * pressure[j] - 1.0
        force[0] -= excess * sx
        force[1] -= excess * sy
        force[2] -= excess * sz


@compiled
def find_fluxes(
    step: Step,
    cell: FloatArray,
    wave: FloatArray,
    rays: Rays,
    stream: Stream,
    change: FloatArray,
    wall_pressure: FloatArray,
    repairs: IntArray,
) -> bool:
    """Fill change (4, n_phi, n_r) with what flows into each cell in a step; False if a wall shock detaches."""
    change[:] = 0.0
    if not add_wall_fluxes(step, cell, change, wall_pressure, repairs):
        return False
    add_radial_fluxes(step, wave, rays, stream, change, repairs)
    add_circumferential_fluxes(step, wave, rays, stream, change, repairs)
    return True


@compiled
def advance_cells(
    conserved: FloatArray,
    area_before: FloatArray,
    first: FloatArray,
    second: FloatArray,
    area_after: FloatArray,
    result: FloatArray,
) -> None:
    """Fill ``result`` with E after a step in which the mean of ``first`` and ``second`` flows into each cell."""
    for k in range(conserved.shape[0]):
        for j in range(conserved.shape[1]):
            for i in range(conserved.shape[2]):
                inflow = 0.5 * (first[k, j, i] + second[k, j, i])
                result[k, j, i] = (conserved[k, j, i] * area_before[j, i] + inflow) / area_after[j, i]


@compiled
def move_outer(outer: FloatArray, growth: FloatArray, last_growth: FloatArray, dx: float, ahead: float) -> None:
    """Move the outer boundary (n_phi + 1,) through a step dx, and make ``growth`` the last one.

    The shock moves as it would half a step ahead (second-order Adams-Bashforth): ``ahead`` is that half step over
    the last step, 0 in the first.
    """
    for j in range(outer.size):
        outer[j] += dx * (growth[j] + ahead * (growth[j] - last_growth[j]))
        last_growth[j] = growth[j]


@compiled
def march(
    conserved: FloatArray,
    outer: FloatArray,
    spacing: FloatArray,
    rays: Rays,
    wall: Wall,
    x_start: float,
    x_end: float,
    stream: Stream,
    courant: float,
    stations: FloatArray,
    pressures: FloatArray,
    force: FloatArray,
    repairs: IntArray,
) -> tuple[int, int, float]:
    """March from x_start to x_end along one smooth piece of the body.

    Parameters
    ----------
    conserved, outer : (4, n_phi, n_r), (n_phi + 1,) state and outer boundary at x_start; updated.
    spacing : (n_r + 1,) vertex positions from 0 (wall) to 1 (outer boundary).
    stations : (max_steps,) filled with the middle of each step.
    pressures : (max_steps, n_phi) filled with the wall pressure there.
    force : (3,) force of p - p_inf on the part of the body between the rays, over p_inf [m2]; added to.
    repairs : (1,) number of face states that had to fall back to their cell's; added to.

    Returns
    -------
    status, number of steps, last station.
    """
    n_phi, n_r = conserved.shape[1], conserved.shape[2]
    cell, wave = np.empty((5, n_phi, n_r)), np.empty((4, n_phi + 2, n_r))
    before, after = np.empty((2, n_phi + 1, n_r + 1)), np.empty((2, n_phi + 1, n_r + 1))
    area_before, area_after, crossing = np.empty((n_phi, n_r)), np.empty((n_phi, n_r)), np.empty((n_phi, n_r))
    first, second, guess = np.empty(conserved.shape), np.empty(conserved.shape), np.empty(conserved.shape)
    wall_first, wall_second = np.empty(n_phi), np.empty(n_phi)
    growth, last_growth = np.empty(n_phi + 1), np.zeros(n_phi + 1)
    radius, slope = np.empty(n_phi + 1), np.empty(n_phi + 1)
    x, last_dx = x_start, 0.0
    find_wall(x, wall, radius, slope)
    place_vertices(radius, outer, spacing, rays, before)
    cell_areas(before, area_before)
    for number in range(stations.size):
        if not decode(conserved, rays, stream, cell, wave):
            return cause_of_end(conserved, stream.enthalpy, AXIAL_SONIC), number, x
        outer_boundary_growth(x, before, outer, wave, rays, stream, growth=growth)
        crossing_steps(before, cell, spacing, rays, wall_slope=slope, growth=growth, step=crossing)
        dx = courant * shortest(crossing)
        last = x + dx >= x_end * (1.0 - 1e-12)
        if last:
            dx = x_end - x
        move_outer(outer, growth, last_growth, dx, 0.5 * dx / last_dx if number > 0 else 0.0)
        last_dx = dx
        find_wall(x + dx, wall, radius, slope)
        place_vertices(radius, outer, spacing, rays, after)
        cell_areas(after, area_after)
        step = Step(before, after, dx)
        if not find_fluxes(step, cell, wave, rays, stream, first, wall_pressure=wall_first, repairs=repairs):
            return cause_of_end(conserved, stream.enthalpy, WALL_DETACHED), number, x
        advance_cells(conserved, area_before, first, first, area_after, guess)
        if not decode(guess, rays, stream, cell, wave):
            return cause_of_end(guess, stream.enthalpy, AXIAL_SONIC), number, x
        if not find_fluxes(step, cell, wave, rays, stream, second, wall_pressure=wall_second, repairs=repairs):
            return cause_of_end(guess, stream.enthalpy, WALL_DETACHED), number, x
        advance_cells(conserved, area_before, first, second, area_after, conserved)
        for j in range(n_phi):
            pressures[number, j] = 0.5 * (wall_first[j] + wall_second[j])
        stations[number] = x + 0.5 * dx
        add_wall_force(step, pressures[number], force)
        before, after = after, before
        area_before, area_after = area_after, area_before
        x += dx
        if last:
            return REACHED_END, number + 1, x_end
    return OUT_OF_STEPS, stations.size, x
