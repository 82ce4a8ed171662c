"""Start of the march behind a spherical tip.

The flow over a sphere does not know the body's axis: solved once about the wind
(:mod:`~builder.aero.euler.starts.sphere_flow`), it is cut by a plane across the axis. The cut lies on the cap, so
far back that the flow through it is supersonic along the axis, also on the windward side: nothing behind it, the
end of the cap above all, is felt there. Ahead of it the wall has the sphere's pressure.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import ceil, cos, degrees, hypot, radians, sin, sqrt

import numpy as np
from scipy.optimize import brentq

from builder.aero.euler.planes import Flow, MarchingGrid, Plane
from builder.aero.euler.scheme.gas import GAMMA
from builder.aero.euler.scheme.grid import Rays
from builder.aero.euler.scheme.reconstruction import Stream
from builder.aero.euler.starts.sphere_flow import SphereFlow, solve_sphere
from strainfmu.arrays import FloatArray
from strainfmu.errors import FlowReachError

START_MACH_NUMBER = 1.15
"""Axial Mach number on the windward wall at which the march begins, if the cap reaches so far back."""
LEAST_MACH_NUMBER = 1.05
"""Smallest axial Mach number in the plane with which the march may begin."""
FIRST_ANGLE = radians(50.0)
"""Place on the cap, as angle at its centre from the tip, from which on the first plane is sought."""
ANGLE_STEP = radians(1.0)
REACH_STEP_DEG = 5
"""Reaches of the sphere's flow are multiples of this: planes of many incidences share one."""
KNOWN_REACH_DEG = 75
LARGEST_REACH_DEG = 110
LONGEST_CAP = radians(85.0)
"""Largest angle round its centre of a cap that stands for another tip."""
RINGS = 96
"""Rings over which the pressure on the cap is integrated; stations lie at every third of their edges."""
BISECTIONS = 45
FARTHEST = 10.0
"""Distance from the axis, over the cap's radius, within which the shock is sought."""
GAUSS = 0.5 / np.sqrt(3.0)
"""Distance of the two Gauss points of a cell from its middle, over its height."""


TIP_GRID_LENGTH = 25.0
"""Length, over the cap's radius, behind the cut on which the march keeps the tip's grid."""
TIP_GRID_CELLS = 2.0
"""Radial cells of the tip's grid over the cells of the body's; it is as fine at the wall."""


def tip_grid(grid: MarchingGrid) -> MarchingGrid:
    """Return the grid for the layer behind a cap: its entropy varies all across it, not at the wall alone."""
    if not grid.clustering:
        return grid
    cells = round(TIP_GRID_CELLS * grid.n_radial)
    wall = grid.spacing(grid.n_radial)[1]
    clustering = brentq(lambda c: np.expm1(c / cells) / np.expm1(c) - wall, 1e-6, grid.clustering)
    return replace(grid, n_radial=cells, clustering=float(clustering))


@dataclass(frozen=True)
class Cap:
    """A spherical tip: its radius [m], and the angle at its centre [rad] from the tip to its end."""

    radius: float
    end_angle: float


@dataclass(frozen=True, eq=False)
class CapStart:
    """Where the march begins behind a cap: its plane, and what the tip ahead of it bears.

    Attributes
    ----------
    plane : at the last of the stations; its force is that on the cap ahead of it.
    angle : place of the plane on the cap, at its centre from the tip [rad].
    stations : (n,) from the tip [m].
    pressure : (n, n_phi) p/p_inf there.
    residual : of the sphere's flow.
    """

    plane: Plane
    angle: float
    stations: FloatArray
    pressure: FloatArray
    residual: float


