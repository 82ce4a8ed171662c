"""Campaign of a vehicle file: its engine, conditions and settings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from builder.aero.engine import Engine
from builder.aero.engines.registry import own_surface
from builder.campaign.campaign_run import Campaign
from builder.vehicle.conditions.flight_conditions import ConditionSet
from builder.vehicle.file import Vehicle
from builder.vehicle.shape.profile_record import profile_record
from strainfmu.version import __version__


def vehicle_campaign(
    vehicle: Vehicle,
    engine: Engine,
    sets: Sequence[ConditionSet] = (),
    options: Mapping[str, Any] | None = None,
) -> Campaign:
    """Return the campaign of ``engine`` over ``sets`` one after the other.

    Without sets, over the engine's own conditions if it has only those, else over the vehicle file's.

    A condition of several sets is in the file once for each; its flow is solved once. ``options`` are those by
    which the user set entries of the vehicle file aside (``set``, ``engine``, ``grid``); the file keeps them.
    """
    chosen = list(sets) or [_default_set(vehicle, engine)]
    conditions = tuple(condition for chosen_set in chosen for condition in chosen_set.conditions)
    return Campaign(
        vehicle=vehicle.name,
        engine=engine,
        conditions=conditions,
        internal_pressure=np.array([vehicle.internal_pressure(condition) for condition in conditions]),
        reference=vehicle.reference_quantities(),
        grid=own_surface(vehicle, vehicle.resolution.map) if vehicle.is_of_revolution else None,
        settings={
            "strainfmu_version": __version__,
            "sets": [{"name": chosen_set.name, "conditions": len(chosen_set.conditions)} for chosen_set in chosen],
            "options": dict(options or {}),
            **({"parameters": list(vehicle.conditions.parameters)} if vehicle.conditions.parameters else {}),
            **({"profile": profile_record(vehicle.body())} if vehicle.is_of_revolution else {}),
        },
    )


def _default_set(vehicle: Vehicle, engine: Engine) -> ConditionSet:
    of_engine = engine.conditions()
    if of_engine is not None:
        return ConditionSet(f"{engine.name} engine", tuple(of_engine))
    return ConditionSet("vehicle file", tuple(vehicle.flight_conditions()))
