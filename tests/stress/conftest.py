"""The shipped vehicle at a coarse resolution, a map of few conditions, and flows beyond its envelope."""

from __future__ import annotations

from dataclasses import replace

import pytest
from coarse_vehicle import COARSE

from builder.campaign.scheduling import Scheduling
from builder.campaign.snapshots import Snapshots
from builder.inverse.build import build_inverse_map
from builder.manifold.build import with_manifold
from builder.pipeline.built_sensors import flown_sensors
from builder.pipeline.chosen_estimator import with_estimator
from builder.pipeline.stages import take_snapshots
from builder.reporting import Silent
from builder.stress import flights
from builder.stress.flows import stress_flows
from builder.stress.model import RevolvedModel
from builder.stress.score import Effort, Range
from builder.structure.fourier.model import structural_model
from builder.truth.revolution.flow_table import FlowTable
from builder.truth.revolution.strain import true_structure
from builder.vehicle.file import Vehicle
from builder.vehicle.gauges.sensor_entries import InertialUnit, Ports, Sensors
from builder.vehicle.structure.mass import Mass


@pytest.fixture(scope="session")
def flown(vehicle: Vehicle) -> Vehicle:
    """The coarse vehicle with every second listed angle and Mach number."""
    listed = {"mach_number": [5.0, 6.0, 7.0], "angle_of_attack_deg": [0.0, 3.0, 7.0, 10.0]}
    return vehicle.model_copy(update={"conditions": vehicle.conditions.model_copy(update=listed)})


@pytest.fixture(scope="session")
def flow_beyond(flown: Vehicle, compiled_solver: None) -> FlowTable:
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(flights, "MACH_KNOTS", 5)
        patched.setattr(flights, "INCIDENCE_KNOTS", 6)
        return stress_flows(flown, Silent(), scheduling=Scheduling(workers=0))


@pytest.fixture(scope="session")
def flown_snapshots(flown: Vehicle, compiled_solver: None) -> Snapshots:
    return take_snapshots(flown)


@pytest.fixture(scope="session")
def trial(flown: Vehicle, flow_beyond: FlowTable, flown_snapshots: Snapshots) -> Range:
    structure = structural_model(flown, COARSE, [flown.gauges.layout])
    return Range(
        vehicle=flown,
        model=RevolvedModel(vehicle=flown, structure=true_structure(flown), table=flow_beyond),
        inverse_map=build_inverse_map(flown, flown_snapshots, structure),
        effort=Effort(conditions=50, draws=6),
    )


@pytest.fixture(scope="session")
def sensed_trial(trial: Range, flow_beyond: FlowTable, flown_snapshots: Snapshots) -> Range:
    """The same vehicle with ports and an inertial unit."""
    sensors = Sensors(
        ports=Ports(x_m=0.3, roll_deg=[0.0, 90.0, 180.0, 270.0], std_Pa=300.0, range_Pa=2e5, gain_percent=0.25),
        imu=InertialUnit(x_m=1.2, mass_kg=150.0, center_x_m=2.0, inertia_kg_m2=130.0, thrust_std_N=5.0),
    )
    sensed = trial.vehicle.model_copy(update={"sensors": sensors})
    structure = structural_model(sensed, COARSE, [sensed.gauges.layout])
    truth = trial.model
    assert isinstance(truth, RevolvedModel)
    return Range(
        vehicle=sensed,
        model=replace(truth, vehicle=sensed, sensors=flown_sensors(sensed, truth.structure.surface)),
        inverse_map=build_inverse_map(sensed, flown_snapshots, structure),
        effort=Effort(conditions=40, draws=4),
    )


@pytest.fixture(scope="session")
def heavy_trial(trial: Range, flown_snapshots: Snapshots) -> Range:
    """The same vehicle with a section [mass]."""
    heavy = trial.vehicle.model_copy(update={"mass": Mass(unlisted_kg=1.0)})
    structure = structural_model(heavy, COARSE, [heavy.gauges.layout])
    return Range(
        vehicle=heavy,
        model=trial.model,
        inverse_map=build_inverse_map(heavy, flown_snapshots, structure),
        effort=Effort(conditions=40, draws=4),
    )


@pytest.fixture(scope="session")
def nonlinear_trial(trial: Range, flown_snapshots: Snapshots) -> Range:
    """The same vehicle with a map of the nonlinear estimator."""
    vehicle = with_estimator(trial.vehicle, "nonlinear")
    structure = structural_model(vehicle, COARSE, [vehicle.gauges.layout])
    return Range(
        vehicle=vehicle,
        model=trial.model,
        inverse_map=with_manifold(trial.inverse_map, vehicle, flown_snapshots, structure),
        effort=trial.effort,
    )
