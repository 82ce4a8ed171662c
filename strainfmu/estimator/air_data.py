"""Air data of an estimate by name: angles, Mach number, pressures, with standard deviations."""

from dataclasses import dataclass
from typing import ClassVar

from strainfmu.arrays import BoolArray, FloatArray, component
from strainfmu.estimator.air_inputs import AIR_DATA_NAMES


@dataclass(frozen=True, eq=False, kw_only=True)
class NamedAirData:
    """Air data by name, a float of one sample and (k,) of k: the last axis of ``value``, (7,) or (k, 7)."""

    value: FloatArray

    angle_of_attack = component("value", 0, "[rad].")
    sideslip_angle = component("value", 1, "[rad].")
    total_incidence = component("value", 2, "Angle between body axis and wind [rad].")
    wind_roll_angle = component("value", 3, "phi_T, angle of the leeward meridian from +z towards +y [rad].")
    mach_number = component("value", 4, "[1].")
    static_pressure = component("value", 5, "p_inf [Pa].")
    dynamic_pressure = component("value", 6, "q_inf [Pa].")


@dataclass(frozen=True, eq=False, kw_only=True)
class AirData(NamedAirData):
    """Air data of k samples, or of one; the last axis has the order of :data:`AIR_DATA_NAMES`.

    Attributes
    ----------
    names : of the quantities.
    value, std : (k, 7) or (7,) in :data:`AIR_DATA_UNITS`: rad, rad, rad, rad, 1, Pa, Pa.
    is_identified : (k, 7) whether strain and air-data inputs determine it better than the ranges of the map.
    """

    names: ClassVar[tuple[str, ...]] = AIR_DATA_NAMES
    std: FloatArray
    is_identified: BoolArray

    @property
    def sigma(self) -> NamedAirData:
        """Standard deviations by name: ``air_data.sigma.mach_number``."""
        return NamedAirData(value=self.std)
