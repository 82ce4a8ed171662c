"""Flows that a map needs besides its snapshots: between their conditions, and on a coarser grid.

Conditions left out in turn say little of an axis with three values: what the middle one misses is even about it,
and the odd part of a flow, such as the side force of a fin that turns windward, does not show. So the flow in the
middle of every cell of the conditions is solved as well, by an engine that needs no more than moments for it.

The grids of a campaign are seldom fine enough for an observed order of convergence: by the shock leeward of the
body it is between -1.6 and 2.4 on the shipped vehicle. So the difference between two grids counts as one
standard deviation, without extrapolation (Eca and Hoekstra, J. Comput. Phys. 262 (2014) 104, section 3, for such
data). On the shipped vehicle a grid 1.5 times finer than the map's differs from it by 0.4 to 1.4 times as much.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np

from builder.aero.deflections import deflections_of
from builder.aero.engine import FlowKey
from builder.aero.engines.euler import EulerEngine
from builder.aero.engines.newtonian import NewtonianEngine
from builder.aero.euler.planes import MarchingGrid
from builder.campaign.snapshots import Snapshots
from builder.inverse.ensemble import Ensemble
from builder.vehicle.file import FlowEntries
from builder.vehicle.flight_conditions import flow_key
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


@dataclass(frozen=True, eq=False, kw_only=True)
class SolvedFlows:
    """The flows of a map, and more flows round the same body where they cost little; each is solved once.

    Attributes
    ----------
    snapshots : the flows.
    entries : what flows of the vehicle file are solved from.
    """

    snapshots: Snapshots
    entries: FlowEntries

    @cached_property
    def engine(self) -> NewtonianEngine | None:
        """Newtonian flow at the nodes of the snapshots, by the options that made them; see :meth:`by`."""
        return self.by(None)

    def by(self, leeward: str | None) -> NewtonianEngine | None:
        """Return newtonian flow at the nodes of the snapshots, by another ``leeward`` side if one is given.

        None where the snapshots are not newtonian flow by the options of the vehicle file round a shape that is
        no body of revolution.
        """
        entry, snapshots = self.entries.engine, self.snapshots
        if self.entries.body is not None or {entry.engine, snapshots.engine} != {"newtonian"}:
            return None
        surface, stagnation = snapshots.surface, entry.stagnation or "rayleigh_pitot"
        moved = deflections_of(self.entries, surface) if snapshots.parameter_names else ()
        newtonian = NewtonianEngine(surface, stagnation, entry.leeward or "ambient", moved)
        first = snapshots.conditions()[0]
        again = newtonian.solve(newtonian.flow_key(first)).arrays["pressure_ratio"]
        if np.abs(again - snapshots.pressure[0] / first.ambient_pressure).max() > _SAME:
            return None
        return newtonian if leeward is None else NewtonianEngine(surface, stagnation, leeward, moved)

    @cached_property
    def between(self) -> FlowsBetween | None:
        """Flows between the conditions of the snapshots; None where they are not known at little cost.

        That is newtonian flow round any shape but a body of revolution, by the options that made the snapshots.
        """
        if self.engine is None:
            return None
        conditions, cells = _between(self.snapshots.conditions())
        try:
            ratio = [
                self.engine.solve(self.engine.flow_key(condition)).arrays["pressure_ratio"]
                for condition in conditions
            ]
        except FlowReachError:
            return None
        return FlowsBetween(conditions=conditions, ratio=np.array(ratio), cells=cells)

    @cached_property
    def grid_difference(self) -> tuple[tuple[FlightCondition, FloatArray], ...] | None:
        """Some conditions, and p / p_inf (n_p,) there less that on a coarser grid of the flow.

        They are at the ends of the Mach numbers, at the smallest, the middle and the largest total incidence. None
        where the grid of the snapshots is not known: other engines, and bodies that are not of revolution.
        """
        snapshots, body, marching = self.snapshots, self.entries.body, _coarser(self.snapshots.settings)
        if snapshots.grid is None or marching is None or body is None or snapshots.engine != "euler":
            return None
        engine = EulerEngine(body, marching, snapshots.grid)
        conditions, differences = snapshots.conditions(), list[tuple[FlightCondition, FloatArray]]()
        keys: list[FlowKey] = [flow_key(condition) for condition in conditions]
        for key in _chosen(keys):
            row = keys.index(key)
            condition = conditions[row]
            try:
                coarse = engine.pressure_ratio(engine.solve(key), condition)
            except FlowReachError:
                continue
            differences.append((condition, snapshots.pressure[row] / condition.ambient_pressure - coarse))
        return tuple(differences)


COARSER = 2.0 / 3.0
"""Cells of the coarser grid over the campaign's, in either direction."""

FEWEST_CELLS = 8


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
