"""Error of the flow's grid: some flows solved again on a coarser one.

The grids of a campaign are seldom fine enough for an observed order of convergence: by the shock leeward of the
body it is between -1.6 and 2.4 on the shipped vehicle. So the difference between two grids counts as one
standard deviation, without extrapolation (Eca and Hoekstra, J. Comput. Phys. 262 (2014) 104, section 3, for such
data). On the shipped vehicle a grid 1.5 times finer than the map's differs from it by 0.4 to 1.4 times as much.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from builder.aero.engine import FlowKey
from builder.aero.engines.euler import EulerEngine
from builder.aero.euler.planes.marching_grid import MarchingGrid
from builder.campaign.snapshots import Snapshots
from builder.manifold.field_tables import MAX_FIELD_HARMONIC
from builder.manifold.flow_amplitudes import cosine_amplitudes
from builder.vehicle.conditions.flight_conditions import flow_key
from builder.vehicle.file import Vehicle
from strainfmu.arrays import FloatArray
from strainfmu.errors import FlowReachError

COARSER = 2.0 / 3.0
"""Cells of the coarser grid over the campaign's, in either direction."""

FEWEST_CELLS = 8


def grid_errors(vehicle: Vehicle, snapshots: Snapshots) -> FloatArray | None:
    """Return (q, n_x, n_m) amplitudes of cos m(phi - phi_T) of the error of p / p_inf in q flows.

    The flows are at the ends of the Mach numbers, at the smallest, the middle and the largest total incidence.
    None where the grid of the snapshots is not known: other engines, and bodies that are not of revolution.
    """
    grid, marching = snapshots.grid, _coarser(snapshots.settings)
    if grid is None or marching is None or not vehicle.is_axisymmetric or snapshots.engine != "euler":
        return None
    n_m = min(MAX_FIELD_HARMONIC, (grid.n_roll - 1) // 2) + 1
    engine = EulerEngine(vehicle.body(), marching, grid)
    conditions, amplitudes = snapshots.conditions(), list[FloatArray]()
    keys: list[FlowKey] = [flow_key(condition) for condition in conditions]
    for key in _chosen(keys):
        row = keys.index(key)
        condition = conditions[row]
        try:
            coarse = engine.pressure_ratio(engine.solve(key), condition)
        except FlowReachError:
            continue
        difference = snapshots.pressure[row] / condition.ambient_pressure - coarse
        angle = grid.roll_angle - condition.leeward_roll_angle
        amplitudes.append(cosine_amplitudes(difference.reshape(len(grid.x), -1), angle, n_m))
    return np.array(amplitudes) if amplitudes else None


def _chosen(keys: list[FlowKey]) -> list[FlowKey]:
    """Return the keys at the ends of the Mach numbers, at three incidences each."""
    chosen_keys = list[FlowKey]()
    mach_numbers = [key[0] for key in keys]
    for mach in dict.fromkeys((min(mach_numbers), max(mach_numbers))):
        incidence = sorted({key[1] for key in keys if key[0] == mach})
        chosen = dict.fromkeys((incidence[0], incidence[len(incidence) // 2], incidence[-1]))
        chosen_keys += [(mach, incidence) for incidence in chosen]
    return chosen_keys


def _coarser(settings: Mapping[str, Any]) -> MarchingGrid | None:
    """Return the grid of the snapshots with fewer cells; None where it is not known or cannot be coarser."""
    entries = settings.get("inputs", {}).get("marching_grid")
    if entries is None:
        return None
    finest = MarchingGrid(**entries)
    cells = [round(COARSER * count) for count in (finest.n_radial, finest.n_circumferential)]
    if min(cells) < FEWEST_CELLS:
        return None
    return replace(finest, n_radial=cells[0], n_circumferential=cells[1])
