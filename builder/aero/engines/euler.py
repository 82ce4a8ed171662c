"""The marching Euler solver as an engine: each (Mach number, total incidence) is solved once, then rolled.

Pressure at the vehicle's surface nodes from the flow solver's wall pressure.

On a body of revolution the flow depends on Mach number and total incidence alone; angle of attack and
sideslip only roll it. So one solution at the stations of the surface grid gives every condition
of the same (M, a_T), by rotation.

The marching Euler solver all round a body of sections, as an engine of campaigns.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.interpolate import Akima1DInterpolator

from builder.aero.engine import CAPPED_TO, Flow, FlowKey
from builder.aero.euler.bodies.solver import FlowSolution, FullFlowSolution, solve_flow, solve_full_flow
from builder.aero.euler.planes import MarchingGrid
from builder.aero.shapes import node_roll_angles, sections_grid, sections_mesh
from builder.aero.surface.mesh import SurfaceMesh, mesh_of_grid
from builder.vehicle.flight_conditions import flow_key
from builder.vehicle.shape.geometry import BodyOfRevolution, SurfaceGrid
from builder.vehicle.shape.sectioned_body import SectionedBody
from strainfmu.arrays import FloatArray
from strainfmu.flight_condition import FlightCondition


def pressure_at_stations(pieces: Sequence[tuple[FloatArray, FloatArray]], grid: SurfaceGrid) -> FloatArray:
    """Interpolate a flow's wall pressure linearly in x to the stations of ``grid``.

    Parameters
    ----------
    pieces : per smooth piece of the meridian, stations (n,) [m] and p/p_inf (n, n_phi).

    Returns
    -------
    (n_x, n_phi) p/p_inf. Never interpolated across a slope break; towards the ends of a smooth piece, where no
    marching step has its middle, the nearest value holds.
    """
    joints = np.flatnonzero(np.diff(grid.x) == 0.0) + 1
    parts = np.split(np.arange(len(grid.x)), joints)
    if len(parts) != len(pieces):
        raise ValueError(f"{len(pieces)} smooth pieces solved, surface grid has {len(parts)}")
    ratio = np.empty((len(grid.x), pieces[0][1].shape[1]))
    for part, (x, pressure) in zip(parts, pieces, strict=True):
        for j in range(pressure.shape[1]):
            ratio[part, j] = np.interp(grid.x[part], x, pressure[:, j])
    return ratio


def pressure_ratio_on_surface(
    ratio: FloatArray, roll_angle: FloatArray, grid: SurfaceGrid, leeward_roll_angle: float
) -> FloatArray:
    """Roll a half-body pressure so that its leeward meridian lies at ``leeward_roll_angle`` [rad].

    Parameters
    ----------
    ratio : (n_x, n_phi) p/p_inf at ``roll_angle`` (n_phi,) from the leeward meridian, 0..pi.

    Returns
    -------
    (n_nodes,) p/p_inf at the nodes of ``grid``; modified Akima interpolation round the body, which
    swings little next to the leeward shock (within 0.5 % of the range round the body).
    """
    away = np.mod(grid.roll_angle - leeward_roll_angle, 2.0 * np.pi)
    away = np.minimum(away, 2.0 * np.pi - away)
    angles = np.concatenate([-roll_angle[::-1], roll_angle, 2.0 * np.pi - roll_angle[::-1]])
    mirrored = np.concatenate([ratio[:, ::-1], ratio, ratio[:, ::-1]], axis=1)
    return Akima1DInterpolator(angles, mirrored, axis=1, method="makima")(away).ravel()


METHOD_VERSION = 5
"""Raised whenever the solver's results change, so that stored flows of an older one are solved again."""


@dataclass(frozen=True, eq=False)
class EulerEngine:
    """Inviscid flow over a body of revolution (:mod:`builder.aero.euler`).

    Attributes
    ----------
    body : the outer shape.
    marching_grid : resolution of the cross-plane.
    grid : the surface nodes at which pressures are given.
    """

    body: BodyOfRevolution
    marching_grid: MarchingGrid
    grid: SurfaceGrid

    def __reduce__(self) -> tuple[type[EulerEngine], tuple[BodyOfRevolution, MarchingGrid, SurfaceGrid]]:
        """Leave the triangulated surface behind: a worker has no use for it."""
        return type(self), (self.body, self.marching_grid, self.grid)

    @property
    def name(self) -> str:
        return "euler"

    @cached_property
    def surface(self) -> SurfaceMesh:
        return mesh_of_grid(self.grid)

    def inputs(self) -> Mapping[str, Any]:
        return {
            "engine": self.name,
            "method_version": METHOD_VERSION,
            "profile": [asdict(segment) for segment in self.body.segments],
            "marching_grid": asdict(self.marching_grid),
        }

    def conditions(self) -> None:
        return None

    def flow_key(self, condition: FlightCondition) -> FlowKey:
        return flow_key(condition)

    def solve(self, key: FlowKey) -> Flow:
        mach_number, incidence = key
        solution = solve_flow(self.body, mach_number, incidence, self.marching_grid)
        imbalance = np.linalg.norm(solution.force - solution.force_from_momentum)
        momentum_error = float(imbalance / np.linalg.norm(solution.force))
        return Flow(
            key=key,
            arrays=_arrays(solution),
            momentum_error=momentum_error,
            mass_error=abs(solution.mass_defect),
            repairs=solution.n_repairs,
        )

    def pressure_ratio(self, flow: Flow, condition: FlightCondition) -> FloatArray:
        at_stations = pressure_at_stations(pieces(flow), self.grid)
        return pressure_ratio_on_surface(
            at_stations, flow.arrays["roll_angle"], self.grid, condition.leeward_roll_angle
        )


