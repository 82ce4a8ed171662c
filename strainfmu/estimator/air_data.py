"""Air data: names and units of angles, Mach number and pressures, and their values at a flight state."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.atmosphere import HEAT_CAPACITY_RATIO
from strainfmu.estimator.tables.flight_tables import LOG_PRESSURE, MACH, MIN_INCIDENCE, U, W

AIR_DATA_NAMES = (
    "angle_of_attack",
    "sideslip_angle",
    "total_incidence",
    "wind_roll_angle",
    "mach_number",
    "static_pressure",
    "dynamic_pressure",
)
AIR_DATA_UNITS = ("rad", "rad", "rad", "rad", "1", "Pa", "Pa")
"""Units of :data:`AIR_DATA_NAMES`."""

NAVIGATION = ("mach_number", "static_pressure", "dynamic_pressure")
"""Air data that are inputs, in this order."""


@dataclass(frozen=True, eq=False, kw_only=True)
class AirData:
    """Air data of k samples, or of one; the last axis is that of :data:`AIR_DATA_NAMES`, ``wind_roll_angle``
    phi_T that of the leeward meridian from +z towards +y.

    Attributes
    ----------
    names : of the quantities.
    value, std : (k, 7) or (7,) in :data:`AIR_DATA_UNITS`: rad, rad, rad, rad, 1, Pa, Pa.
    is_identified : (k, 7) whether strain and navigation say more of it than the ranges of the map do.
    """

    names: ClassVar[tuple[str, ...]] = AIR_DATA_NAMES
    value: FloatArray
    std: FloatArray
    is_identified: BoolArray

    def of_sample(self, sample: int) -> AirData:
        """Return the air data of one sample, arrays (7,)."""
        return AirData(value=self.value[sample], std=self.std[sample], is_identified=self.is_identified[sample])


def air_data_of_state(state: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the values (k, 7) at ``state`` (k, 4), and their derivatives by it (k, 7, 4)."""
    mach, u, w = state[:, MACH], state[:, U], state[:, W]
    incidence = np.sqrt(u * u + w * w + MIN_INCIDENCE * MIN_INCIDENCE)
    pressure = np.exp(state[:, LOG_PRESSURE])
    dynamic = 0.5 * HEAT_CAPACITY_RATIO * mach * mach * pressure
    # Direction of the wind in body axes: x aft, y to starboard, z up.
    across = np.sin(incidence) / incidence
    along, y, z = np.cos(incidence), across * w, across * u
    value = np.column_stack(
        [np.arctan2(z, along), -np.arcsin(y), incidence, np.arctan2(w, u), mach, pressure, dynamic]
    )
    jacobian = np.zeros((len(state), 7, 4))
    by_incidence = np.stack([u, w], axis=1) / incidence[:, None]
    slope = ((np.cos(incidence) - across) / incidence)[:, None] * by_incidence
    by_z, by_y = slope * u[:, None], slope * w[:, None]
    by_z[:, 0] += across
    by_y[:, 1] += across
    by_along = -np.sin(incidence)[:, None] * by_incidence
    jacobian[:, 0, U : W + 1] = (along[:, None] * by_z - z[:, None] * by_along) / (along**2 + z**2)[:, None]
    jacobian[:, 1, U : W + 1] = -by_y / np.sqrt(1.0 - y * y)[:, None]
    jacobian[:, 2, U : W + 1] = by_incidence
    jacobian[:, 3, U : W + 1] = np.stack([-w, u], axis=1) / (incidence * incidence)[:, None]
    jacobian[:, 4, MACH] = 1.0
    jacobian[:, 5, LOG_PRESSURE] = pressure
    jacobian[:, 6, MACH], jacobian[:, 6, LOG_PRESSURE] = 2.0 * dynamic / mach, dynamic
    return value, jacobian
