"""Cross-planes of the march: resolution, the flow in each, and the balance of mass and momentum up to it."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from builder.aero.euler.scheme.gas import GAMMA
from builder.aero.euler.scheme.grid import Rays, cell_areas, place_vertices
from builder.aero.euler.scheme.reconstruction import Stream
from builder.vehicle.model_entries import Resolution
from strainfmu.arrays import FloatArray
from strainfmu.errors import FlowReachError


@dataclass(frozen=True, kw_only=True)
class MarchingGrid:
    """Resolution of the cross-plane.

    Attributes
    ----------
    n_radial : cells between body and outer boundary.
    n_circumferential : cells over half a turn: over the half body, leeward to windward.
    clustering : cells grow outward by exp(clustering) from the first to the last: at high incidence the vortical
        layer on the leeward side is thin, and the grid converges cleanly only if it is resolved.
    conical_tolerance : change of wall pressure (relative to its mean) and shock radius while x grows by half,
        imbalance of wall force and momentum, and ten times the imbalance of mass, that end the conical start.
    corner : how a convex corner of a body of revolution is passed. ``fan``: by a centred expansion
        (:mod:`~builder.aero.euler.bodies.corner`). ``marched``: by the march alone, which leaves the pressure
        behind the corner 0.5 to 1 % off on every grid and makes it swing by some percent.
    """

    n_radial: int = 24
    n_circumferential: int = 36
    clustering: float = 2.5
    conical_tolerance: float = 3e-4
    corner: Literal["fan", "marched"] = "fan"

    def spacing(self, n_radial: int) -> FloatArray:
        """Return (n_radial + 1,) vertex positions from 0 (wall) to 1 (outer boundary)."""
        t = np.linspace(0.0, 1.0, n_radial + 1)
        return np.expm1(self.clustering * t) / np.expm1(self.clustering) if self.clustering else t


def marching_grid_of(resolution: Resolution) -> MarchingGrid:
    """Return the grid of a resolution in a vehicle file."""
    return MarchingGrid(n_radial=resolution.radial_cells, n_circumferential=resolution.circumferential_cells)


GRID_LEVELS = {
    "coarse": MarchingGrid(n_radial=16, n_circumferential=24),
    "medium": MarchingGrid(n_radial=24, n_circumferential=36),
    "fine": MarchingGrid(n_radial=36, n_circumferential=54),
}
"""Grids by name, each 1.5 times finer than the one before; ``coarse`` is the default of a vehicle file.

Errors of C_N and C_A for the shipped vehicle against the value extrapolated from the three grids, and CPU time:

======  ==============  ==============  ===============  ===============  ==============
level   M 5, 8.478 deg  M 5, 8.478 deg  M 7, 14.106 deg  M 7, 14.106 deg  CPU s per flow
        C_N             C_A             C_N              C_A              0 .. 14 deg
