"""Way round a convex corner of the wall, where the flow expands in a centred fan.

A fan that begins in a corner is narrower than a cell at first. The mean of a cell that holds it has more entropy
than the flow has, by an amount that no finer grid reduces: cells are thinner, but the fan is as narrow against
them. The wall keeps that entropy, and the pressure behind the corner swings by some percent.

So the fan is placed into the flow where it is wide enough. The plane is put on a grid much finer at the wall and
marched a short way along the wall as it was before the corner. There, within the reach of the corner, the flow is
the expansion of Prandtl and Meyer, exact at the wall, and elsewhere what it would be without the corner. Then the
march goes on, and as the fan widens the grid is coarsened in steps back to its own. Near the corner the flow is
plane: curvature changes it by the height of the fan over the radius, 0.1 % where it is placed.

Bodies of revolution only: elsewhere the edge is not at right angles to the axis.
"""

from dataclasses import dataclass, replace
from math import ceil, expm1, log1p, log2

import numpy as np

from builder.aero.euler.planes import MarchingGrid, Plane
from builder.aero.euler.scheme.gas import GAMMA, MIN_PRESSURE_RATIO, expanded_pressure_ratio
from builder.aero.euler.scheme.grid import Step, Wall, find_wall, place_vertices
from builder.aero.euler.scheme.march import add_wall_force
from strainfmu.arrays import FloatArray

FAN_CELLS = 16
"""Cells at the wall over which a fan is spread when it is placed into the flow."""
LEAST_LEVELS, MOST_LEVELS = 5, 10
"""Times that the cells at the wall are halved for it."""
GREATEST_HEIGHT = 2e-3
"""Height of the fan over the radius above which they are halved more often than LEAST_LEVELS."""
LEAST_TURN = 1e-3
"""Turn of the wall away from the flow [rad] below which the march alone is good enough."""
FAN_POINTS = 129
SAMPLES = 16
"""Points of a cell at which the fan is taken."""


def refined_at_wall(grid: MarchingGrid, level: int) -> MarchingGrid:
    """Return ``grid`` with cells at the wall 2^level times as thin, growing outward at the same rate."""
    if level == 0:
        return grid
    clustering = log1p(2.0**level * expm1(grid.clustering))
    return replace(grid, n_radial=round(grid.n_radial * clustering / grid.clustering), clustering=clustering)


def levels_for(cell: float, radius: float) -> int:
    """Return how often cells at the wall, ``cell`` [m] thick, are halved at a corner of ``radius`` [m]."""
    needed = log2(FAN_CELLS * cell / (GREATEST_HEIGHT * radius))
    return min(max(ceil(needed), LEAST_LEVELS), MOST_LEVELS)


def turn_of(before: Wall, after: Wall) -> float:
    """Return by how much a wall turns away from the flow at a joint [rad]; 0 unless alike on all rays."""
    slopes = np.stack([before.slope[-1], after.slope[0]])
    if np.any(slopes != slopes[:, :1]) or np.any(after.radius[0] != after.radius[0, 0]):
        return 0.0
    return float(np.arctan(slopes[0, 0]) - np.arctan(slopes[1, 0]))


def straight_on(before: Wall, x_end: float) -> Wall:
    """Return the wall ``before`` continued straight from its end to ``x_end`` [m]."""
    start, slope, radius = float(before.x[-1]), before.slope[-1], before.radius[-1]
    return Wall(
        np.array([start, x_end]),
        np.stack([radius, radius + slope * (x_end - start)]),
        np.stack([slope, slope]),
    )


def cell_edges(radius: FloatArray, outer: FloatArray, spacing: FloatArray) -> FloatArray:
    """Return half the product of the radii of the cells' edges on their two rays (n_phi, n_r + 1) [m2].

    Its differences outward are the areas of the cells over the angle between rays.
    """
    r = radius[:, None] + (outer - radius)[:, None] * spacing
    return 0.5 * r[1:] * r[:-1]


