"""Readings of auxiliary sensors in recorded data: names of their columns, and the rows of the map they make."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.sensors import SensorRows
from strainfmu.interface.sensor_variables import PREFIX, THRUST
from strainfmu.recorded.columns.columns import StrainBlock


def recorded_readings(units: Mapping[str, str]) -> dict[str, str]:
    """Return the units of auxiliary sensors and of thrust by the names of columns, inputs less the prefix."""
    return {name.removeprefix(PREFIX): unit for name, unit in units.items()}


def all_readings(block: StrainBlock, readings: Mapping[str, str]) -> FloatArray:
    """Return (n, n_s) what the auxiliary sensors read, NaN of one that the recording does not hold."""
    nothing = np.full(len(block.time), np.nan)
    columns = [block.readings.get(name, nothing) for name in readings if name != THRUST]
    return np.column_stack(columns) if columns else np.empty((len(block.time), 0))


def rows_of_map(block: StrainBlock, sensors: SensorRows, readings: Mapping[str, str]) -> FloatArray:
    """Return (n, n_d) readings of a map: strains, then auxiliary sensors less what thrust makes of them.

    Thrust that the recording does not hold is 0.
    """
    thrust = block.readings.get(THRUST, np.zeros(len(block.time)))
    return sensors.without_thrust(np.hstack([block.strain, all_readings(block, readings)]), thrust)