======  ==============  ==============  ===============  ===============  ==============
coarse  0.2 %           1.0 %           1.0 %            < 0.1 %          0.04 .. 0.08
medium  0.1 %           0.4 %           0.6 %            < 0.1 %          0.1 .. 0.2
fine    < 0.1 %         0.2 %           0.4 %            < 0.1 %          0.2 .. 0.4
======  ==============  ==============  ===============  ===============  ==============
"""


@dataclass(frozen=True)
class Flow:
    """The flow to march: its free stream, and its name in messages."""

    mach_number: float
    stream: Stream
    name: str

    def refusal(self, reason: str) -> FlowReachError:
        return FlowReachError(f"euler: {reason} for {self.name}: outside the solver's reach")


MASS_WEIGHT = 10.0
"""How much more an imbalance of mass counts than one of force: 1e-5 of it is as bad as 1e-4 of the force."""


@dataclass(eq=False, kw_only=True)
class Plane:
    """State of the march at one station, and the sums up to it.

    Attributes
    ----------
    x : station [m].
    rays : the roll angles of its cells.
    conserved : (4, n_phi, n_r) E per unit area.
    outer : (n_phi + 1,) radius of the outer boundary on the rays [m].
    force : (3,) force of p - p_inf along x, y, z on the body between the rays, over p_inf [m2].
    """

    x: float
    rays: Rays
    conserved: FloatArray
    outer: FloatArray
    force: FloatArray = field(default_factory=lambda: np.zeros(3))
    n_steps: int = 0
    repairs: NDArray[np.int64] = field(default_factory=lambda: np.zeros(1, dtype=np.int64))


def free_stream(stream: Stream, n_phi: int, n_r: int) -> FloatArray:
    """Return E (4, n_phi, n_r) of the undisturbed stream."""
    u = stream.u
    state = np.array([u, u * u + 1.0 / GAMMA, u * stream.v, u * stream.w])
    return np.tile(state[:, None, None], (1, n_phi, n_r))


def refine(plane: Plane, rays: Rays, n_r: int) -> Plane:
    """Put a plane on a finer grid by linear interpolation in the index."""
    period = 1.0 if rays.closed else None

    def between_centres(n_fine: int, n_known: int, period: float | None) -> FloatArray:
        """Return (n_fine, n_known): values at fine cell centres from those at known ones."""
        centre, known = (np.arange(n_fine) + 0.5) / n_fine, (np.arange(n_known) + 0.5) / n_known
        return np.stack([np.interp(centre, known, unit, period=period) for unit in np.eye(n_known)], axis=1)

    around = between_centres(rays.cell_sine.size, plane.rays.cell_sine.size, period)
    outward = between_centres(n_r, plane.conserved.shape[2], None)
    conserved = np.ascontiguousarray(np.einsum("jb,kbc,ic->kji", around, plane.conserved, outward))
    known_angle = np.linspace(0.0, 1.0, plane.outer.size)
    outer = np.interp(np.linspace(0.0, 1.0, rays.sine.size), known_angle, plane.outer)
    return Plane(x=plane.x, rays=rays, conserved=conserved, outer=outer)


def momentum_balance(
    plane: Plane, radius: FloatArray, stream: Stream, grid: MarchingGrid
) -> tuple[FloatArray, float]:
    """Return the force (3,) [m2] from the momentum of the exit plane, between the rays, and the mass defect.

    ``radius`` (n_phi + 1,) is the body's on the rays. Control volume: free stream on the outer boundary, body,
    exit plane. With E the flux through planes of x, the force of p - p_inf is the free stream's flux through the
    whole exit section less the flow's through its annulus, less p_inf times the base area.
    """
    n_phi, n_r = plane.conserved.shape[1:]
    vertex, area = np.empty((2, n_phi + 1, n_r + 1)), np.empty((n_phi, n_r))
    place_vertices(radius, plane.outer, grid.spacing(n_r), plane.rays, vertex)
    cell_areas(vertex, area)
    undisturbed = free_stream(stream, n_phi, n_r)
    base_area = section_area(vertex[:, :, 0])
    deficit = np.sum((undisturbed - plane.conserved) * area, axis=(1, 2)) + undisturbed[:, 0, 0] * base_area
    force = GAMMA * (deficit[1:] - np.array([base_area / GAMMA, 0.0, 0.0]))
    return force, float(deficit[0] / (undisturbed[0, 0, 0] * base_area))


def section_area(corner: FloatArray) -> float:
    """Return the area [m2] between the rays of a section with corners (2, n_phi + 1)."""
    y, z = corner
    return float(0.5 * np.sum(y[1:] * z[:-1] - z[1:] * y[:-1]))


def cone_force(x: float, corner: FloatArray, pressure: FloatArray) -> FloatArray:
    """Return the force (3,) [m2] of p/p_inf (n_phi,) on the cone from tip to corners (2, n_phi + 1) at ``x``."""
    y, z = corner
    sx = -0.5 * (y[1:] * z[:-1] - z[1:] * y[:-1])
    sy, sz = -0.5 * x * np.diff(z), 0.5 * x * np.diff(y)
    return -np.array([np.sum((pressure - 1.0) * s) for s in (sx, sy, sz)])


def cone_imbalance(
    plane: Plane, slope: FloatArray, pressure: FloatArray, stream: Stream, grid: MarchingGrid
) -> float:
    """Return the imbalance of wall force and momentum over the cone r = slope x (n_phi + 1,), over the force.

    ``plane`` is at x = 1, ``pressure`` is p/p_inf (n_phi,). The mass defect times MASS_WEIGHT if that is larger.
    """
    momentum, mass_defect = momentum_balance(plane, slope, stream, grid)
    corner = np.empty((2, slope.size, 2))
    place_vertices(slope, plane.outer, np.array([0.0, 1.0]), plane.rays, corner)
    force = cone_force(1.0, corner[:, :, 0], pressure)
    # On half a body the force across the symmetry plane is in the momentum along y, and no part of the wall's.
    along = [0, 1, 2] if plane.rays.closed else [0, 2]
    imbalance = float(np.linalg.norm((momentum - force)[along]) / np.linalg.norm(force[along]))
    return max(imbalance, MASS_WEIGHT * abs(mass_defect))


def change_between(
    pressure_before: FloatArray, pressure: FloatArray, outer_before: FloatArray, outer: FloatArray
) -> float:
    """Return the largest change of pressure (n_phi,), over its mean, or of the outer boundary (n_phi + 1,)."""
    moved = np.max(np.abs(outer / outer_before - 1.0))
    return float(max(np.max(np.abs(pressure - pressure_before)) / np.mean(pressure), moved))
