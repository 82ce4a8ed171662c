"""The kinds of error of the stress test, in the order of its table."""

from __future__ import annotations

from builder.stress.air_data_kinds import computed_kinds, row_kinds
from builder.stress.flight_kinds import envelope_kinds, flow_kinds
from builder.stress.gauge_kinds import gauge_kinds
from builder.stress.hardware_kinds import beyond_kinds, filter_kinds, fixed_kinds, nominal_kinds, stated_kinds
from builder.stress.inertia_kinds import inertia_kinds
from builder.stress.kind import Kind
from builder.stress.sensor_kinds import parameter_kinds, sensor_kinds
from builder.stress.viscous_kinds import viscous_kinds
from builder.vehicle.file import Vehicle


def all_kinds(vehicle: Vehicle) -> list[Kind]:
    """Return the kinds of error for ``vehicle``; sizes and classes follow from what its file states."""
    return [
        *nominal_kinds(),
        *stated_kinds(vehicle.noise),
        *fixed_kinds(vehicle.noise),
        *beyond_kinds(vehicle.noise),
        *(filter_kinds() if vehicle.map.follows_pressure else []),
        *gauge_kinds(vehicle.noise),
        *row_kinds(vehicle),
        *(computed_kinds() if vehicle.map.follows_pressure else []),
        *inertia_kinds(vehicle),
        *sensor_kinds(vehicle),
        *parameter_kinds(vehicle),
        *envelope_kinds(vehicle),
        *flow_kinds(vehicle),
        *viscous_kinds(vehicle),
    ]
