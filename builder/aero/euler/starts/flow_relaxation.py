"""Relaxation of the flow over a cone, every cell with its own step.

On a cone the march has an end: the state that a step leaves as it is but for the growth of x. It is the same for
steps of any length, because all areas of a step in which the whole plane grows in proportion go with
(x + dx)^2 - x^2. So each cell may take the longest step that is stable for it, as in pseudo-time, and the
thin cells at the wall no longer set the pace of all. What then remains are a few slow modes, above all the layer
of entropy at the wall, and extrapolation from several rounds of sweeps removes them (Anderson, J. ACM 12, 1965).
Where vortices lift off the lee side, an extrapolation may increase the residual; from then on sweeps run alone.
Arrays are as in :mod:`builder.aero.euler.scheme.march`; sweeps are compiled.
"""

import numpy as np

from builder.aero.euler.planes import MarchingGrid, Plane, change_between, cone_imbalance
from builder.aero.euler.scheme.bow_shock import outer_boundary_growth
from builder.aero.euler.scheme.gas import GAMMA
from builder.aero.euler.scheme.grid import Rays, Step, cell_areas, place_vertices
from builder.aero.euler.scheme.march import (
    AXIAL_SONIC,
    REACHED_END,
    WALL_DETACHED,
    crossing_steps,
    decode,
    find_fluxes,
)
from builder.aero.euler.scheme.reconstruction import Stream
from builder.compiled import compiled
from strainfmu.arrays import FloatArray

COURANT = 1.1
"""Of the second stage; the scheme is unstable from 1.2 to 1.4 on."""
FIRST_STAGE = 0.42
"""Fraction of the step taken by the first stage (van Leer, Tai, Powell, AIAA 89-1933: 0.4242 for this scheme)."""
PROBE = 1e-3
"""Length of the step at x = 1 from which the rates of change are taken."""
ROUND = 20
"""Sweeps between two checks of convergence."""
MAX_ROUNDS = 80
DEPTH = 6
"""Rounds from which is extrapolated."""
NEAR = 0.01
"""Change over a round below which is extrapolated."""


@compiled
def copy_values(values: FloatArray, into: FloatArray) -> None:
    """Copy (4, n_phi, n_r); an assignment to a slice takes seconds to compile, for its messages."""
    for k in range(values.shape[0]):
        for j in range(values.shape[1]):
            for i in range(values.shape[2]):
                into[k, j, i] = values[k, j, i]


@compiled
def step_cells(
    start: FloatArray,
    present: FloatArray,
    area: FloatArray,
    area_after: FloatArray,
    inflow: FloatArray,
    step: FloatArray,
    fraction: float,
    result: FloatArray,
) -> None:
    """Fill ``result`` (4, n_phi, n_r) with E after ``fraction`` of each cell's own step from ``start``.

    ``inflow`` (4, n_phi, n_r) flows into the cells, and their area grows, over a step of PROBE at the E
    ``present``; ``step`` (n_phi, n_r) are the times of crossing, of which a cell's own step is COURANT.
    """
    for k in range(start.shape[0]):
        for j in range(start.shape[1]):
            for i in range(start.shape[2]):
                probes = fraction * COURANT * step[j, i] / PROBE
                growth = area_after[j, i] - area[j, i]
                gain = inflow[k, j, i] - present[k, j, i] * growth
                result[k, j, i] = start[k, j, i] + probes * gain / (area[j, i] + probes * growth)


