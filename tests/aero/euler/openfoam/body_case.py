"""Flow over a pointed body by OpenFOAM's rhoCentralFoam, from the mesh to the wall pressure.

Inviscid perfect gas, gamma 1.4, in units in which the free stream's pressure, temperature and sound speed are 1.
The mesh is structured: cell (i, j, k) lies between stations x_i, x_i+1, roll angles phi_j, phi_j+1 (0 on +z, the
leeward side, to pi) and the k-th and next layer from the wall outward. The outer boundary is a cone around the
bow shock. The tip is cut off: the free stream enters through the ring around the first station.

The flow is supersonic along the body, so nothing travels upstream: the body is done in windows of a few
planes, each run to its steady state with local time steps, the last plane of one entering the next.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from math import cos, pi, sin, sqrt
from pathlib import Path

import numpy as np

from builder.vehicle.shape.geometry import BodyOfRevolution
from openfoam.case_files import State, read_state, run_solver, write_case
from strainfmu.arrays import FloatArray

OVERLAP = 2
"""Planes at a window's end that the next one does again, for the outlet's sake."""


@dataclass(frozen=True, eq=False, kw_only=True)
class FlowCase(ABC):
    """One flow in the plane y = 0 of symmetry, and the mesh of half a body.

    Attributes
    ----------
    mach_number, incidence : M [1], total incidence a_T [rad].
    stations : (n_x + 1,) planes of the mesh [m], the first a little aft of the tip.
    n_circumferential, n_radial : cells over the half body and from wall to outer boundary.
    clustering : cells grow outward by exp(clustering) from the wall to the outer boundary.
    outer_angles : angles of the outer boundary to the body's axis at the leeward side, between and at the
        windward side [rad]; the nearer it follows the bow shock, the less noise the captured shock makes.
    """

    mach_number: float
    incidence: float
    stations: FloatArray
    n_circumferential: int
    n_radial: int
    clustering: float
    outer_angles: tuple[float, float, float]

    @property
    def n_cells(self) -> int:
        return (len(self.stations) - 1) * self.n_circumferential * self.n_radial

    @property
    def velocity(self) -> tuple[float, float, float]:
        """Free stream's velocity over its sound speed."""
        return self.mach_number * cos(self.incidence), 0.0, self.mach_number * sin(self.incidence)

    @property
    def swell(self) -> float:
        """The factor that gives a chord polygon the area of its circle, or of an ellipse, its projection."""
        step = pi / self.n_circumferential
        return sqrt(step / sin(step))

    @abstractmethod
    def sides(self) -> tuple[FloatArray, FloatArray]:
        """Return y and z [m] of wall and outer boundary, each (n_x + 1, n_phi + 1, 2), leeward to windward."""

    @cached_property
    def vertices(self) -> FloatArray:
        """(n_x + 1, n_phi + 1, n_r + 1, 3) vertices of the mesh [m]."""
        wall, outer = (side[:, :, None] for side in self.sides())
        share = np.expm1(np.linspace(0.0, self.clustering, self.n_radial + 1)) / np.expm1(self.clustering)
        across = wall + (outer - wall) * share[:, None]
        across[:, [0, -1], :, 0] = 0.0  # exactly on the symmetry plane
        x = np.broadcast_to(self.stations[:, None, None, None], (*across.shape[:3], 1))
        return np.concatenate([x, self.swell * across], axis=-1)


@dataclass(frozen=True, eq=False, kw_only=True)
class BodyCase(FlowCase):
    """Flow over a body of revolution, its meshes' planes even in roll angle."""

    body: BodyOfRevolution

    @property
    def roll_angle(self) -> FloatArray:
        """(n_phi,) roll angles of the cells [rad]."""
        return (np.arange(self.n_circumferential) + 0.5) * pi / self.n_circumferential

    def sides(self) -> tuple[FloatArray, FloatArray]:
        phi = np.linspace(0.0, pi, self.n_circumferential + 1)
        leeward, side, windward = self.outer_angles
        angle = 0.25 * (leeward + 2.0 * side + windward) + 0.5 * (leeward - windward) * np.cos(phi)
        angle += 0.25 * (leeward - 2.0 * side + windward) * np.cos(2.0 * phi)
        outer = self.stations[:, None] * np.tan(angle)
        wall = np.broadcast_to(self.body.radius(self.stations)[:, None], outer.shape)
        around = np.stack([np.sin(phi), np.cos(phi)], axis=-1)
        return wall[..., None] * around, outer[..., None] * around


@dataclass(frozen=True, eq=False, kw_only=True)
class Solution:
    """Wall pressure of a case, and what it took.

    Attributes
    ----------
    x : (n_x,) stations of the cells [m].
    pressure : (n_x, n_phi) p/p_inf on the wall.
    unrest : (n_x,) largest relative change of it in each ring over the last fifth of the iterations.
    cpu_seconds : user time of the solver's processes.
    """

    x: FloatArray
    pressure: FloatArray
    unrest: FloatArray
    cpu_seconds: float


