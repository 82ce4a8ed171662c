"""Flights of a comparison on the independent model: of a body of revolution, and of any other shape.

The first has a table of flows over Mach number and incidence, read between its knots; every other shape a flow at
each of its conditions.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from builder.aero.surface.mesh import mesh_of
from builder.campaign.journal import Journal
from builder.campaign.snapshots import load_snapshots
from builder.compare.field import true_field
from builder.compare.flights import Effort, example_conditions, random_conditions, vehicle_that_flies
from builder.compare.trial import Flown
from builder.inverse.problem import AnyStructure
from builder.manifold.mirror_images import with_mirror_images
from builder.manifold.snapshot_grid import snapshot_grid
from builder.pipeline.map_files import true_structure_of
from builder.pipeline.pipeline import Pipeline
from builder.pipeline.shape_flows import make_shape_flows, shape_structure_of
from builder.pipeline.used_files import SNAPSHOTS
from builder.truth.flights import RevolvedFlights
from builder.truth.revolution import flow_table as flow_table_file
from builder.truth.revolution.flow_table import load_flow_table, save_flow_table
from builder.truth.revolution.flows import independent_flows, truth_inputs
from builder.truth.revolution.strain import true_flights, without_faint_harmonics
from builder.truth.shape.flights import ShapeFlights, shape_flights
from builder.vehicle.file import Vehicle
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.errors import InputError
from strainfmu.flight_condition import FlightCondition

FLOWS = "compare_flows.h5"


@dataclass(frozen=True, kw_only=True)
class FlownPair:
    """Flights at random conditions and, where they could be solved, the flights of the example."""

    flown: Flown
    example: Flown | None


def make_flows(pipeline: Pipeline, vehicle: Vehicle, effort: Effort) -> None:
    """Make the file of flows of the independent model between the conditions of the map.

    Raises
    ------
    InputError
        The snapshots do not suffice for tables, or a condition is outside the solver's reach.
    """
    holds = "flows of the independent model between the conditions of the map"
    if not vehicle.is_of_revolution:
        snapshots = load_snapshots(pipeline.path(SNAPSHOTS))
        snapshot_grid(with_mirror_images(snapshots, snapshots.surface))  # refused here, before the long work
        drawn = _random_conditions(vehicle, effort)
        make_shape_flows(pipeline, vehicle, [*drawn, example_conditions(vehicle)[0]], FLOWS, holds)
        return
    flies = vehicle_that_flies(vehicle)

    def write(path: Path) -> None:
        with Journal(path) as journal:
            save_flow_table(independent_flows(flies, pipeline.reporter, journal), path)
            journal.remove()

    inputs = {"schema_version": flow_table_file.SCHEMA_VERSION, **truth_inputs(flies)}
    pipeline.make(FLOWS, holds, inputs, write)


def flown_pair(pipeline: Pipeline, vehicle: Vehicle, structure: AnyStructure, effort: Effort) -> FlownPair:
    """Return the flights of a comparison, on the flows of :func:`make_flows`; ``structure`` is the map's.

    Raises
    ------
    InputError
        The snapshots of a body of revolution are on a free surface.
    """
    if vehicle.is_of_revolution:
        return _revolved(pipeline, vehicle, structure, effort)
    flows = load_snapshots(pipeline.path(FLOWS))
    found = shape_flights(vehicle, shape_structure_of(pipeline), flows, mesh_of(structure.surface))
    examples = example_conditions(vehicle)
    has_example = found.conditions[-1] == examples[0]
    rows = np.arange(len(found.conditions) - has_example)
    again = np.full(len(examples), len(rows))
    return FlownPair(
        flown=_with_field(found.chosen(rows)), example=_with_field(found.chosen(again)) if has_example else None
    )


def _with_field(flights: ShapeFlights) -> Flown:
    return Flown(flights=flights, field=flights.pressure)


def _random_conditions(vehicle: Vehicle, effort: Effort) -> list[FlightCondition]:
    return random_conditions(vehicle, effort.conditions, np.random.default_rng(effort.seed))


def _revolved(pipeline: Pipeline, vehicle: Vehicle, structure: AnyStructure, effort: Effort) -> FlownPair:
    grid = structure.surface
    if not isinstance(grid, SurfaceGrid):
        raise InputError("compare: expected a body of revolution with rings of nodes, got a free surface")
    truth, table = true_structure_of(pipeline), load_flow_table(pipeline.path(FLOWS))

    def flown(conditions: list[FlightCondition]) -> Flown:
        flights = without_faint_harmonics(
            true_flights(vehicle=vehicle, structure=truth, table=table, conditions=conditions)
        )
        field = true_field(table=table, of_table=truth.surface, grid=grid, conditions=flights.conditions)
        return Flown(flights=RevolvedFlights(structure=truth, flown=flights), field=field)

    return FlownPair(flown=flown(_random_conditions(vehicle, effort)), example=flown(example_conditions(vehicle)))