def means_between(values: FloatArray, known: FloatArray, target: FloatArray) -> FloatArray:
    """Return means (k, n_phi, n) between ``target`` edges (n_phi, n + 1) of ``values`` (k, n_phi, m).

    ``known`` (n_phi, m + 1) are the edges of those, each linear in its cell with the smaller of its two slopes.
    Between the outermost edges nothing is lost. Where two edges coincide the mean is 0.
    """
    width, centre = np.diff(known), 0.5 * (known[:, 1:] + known[:, :-1])
    rise = np.diff(values, axis=2) / np.diff(centre)
    before, after = rise[:, :, :-1], rise[:, :, 1:]
    slope = np.zeros_like(values)
    slope[:, :, 1:-1] = np.where(
        before * after > 0.0, np.where(np.abs(before) < np.abs(after), before, after), 0.0
    )
    slope[:, :, 0] = rise[:, :, 0]
    total = np.concatenate([np.zeros((*values.shape[:2], 1)), np.cumsum(values * width, axis=2)], axis=2)
    result = np.empty((*values.shape[:2], target.shape[1] - 1))
    for j in range(values.shape[1]):
        cell = np.clip(np.searchsorted(known[j], target[j], side="right") - 1, 0, width.shape[1] - 1)
        t = target[j] - known[j, cell]
        up_to = total[:, j, cell] + t * (values[:, j, cell] + 0.5 * slope[:, j, cell] * (t - width[j, cell]))
        size = np.diff(target[j])
        result[:, j] = np.diff(up_to, axis=1) / np.where(size > 0.0, size, 1.0)
    return result


def regrid(plane: Plane, radius: FloatArray, old: MarchingGrid, new: MarchingGrid) -> None:
    """Put ``plane``, over a wall of ``radius`` (n_phi + 1,), from one grid on another; E is conserved."""
    known, target = (cell_edges(radius, plane.outer, grid.spacing(grid.n_radial)) for grid in (old, new))
    plane.conserved = means_between(plane.conserved, known, target)


@dataclass(frozen=True, eq=False, kw_only=True)
class WallStream:
    """The flow along the wall up to a corner, by column.

    Attributes
    ----------
    pressure, density, speed : (n_phi,), the speed in the plane through the axis.
    around : (n_phi,) velocity round the body, towards increasing roll angle.
    angle : of the wall [rad].
    """

    pressure: FloatArray
    density: FloatArray
    speed: FloatArray
    around: FloatArray
    angle: float

    @property
    def head_angle(self) -> FloatArray:
        """(n_phi,) angle of the Mach line from the corner, the head of its fan, from the axis [rad]."""
        return self.angle + np.arcsin(np.sqrt(GAMMA * self.pressure / self.density) / self.speed)


def wall_stream(plane: Plane, cell: FloatArray, pressure: FloatArray, angle: float, enthalpy: float) -> WallStream:
    """Return the flow on the wall of ``pressure`` (n_phi,) and ``angle`` [rad].

    Its entropy and velocity round the body are taken from the first cells of ``cell`` (5, n_phi, n_r): p, rho, u,
    v, w. Total ``enthalpy`` gives its speed.
    """
    p, rho, _, v, w = cell[:, :, 0]
    density = rho * (pressure / p) ** (1.0 / GAMMA)
    around = v * plane.rays.cell_cosine - w * plane.rays.cell_sine
    square = 2.0 * (enthalpy - GAMMA / (GAMMA - 1.0) * pressure / density) - around**2
    return WallStream(pressure=pressure, density=density, speed=np.sqrt(square), around=around, angle=angle)


def pressure_ratio_behind(stream: WallStream, turn: float) -> FloatArray:
    """Return p behind over p before (n_phi,) a corner that turns the wall away by ``turn`` [rad]."""
    mach = stream.speed / np.sqrt(GAMMA * stream.pressure / stream.density)
    return np.array([expanded_pressure_ratio(m, turn) for m in mach])


def is_vacuum(pressure_ratio: FloatArray) -> bool:
    """Return whether an expansion ends where the gas relations do, next to vacuum."""
    return bool(np.any(pressure_ratio <= MIN_PRESSURE_RATIO))


