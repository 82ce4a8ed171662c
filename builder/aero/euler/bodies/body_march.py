"""March from tip to base: conical or spherical start, then step by step along the surface.

The flow over the tip is conical. It is relaxed, first on half the grid, then on the whole, and then marched over
ever larger cones until nothing changes, which after the relaxation is seldom more than one leg. The relaxation
begins with the free stream. That must turn at once by the whole angle of the tip, as at a wedge, whose shock
detaches at a higher Mach number than the cone's: where it does, the cone is opened step by step from a slender
one. A body that begins with a cone is done up to that cone's end; the rest is marched piece by piece, so that
slope breaks are met exactly. Round a convex one the flow is led by :mod:`~builder.aero.euler.bodies.corner`.
Behind a spherical tip :mod:`~builder.aero.euler.starts.spherical_start` gives the first plane. A curved tip whose
conical flow is out of reach is replaced by the smallest sphere, tangent to the wall, behind which the march can
begin; the tip has the sphere's pressure at the same inclination.
"""

from dataclasses import dataclass, replace
from itertools import pairwise
from math import atan, log

import numpy as np

from builder.aero.euler.bodies import corner
from builder.aero.euler.bodies.surface_function import CappedBody, capped_body, cone_wall
from builder.aero.euler.planes import (
    Flow,
    MarchingGrid,
    Plane,
    change_between,
    cone_force,
    cone_imbalance,
    free_stream,
    momentum_balance,
    refine,
)
from builder.aero.euler.scheme import march
from builder.aero.euler.scheme.gas import GAMMA, total_enthalpy
from builder.aero.euler.scheme.grid import Rays, Wall, find_wall, full_body_rays, half_body_rays, place_vertices
from builder.aero.euler.scheme.reconstruction import Stream
from builder.aero.euler.starts.flow_relaxation import relax_cone
from builder.aero.euler.starts.spherical_start import (
    TIP_GRID_LENGTH,
    Cap,
    begin_angle,
    start_behind_cap,
    tip_grid,
)
from builder.vehicle.toml.toml_sections import MACH_NUMBER
from strainfmu.arrays import FloatArray
from strainfmu.errors import FlowReachError

