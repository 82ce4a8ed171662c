"""The numbers that the tests of the inverse problem share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from builder.aero.engine import Engine
from builder.campaign.run import take_snapshots
from builder.campaign.scheduling import Scheduling, solve_flows
from builder.campaign.vehicle_campaign import vehicle_campaign
from builder.flight_conditions import ConditionSet
from builder.reduction import PressureModes
from builder.snapshots import Snapshots
from builder.vehicle import Vehicle
from strainfmu.flight_condition import FlightCondition


@dataclass(frozen=True)
class Case:
    """What the algebra of the inverse problem works on."""

    strain_operator: np.ndarray
    loads: np.ndarray
    modes: PressureModes
    noise_std: np.ndarray
    internal_pressure: float


def snapshots_at(engine: Engine, vehicle: Vehicle, conditions: Sequence[FlightCondition]) -> Snapshots:
    """Return the engine's pressures at ``conditions``, without a file."""
    campaign = vehicle_campaign(vehicle, engine, [ConditionSet("test", tuple(conditions))])
    keys = map(engine.flow_key, conditions)
    flows = {one.flow.key: one.flow for one in solve_flows(engine, keys, Scheduling(workers=0))}
    return take_snapshots(campaign, flows)