def start_behind_cap(cap: Cap, rays: Rays, flow: Flow, grid: MarchingGrid) -> CapStart:
    """Return the start of the march over a body with the tip ``cap``.

    Raises
    ------
    FlowReachError
        The flow over the cap is not found, or nowhere on it supersonic along the axis.
    """
    try:
        for angle in _angles(cap, flow):
            sphere = _sphere_for(angle, flow)
            plane, mach_number = _cut(sphere, cap, angle, rays, flow.stream, grid)
            if mach_number >= LEAST_MACH_NUMBER:
                stations, pressure = _wear_cap(sphere, cap, angle, plane, flow.stream)
                return CapStart(plane, angle, stations, pressure, sphere.residual)
    except FlowReachError as error:
        raise flow.refusal(str(error).removeprefix("euler: ")) from error
    end = cap.radius * (1.0 - cos(cap.end_angle))
    raise flow.refusal(
        f"the axial Mach number is below {LEAST_MACH_NUMBER} where the spherical tip ends, x = {end:.4g} m,"
    )


def begin_angle(rays: Rays, flow: Flow, grid: MarchingGrid) -> float:
    """Return the angle at the centre of a sphere [rad] up to which a cap must reach for a march to begin on it.

    Raises
    ------
    FlowReachError
        As :func:`start_behind_cap`.
    """
    return start_behind_cap(Cap(1.0, LONGEST_CAP), rays, flow, grid).angle


def _angles(cap: Cap, flow: Flow) -> Iterator[float]:
    """Yield places of the plane on the cap, from where the windward wall has START_MACH_NUMBER on."""
    lean, furthest = _lean(flow.stream), radians(KNOWN_REACH_DEG)
    sphere = solve_sphere(flow.mach_number, furthest)
    angle = FIRST_ANGLE
    while angle < cap.end_angle:
        windward = min(max(angle - lean, 0.0), furthest)
        p, rho, _, v = sphere.state(np.array([windward]), np.ones(1))
        if v[0] * sin(angle) >= START_MACH_NUMBER * sqrt(GAMMA * p[0] / rho[0]):
            yield angle
        angle += ANGLE_STEP
    yield cap.end_angle


def _lean(stream: Stream) -> float:
    """Return the total incidence [rad]."""
    return float(np.arctan2(hypot(stream.v, stream.w), stream.u))


def _sphere_for(angle: float, flow: Flow) -> SphereFlow:
    """Return a flow over the sphere that reaches as far as the plane at ``angle`` [rad] does, shock and lee."""
    lean = _lean(flow.stream)
    first = REACH_STEP_DEG * ceil(degrees(angle + lean) / REACH_STEP_DEG)
    for reach_deg in range(max(first, KNOWN_REACH_DEG), LARGEST_REACH_DEG + 1, REACH_STEP_DEG):
        reach = radians(reach_deg)
        sphere = solve_sphere(flow.mach_number, reach)
        if float(sphere.shock_radius(np.array([reach]))[0]) * cos(reach - lean) < cos(angle):
            return sphere
    raise FlowReachError(f"euler: the plane on the spherical tip lies past {LARGEST_REACH_DEG} deg from the wind")


