"""The flows of the independent model in a folder of results: a table of a body of revolution, and flows at given
conditions of any other shape."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from builder.aero.engine import FlowKey
from builder.aero.engines.registry import make_engine
from builder.campaign import snapshots as snapshots_file
from builder.campaign.campaign_run import run_campaign, vehicle_campaign
from builder.campaign.journal import Journal
from builder.campaign.scheduling import Scheduling
from builder.pipeline.pipeline import Pipeline
from builder.pipeline.stages import note_campaign
from builder.truth.revolution.flow_table import flow_inputs, save_flow_table, solved_flows
from builder.vehicle.conditions.flight_conditions import ConditionSet
from builder.vehicle.file import Vehicle
from strainfmu.arrays import FloatArray
from strainfmu.flight_condition import FlightCondition


def make_flow_table(
    pipeline: Pipeline,
    vehicle: Vehicle,
    knots: tuple[FloatArray, FloatArray],
    name: str,
    holds: str,
    *,
    failed: dict[FlowKey, str] | None = None,
) -> None:
    """Make the file ``name`` of flows of a body of revolution at ``knots``, Mach numbers and positive incidences
    [rad]. Flows are kept as they are solved; ``failed`` takes those out of reach, as of
    :func:`~builder.truth.revolution.flow_table.solved_flows`."""

    def write(path: Path) -> None:
        with Journal(path) as journal:
            save_flow_table(solved_flows(vehicle, *knots, pipeline.reporter, failed=failed, journal=journal), path)
            journal.remove()

    pipeline.make(name, holds, flow_inputs(vehicle, *knots), write, shared=True)


def make_shape_flows(
    pipeline: Pipeline, vehicle: Vehicle, conditions: Sequence[FlightCondition], name: str, holds: str
) -> None:
    """Make the file ``name`` of flows at ``conditions``, on the finer surface.

    Flows are kept as they are solved, and taken from an earlier file of other conditions. Those outside the
    engine's reach are left out.

    Raises
    ------
    FlowReachError
        All of them are.
    """
    engine = make_engine(vehicle, None, vehicle.resolution.truth, note=pipeline.reporter.note)
    campaign = vehicle_campaign(vehicle, engine, (ConditionSet("independent model", tuple(conditions)),))

    def write(path: Path) -> None:
        note_campaign(run_campaign(campaign, path, Scheduling(), pipeline.reporter), pipeline.reporter)

    inputs = {
        "schema_version": snapshots_file.SCHEMA_VERSION,
        "vehicle": vehicle.name,
        "engine": dict(engine.inputs()),
        "conditions": [condition.as_row() for condition in conditions],
        "internal_pressure": campaign.internal_pressure.tolist(),
    }
    pipeline.make(name, holds, inputs, write, shared=True)
