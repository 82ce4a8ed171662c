"""From tip to base: conical start, then marching along the meridian.

The flow over the tip is conical, so marching over ever larger cones until nothing changes gives it: first
on half the grid, then on the whole. A body that begins with a straight segment is done up to that
segment's end; the rest is marched segment by segment, so that slope breaks are met exactly.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import atan, degrees, pi

import numpy as np
from numpy.typing import NDArray

from builder.aero.euler import grid as cross_plane
from builder.aero.euler import march
from builder.aero.euler.gas import GAMMA
from builder.aero.euler.marching_grid import MarchingGrid
from builder.geometry import BodyOfRevolution
from strainfmu.errors import FlowReachError

FloatArray = NDArray[np.float64]

COURANT = 0.9
MAX_STEPS = 20_000
LEG = 1.5
"""Growth of x over one leg of the conical start."""
MAX_LEGS = 25
LARGEST_MASS_DEFECT = 1e-5
"""Imbalance of mass, over the free stream through the base, that a settled conical start may have."""
LARGEST_UNREST = 0.02
"""Change over a leg above which a conical start that has not settled is refused."""
OGIVE_START = 0.01
"""Share of the first segment's length that is taken as a cone where that segment is curved."""


@dataclass(frozen=True)
class FlowSolution:
    """Wall pressure of one flow, and how well it was computed.

    Attributes
    ----------
    mach_number, incidence : M [1], total incidence a_T [rad].
    roll_angle : (n_phi,) cell centres from the leeward meridian [rad], 0..pi.
    pieces : per smooth piece of the meridian (stations (n,) [m], p/p_inf (n, n_phi)).
    force : (2,) axial and normal force of p - p_inf from the wall fluxes, over p_inf [m2].
    force_from_momentum : (2,) the same from the momentum deficit of the exit plane [m2].
    mass_defect : relative imbalance of mass over the control volume.
    conical_change : relative change of wall pressure and shock radius in the last leg of the conical start.
    n_steps : marching steps taken.
    n_repairs : face states that fell back to first order to stay physical, after the conical start.
    """

    mach_number: float
    incidence: float
    roll_angle: FloatArray
    pieces: tuple[tuple[FloatArray, FloatArray], ...]
    force: FloatArray
    force_from_momentum: FloatArray
    mass_defect: float
    conical_change: float
    n_steps: int
    n_repairs: int


@dataclass
class _Plane:
    """State of the march at one station: E, outer boundary and what has been summed so far."""

    x: float
    conserved: FloatArray
    outer: FloatArray
    force: FloatArray
    n_steps: int = 0
    repairs: NDArray[np.int64] = field(default_factory=lambda: np.zeros(1, dtype=np.int64))


def solve_flow(
    body: BodyOfRevolution, mach_number: float, incidence: float, grid: MarchingGrid | None = None
) -> FlowSolution:
    """Solve the inviscid flow over ``body`` at Mach number M and total incidence a_T [rad].

    Raises
    ------
    FlowReachError
        The axial Mach number falls to 1, the wall shock detaches or the bow shock leaves the grid; the
        message names the station and the condition.
    """
    grid = grid or MarchingGrid()
    # One compiled version of the march serves all calls if every scalar is a float.
    mach_number, incidence = float(mach_number), float(incidence)
    if not mach_number > 1.0:
        raise FlowReachError(f"euler: Mach number {mach_number:g} found, must be greater than 1")
    first = body.segments[0]
    start = float(first.end_x if first.is_straight else OGIVE_START * first.end_x)
    start_angle = atan(float(body.radius(start)) / start)
    plane, cone_pressure, change = _conical_start(start_angle, start, mach_number, incidence, grid)
    stations, pressures = [np.array([0.0, start])], [np.stack([cone_pressure, cone_pressure])]
    pieces: list[tuple[FloatArray, FloatArray]] = []
    for segment in body.segments:
        if segment.start_x in body.slope_breaks:
            pieces.append((np.concatenate(stations), np.concatenate(pressures)))
            stations, pressures = [], []
        if segment.end_x <= plane.x:
            continue
        parameters = np.array(
            [segment.start_x, segment.start_radius, segment.start_angle, segment.end_angle, segment.end_x]
        )
        x, pressure = _advance(plane, parameters, segment.end_x, mach_number, incidence, grid)
        stations.append(x)
        pressures.append(pressure)
    pieces.append((np.concatenate(stations), np.concatenate(pressures)))
    momentum, mass_defect = _momentum_balance(plane, body.base_radius, mach_number, incidence, grid)
    n_phi = grid.n_circumferential
    return FlowSolution(
        mach_number=mach_number,
        incidence=incidence,
        roll_angle=(np.arange(n_phi) + 0.5) * pi / n_phi,
        pieces=tuple(pieces),
        force=plane.force,
        force_from_momentum=momentum,
        mass_defect=mass_defect,
        conical_change=change,
        n_steps=plane.n_steps,
        n_repairs=int(plane.repairs[0]),
    )


