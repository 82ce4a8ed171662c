"""Worlds of the coarse vehicle of :mod:`coarse_vehicle`, with flows beyond its envelope, and of another shape."""

from dataclasses import replace

import numpy as np
import pytest
from deflected_shape import DEFLECTIONS, NAME, deflected, known_map
from shape_case import flown as flown_shape
from shape_case import shape_map, shape_vehicle
from shape_truth import beam
from trial_cases import other_world, with_entries

from builder.campaign.scheduling import Scheduling
from builder.campaign.snapshots import Snapshots
from builder.inverse.build import build_inverse_map
from builder.manifold.nonlinear_build import with_manifold
from builder.pipeline.built_sensors import flown_sensors
from builder.pipeline.trials import shape_conditions
from builder.reporting import Silent
from builder.structure.fourier.fourier_model import StructuralModel
from builder.trial import conditions
from builder.trial.cases import cases_for, load_trial
from builder.trial.readings import World
from builder.truth.flow_table import FlowTable, solved_flows
from builder.truth.true_structure import TrueStructure
from builder.vehicle.file import Vehicle
from builder.vehicle.flight_conditions import FlowParameter
from builder.vehicle.gauges.sensor_entries import InertialUnit, Ports, Sensors
from builder.vehicle.structure_section import Mass
from strainfmu.estimator.map.inverse_map import InverseMap


@pytest.fixture(scope="session")
def full_map(vehicle: Vehicle, snapshots: Snapshots, structure: StructuralModel) -> InverseMap:
    """The map with tables and nominal alarm levels."""
    return with_manifold(build_inverse_map(vehicle, snapshots, structure), vehicle, snapshots, structure)


@pytest.fixture(scope="session")
def flow_beyond(vehicle: Vehicle, compiled_solver: None) -> FlowTable:
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(conditions, "MACH_KNOTS", 5)
        patched.setattr(conditions, "INCIDENCE_KNOTS", 6)
        knots = conditions.stress_knots(vehicle)
        return solved_flows(vehicle, *knots, Silent(), failed={}, scheduling=Scheduling(workers=0))


@pytest.fixture(scope="session")
def tabled_world(
    vehicle: Vehicle, true_model: TrueStructure, flow_beyond: FlowTable, full_map: InverseMap
) -> World:
    return World(vehicle=vehicle, structure=true_model, flows=flow_beyond, inverse_map=full_map, conditions=50)


@pytest.fixture(scope="session")
def full_world(tabled_world: World) -> World:
    """The same, flown at 200 conditions."""
    return other_world(tabled_world, conditions=200, seed=4)


@pytest.fixture(scope="session")
def world(tabled_world: World, snapshots: Snapshots, structure: StructuralModel) -> World:
    """The same with the linear map alone."""
    return other_world(tabled_world, inverse_map=build_inverse_map(tabled_world.vehicle, snapshots, structure))


@pytest.fixture(scope="session")
def sensed_world(
    world: World, true_model: TrueStructure, snapshots: Snapshots, structure: StructuralModel
) -> World:
    """The same vehicle with ports and an inertial unit."""
    sensors = Sensors(
        ports=Ports(x_m=0.3, roll_deg=[0.0, 90.0, 180.0, 270.0], std_Pa=300.0, range_Pa=2e5, gain_percent=0.25),
        imu=InertialUnit(x_m=1.2, mass_kg=150.0, center_x_m=2.0, inertia_kg_m2=130.0, thrust_std_N=5.0),
    )
    vehicle = world.vehicle.model_copy(update={"sensors": sensors})
    made, fly = build_inverse_map(vehicle, snapshots, structure), flown_sensors(vehicle, true_model.surface)
    assert fly is not None
    return other_world(world, vehicle=vehicle, inverse_map=made, sensors=fly.as_built, conditions=40)


@pytest.fixture(scope="session")
def heavy_world(world: World, snapshots: Snapshots, structure: StructuralModel) -> World:
    """The same vehicle with a section [mass]."""
    vehicle = world.vehicle.model_copy(update={"mass": Mass(unlisted_kg=1.0)})
    made = build_inverse_map(vehicle, snapshots, structure)
    return other_world(world, vehicle=vehicle, inverse_map=made, conditions=40)


@pytest.fixture(scope="session")
def shape_world() -> World:
    """The elliptic cone, its structure a closed form."""
    vehicle = shape_vehicle()
    flows = flown_shape(shape_conditions(vehicle, cases_for(vehicle, load_trial("stress")), 24, 1))
    structure = beam(flows.surface)
    return World(vehicle=vehicle, structure=structure, flows=flows, inverse_map=shape_map(), conditions=24)


@pytest.fixture(scope="session")
def deflected_world() -> World:
    """The same with a flow parameter, whose value is known."""
    vehicle = shape_vehicle()
    parameters = {NAME: FlowParameter(values=list(DEFLECTIONS))}
    vehicle = with_entries(vehicle, "aerodynamics", engine="table", manifest="f.toml")
    vehicle = with_entries(vehicle, "conditions", parameters=parameters)
    drawn = conditions.flown_conditions(conditions.Where(), vehicle, None, 20, np.random.default_rng(1))
    at_rest = flown_shape([replace(one, parameters=()) for one in drawn])
    flows = deflected(at_rest, np.array([one.parameters[0] for one in drawn]))
    structure = beam(flows.surface)
    return World(vehicle=vehicle, structure=structure, flows=flows, inverse_map=known_map(), conditions=20)
