"""What flush ports and an inertial unit buy on the shipped vehicle at its own resolution."""

import numpy as np
import pytest

from builder.aero.engines.registry import make_engine
from builder.campaign.campaign_run import snapshots_of_flows, vehicle_campaign
from builder.campaign.scheduling import Scheduling, solve_flows
from builder.campaign.snapshots import Snapshots
from builder.structure.fourier.fourier_model import structural_model
from builder.vehicle.file import IC3X, Vehicle, load_vehicle
from builder.vehicle.flight_conditions import ConditionSet, condition_grid
from builder.vehicle.gauges.sensor_entries import Sensors
from tests.inverse.test_sensors import CELLS, IMU, PORTS, scored, with_sensors

pytestmark = pytest.mark.slow

NUISANCES = {"base_pressure_percent": 20.0, "friction_C_A_std": 0.005}
RANGE = ("C_A", "C_N", "C_Y", "M_P", "M_Y")


def flown(vehicle: Vehicle, conditions: ConditionSet) -> Snapshots:
    engine = make_engine(vehicle, None, vehicle.resolution.map)
    keys = {engine.flow_key(one) for one in conditions.conditions}
    found = {one.flow.key: one.flow for one in solve_flows(engine, keys, Scheduling(workers=0), print)}
    return snapshots_of_flows(vehicle_campaign(vehicle, engine, (conditions,)), found)


def test_what_ports_and_inertial_unit_buy_at_the_shipped_resolution() -> None:
    """Base pressure +-20 % of p_inf, friction +-0.005 in C_A: C_A at most half, C_N a quarter, M_P a fifth."""
    shipped = load_vehicle(IC3X)
    vehicle = shipped.model_copy(update={"map": shipped.map.model_copy(update={"estimator": "linear"})})
    snapshots = flown(vehicle, ConditionSet("vehicle file", tuple(vehicle.flight_conditions())))
    between = condition_grid([5.2, 5.8, 6.3, 6.8], [1.0, 3.0, 5.0, 7.0, 9.0, 11.0], [2.5], 20e3)
    held_out = flown(vehicle, ConditionSet("between", tuple(between)))
    structure = structural_model(vehicle, vehicle.resolution.map, list(vehicle.gauges.layouts))
    spread = np.ptp(snapshots.coefficients(), axis=0)
    rows = {
        "strain": None,
        "+ 4 ports": Sensors(ports=PORTS, **NUISANCES),
        "+ inertial unit, base pressure and friction known": Sensors(
            imu=IMU, base_pressure_percent=0.0, friction_C_A_std=0.0
        ),
        "+ inertial unit": Sensors(imu=IMU, **NUISANCES),
        "+ ports and inertial unit": Sensors(ports=PORTS, imu=IMU, **NUISANCES),
        "+ load cells": Sensors(load_cells=CELLS, **NUISANCES),
    }
    sigma, inside = {}, {}
    for name, sensors in rows.items():
        sigma[name], inside[name] = scored(with_sensors(vehicle, sensors), snapshots, held_out, structure)
        of_range = ", ".join(
            f"{one} {value:.3g}" for one, value in zip(RANGE, 100 * sigma[name] / spread, strict=True)
        )
        print(f"{name}: sigma in % of the range {of_range}; least coverage {100 * inside[name].min():.2f} %")
    axial, normal, side, pitch, yaw = sigma["+ ports and inertial unit"] / sigma["strain"]
    assert axial <= 0.5
    assert max(normal, side) <= 0.25
    assert max(pitch, yaw) <= 0.2
    assert min(one.min() for one in inside.values()) >= 0.99