def spread_stations(body: BodyOfRevolution, first: float, growth: float, largest: float) -> FloatArray:
    """Return planes from ``first`` [m] to the base, the slope breaks among them.

    Steps are ``growth`` x, as a conical flow wants them, up to ``largest`` [m],
    and begin with the first again at slope breaks.
    """
    ends = [*body.slope_breaks.tolist(), body.length]
    stations, origin, x = [first], 0.0, first
    for end in ends:
        piece = [x]
        while piece[-1] < end:
            piece.append(piece[-1] + min(growth * max(piece[-1] - origin, 5.0 * first), largest))
        # Stretched to meet the end.
        stations += [x + (station - x) * (end - x) / (piece[-1] - x) for station in piece[1:]]
        origin = x = end
    return np.array(stations)


def solve_case(case: FlowCase, directory: Path, window: int = 10, iterations: int = 400) -> Solution:
    """Run ``case`` in ``directory``, ``window`` planes at a time, each for a number of local time steps.

    The first window, where the bow shock has to form, gets four times as many.
    """
    n_x, n_phi, n_r = len(case.stations) - 1, case.n_circumferential, case.n_radial
    pressure, unrest, cpu_seconds = np.empty((n_x, n_phi)), np.empty(n_x), 0.0
    entering = State(np.ones((n_phi, n_r)), np.ones((n_phi, n_r)), np.broadcast_to(case.velocity, (n_phi, n_r, 3)))
    start, end = 0, 0
    while end < n_x:
        end = min(start + window, n_x)
        place = directory / f"planes_{start}"
        steps = iterations if start else 4 * iterations
        write_case(case.vertices[start : end + 1], case.velocity, entering, steps, place)
        cpu_seconds += run_solver(place)
        earlier = read_state(place / f"{steps - steps // 5}", (end - start, n_phi, n_r))
        state = read_state(place / f"{steps}", (end - start, n_phi, n_r))
        pressure[start:end] = _wall_pressure(state, case.vertices[start : end + 1])
        change = np.abs(state.pressure[:, :, 0] / earlier.pressure[:, :, 0] - 1.0)
        unrest[start:end] = change.max(axis=1)
        entering = _between(state, end - start - OVERLAP)
        start = end - OVERLAP
    return Solution(
        x=0.5 * (case.stations[1:] + case.stations[:-1]), pressure=pressure, unrest=unrest, cpu_seconds=cpu_seconds
    )


def _wall_pressure(state: State, vertices: FloatArray) -> FloatArray:
    """Return (n_x, n_phi) pressure on the wall, extrapolated from the centres of the two cells next to it."""
    height = np.linalg.norm(np.diff(vertices[1:, 1:, :3], axis=2), axis=-1)
    share = height[..., 0] / (height[..., 0] + height[..., 1])
    return state.pressure[..., 0] + share * (state.pressure[..., 0] - state.pressure[..., 1])


def _between(state: State, i: int) -> State:
    """Return the state on the plane between cells i - 1 and i."""
    return State(
        0.5 * (state.pressure[i - 1] + state.pressure[i]),
        0.5 * (state.temperature[i - 1] + state.temperature[i]),
        0.5 * (state.velocity[i - 1] + state.velocity[i]),
    )


def wall_faces(case: FlowCase) -> tuple[FloatArray, FloatArray]:
    """Return areas along the inward normal [m2] and centres [m] of the wall's faces, both (n_x, n_phi, 3)."""
    wall = case.vertices[:, :, 0]
    inward = 0.5 * np.cross(wall[1:, 1:] - wall[:-1, :-1], wall[1:, :-1] - wall[:-1, 1:])
    return inward, 0.25 * (wall[1:, 1:] + wall[:-1, :-1] + wall[1:, :-1] + wall[:-1, 1:])


def loads_ahead(case: BodyCase, pressure: FloatArray) -> FloatArray:
    """Return (n_x + 1, 2) normal force [m2] and its moment about the tip [m3] ahead of each plane, over p_inf.

    Both halves of the body count. The first half of the first segment carries a conical flow's load: that of
    the plane that ends it. This makes up for the tip, which is cut off, and for what the cut disturbs.
    """
    inward, centre = wall_faces(case)
    force = 2.0 * (pressure - 1.0)[..., None] * inward
    moment = force[..., 2] * centre[..., 0] - force[..., 0] * centre[..., 2]
    ring = np.stack([force[..., 2].sum(axis=1), moment.sum(axis=1)], axis=1)
    x = case.stations
    last = int(np.searchsorted(x, 0.5 * case.body.segments[0].end_x)) - 1
    power = np.array([2, 3])  # a cone's force grows with its length squared, the moment cubed
    ring[last] *= x[last + 1] ** power / (x[last + 1] ** power - x[last] ** power)
    ring[:last] = 0.0
    return np.concatenate([np.zeros((1, 2)), np.cumsum(ring, axis=0)])