@compiled
def sweep(
    conserved: FloatArray,
    outer: FloatArray,
    spacing: FloatArray,
    rays: Rays,
    slope: FloatArray,
    stream: Stream,
    pressure: FloatArray,
) -> int:
    """Do one round of sweeps at x = 1 towards the flow over the cone r = slope x; return a status of the march.

    Parameters
    ----------
    conserved, outer : (4, n_phi, n_r), (n_phi + 1,) state and outer boundary at x = 1; updated.
    spacing : (n_r + 1,) vertex positions from 0 (wall) to 1 (outer boundary).
    slope : (n_phi + 1,) of the cone on the rays.
    pressure : (n_phi,) filled with the wall pressure of the last sweep.
    """
    n_phi, n_r = conserved.shape[1], conserved.shape[2]
    cell, wave = np.empty((5, n_phi, n_r)), np.empty((4, n_phi + 2, n_r))
    before, after = np.empty((2, n_phi + 1, n_r + 1)), np.empty((2, n_phi + 1, n_r + 1))
    area, area_after, step = np.empty((n_phi, n_r)), np.empty((n_phi, n_r)), np.empty((n_phi, n_r))
    present, inflow = np.empty(conserved.shape), np.empty(conserved.shape)
    copy_values(conserved, present)
    growth, outer_start, outer_step = np.empty(n_phi + 1), np.empty(n_phi + 1), np.empty(n_phi + 1)
    slope_after, outer_after = np.empty(n_phi + 1), np.empty(n_phi + 1)
    repairs = np.zeros(1, dtype=np.int64)
    for _ in range(ROUND):
        for j in range(n_phi + 1):
            outer_start[j] = outer[j]
        for stage in range(2):
            fraction = FIRST_STAGE if stage == 0 else 1.0
            if not decode(present, rays, stream, cell, wave):
                return AXIAL_SONIC
            place_vertices(slope, outer, spacing, rays, before)
            cell_areas(before, area)
            outer_boundary_growth(1.0, before, outer, wave, rays, stream, growth=growth)
            if stage == 0:
                crossing_steps(before, cell, spacing, rays, wall_slope=slope, growth=growth, step=step)
                for j in range(n_phi + 1):
                    previous, following = max(j - 1, 0), min(j, n_phi - 1)
                    if rays.closed and (j == 0 or j == n_phi):
                        previous, following = n_phi - 1, 0
                    outer_step[j] = COURANT * min(step[previous, n_r - 1], step[following, n_r - 1])
            for j in range(n_phi + 1):
                slope_after[j], outer_after[j] = slope[j] * (1.0 + PROBE), outer[j] + PROBE * growth[j]
            place_vertices(slope_after, outer_after, spacing, rays, after)
            cell_areas(after, area_after)
            probe = Step(before, after, PROBE)
            if not find_fluxes(probe, cell, wave, rays, stream, inflow, wall_pressure=pressure, repairs=repairs):
                return WALL_DETACHED
            step_cells(conserved, present, area, area_after, inflow, step=step, fraction=fraction, result=present)
            for j in range(n_phi + 1):
                outer[j] = outer_start[j] + fraction * outer_step[j] * (growth[j] - outer[j])
        copy_values(present, conserved)
    return REACHED_END


def extrapolate(results: list[FloatArray], moves: list[FloatArray]) -> FloatArray:
    """Return the combination of ``results`` (n,) of rounds whose ``moves`` (m,), combined alike, are smallest."""
    move_differences = np.diff(np.stack(moves), axis=0)
    gram = move_differences @ move_differences.T
    weights = np.linalg.lstsq(gram, move_differences @ moves[-1], rcond=1e-10)[0]
    return results[-1] - weights @ np.diff(np.stack(results), axis=0)


def relax_cone(plane: Plane, slope: FloatArray, stream: Stream, grid: MarchingGrid, tolerance: float) -> bool:
    """Relax the flow over the cone r = slope x (n_phi + 1,) on ``plane``, which is at x = 1.

    Returns whether it changes by less than ``tolerance`` over a round and is balanced within it. Otherwise
    the plane is left as it was: where a state on the way is out of reach, the march may still succeed.
    """
    shape, spacing = plane.conserved.shape, grid.spacing(plane.conserved.shape[2])
    # Mass flux, momentum and cross-flow momentum (c_inf = 1) are made comparable with the relative radius.
    size = np.array([stream.u, stream.u**2, stream.u, stream.u])[:, None, None]

    def packed() -> FloatArray:
        return np.concatenate([(plane.conserved / size).ravel(), plane.outer])

    def unpack(state: FloatArray) -> None:
        plane.conserved = state[: plane.conserved.size].reshape(shape) * size
        plane.outer = state[plane.conserved.size :].copy()

    start, pressure = packed(), np.ones(shape[1])
    extrapolates = True
    results: list[FloatArray] = []
    moves: list[FloatArray] = []
    for _ in range(MAX_ROUNDS):
        before, pressure_before, outer_before = packed(), pressure.copy(), plane.outer.copy()
        status = sweep(plane.conserved, plane.outer, spacing, plane.rays, slope, stream, pressure=pressure)
        if status != REACHED_END and not results:
            break
        change = change_between(pressure_before, pressure, outer_before, plane.outer)
        imbalance = cone_imbalance(plane, slope, GAMMA * pressure, stream, grid)
        if status == REACHED_END and max(change, imbalance) < tolerance:
            return True
        after = packed()
        # Moves of the cells alone are weighed: half a body and the whole then take the same way.
        move = (after - before)[: plane.conserved.size]
        leads_away = len(results) > 1 and np.linalg.norm(move) > np.linalg.norm(moves[-1])
        if status != REACHED_END or leads_away:
            unpack(results[-1])
            extrapolates, results, moves = False, [], []
        elif change < NEAR and extrapolates:
            results, moves = [*results[1 - DEPTH :], after], [*moves[1 - DEPTH :], move]
            if len(results) > 1:
                unpack(extrapolate(results, moves))
    unpack(start)
    return False
