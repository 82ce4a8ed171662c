"""Accuracy of a map of imported results on results that it was not made from: some are left out in turn.

The solver of a table is not here: there is no flow between its conditions. So the map is made again without some
of the flows, and estimates the loads of these. All else is as in the flights that alarm levels are set from: the
independent structure, errors of hardware, gauges and navigation drawn.

A table that is a grid of Mach numbers and total incidences loses one inner Mach number, or one incidence but the
largest, at a time: tables over the flight state need a grid. Of any other table a fifth of the flows inside is
left out at a time. What is left out is between flows of the map, never beyond them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import degrees
from typing import Any

import numpy as np

from builder.aero.engines.registry import own_surface
from builder.campaign.snapshot_transfer import snapshots_on
from builder.campaign.snapshots import Snapshots
from builder.inverse.problem import AnyStructure
from builder.manifold.flow_amplitudes import cosine_amplitudes
from builder.pipeline.demonstration.flight_trial import Flown
from builder.pipeline.stages import map_from
from builder.reporting import Reporter, Silent
from builder.structure.structure_file import Structure
from builder.trial.bound import KNOWN, cramer_rao_bound
from builder.trial.conditions import at_any_roll
from builder.trial.estimators import Estimates, of_map, together
from builder.trial.levels import stated_readings
from builder.trial.readings import Readings, joined
from builder.trial.world import World
from builder.truth.revolution.strain import TrueFlights, TrueStructure, flights_of_harmonics, true_structure
from builder.vehicle.file import Vehicle
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.flight_condition import FlightCondition

SEED, VEHICLES, ROLLS = 3, 20, 4
"""Of the draws; vehicles at each condition; aerodynamic roll angles of each flow, where a map takes it at all."""
MOST_PARTS = 6
FEWEST_KNOTS = 2
"""Mach numbers, and incidences, that a map must keep."""
PART = 10**9
"""Between the numbers of vehicles, and of flights, of two parts."""


@dataclass(frozen=True, eq=False, kw_only=True)
class LeftOut:
    """Flows that a map is made without.

    Attributes
    ----------
    name : what they have in common, in words.
    rows : of the snapshots.
    flown : the rows that are flown: of Mach numbers inside, where there are any. At an end of their range a
        stated Mach number is outside as often as not, and so is health.
    """

    name: str
    rows: IntArray
    flown: IntArray


def left_out_parts(snapshots: Snapshots) -> list[LeftOut]:
    """Return the parts of the flows of ``snapshots`` to leave out in turn; empty where there are too few flows."""
    key = np.round([(one.mach_number, one.total_incidence) for one in snapshots.conditions()], 6)
    mach, incidence = np.unique(key[:, 0]), np.unique(key[:, 1])
    flows = np.unique(key, axis=0)
    inner = [mach[1:-1], incidence[:-1]]
    is_inside = np.isin(key[:, 0], inner[0]) if len(inner[0]) else np.ones(len(key), dtype=bool)

    def part(name: str, rows: IntArray) -> LeftOut:
        return LeftOut(name=name, rows=rows, flown=rows[is_inside[rows]])

    if len(flows) < len(mach) * len(incidence):
        inside = flows[(flows[:, 1] < incidence[-1]) & np.isin(flows[:, 0], inner[0])]
        parts = [inside[first::5] for first in range(min(5, len(inside)))]
        return [part(f"part {i} of {len(parts)}", _rows(key, one)) for i, one in enumerate(parts, start=1)]
    named = [
        [(f"M {one:g}", 0, one) for one in inner[0] if len(mach) > FEWEST_KNOTS],
        [
            (f"total incidence {degrees(one):.4g} deg", 1, one)
            for one in inner[1]
            if len(incidence) > FEWEST_KNOTS + 1
        ],
    ]
    half = MOST_PARTS // 2
    room = [max(half, MOST_PARTS - len(named[1])), max(half, MOST_PARTS - len(named[0]))]
    chosen = [_spread(one, count) for one, count in zip(named, room, strict=True)]
    return [part(name, np.flatnonzero(key[:, axis] == value)) for one in chosen for name, axis, value in one]


def _rows(key: FloatArray, flows: FloatArray) -> IntArray:
    """Return the rows of ``key`` (n, 2) that are among ``flows`` (k, 2)."""
    return np.flatnonzero((key[:, None, :] == flows[None, :, :]).all(axis=2).any(axis=1))


def _spread(values: list[Any], count: int) -> list[Any]:
    """Return at most ``count`` of ``values``, evenly spread."""
    if len(values) <= count:
        return values
    return [values[i] for i in np.unique(np.round(np.linspace(0, len(values) - 1, count)).astype(int))]


def held_out_score(
    vehicle: Vehicle,
    snapshots: Snapshots,
    structure: AnyStructure,
    reporter: Reporter,
    solid: Structure | None = None,
) -> dict[str, Any] | None:
    """Return the score of maps of ``vehicle`` on flows of ``snapshots`` that they are made without, for a file of
    results: names of the parts that were left out in turn, number of their flows, and parts without which no map
    could be made, with the reason.

    ``structure`` is the structure of the map, ``solid`` the three-dimensional one behind it. None where there are
    too few flows to leave some out, or no map can be made without them.
    """
    parts = left_out_parts(snapshots)
    if not parts:
        return None
    on_grid = snapshots_on(snapshots, own_surface(vehicle, vehicle.resolution.map))
    truth, conditions = _true_structure(vehicle), snapshots.conditions()
    every, made, names, not_built = list[Readings](), list[Estimates](), list[str](), list[str]()
    flows = set[tuple[float, float]]()
    with reporter.stage("Held-out conditions: maps made without some results") as progress:
        for number, part in enumerate(parts):
            rest = np.setdiff1d(np.arange(len(conditions)), part.rows)
            try:
                inverse_map = map_from(vehicle, snapshots.chosen(rest), structure, Silent(), solid)
            except InputError as error:
                not_built.append(f"{part.name}: {error}")
                continue
            names.append(part.name)
            flows |= {
                (round(c.mach_number, 6), round(c.total_incidence, 6))
                for c in (conditions[row] for row in part.flown)
            }
            random = np.random.default_rng([SEED, number])
            flown = _flown(vehicle, on_grid.chosen(part.flown), truth, inverse_map, random)
            world = World(vehicle=vehicle, structure=truth, flows=None, inverse_map=inverse_map)
            read = joined(list(stated_readings(world, flown, random, VEHICLES)))
            made.append(of_map(inverse_map)(read))
            bound = cramer_rao_bound(inverse_map, flown.conditions, KNOWN)
            every.append(
                replace(
                    read,
                    vehicle=read.vehicle + PART * number,
                    flight=read.flight + PART * number,
                    bound=None if bound is None else bound[read.flight],
                )
            )
            progress(number + 1, len(parts))
    if not made:
        return None
    score = Flown(joined(every), together(made)).record()
    return {**score, "left_out": names, "flows": len(flows), "not_built": not_built}


def _true_structure(vehicle: Vehicle) -> TrueStructure:
    """Return the structure of the independent model with the pressure nodes of the map, where the results are."""
    own, truth = vehicle.resolution.map, vehicle.resolution.truth
    nodes = {
        "surface_stations": own.surface_stations,
        "surface_roll_angles": own.surface_roll_angles,
        "harmonics": min(truth.harmonics, (own.surface_roll_angles - 1) // 2),
    }
    resolution = vehicle.resolution.model_copy(update={"truth": truth.model_copy(update=nodes)})
    return true_structure(vehicle.model_copy(update={"resolution": resolution}))


def _flown(
    vehicle: Vehicle, snapshots: Snapshots, structure: TrueStructure, made: InverseMap, random: np.random.Generator
) -> TrueFlights:
    """Return the flights of a vehicle in the flows of ``snapshots``: rolled where the map takes every flow at
    every roll angle."""
    grid = snapshots.grid
    assert grid is not None
    n_m = structure.n_harmonics
    harmonic, conditions = list[FloatArray](), list[FlightCondition]()
    for row, condition in enumerate(snapshots.conditions()):
        ratio = snapshots.pressure[row].reshape(len(grid.x), -1) / condition.ambient_pressure
        amplitude = cosine_amplitudes(ratio, grid.roll_angle - condition.leeward_roll_angle, n_m)
        rolled = made.provenance["symmetry"] == "full"
        for _ in range(ROLLS if rolled else 1):
            harmonic.append(amplitude)
            conditions.append(at_any_roll(condition, condition.total_incidence, random) if rolled else condition)
    return flights_of_harmonics(vehicle, structure, np.array(harmonic), conditions)