def _arrays(solution: FlowSolution) -> dict[str, FloatArray]:
    arrays = {"roll_angle": solution.roll_angle}
    if solution.capped_to:
        arrays[CAPPED_TO] = np.array([solution.capped_to])
    for number, (station, ratio) in enumerate(solution.pieces):
        arrays[f"station_{number}"] = station
        arrays[f"ratio_{number}"] = ratio
    return arrays


def pieces(flow: Flow) -> list[tuple[FloatArray, FloatArray]]:
    """Return, per smooth piece of the meridian, stations (n,) [m] and p/p_inf (n, n_phi)."""
    count = sum(name.startswith("station_") for name in flow.arrays)
    return [(flow.arrays[f"station_{i}"], flow.arrays[f"ratio_{i}"]) for i in range(count)]


@dataclass(frozen=True, eq=False)
class FullBodyEngine:
    """Inviscid flow over a pointed body of sections.

    The plane y = 0 is one of symmetry, and z = 0 where no section is off centre: a flow stands for its mirror
    images.

    Attributes
    ----------
    body : the outer shape.
    marching_grid : resolution of the cross-plane; circumferential cells are per half turn.
    n_x, n_roll : stations and roll angles of the surface nodes.
    """

    body: SectionedBody
    marching_grid: MarchingGrid
    n_x: int
    n_roll: int

    @property
    def name(self) -> str:
        return "euler"

    @cached_property
    def surface(self) -> SurfaceMesh:
        return sections_mesh(self.body, self.n_x, self.n_roll)

    def inputs(self) -> Mapping[str, Any]:
        table = {name: np.asarray(value).tolist() for name, value in asdict(self.body).items()}
        return {
            "engine": self.name,
            "method_version": METHOD_VERSION,
            "sections": table,
            "marching_grid": asdict(self.marching_grid),
        }

    def conditions(self) -> None:
        return None

    def flow_key(self, condition: FlightCondition) -> FlowKey:
        """Return (M, alpha, beta), angles in radians, without the signs that symmetry takes off."""
        alpha = condition.angle_of_attack
        alpha = abs(alpha) if self.body.is_symmetric_up_and_down else alpha
        return round(condition.mach_number, 9), round(alpha, 9), round(abs(condition.sideslip_angle), 9)

    def solve(self, key: FlowKey) -> Flow:
        mach_number, angle_of_attack, sideslip = key
        solution = solve_full_flow(self.body, mach_number, angle_of_attack, sideslip, self.marching_grid)
        imbalance = np.linalg.norm(solution.force - solution.force_from_momentum)
        return Flow(
            key=key,
            arrays=_full_body_arrays(solution),
            momentum_error=float(imbalance / np.linalg.norm(solution.force)),
            mass_error=abs(solution.mass_defect),
            repairs=solution.n_repairs,
        )

    def pressure_ratio(self, flow: Flow, condition: FlightCondition) -> FloatArray:
        grid = sections_grid(self.body, self.n_x, self.n_roll)
        ratio = pressure_at_stations(pieces(flow), grid)
        angle, roll = flow.arrays["roll_angle"], node_roll_angles(self.body, grid)
        if condition.sideslip_angle < 0.0:
            roll = -roll
        if condition.angle_of_attack < 0.0 and self.body.is_symmetric_up_and_down:
            roll = np.pi - roll
        turn = 2.0 * np.pi
        angles, roll = np.concatenate([angle - turn, angle, angle + turn]), np.mod(roll, turn)
        at_nodes = np.empty(roll.shape)
        for station, row in enumerate(np.tile(ratio, (1, 3))):
            at_nodes[station] = Akima1DInterpolator(angles, row, method="makima")(roll[station])
        return at_nodes.ravel()


def _full_body_arrays(solution: FullFlowSolution) -> dict[str, FloatArray]:
    arrays = {"roll_angle": solution.roll_angle}
    for number, (station, ratio) in enumerate(solution.pieces):
        arrays[f"station_{number}"] = station
        arrays[f"ratio_{number}"] = ratio
    return arrays