def _conical_start(
    half_angle: float, x: float, mach_number: float, incidence: float, grid: MarchingGrid
) -> tuple[_Plane, FloatArray, float]:
    """Return the plane at ``x`` of a cone's flow, its p/p_inf (n_phi,) and the last change."""
    cone = np.array([0.0, 0.0, half_angle, half_angle, np.inf])
    coarse = MarchingGrid(max(grid.n_radial // 2, 8), max(grid.n_circumferential // 2, 8), grid.clustering)
    mach_angle = np.arcsin(1.0 / mach_number)
    reach = 1.3 * np.tan(min(mach_angle + max(half_angle, incidence), 1.3))
    plane = _Plane(
        x=1.0,
        conserved=_free_stream(mach_number, incidence, coarse),
        outer=np.full(coarse.n_circumferential + 1, reach),
        force=np.zeros(2),
    )
    _settle(plane, cone, mach_number, incidence, coarse)
    plane = _prolong(plane, coarse, grid)
    pressure, change = _settle(plane, cone, mach_number, incidence, grid)
    plane.x, plane.outer = x, plane.outer * x
    plane.repairs[:] = 0  # what the impulsive start needed says nothing of the flow
    area = (x * np.tan(half_angle)) ** 2
    around = (np.arange(grid.n_circumferential) + 0.5) * pi / grid.n_circumferential
    plane.force = area * np.array(
        [pi * np.mean(pressure - 1.0), -pi * np.mean(pressure * np.cos(around)) / np.tan(half_angle)]
    )
    return plane, pressure, change


def _settle(
    plane: _Plane, cone: FloatArray, mach_number: float, incidence: float, grid: MarchingGrid
) -> tuple[FloatArray, float]:
    """March a cone leg by leg, shrinking the plane back to x = 1, until it changes no more.

    Returns p/p_inf (n_phi,) and the relative change of it or of the shock's radius over the last leg.
    Raises FlowReachError where that is still large after all legs.
    """
    pressure, change = np.ones(grid.n_circumferential), np.inf
    for _ in range(MAX_LEGS):
        before, shock = pressure, plane.outer.copy()
        _, pressures = _advance(plane, cone, LEG, mach_number, incidence, grid)
        plane.outer /= LEG
        plane.x = 1.0
        pressure = pressures[-1]
        change = float(max(np.max(np.abs(pressure / before - 1.0)), np.max(np.abs(plane.outer / shock - 1.0))))
        _, mass_defect = _momentum_balance(plane, float(np.tan(cone[2])), mach_number, incidence, grid)
        if change < grid.conical_tolerance and abs(mass_defect) < LARGEST_MASS_DEFECT:
            break
    if change > LARGEST_UNREST:
        raise FlowReachError(
            f"euler: the flow over the tip does not settle for M {mach_number:g}, total incidence "
            f"{degrees(incidence):.4g} deg: it still changes by {change:.1%} over a leg"
        )
    return pressure, change


def _advance(
    plane: _Plane,
    segment: FloatArray,
    x_end: float,
    mach_number: float,
    incidence: float,
    grid: MarchingGrid,
) -> tuple[FloatArray, FloatArray]:
    """March ``plane`` to ``x_end`` and return stations (n,) and p/p_inf (n, n_phi)."""
    n_phi = grid.n_circumferential
    stations, pressures = np.empty(MAX_STEPS), np.empty((MAX_STEPS, n_phi))
    status, n_steps, x = march.march(
        plane.conserved,
        plane.outer,
        grid.spacing(grid.n_radial),
        segment,
        float(plane.x),
        float(x_end),
        mach_number,
        incidence,
        COURANT,
        stations,
        pressures,
        plane.force,
        plane.repairs,
    )
    if status != march.REACHED_END:
        reasons = {
            march.AXIAL_SONIC: "the axial Mach number falls to 1",
            march.WALL_DETACHED: "the axial Mach number falls to 1, the shock at the wall detaches,",
            march.OUT_OF_STEPS: f"more than {MAX_STEPS} marching steps are needed",
        }
        conical = np.isinf(segment[4])
        raise FlowReachError(
            f"euler: {reasons[status]} at x = {0.0 if conical else x:.4g} m{' (tip)' if conical else ''} "
            f"for M {mach_number:g}, total incidence {degrees(incidence):.4g} deg: outside the solver's reach"
        )
    plane.x = x_end
    plane.n_steps += n_steps
    return stations[:n_steps].copy(), GAMMA * pressures[:n_steps]


def _free_stream(mach_number: float, incidence: float, grid: MarchingGrid) -> FloatArray:
    """Return E (4, n_phi, n_r) of the undisturbed stream."""
    u, w = mach_number * np.cos(incidence), mach_number * np.sin(incidence)
    state = np.array([u, u * u + 1.0 / GAMMA, 0.0, u * w])
    return np.tile(state[:, None, None], (1, grid.n_circumferential, grid.n_radial))


def _prolong(plane: _Plane, coarse: MarchingGrid, fine: MarchingGrid) -> _Plane:
    """Put a plane of the coarse grid on the fine one by linear interpolation."""

    def weights(n_fine: int, n_coarse: int) -> FloatArray:
        """Return (n_fine, n_coarse): values at fine cell centres from those at coarse ones."""
        centre = (np.arange(n_fine) + 0.5) / n_fine
        known = (np.arange(n_coarse) + 0.5) / n_coarse
        return np.stack([np.interp(centre, known, unit) for unit in np.eye(n_coarse)], axis=1)

    around = weights(fine.n_circumferential, coarse.n_circumferential)
    outward = weights(fine.n_radial, coarse.n_radial)
    conserved = np.ascontiguousarray(np.einsum("jb,kbc,ic->kji", around, plane.conserved, outward))
    angle = np.linspace(0.0, 1.0, fine.n_circumferential + 1)
    outer = np.interp(angle, np.linspace(0.0, 1.0, coarse.n_circumferential + 1), plane.outer)
    return _Plane(plane.x, conserved, outer, np.zeros(2))


def _momentum_balance(
    plane: _Plane, base_radius: float, mach_number: float, incidence: float, grid: MarchingGrid
) -> tuple[FloatArray, float]:
    """Return the force (axial, normal) [m2] from the momentum of the exit plane, and the mass defect.

    Control volume: free stream on the outer boundary, body, exit plane. With E the flux through planes of
    x, the force of p - p_inf is the free stream's flux through the whole exit disc less the flow's through
    its annulus, less p_inf times the base area.
    """
    spacing = grid.spacing(grid.n_radial)
    vertex = np.empty((2, grid.n_circumferential + 1, grid.n_radial + 1))
    area = np.empty((grid.n_circumferential, grid.n_radial))
    cross_plane.place_vertices(base_radius, plane.outer, spacing, vertex)
    cross_plane.cell_areas(vertex, area)
    free_stream = _free_stream(mach_number, incidence, grid)
    base_area = pi * base_radius**2
    deficit = 2.0 * np.sum((free_stream - plane.conserved) * area, axis=(1, 2)) + free_stream[:, 0, 0] * base_area
    force = GAMMA * np.array([deficit[1] - base_area / GAMMA, deficit[3]])
    return force, float(deficit[0] / (free_stream[0, 0, 0] * base_area))
