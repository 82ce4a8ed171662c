"""What sensors buy the nonlinear estimator on the shipped vehicle at its own resolution."""

import numpy as np
import pytest

from builder.structure.fourier.fourier_model import structural_model
from builder.vehicle.file import IC3X, load_vehicle
from builder.vehicle.flight_conditions import ConditionSet, condition_grid
from builder.vehicle.gauges.sensor_entries import Sensors
from tests.inverse.test_sensors import CELLS, IMU, PORTS
from tests.inverse.test_sensors_shipped import NUISANCES, RANGE, flown
from tests.manifold.test_manifold_sensors import built, estimated, flights, with_sensors

pytestmark = pytest.mark.slow


def test_what_sensors_buy_the_nonlinear_estimator_at_the_shipped_resolution() -> None:
    """Base pressure +-20 %, friction +-0.005 in C_A: C_A by a quarter, C_N to two fifths, M_P to a sixth."""
    vehicle = load_vehicle(IC3X)
    snapshots = flown(vehicle, ConditionSet("vehicle file", tuple(vehicle.flight_conditions())))
    between = condition_grid([5.2, 5.8, 6.3, 6.8], [1.0, 3.0, 5.0, 7.0, 9.0, 11.0], [2.5], 20e3)
    held_out = flown(vehicle, ConditionSet("between", tuple(between)))
    structure = structural_model(vehicle, vehicle.resolution.map, list(vehicle.gauges.layouts))
    spread = np.ptp(snapshots.coefficients(), axis=0)
    every = Sensors(ports=PORTS, imu=IMU, load_cells=CELLS, **NUISANCES)
    known = Sensors(imu=IMU, base_pressure_percent=0.0, friction_C_A_std=0.0)
    rows = {
        "strain": (every, ("port", "imu", "cell")),
        "+ 4 ports": (every, ("imu", "cell")),
        "+ inertial unit, base pressure and friction known": (known, ("none",)),
        "+ inertial unit": (every, ("port", "cell")),
        "+ ports and inertial unit": (every, ("cell",)),
        "+ load cells": (every, ("port", "imu")),
        "ports, unit and load cells": (every, ("none",)),
    }
    maps = {id(one): built(with_sensors(vehicle, one), snapshots, structure) for one in (every, known)}
    sigma, inside = {}, {}
    for name, (sensors, without) in rows.items():
        inverse_map, problem = maps[id(sensors)]
        flights_of = flights(with_sensors(vehicle, sensors), inverse_map, problem, held_out, structure, 3000)
        found = estimated(inverse_map, flights_of, *without)
        sigma[name] = np.sqrt(np.mean(found.coefficients_std**2, axis=0))
        inside[name] = np.mean(
            np.abs(found.coefficients - flights_of.coefficients) <= 3.0 * found.coefficients_std, axis=0
        )
        of_range = ", ".join(
            f"{one} {value:.3g}" for one, value in zip(RANGE, 100 * sigma[name] / spread, strict=True)
        )
        print(
            f"{name}: sigma in % of the range {of_range}; least coverage {100 * inside[name].min():.2f} %; "
            f"fits {100 * found.fits.mean():.2f} %, no suspect "
            f"{100 * np.mean([one == () for one in found.suspects]):.2f} %"
        )
    axial, normal, side, pitch, yaw = sigma["+ ports and inertial unit"] / sigma["strain"]
    assert axial <= 0.75
    assert max(normal, side) <= 0.4
    assert max(pitch, yaw) <= 0.17
    assert min(one.min() for one in inside.values()) >= 0.99
