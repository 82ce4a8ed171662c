"""A flight condition mu = [M, alpha, beta, H] and what follows from it.

The wind seen by the body is V (cos a cos b, -sin b, sin a cos b) in body axes: x aft, y starboard, z up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from math import atan2, cos, degrees, hypot, pi, sin

from strainfmu.atmosphere import dynamic_pressure, pressure_and_temperature


def _stated(label: str, unit: str, shown: str, factor: float) -> dict[str, dict[str, str | float]]:
    """Return the metadata of a field that files state: words, its unit, the unit of files, and the first per the
    second."""
    return {"stated": {"label": label, "unit": unit, "shown": shown, "factor": factor}}


@dataclass(frozen=True)
class FlightCondition:
    """One flight condition. Its fields declare names and units; files and records follow
    :data:`CONDITION_QUANTITIES`.

    Attributes
    ----------
    mach_number : M [1].
    angle_of_attack : alpha [rad], positive nose-up.
    sideslip_angle : beta [rad], positive with the wind from starboard.
    altitude : H, geopotential [m].
    parameters : flow parameters, such as deflections of control surfaces, in the order and the
        units of the vehicle file.

    Example
    -------
    >>> from math import degrees, radians
    >>> condition = FlightCondition(6.0, radians(4.0), radians(3.0), 20e3)
    >>> print(f"{degrees(condition.total_incidence):.3f} deg, {1e-3 * condition.dynamic_pressure:.1f} kPa")
    4.999 deg, 138.0 kPa
    """

    mach_number: float = field(metadata=_stated("Mach number", "1", "1", 1.0))
    angle_of_attack: float = field(metadata=_stated("angle of attack", "rad", "deg", pi / 180.0))
    sideslip_angle: float = field(metadata=_stated("sideslip angle", "rad", "deg", pi / 180.0))
    altitude: float = field(metadata=_stated("altitude", "m", "km", 1e3))
    parameters: tuple[float, ...] = ()

    @classmethod
    def of_row(cls, row: Sequence[float]) -> FlightCondition:
        """Return the condition of :meth:`as_row`."""
        mach_number, angle_of_attack, sideslip_angle, altitude, *parameters = map(float, row)
        return cls(mach_number, angle_of_attack, sideslip_angle, altitude, tuple(parameters))

    @property
    def _cross_flow(self) -> tuple[float, float]:
        """Direction of the wind along y and z."""
        return -sin(self.sideslip_angle), sin(self.angle_of_attack) * cos(self.sideslip_angle)

    @property
    def total_incidence(self) -> float:
        """Angle a_T between the axis and the wind [rad]: cos a_T = cos alpha cos beta.

        By the arc tangent, which keeps its digits near 0, where the arc cosine loses half of them.
        """
        return atan2(hypot(*self._cross_flow), cos(self.angle_of_attack) * cos(self.sideslip_angle))

    @property
    def leeward_roll_angle(self) -> float:
        """Roll angle phi_T of the leeward meridian [rad], from +z towards +y (0 without incidence)."""
        return atan2(*self._cross_flow)

    @property
    def ambient_pressure(self) -> float:
        """p_inf [Pa]."""
        return pressure_and_temperature(self.altitude)[0]

    @property
    def dynamic_pressure(self) -> float:
        """q_inf [Pa]."""
        return dynamic_pressure(self.mach_number, self.altitude)

    def as_tuple(self) -> tuple[float, float, float, float]:
        """Return (mach_number, angle_of_attack, sideslip_angle, altitude)."""
        return self.mach_number, self.angle_of_attack, self.sideslip_angle, self.altitude

    def as_row(self) -> tuple[float, ...]:
        """Return :meth:`as_tuple` and the flow parameters after it."""
        return (*self.as_tuple(), *self.parameters)

    def __str__(self) -> str:
        return (
            f"M {self.mach_number:g}, angle of attack {degrees(self.angle_of_attack):g} deg, "
            f"sideslip {degrees(self.sideslip_angle):g} deg, {self.altitude / 1e3:g} km"
            + (f", parameters {', '.join(f'{value:g}' for value in self.parameters)}" if self.parameters else "")
        )


@dataclass(frozen=True)
class ConditionQuantity:
    """A quantity of a flight condition: ``name`` of its attribute, ``label`` in words, ``unit`` of the attribute,
    ``shown`` the unit that files state it in, ``factor`` the first per the second."""

    name: str
    label: str
    unit: str
    shown: str
    factor: float

    @property
    def column(self) -> str:
        """Name of the columns of files and of the entries of vehicle files: it ends on the unit."""
        return with_unit(self.name, self.shown)


def with_unit(name: str, unit: str) -> str:
    """Return the name of a column or an entry of ``name`` in ``unit``."""
    return name if unit == "1" else f"{name}_{unit}"


CONDITION_QUANTITIES = tuple(
    ConditionQuantity(row.name, **row.metadata["stated"]) for row in fields(FlightCondition) if row.metadata
)
"""What a flight condition consists of without flow parameters, in the order of its rows."""

CONDITION_NAMES = tuple(quantity.name for quantity in CONDITION_QUANTITIES)
CONDITION_COLUMNS = tuple(quantity.column for quantity in CONDITION_QUANTITIES)

MACH_NUMBER, ANGLE_OF_ATTACK, SIDESLIP_ANGLE, ALTITUDE = CONDITION_NAMES
MACH_COLUMN, ANGLE_COLUMN, SIDESLIP_COLUMN, ALTITUDE_COLUMN = CONDITION_COLUMNS
