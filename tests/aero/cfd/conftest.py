"""One real snapshot of the shipped vehicle, and what other meshes of it make of it."""

from math import radians

import numpy as np
import pytest
from imported_case import CONDITION, SYMMETRIC

from builder.aero.engines.euler import EulerEngine
from builder.aero.euler.planes import marching_grid_of
from builder.campaign.snapshots import Snapshots
from builder.vehicle.file import IC3X, load_vehicle
from builder.vehicle.shape.geometry import SurfaceGrid, surface_grid
from strainfmu.flight_condition import FlightCondition


@pytest.fixture(scope="session")
def other_grid() -> SurfaceGrid:
    """Return another mesh of the vehicle than the snapshots': coarser, and its nodes at other places."""
    return surface_grid(load_vehicle(IC3X).body(), 65, 48)


@pytest.fixture(scope="session")
def snapshots(compiled_solver: None) -> Snapshots:
    """Return two snapshots of one flow on the vehicle's own grid: rolled, and in the plane of symmetry."""
    vehicle = load_vehicle(IC3X)
    resolution = vehicle.resolution.map
    grid = surface_grid(vehicle.body(), *resolution.surface_nodes)
    engine = EulerEngine(vehicle.body(), marching_grid_of(resolution), grid)
    flow = engine.solve(engine.flow_key(CONDITION))
    conditions = [CONDITION, SYMMETRIC]
    ambient = np.array([c.ambient_pressure for c in conditions])
    reference = vehicle.reference_quantities()
    return Snapshots(
        vehicle=vehicle.name,
        engine=engine.name,
        settings={},
        condition=np.array([c.as_tuple() for c in conditions]),
        pressure=np.array([engine.pressure_ratio(flow, c) for c in conditions]) * ambient[:, None],
        internal_pressure=ambient,
        reference=np.array([reference.area, reference.length, reference.moment_station]),
        point=engine.surface.point,
        triangle=engine.surface.triangle,
        station=grid.x,
        radius=grid.radius,
        meridian_angle=grid.angle,
        solved=np.array([True, False]),
        flow=np.array([0, 0]),
        momentum_error=np.full(2, flow.momentum_error),
        repairs=np.zeros(2, dtype=np.int64),
    )


@pytest.fixture(scope="session")
def zero_incidence() -> FlightCondition:
    return FlightCondition(5.0, radians(0.0), 0.0, 20e3)
