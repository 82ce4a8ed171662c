"""Air data: names and units of angles, Mach number and pressures, and their values at a flight state."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE, MACH_NUMBER, STATIC_PRESSURE

AIR_DATA_NAMES = (
    "angle_of_attack",
    "sideslip_angle",
    "total_incidence",
    "wind_roll_angle",
    MACH_NUMBER,
    STATIC_PRESSURE,
    DYNAMIC_PRESSURE,
)
AIR_DATA_UNITS = ("rad", "rad", "rad", "rad", "1", "Pa", "Pa")
"""Units of :data:`AIR_DATA_NAMES`."""

NAVIGATION = (MACH_NUMBER, STATIC_PRESSURE, DYNAMIC_PRESSURE)
"""Air data that are inputs, in this order."""


@dataclass(frozen=True, eq=False, kw_only=True)
class AirData:
    """Air data of k samples, or of one; the last axis has the order of :data:`AIR_DATA_NAMES`, ``wind_roll_angle``
    phi_T is the angle of the leeward meridian from +z towards +y.

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
