"""Flows between the listed conditions, where they cost little: what no map made from the listed ones holds.

Conditions left out in turn say little of an axis with three values: what the middle one misses is even about it,
and the odd part of a flow, such as the side force of a fin that turns windward, does not show. So the flow in the
middle of every cell of the conditions is solved as well, by an engine that needs no more than moments for it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from builder.aero.deflections import deflections_of
from builder.aero.engines.newtonian import NewtonianEngine
from builder.campaign.snapshots import Snapshots
from builder.inverse.modes.ensemble import Ensemble
from builder.vehicle.file import Vehicle
from strainfmu.arrays import FloatArray
from strainfmu.errors import FlowReachError
from strainfmu.flight_condition import FlightCondition

BETWEEN = "flows between the snapshots"
"""Name of their error, in the linear map and in the tables."""

MOST_FLOWS = 800
"""Flows that are solved at most; of more cells some are drawn."""

_SAME = 1e-6
"""Largest difference of p / p_inf by which the engine repeats a snapshot."""

_NEGLIGIBLE = 1e-7
"""Variance relative to the largest below which a mode of the snapshots is no direction of theirs."""


@dataclass(frozen=True, eq=False, kw_only=True)
class FlowsBetween:
    """Flows in the middle of c cells of Mach number, angle of attack and sideslip.

    Attributes
    ----------
    conditions : c n_k of them, the n_k listed combinations of flow parameters of a cell one after another.
    ratio : (c n_k, n_p) p / p_inf at the snapshots' nodes.
    cells : their number c.
    """

    conditions: tuple[FlightCondition, ...]
    ratio: FloatArray
    cells: int

    def of_cells(self, operator: FloatArray) -> FloatArray:
        """Return (c, n) ``operator`` (n, n_p) times p / p_inf - 1, the mean over the flow parameters."""
        difference = (self.ratio - 1.0) @ operator.T
        return np.asarray(difference.reshape(self.cells, -1, len(operator)).mean(axis=1))

    def middle_of_cells(self) -> tuple[FlightCondition, ...]:
        """Return one condition of each cell."""
        return self.conditions[:: len(self.conditions) // self.cells]

    def off_the_snapshots(self, ensemble: Ensemble, is_scaled: bool) -> FloatArray:
        """Return fields (c n_k, n_p) at the level of ``ensemble`` that are no combination of its members [Pa];
        their squares add up to the mean one.

        ``is_scaled`` states whether the ensemble is at one dynamic pressure.
        """
        ambient = np.array([condition.ambient_pressure for condition in self.conditions])
        field = ambient[:, None] * self.ratio
        if is_scaled:
            dynamic = np.array([condition.dynamic_pressure for condition in self.conditions])
            net = field - ambient[:, None] if ensemble.fixed_pressure == 0.0 else field
            field = net * (ensemble.nominal_dynamic_pressure / dynamic)[:, None]
        off, centred = field - ensemble.mean(), ensemble.pressure - ensemble.mean()
        value, vector = np.linalg.eigh(centred @ centred.T)
        significant = value > _NEGLIGIBLE * value[-1]
        basis = (vector[:, significant] / np.sqrt(value[significant])).T @ centred
        return np.asarray((off - (off @ basis.T) @ basis) / np.sqrt(len(off)))


def flows_between(vehicle: Vehicle, snapshots: Snapshots) -> FlowsBetween | None:
    """Return the flows between the conditions of ``snapshots``; None where they are not known at little cost.

    That is newtonian flow round any shape but a body of revolution, by the options that made the snapshots.
    """
    engine, listed = same_engine(vehicle, snapshots), snapshots.conditions()
    if engine is None:
        return None
    conditions, cells = _between(listed)
    try:
        ratio = [engine.solve(engine.flow_key(condition)).arrays["pressure_ratio"] for condition in conditions]
    except FlowReachError:
        return None
    return FlowsBetween(conditions=conditions, ratio=np.array(ratio), cells=cells)


def same_engine(vehicle: Vehicle, snapshots: Snapshots, leeward: str | None = None) -> NewtonianEngine | None:
    """Return newtonian flow at the nodes of ``snapshots``, by another ``leeward`` side if one is given.

    None where the snapshots are not newtonian flow by the options of the vehicle file round a shape that is no
    body of revolution.
    """
    entry = vehicle.aerodynamics
    if vehicle.is_axisymmetric or {entry.engine, snapshots.engine} != {"newtonian"}:
        return None
    surface, stagnation = snapshots.surface, entry.stagnation or "rayleigh_pitot"
    moved = deflections_of(vehicle, surface) if snapshots.parameter_names else ()
    newtonian = NewtonianEngine(surface, stagnation, entry.leeward or "ambient", moved)
    first = snapshots.conditions()[0]
    again = newtonian.solve(newtonian.flow_key(first)).arrays["pressure_ratio"]
    if np.abs(again - snapshots.pressure[0] / first.ambient_pressure).max() > _SAME:
        return None
    return newtonian if leeward is None else NewtonianEngine(surface, stagnation, leeward, moved)


def _between(listed: Sequence[FlightCondition]) -> tuple[tuple[FlightCondition, ...], int]:
    """Return the conditions in the middle of the cells of ``listed``, and the number of these cells."""
    flows = [(condition.mach_number, condition.angle_of_attack, condition.sideslip_angle) for condition in listed]
    axes = [_middles(axis) for axis in zip(*flows, strict=True)]
    parameters = sorted({condition.parameters for condition in listed})
    cells, most = list(product(*axes)), max(1, MOST_FLOWS // len(parameters))
    if len(cells) > most:
        chosen = np.random.default_rng(1).permutation(len(cells))[:most]
        cells = [cells[number] for number in sorted(chosen.tolist())]
    between = tuple(
        FlightCondition(mach, alpha, beta, listed[0].altitude, values)
        for (mach, alpha, beta), values in product(cells, parameters)
    )
    return between, len(cells)


def _middles(values: Sequence[float]) -> list[float]:
    """Return the middles between distinct ``values``; the value itself where it is alone."""
    distinct = np.unique(np.round(values, 9))
    middles = 0.5 * (distinct[1:] + distinct[:-1]) if len(distinct) > 1 else distinct
    return [float(middle) for middle in middles]