def fan_rays(stream: WallStream, j: int, turn: float) -> tuple[FloatArray, FloatArray]:
    """Return the rays of the fan of column ``j``: angles from the axis (n,) [rad], tail to head, and flow (4, n).

    The flow on them is p, rho, u and the velocity away from the axis (Prandtl-Meyer).
    """
    pressure, density, speed = float(stream.pressure[j]), float(stream.density[j]), float(stream.speed[j])
    mach = speed / np.sqrt(GAMMA * pressure / density)
    turns = np.linspace(turn, 0.0, FAN_POINTS)
    ratio = np.array([expanded_pressure_ratio(mach, part) for part in turns])
    p, rho = pressure * ratio, density * ratio ** (1.0 / GAMMA)
    flow = np.sqrt(speed**2 + 2.0 * GAMMA / (GAMMA - 1.0) * (pressure / density - p / rho))
    direction = stream.angle - turns
    angle = direction + np.arcsin(np.sqrt(GAMMA * p / rho) / flow)
    return angle, np.stack([p, rho, flow * np.cos(direction), flow * np.sin(direction)])


def let_fan_in(plane: Plane, before: Wall, after: Wall, stream: WallStream, grid: MarchingGrid) -> FloatArray:
    """Put the fan of the corner into ``plane``, which was marched straight on over the wall ``before``.

    Its force includes the force on the short piece of wall. Returns the wall pressure (n_phi,) behind the corner.
    """
    rays, spacing = plane.rays, grid.spacing(grid.n_radial)
    distance, corner_radius = plane.x - float(after.x[0]), after.radius[0]
    radius, unused = np.empty((2, corner_radius.size))
    find_wall(plane.x, after, radius, unused)
    turn = turn_of(before, after)
    known = cell_edges(corner_radius + before.slope[-1] * distance, plane.outer, spacing)
    target = cell_edges(radius, plane.outer, spacing)
    heads = 0.5 * (corner_radius[0] + distance * np.tan(stream.head_angle)) ** 2
    # Cells beyond the fan, and of the cell that holds its head the part beyond.
    result = means_between(plane.conserved, known, np.maximum(target, heads[:, None]))
    result *= np.diff(np.maximum(target, heads[:, None])) / np.diff(target)
    for j, head in enumerate(heads):
        angles, flow = fan_rays(stream, j, turn)
        reached = int(np.searchsorted(target[j, :-1], head))
        low, area = target[j, :reached], np.diff(target[j, : reached + 1])
        inside = np.minimum(target[j, 1 : reached + 1], head) - low
        half_square = low[:, None] + (np.arange(SAMPLES) + 0.5) / SAMPLES * inside[:, None]
        ray_angle = np.arctan((np.sqrt(2.0 * half_square) - corner_radius[0]) / distance)
        p, rho, u, outward = (np.interp(ray_angle, angles, row) for row in flow)
        v = outward * rays.cell_sine[j] + stream.around[j] * rays.cell_cosine[j]
        w = outward * rays.cell_cosine[j] - stream.around[j] * rays.cell_sine[j]
        means = np.stack([rho * u, rho * u * u + p, rho * u * v, rho * u * w]).mean(axis=2)
        result[:, j, :reached] += means * inside / area
        # Curvature makes a little mass too much or too little, of the order of the fan's height over the radius.
        missing = plane.conserved[0, j] @ np.diff(known[j]) - result[0, j] @ np.diff(target[j])
        result[:, j, :reached] *= 1.0 + missing / (result[0, j, :reached] @ area)
    plane.conserved = result
    pressure = stream.pressure * pressure_ratio_behind(stream, turn)
    vertices = np.empty((2, 2, radius.size, 2))
    for vertex, r in zip(vertices, (corner_radius, radius), strict=True):
        place_vertices(r, plane.outer, np.array([0.0, 1.0]), rays, vertex)
    add_wall_force(Step(vertices[0], vertices[1], distance), pressure, plane.force)
    return pressure
