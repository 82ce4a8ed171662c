"""Auxiliary sensors over the flight state: base pressure, friction and the errors that no surface pressure makes.

The surface pressure's part of a reading is a row of the tables as strain is. Base pressure adds to an axial force
in proportion to p_inf, friction in proportion to q_inf = gamma M^2 p_inf / 2: both are exact in the splines.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from builder.inverse.noise.hardware_errors import HardwareError
from builder.inverse.sensors.sensor_set import base_area
from builder.inverse.solution import Problem
from builder.vehicle.file import Vehicle
from strainfmu.arrays import FloatArray
from strainfmu.atmosphere import HEAT_CAPACITY_RATIO
from strainfmu.estimator.numerics import DEGREE, padded_knots


def with_base_and_friction(
    vehicle: Vehicle, problem: Problem, mach_knots: FloatArray, coefficients: FloatArray
) -> FloatArray:
    """Return ``coefficients`` (n_M + 2, n_a + 2, n, n_m, 2), base pressure and friction in the sensors' rows."""
    sensors, entry = problem.sensors, vehicle.sensors
    if sensors is None or entry is None:
        return coefficients
    padded = padded_knots(mach_knots)
    first, second, third = (padded[i : len(mach_knots) + 2 + i] for i in range(1, DEGREE + 1))
    square = (first * second + second * third + first * third) / 3.0  # coefficients of M^2, by its polar form
    area = vehicle.reference_quantities().area
    of_base = base_area(vehicle) * (1.0 - entry.base_pressure_ratio)
    force = of_base + 0.5 * HEAT_CAPACITY_RATIO * square * area * entry.friction_C_A
    rows, n_d = sensors.per_axial_force, len(problem.strain_operator)
    out = coefficients.copy()
    # B-splines add up to 1: the same coefficient at every incidence is a constant.
    out[:, :, n_d - len(rows) : n_d, 0, 0] += np.outer(force, rows)[:, None]
    return out


def base_pressure_error(vehicle: Vehicle, problem: Problem, n: int) -> dict[str, FloatArray]:
    """Return the column (n, 1) per p_inf of the base pressure's error by name, none where it moves no reading.

    The pressure level is part of the flight state: of the linear map's term, its spread is left out.
    """
    sensors, entry = problem.sensors, vehicle.sensors
    if sensors is None or entry is None:
        return {}
    column = np.zeros((n, 1))
    n_d, size = len(problem.strain_operator), 0.01 * entry.base_pressure_percent * base_area(vehicle)
    column[n_d - len(sensors.rows) : n_d, 0] = size * sensors.per_axial_force
    return {"base pressure": column} if column.any() else {}


def friction_error(vehicle: Vehicle, problem: Problem) -> list[HardwareError]:
    """Return the error of friction, which grows with q_inf, over the members of the ensemble; none where it moves
    no reading."""
    sensors, entry, ensemble = problem.sensors, vehicle.sensors, problem.ensemble
    if sensors is None or entry is None:
        return []
    n_d, n_p = problem.strain_operator.shape
    reading = np.zeros(n_d)
    area = vehicle.reference_quantities().area
    size = entry.friction_C_A_std * ensemble.nominal_dynamic_pressure * area
    reading[n_d - len(sensors.rows) :] = size * sensors.per_axial_force
    if not reading.any():
        return []
    of_member = np.tile(reading, (len(ensemble.member_weight), 1))
    none = np.zeros((n_d, n_p))  # surface pressure has no part in it
    return [HardwareError(name="friction", operator=none, strain=of_member, common=True, with_rest=True)]


def gains_of_sensors(vehicle: Vehicle, problem: Problem) -> dict[str, Any]:
    """Return a map's fields that hold errors of the sensors' gains: their own, and that shared with gauges."""
    if problem.sensors is None:
        return {}
    rows = problem.sensors.rows
    shared = np.array(["common gain" in row.shared for row in rows])
    return {
        "sensor_gain_std": np.array([row.gain for row in rows]),
        "sensor_common_gain_std": np.where(shared, 0.01 * vehicle.noise.common_gain_percent, 0.0),
    }
