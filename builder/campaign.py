"""Pressure snapshots over many flight conditions: solve each distinct flow once, roll it, keep it on disk."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from builder.aero.euler.marching_grid import MarchingGrid
from builder.aero.euler.solver import FlowSolution, solve_flow
from builder.aero.surface_pressure import pressure_at_stations, pressure_ratio_on_surface
from builder.flight_conditions import flow_key
from builder.geometry import BodyOfRevolution, SurfaceGrid
from strainfmu.flight_condition import FlightCondition
from strainfmu.records import load_record, save_record

FloatArray = NDArray[np.float64]
FlowKey = tuple[float, float]
Progress = Callable[[int, int], None]

SCHEMA = "strainfmu.snapshots"
SCHEMA_VERSION = 2

_UNITS = {
    "condition": "1, rad, rad, m",
    "pressure": "Pa",
    "station": "m",
    "radius": "m",
    "roll_angle": "rad",
}


@dataclass(frozen=True)
class Snapshots:
    """Surface pressure at N flight conditions.

    Attributes
    ----------
    condition : (N, 4) Mach number [1], angle of attack [rad], sideslip angle [rad], altitude [m].
    pressure : (N, n_p) absolute pressure at the surface nodes [Pa]; node = station index * n_roll + roll index.
    station, radius : (n_x,) where the nodes are [m]; equal stations in a pair mark a slope break.
    roll_angle : (n_roll,) roll angles of the nodes [rad].
    solved : (N,) True where the flow was solved for this condition, False where it was rolled from another.
    momentum_error : (N,) relative difference of the force from wall pressure and from momentum.
    repairs : (N,) face states of the flow that fell back to first order to stay physical.
    """

    condition: FloatArray
    pressure: FloatArray
    station: FloatArray
    radius: FloatArray
    roll_angle: FloatArray
    solved: NDArray[np.bool_]
    momentum_error: FloatArray
    repairs: NDArray[np.int64]

    def conditions(self) -> list[FlightCondition]:
        """Return the conditions as objects."""
        return [FlightCondition(*map(float, row)) for row in self.condition]


def solve_flows(
    body: BodyOfRevolution, keys: Iterable[FlowKey], grid: MarchingGrid, progress: Progress | None = None
) -> dict[FlowKey, FlowSolution]:
    """Solve the flow at each (M, a_T [rad]), in as many threads as there are cores.

    The compiled solver releases the interpreter lock, so threads run side by side.

    Raises
    ------
    FlowReachError
        A condition is outside the solver's reach; the others are abandoned.
    """
    wanted = sorted(set(keys))
    solutions: dict[FlowKey, FlowSolution] = {}
    with ThreadPoolExecutor(max_workers=os.cpu_count()) as pool:
        futures = {pool.submit(solve_flow, body, *key, grid): key for key in wanted}
        try:
            for future in as_completed(futures):
                solutions[futures[future]] = future.result()
                if progress is not None:
                    progress(len(solutions), len(wanted))
        except BaseException:
            pool.shutdown(wait=True, cancel_futures=True)
            raise
    return solutions


def take_snapshots(
    body: BodyOfRevolution,
    conditions: list[FlightCondition],
    marching_grid: MarchingGrid,
    surface: SurfaceGrid,
    progress: Progress | None = None,
) -> Snapshots:
    """Compute the surface pressure at every condition; conditions that share a flow share its solution."""
    flows = solve_flows(body, map(flow_key, conditions), marching_grid, progress)
    at_stations = {key: pressure_at_stations(flow, surface) for key, flow in flows.items()}
    pressure = np.empty((len(conditions), surface.n_nodes))
    solved = np.zeros(len(conditions), dtype=bool)
    error = np.empty(len(conditions))
    repairs = np.empty(len(conditions), dtype=np.int64)
    seen: set[FlowKey] = set()
    for i, condition in enumerate(conditions):
        key = flow_key(condition)
        flow = flows[key]
        ratio = pressure_ratio_on_surface(at_stations[key], flow.roll_angle, surface, condition.leeward_roll_angle)
        pressure[i] = condition.ambient_pressure * ratio
        solved[i] = key not in seen
        error[i] = np.linalg.norm(flow.force - flow.force_from_momentum) / np.linalg.norm(flow.force)
        repairs[i] = flow.n_repairs
        seen.add(key)
    table = np.array([condition.as_tuple() for condition in conditions])
    return Snapshots(table, pressure, surface.x, surface.radius, surface.roll_angle, solved, error, repairs)


def save_snapshots(snapshots: Snapshots, path: Path) -> None:
    """Write ``snapshots.h5`` atomically.

    Raises
    ------
    StrainfmuError
        The file could not be written; what was there before is untouched.
    """
    save_record(snapshots, path, SCHEMA, SCHEMA_VERSION, _UNITS)


def load_snapshots(path: Path) -> Snapshots:
    """Read ``snapshots.h5``.

    Raises
    ------
    InputError
        The file is missing, damaged, altered, or of another schema version.
    """
    return load_record(Snapshots, path, SCHEMA, SCHEMA_VERSION)