COURANT = 0.9
MAX_STEPS = 20_000
LEG = 1.1
"""Growth of x over one leg of the conical start."""
MAX_LEGS = 160
LARGEST_UNREST = 0.02
"""Change, while x grows by half, above which a conical start that has not settled is refused."""
COARSE_TOLERANCE = 0.01
"""Tolerance of the start on half the grid, from which that on the whole grid begins."""
ROUGH_TOLERANCE = 0.3
"""Tolerance to which the march takes an impulsive start before the relaxation, which failed on it, tries again."""
FIRST_OPENING = 0.25
"""Share of the tip's slope and of the cross-flow with which a cone that is opened step by step begins."""
LEAST_OPENING = 1.0 / 512.0
"""Smallest step of that share."""
OGIVE_START = 0.01
"""Fraction of the first piece's length that is taken as a cone where that piece is curved."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Marched:
    """What a march over a body gives; see :class:`~builder.aero.euler.bodies.solver.FlowSolution`.

    Forces (3,) along x, y, z are those on the body between the rays, over p_inf [m2]; ``capped`` is the body that
    was marched where a sphere stands for its tip.
    """

    pieces: tuple[tuple[FloatArray, FloatArray], ...]
    force: FloatArray
    force_from_momentum: FloatArray
    mass_defect: float
    conical_change: float
    n_steps: int
    n_repairs: int
    capped: CappedBody | None


def march_body(
    pieces: list[list[Wall]], rays: Rays, flow: Flow, grid: MarchingGrid, cap: Cap | None = None
) -> Marched:
    """March from tip to base over the walls of a body's smooth ``pieces``, behind a spherical tip if one is given.

    Raises
    ------
    FlowReachError
        The axial Mach number falls to 1, the wall shock detaches, the flow expands to near vacuum, the conical
        start does not settle or the flow over the spherical tip is not found.
    """
    try:
        plane, tip, change, capped = _start(pieces, rays, flow, grid, cap)
    except FlowReachError as error:
        if cap is not None:
            raise
        raise FlowReachError(f"{error}; {_ways_out(pieces, rays, flow, grid)}") from error
    if capped is not None:
        pieces = capped.pieces
    solved: list[tuple[FloatArray, FloatArray]] = []
    for number, piece in enumerate(pieces):
        stations = [tip[0]] if number == 0 else []
        pressures = [tip[1]] if number == 0 else []
        if number > 0:
            at_corner = _pressure_at_end(*solved[-1], plane.x) / GAMMA
            x, pressure = _round_corner(plane, pieces[number - 1][-1], piece[0], at_corner, flow, grid)
            stations.append(x)
            pressures.append(pressure)
        for wall in piece:
            if wall.x[-1] > plane.x:
                x, pressure = advance(plane, wall, float(wall.x[-1]), flow, grid)
                stations.append(x)
                pressures.append(pressure)
        solved.append((np.concatenate(stations), np.concatenate(pressures)))
    if capped is not None:
        solved = [capped.on_body(*piece) for piece in solved]
    momentum, mass_defect = momentum_balance(plane, pieces[-1][-1].radius[-1], flow.stream, grid)
    return Marched(
        pieces=tuple(solved),
        force=plane.force,
        force_from_momentum=momentum,
        mass_defect=mass_defect,
        conical_change=change,
        n_steps=plane.n_steps,
        n_repairs=int(plane.repairs[0]),
        capped=capped,
    )


def _start(
    pieces: list[list[Wall]], rays: Rays, flow: Flow, grid: MarchingGrid, cap: Cap | None
) -> tuple[Plane, tuple[FloatArray, FloatArray], float, CappedBody | None]:
    """Return the first plane, stations and p/p_inf ahead of it, the last change, and the body with a cap of ours.

    That cap is the smallest behind which the march can begin, where the conical flow is out of reach; None where
    the body's own tip is marched.
    """
    capped = None
    if cap is None:
        x = _end_of_cone(pieces[0][0])
        try:
            plane, pressure, change = _conical_start(pieces[0][0], x, rays, flow, grid)
            return plane, (np.array([0.0, x]), np.stack([pressure, pressure])), change, None
        except FlowReachError:
            capped = capped_body(pieces, lambda: begin_angle(rays, flow, tip_grid(grid)))
            if capped is None:
                raise
            pieces, cap = capped.pieces, capped.cap
    return *_spherical_start(pieces[0], cap, rays, flow, grid), capped


def _spherical_start(
    walls: list[Wall], cap: Cap, rays: Rays, flow: Flow, grid: MarchingGrid
) -> tuple[Plane, tuple[FloatArray, FloatArray], float]:
    """March the first smooth piece of a body with the tip ``cap`` as far as the tip's grid is used.

    Returns the plane there, on ``grid``, stations and p/p_inf (n, n_phi) up to it and the residual of the sphere.
    """
    fine = tip_grid(grid)
    begun = start_behind_cap(cap, rays, flow, fine)
    plane, stations, pressures = begun.plane, [begun.stations], [begun.pressure]
    end = min(plane.x + TIP_GRID_LENGTH * cap.radius, float(walls[-1].x[-1]))
    wall_radius, unused = np.empty((2, rays.sine.size))
    for wall in walls:
        to = min(end, float(wall.x[-1]))
        if to > plane.x:
            x, pressure = advance(plane, wall, to, flow, fine)
            stations.append(x)
            pressures.append(pressure)
        # A cut at the very end of the cap needs no march, and the wall there all the same.
        if wall.x[0] <= plane.x <= wall.x[-1]:
            find_wall(plane.x, wall, wall_radius, unused)
    corner.regrid(plane, wall_radius, fine, grid)
    return plane, (np.concatenate(stations), np.concatenate(pressures)), begun.residual


def _round_corner(
    plane: Plane, before: Wall, after: Wall, pressure: FloatArray, flow: Flow, grid: MarchingGrid
) -> tuple[FloatArray, FloatArray]:
    """March round a corner at which the wall turns away from the flow (:mod:`~builder.aero.euler.bodies.corner`).

    ``pressure`` (n_phi,) is p on the wall up to it. Returns stations and p/p_inf (n, n_phi) behind it; none where
    the march itself does: in a concave or slight corner, in one that expands the flow to vacuum, or where the
    wall's cells are as thick as all others.
    """
    n_phi, n_r = plane.conserved.shape[1:]
    cell, wave = np.empty((5, n_phi, n_r)), np.empty((4, n_phi + 2, n_r))
    turn = corner.turn_of(before, after)
    if (
        grid.corner == "marched"
        or not grid.clustering
        or turn < corner.LEAST_TURN
        or not march.decode(plane.conserved, plane.rays, flow.stream, cell, wave)
    ):
        return np.empty(0), np.empty((0, n_phi))
    angle = float(np.arctan(before.slope[-1, 0]))
    stream = corner.wall_stream(plane, cell, pressure, angle, flow.stream.enthalpy)
    if corner.is_vacuum(corner.pressure_ratio_behind(stream, turn)):
        return np.empty(0), np.empty((0, n_phi))
    saved = replace(
        plane,
        conserved=plane.conserved.copy(),
        outer=plane.outer.copy(),
        force=plane.force.copy(),
        repairs=plane.repairs.copy(),
    )
    try:
        return _through_fan(plane, before, after, stream, flow, grid)
    except FlowReachError:  # The march alone may still get through.
        vars(plane).update(vars(saved))
        return np.empty(0), np.empty((0, n_phi))


def _through_fan(
    plane: Plane, before: Wall, after: Wall, stream: corner.WallStream, flow: Flow, grid: MarchingGrid
) -> tuple[FloatArray, FloatArray]:
    """Let the fan of a corner in and march until it is wide enough for ``grid``; as :func:`_round_corner`."""
    x_corner, radius = float(plane.x), before.radius[-1]
    layer = float(np.min(plane.outer - radius))
    count = corner.levels_for(layer * grid.spacing(grid.n_radial)[1], float(radius[0]))
    levels = [corner.refined_at_wall(grid, level) for level in range(count + 1)]
    finest, length = levels[-1], float(after.x[-1]) - x_corner
    widening = float(np.max(np.tan(stream.head_angle))) - float(after.slope[0, 0])
    distance = corner.FAN_CELLS * layer * finest.spacing(finest.n_radial)[1] / widening
    distance = min(distance, 0.5 * length)
    corner.regrid(plane, radius, grid, finest)
    force = plane.force.copy()
    advance(plane, corner.straight_on(before, x_corner + distance), x_corner + distance, flow, finest)
    plane.force = force
    downstream = corner.let_fan_in(plane, before, after, stream, finest)
    stations, pressures = [np.array([x_corner + 0.5 * distance])], [GAMMA * downstream[None]]
    wall_radius, unused = np.empty((2, radius.size))
    for finer, coarser in pairwise(reversed(levels)):
        distance = min(2.0 * distance, length)
        if x_corner + distance > plane.x:
            x, ratio = advance(plane, after, x_corner + distance, flow, finer)
            stations.append(x)
            pressures.append(ratio)
        find_wall(plane.x, after, wall_radius, unused)
        corner.regrid(plane, wall_radius, finer, coarser)
    return np.concatenate(stations), np.concatenate(pressures)


def _pressure_at_end(stations: FloatArray, pressure: FloatArray, x: float) -> FloatArray:
    """Return p/p_inf (n_phi,) at ``x``, just past the last of ``stations``, on the line through the last two."""
    if len(stations) < 2:
        return pressure[-1]
    ahead = (x - stations[-1]) / (stations[-1] - stations[-2])
    return pressure[-1] + ahead * (pressure[-1] - pressure[-2])


def _end_of_cone(wall: Wall) -> float:
    """Return the station up to which a body is taken as a cone: the end of its first wall if that is one."""
    ratio = wall.radius[1:] / wall.x[1:, None]
    is_cone = np.allclose(ratio, ratio[-1], rtol=1e-9, atol=0.0)
    return float(wall.x[-1] if is_cone else OGIVE_START * wall.x[-1])


def _conical_start(
    wall: Wall, x: float, rays: Rays, flow: Flow, grid: MarchingGrid
) -> tuple[Plane, FloatArray, float]:
    """Return the plane at ``x`` of the flow over the tip, its p/p_inf (n_phi,) and the last change."""
    n_half, n_r = grid.n_circumferential, grid.n_radial
    n_coarse = max(n_half // 2, 8)
    coarse_rays = full_body_rays(n_coarse) if rays.closed else half_body_rays(n_coarse)
    coarse_r = max(n_r // 2, 8)
    radius, unused = np.empty((2, rays.sine.size))
    find_wall(x, wall, radius, unused)
    slope = radius / x
    # On the coarse rays the tip's slope is interpolated: this start only has to be near.
    fine_index, coarse_index = np.linspace(0.0, 1.0, slope.size), np.linspace(0.0, 1.0, coarse_rays.sine.size)
    coarse_slope = np.interp(coarse_index, fine_index, slope)
    lean = atan(float(np.hypot(flow.stream.v, flow.stream.w)) / flow.stream.u)
    mach_angle = np.arcsin(1.0 / flow.mach_number)
    reach = 1.3 * np.tan(min(mach_angle + max(atan(float(slope.max())), lean), 1.3))
    try:
        plane = _sudden_start(coarse_slope, coarse_rays, reach, coarse_r, flow, grid)
    except FlowReachError:
        plane = _opened_cone(coarse_slope, coarse_rays, reach, coarse_r, flow, grid)
    plane = refine(plane, rays, n_r)
    relax_cone(plane, slope, flow.stream, grid, grid.conical_tolerance)
    pressure, change = _settle(plane, slope, flow, grid, grid.conical_tolerance)
    plane.x, plane.outer = x, plane.outer * x
    plane.n_steps, plane.repairs[:] = 0, 0  # those of the impulsive start do not belong to the flow
    vertex = np.empty((2, radius.size, 2))
    place_vertices(radius, plane.outer, np.array([0.0, 1.0]), rays, vertex)
    plane.force = cone_force(x, vertex[:, :, 0], pressure)
    return plane, pressure, change


def _ways_out(pieces: list[list[Wall]], rays: Rays, flow: Flow, grid: MarchingGrid) -> str:
    """Return what helps where the flow over the tip is out of reach: Mach number, another engine."""
    mach_number = _lowest_mach_number(pieces, rays, flow, grid)
    mach = f"this tip needs M {mach_number:g} here" if mach_number else "no Mach number helps here"
    return f"{mach}; else take engine = 'newtonian'"


def _lowest_mach_number(pieces: list[list[Wall]], rays: Rays, flow: Flow, grid: MarchingGrid) -> float | None:
    """Return the lowest Mach number, in steps of 0.1, at which the flow over the tip is solved in this direction.

    That is a number above the flow's own; None if there is none up to the largest of a vehicle file.
    """

    def is_solved(tenths: int) -> bool:
        mach_number, ratio = tenths / 10.0, tenths / 10.0 / flow.mach_number
        u, v, w = (ratio * component for component in flow.stream[:3])
        stream = Stream(u=u, v=v, w=w, enthalpy=float(total_enthalpy(mach_number)))
        try:
            _start(pieces, rays, Flow(mach_number, stream, flow.name), grid, None)
        except FlowReachError:
            return False
        return True

    low, last = int(10.0 * flow.mach_number), int(10.0 * MACH_NUMBER.high)
    high = min(low + 4, last)
    while not is_solved(high):
        if high >= last:
            return None
        low, high = high, min(2 * high, last)
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if is_solved(middle) else (middle, high)
    return high / 10.0


def _undisturbed(stream: Stream, rays: Rays, reach: float, n_r: int) -> Plane:
    """Return the plane at x = 1 of the free stream inside the radius ``reach`` [m]."""
    n_phi = rays.cell_sine.size
    return Plane(x=1.0, rays=rays, conserved=free_stream(stream, n_phi, n_r), outer=np.full(n_phi + 1, reach))


def _sudden_start(slope: FloatArray, rays: Rays, reach: float, n_r: int, flow: Flow, grid: MarchingGrid) -> Plane:
    """Return the flow over the cone r = slope x, relaxed from the free stream within COARSE_TOLERANCE.

    Raises FlowReachError where the free stream cannot be turned by the cone's angle at once.
    """
    plane = _undisturbed(flow.stream, rays, reach, n_r)
    tolerance = max(COARSE_TOLERANCE, grid.conical_tolerance)
    for enough in (ROUGH_TOLERANCE, COARSE_TOLERANCE):
        if relax_cone(plane, slope, flow.stream, grid, tolerance):
            break
        _settle(plane, slope, flow, grid, max(enough, grid.conical_tolerance))
    return plane


def _opened_cone(slope: FloatArray, rays: Rays, reach: float, n_r: int, flow: Flow, grid: MarchingGrid) -> Plane:
    """Return the same, reached over more slender cones in less cross-flow, each from the flow over the one before.

    Raises FlowReachError where even LEAST_OPENING is too large a step: there the flow is out of reach.
    """
    stream, tolerance = flow.stream, max(COARSE_TOLERANCE, grid.conical_tolerance)
    square = stream.u**2 + stream.v**2 + stream.w**2
    plane = _undisturbed(stream._replace(u=square**0.5, v=0.0, w=0.0), rays, reach, n_r)
    done, step = 0.0, FIRST_OPENING
    while done < 1.0:
        share = min(done + step, 1.0)
        v, w = share * stream.v, share * stream.w
        partly = stream._replace(u=(square - v * v - w * w) ** 0.5, v=v, w=w)
        if relax_cone(plane, share * slope, partly, grid, tolerance):
            done, step = share, 2.0 * step
        elif step > LEAST_OPENING:
            step *= 0.5
        else:
            _settle(plane, share * slope, replace(flow, stream=partly), grid, tolerance)
            done = share
    return plane


def _settle(
    plane: Plane, slope: FloatArray, flow: Flow, grid: MarchingGrid, tolerance: float
) -> tuple[FloatArray, float]:
    """March a cone leg by leg, shrinking the plane back to x = 1, until it settles within ``tolerance``.

    It has settled when it changes no more than that and wall force, momentum and mass are that near to balance.
    Returns p/p_inf (n_phi,) and the change of it while x grows by half, at the pace of the last leg, relative to
    its mean, or of the shock's radius if that is larger. Raises FlowReachError where that is still large after all
    legs.
    """
    wall = cone_wall(slope, LEG)
    pressure, change = np.ones(plane.rays.cell_sine.size), np.inf
    for _ in range(MAX_LEGS):
        shock = plane.outer.copy()
        _, pressures = advance(plane, wall, LEG, flow, grid, tip=True)
        plane.outer /= LEG
        plane.x = 1.0
        pressure = pressures[-1]
        change = change_between(pressures[0], pressure, shock, plane.outer) * log(1.5) / log(LEG)
        if max(change, cone_imbalance(plane, slope, pressure, flow.stream, grid)) < tolerance:
            return pressure, change
    if change > LARGEST_UNREST:
        raise FlowReachError(
            f"euler: the flow over the tip does not settle for {flow.name}: "
            f"it still changes by {change:.1%} over a leg"
        )
    return pressure, change


def advance(
    plane: Plane, wall: Wall, x_end: float, flow: Flow, grid: MarchingGrid, *, tip: bool = False
) -> tuple[FloatArray, FloatArray]:
    """March ``plane`` to ``x_end`` and return stations (n,) and p/p_inf (n, n_phi)."""
    n_phi, n_r = plane.conserved.shape[1:]
    stations, pressures = np.empty(MAX_STEPS), np.empty((MAX_STEPS, n_phi))
    status, n_steps, x = march.march(
        conserved=plane.conserved,
        outer=plane.outer,
        spacing=grid.spacing(n_r),
        rays=plane.rays,
        wall=wall,
        x_start=float(plane.x),
        x_end=float(x_end),
        stream=flow.stream,
        courant=COURANT,
        stations=stations,
        pressures=pressures,
        force=plane.force,
        repairs=plane.repairs,
    )
    if status != march.REACHED_END:
        reasons = {
            march.AXIAL_SONIC: "the axial Mach number falls to 1",
            march.WALL_DETACHED: "the axial Mach number falls to 1, the shock at the wall detaches,",
            march.NEAR_VACUUM: "the flow expands to near vacuum",
            march.OUT_OF_STEPS: f"more than {MAX_STEPS} marching steps are needed",
        }
        raise flow.refusal(f"{reasons[status]} at x = {0.0 if tip else x:.4g} m{' (tip)' if tip else ''}")
    plane.x = x_end
    plane.n_steps += n_steps
    return stations[:n_steps].copy(), GAMMA * pressures[:n_steps]