def _from_wind(
    angle: float, distance: FloatArray, sine: FloatArray, cosine: FloatArray, stream: Stream
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return theta [rad], r, and the unit vectors (3, ..) along r and theta of points in the plane at ``angle``.

    ``distance`` from the axis and r are over the cap's radius; ``sine`` and ``cosine`` are of roll angles.
    """
    position = np.stack(np.broadcast_arrays(-cos(angle), distance * sine, distance * cosine))
    velocity = np.array([stream.u, stream.v, stream.w])
    wind = (velocity / np.linalg.norm(velocity)).reshape(3, *(1,) * (position.ndim - 1))
    r = np.linalg.norm(position, axis=0)
    outward = position / r
    cosine_theta = np.clip(-np.sum(outward * wind, axis=0), -1.0, 1.0)
    theta = np.arccos(cosine_theta)
    along = (wind + cosine_theta * outward) / np.maximum(np.sin(theta), 1e-12)
    return theta, r, outward, along


def _shock_on(
    sphere: SphereFlow, angle: float, sine: FloatArray, cosine: FloatArray, stream: Stream
) -> FloatArray:
    """Return the shock's distance from the axis (n,), over the cap's radius, in the plane at ``angle`` [rad]."""
    near, far = np.full(sine.shape, sin(angle)), np.full(sine.shape, FARTHEST)
    for _ in range(BISECTIONS):
        middle = 0.5 * (near + far)
        theta, r, _, _ = _from_wind(angle, middle, sine, cosine, stream)
        inside = r < sphere.shock_radius(np.minimum(theta, sphere.nodes.reach))
        near, far = np.where(inside, middle, near), np.where(inside, far, middle)
    return np.asarray(0.5 * (near + far))


def _cut(
    sphere: SphereFlow, cap: Cap, angle: float, rays: Rays, stream: Stream, grid: MarchingGrid
) -> tuple[Plane, float]:
    """Return the plane at ``angle`` [rad] of the cap and the smallest axial Mach number in it.

    Cells hold the mean over two Gauss points along their middle ray, weighted by radius.
    """
    spacing = grid.spacing(grid.n_radial)
    middle, height = 0.5 * (spacing[1:] + spacing[:-1]), np.diff(spacing)
    outer = _shock_on(sphere, angle, rays.cell_sine, rays.cell_cosine, stream)[:, None]
    conserved, weights, mach_number = 0.0, 0.0, np.inf
    for share in (-GAUSS, GAUSS):
        distance = sin(angle) + (outer - sin(angle)) * (middle + share * height)
        theta, r, outward, along = _from_wind(
            angle, distance, rays.cell_sine[:, None], rays.cell_cosine[:, None], stream
        )
        p, rho, radial, tangential = sphere.state(theta, r)
        u, v, w = radial * outward + tangential * along
        conserved = conserved + distance * np.stack([rho * u, rho * u * u + p, rho * u * v, rho * u * w])
        weights = weights + distance
        mach_number = min(mach_number, float(np.min(u / np.sqrt(GAMMA * p / rho))))
    plane = Plane(
        x=cap.radius * (1.0 - cos(angle)),
        rays=rays,
        conserved=np.ascontiguousarray(conserved / weights),
        outer=cap.radius * _shock_on(sphere, angle, rays.sine, rays.cosine, stream),
    )
    return plane, mach_number


def _wear_cap(
    sphere: SphereFlow, cap: Cap, angle: float, plane: Plane, stream: Stream
) -> tuple[FloatArray, FloatArray]:
    """Return stations (n,) [m] and p/p_inf (n, n_phi) on the cap; the force of ``plane`` becomes the cap's."""
    rays = plane.rays

    def ratio(angles: FloatArray) -> FloatArray:
        """Return p/p_inf (n, n_phi) at angles (n,) [rad] at the cap's centre."""
        rows = [_from_wind(a, np.array(sin(a)), rays.cell_sine, rays.cell_cosine, stream)[0] for a in angles]
        return GAMMA * sphere.wall_pressure(np.stack(rows))

    edge = np.linspace(0.0, angle, RINGS + 1)
    x, r = cap.radius * (1.0 - np.cos(edge)), cap.radius * np.sin(edge)
    excess = ratio(0.5 * (edge[1:] + edge[:-1])) - 1.0
    # The chords are as long as those of the march's rays (place_vertices).
    swell = sqrt(rays.step / sin(rays.step))
    ahead, aside = 0.5 * rays.step * np.diff(r**2), 0.5 * swell * (r[1:] + r[:-1]) * np.diff(x)
    on_rays = aside @ excess
    plane.force = np.array(
        [np.sum(ahead @ excess), np.sum(on_rays * np.diff(rays.cosine)), -np.sum(on_rays * np.diff(rays.sine))]
    )
    stations = edge[::3]
    return cap.radius * (1.0 - np.cos(stations)), ratio(stations)
