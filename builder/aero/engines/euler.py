"""The marching Euler solver as an engine: each (Mach number, total incidence) is solved once, then rolled."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np

from builder.aero.engine import CAPPED_TO, Flow, FlowKey
from builder.aero.engines.surface_pressure import pressure_at_stations, pressure_ratio_on_surface
from builder.aero.euler.bodies.solver import FlowSolution, solve_flow
from builder.aero.euler.planes.marching_grid import MarchingGrid
from builder.aero.surface.mesh import SurfaceMesh, mesh_of_grid
from builder.vehicle.conditions.flight_conditions import flow_key
from builder.vehicle.shape.geometry import BodyOfRevolution, SurfaceGrid
from strainfmu.arrays import FloatArray
from strainfmu.flight_condition import FlightCondition

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
