"""The marching Euler solver all round a body of sections, as an engine of campaigns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.interpolate import Akima1DInterpolator

from builder.aero.engine import Flow, FlowKey
from builder.aero.engines.euler import METHOD_VERSION, pieces
from builder.aero.engines.surface_pressure import pressure_at_stations
from builder.aero.euler.bodies.solver import FullFlowSolution, solve_full_flow
from builder.aero.euler.planes.marching_grid import MarchingGrid
from builder.aero.shapes import node_roll_angles, sections_grid, sections_mesh
from builder.aero.surface.mesh import SurfaceMesh
from builder.vehicle.shape.sectioned_body import SectionedBody
from strainfmu.arrays import FloatArray
from strainfmu.flight_condition import FlightCondition


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
            arrays=_arrays(solution),
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


def _arrays(solution: FullFlowSolution) -> dict[str, FloatArray]:
    arrays = {"roll_angle": solution.roll_angle}
    for number, (station, ratio) in enumerate(solution.pieces):
        arrays[f"station_{number}"] = station
        arrays[f"ratio_{number}"] = ratio
    return arrays
