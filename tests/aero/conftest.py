"""Bodies and flows that several tests of the aerodynamics share."""

from collections.abc import Callable
from functools import cache
from math import radians

import pytest

from builder.aero.euler.bodies.solver import FlowSolution, solve_flow
from builder.vehicle.file import IC3X, load_vehicle
from builder.vehicle.shape.geometry import BodyOfRevolution, chain_segments

BodyMaker = Callable[..., BodyOfRevolution]
ConeFlow = Callable[[float, float, float], FlowSolution]
VehicleFlow = Callable[[float, float], FlowSolution]


@pytest.fixture(scope="session")
def make_body() -> BodyMaker:
    """Return a maker of bodies from (end_x [m], start angle [deg], end angle [deg]) pieces."""

    def make(*pieces: tuple[float, float, float]) -> BodyOfRevolution:
        return chain_segments([(x, radians(start), radians(end)) for x, start, end in pieces])

    return make


@pytest.fixture(scope="session")
def cone_flow(make_body: BodyMaker, compiled_solver: None) -> ConeFlow:
    """Return the flow over a cone of 1 m length by (half-angle [deg], M, a_T [deg]), default grid, kept."""

    @cache
    def flow(half_angle: float, mach_number: float, incidence: float) -> FlowSolution:
        return solve_flow(make_body((1.0, half_angle, half_angle)), mach_number, radians(incidence))

    return flow


@pytest.fixture(scope="session")
def vehicle_body() -> BodyOfRevolution:
    """Return the outer surface of the shipped vehicle."""
    return load_vehicle(IC3X).body()


@pytest.fixture(scope="session")
def vehicle_flow(vehicle_body: BodyOfRevolution, compiled_solver: None) -> VehicleFlow:
    """Return the flow over the shipped vehicle by (M, a_T [deg]), default grid, kept."""

    @cache
    def flow(mach_number: float, incidence: float) -> FlowSolution:
        return solve_flow(vehicle_body, mach_number, radians(incidence))

    return flow
