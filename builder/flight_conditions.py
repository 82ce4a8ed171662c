"""Flight conditions mu = [M, alpha, beta, H] and the sets of them that snapshots are taken at."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import product
from math import acos, atan2, cos, degrees, radians, sin

from strainfmu.atmosphere import dynamic_pressure, pressure_and_temperature
from strainfmu.errors import InputError


@dataclass(frozen=True)
class FlightCondition:
    """One flight condition.

    Attributes
    ----------
    mach_number : M [1].
    angle_of_attack : alpha [rad], positive nose-up.
    sideslip_angle : beta [rad], positive with the wind from starboard.
    altitude : H, geopotential [m].
    """

    mach_number: float
    angle_of_attack: float
    sideslip_angle: float
    altitude: float

    def __post_init__(self) -> None:
        if not self.mach_number > 1.0:
            raise InputError(f"Mach number: {self.mach_number:g} found, must be greater than 1")
        for name in ("angle_of_attack", "sideslip_angle"):
            if not abs(getattr(self, name)) < radians(90.0):
                raise InputError(f"{name}: {degrees(getattr(self, name)):g} deg found, must be within +-90 deg")

    @property
    def total_incidence(self) -> float:
        """Angle a_T between the axis and the wind [rad]: cos a_T = cos alpha cos beta."""
        cosine = cos(self.angle_of_attack) * cos(self.sideslip_angle)
        return acos(min(cosine, 1.0)) if cosine < 1.0 else 0.0

    @property
    def leeward_roll_angle(self) -> float:
        """Roll angle phi_T of the leeward meridian [rad], from +z towards +y (0 without incidence)."""
        y, z = -sin(self.sideslip_angle), sin(self.angle_of_attack) * cos(self.sideslip_angle)
        return atan2(y, z) if (y, z) != (0.0, 0.0) else 0.0

    @property
    def ambient_pressure(self) -> float:
        """p_inf [Pa]."""
        return pressure_and_temperature(self.altitude)[0]

    @property
    def dynamic_pressure(self) -> float:
        """q_inf [Pa]."""
        return dynamic_pressure(self.mach_number, self.altitude)

    def __str__(self) -> str:
        return (
            f"M {self.mach_number:g}, angle of attack {degrees(self.angle_of_attack):g} deg, "
            f"sideslip {degrees(self.sideslip_angle):g} deg, {self.altitude / 1e3:g} km"
        )


def condition_grid(
    mach_numbers: Iterable[float],
    angles_of_attack_deg: Iterable[float],
    sideslip_angles_deg: Iterable[float],
    altitude: float,
) -> list[FlightCondition]:
    """Return all combinations, sideslip running fastest. Angles in degrees, altitude in metres.

    The paper's set P1 is M {5, 5.5, 6, 6.5, 7} x alpha {0, 2, .., 10} x beta {0, 5, 10} at 20 km.
    """
    return [
        FlightCondition(mach, radians(alpha), radians(beta), altitude)
        for mach, alpha, beta in product(mach_numbers, angles_of_attack_deg, sideslip_angles_deg)
    ]


def flow_key(condition: FlightCondition) -> tuple[float, float]:
    """Return (M, a_T [rad]), rounded: on a body of revolution conditions that share it share one flow."""
    return round(condition.mach_number, 9), round(condition.total_incidence, 9)
