"""Loads of a ground test, as they are applied: where, how much, in body axes.

Forces are in newton along body axes (x aft, y starboard, z up), moments in newton metre about the same axes by the
right-hand rule. Roll angles are in radians from +z toward +y. ``"outer"`` and ``"inner"`` are the surfaces of the
wall; a three-dimensional structure has others by name.
"""

import re
from dataclasses import dataclass

import numpy as np

from builder.structure.loads.temperature import TemperatureField
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

STANDARD_GRAVITY = 9.80665  # m/s2
Vector = tuple[float, float, float]
NO_VECTOR: Vector = (0.0, 0.0, 0.0)
UNIT_VECTORS: tuple[Vector, ...] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
"""Along body axes [1]."""


@dataclass(frozen=True, kw_only=True)
class PointForce:
    """A force on one point of the outer surface.

    Attributes
    ----------
    station : [m].
    roll_angle : [rad].
    force : [N].
    """

    station: float
    roll_angle: float
    force: Vector

    def __post_init__(self) -> None:
        _check("point force", station=self.station, roll_angle=self.roll_angle, force=self.force)


@dataclass(frozen=True, kw_only=True)
class PadForce:
    """A force spread over a pad on the outer surface, everywhere along the same direction (a bonded pad, a strap).

    Force per area goes as (1 + cos(pi s / half_length)) (1 + cos(pi phi / half_angle)) with the distance s along
    the axis and phi round it, and sums to ``force``.

    Attributes
    ----------
    station, roll_angle : of the pad's centre [m], [rad].
    half_length : half the pad's length along the axis [m].
    half_angle : half the angle that it spans [rad].
    force : resultant [N].
    """

    station: float
    roll_angle: float
    half_length: float
    half_angle: float
    force: Vector

    def __post_init__(self) -> None:
        _check("pad", station=self.station, roll_angle=self.roll_angle, force=self.force)
        _check_pad(self.half_length, self.half_angle)


@dataclass(frozen=True, kw_only=True)
class PadPressure:
    """A pad that presses along the surface's normal (a soft pad without friction).

    Pressure goes as the force of :class:`PadForce`. ``push`` is what a load cell behind the pad reads: the part of
    the resultant that points from the pad's centre to the axis.

    Attributes
    ----------
    station, roll_angle, half_length, half_angle : as in :class:`PadForce`.
    push : [N], positive inwards.
    """

    station: float
    roll_angle: float
    half_length: float
    half_angle: float
    push: float

    def __post_init__(self) -> None:
        _check("pad", station=self.station, roll_angle=self.roll_angle, push=self.push)
        _check_pad(self.half_length, self.half_angle)
        if self.half_angle > 0.5 * np.pi:
            raise InputError(f"pad: half_angle {self.half_angle:g} rad must be at most pi/2 where it presses")


@dataclass(frozen=True, kw_only=True)
class SurfacePressure:
    """A uniform pressure on a surface, positive into the material.

    ``"inner"`` is internal pressure over the ambient one: on the inner surface and on the face of the solid tip.
    What closes the aft end belongs to the support or is a :class:`SectionLoad`.

    Attributes
    ----------
    surface : name.
    pressure : [Pa].
    """

    surface: str
    pressure: float

    def __post_init__(self) -> None:
        _check("surface pressure", pressure=self.pressure)


@dataclass(frozen=True, kw_only=True)
class SurfaceForce:
    """A force spread evenly over the area of a named surface.

    Attributes
    ----------
    surface : name.
    force : resultant [N].
    """

    surface: str
    force: Vector

    def __post_init__(self) -> None:
        _check("surface force", force=self.force)


@dataclass(frozen=True, eq=False, kw_only=True)
class DistributedForce:
    """A force per length along the body, spread evenly round the outer surface at each station.

    Attributes
    ----------
    station : (n,) increasing [m]; no force ahead of the first and behind the last.
    force_per_length : (n, 3) [N/m], linear between stations.

    Raises
    ------
    InputError
        Stations do not increase, shapes differ, or a value is not finite.
    """

    station: FloatArray
    force_per_length: FloatArray

    def __post_init__(self) -> None:
        n = len(self.station)
        if n < 2 or np.shape(self.force_per_length) != (n, 3):
            raise InputError(
                f"distributed force: expected (n,) stations and (n, 3) forces per length, n at least 2, got "
                f"{np.shape(self.station)} and {np.shape(self.force_per_length)}"
            )
        _check("distributed force", station=self.station, force_per_length=self.force_per_length)
        if np.any(np.diff(self.station) <= 0.0):
            raise InputError("distributed force: stations must increase")


@dataclass(frozen=True, kw_only=True)
class SectionLoad:
    """A force and a moment on the ring of the outer surface at a station, as an end fitting applies them.

    The force is spread evenly round the ring, a bending moment as axial forces that go as its cosine, a torque as
    tangential forces.

    Attributes
    ----------
    station : [m].
    force : [N].
    moment : about the axis' point at the station [N m].
    """

    station: float
    force: Vector = NO_VECTOR
    moment: Vector = NO_VECTOR

    def __post_init__(self) -> None:
        _check("section load", station=self.station, force=self.force, moment=self.moment)


@dataclass(frozen=True, kw_only=True)
class Weight:
    """Own weight, point masses included, in an attitude of the vehicle.

    Attributes
    ----------
    up_roll_angle : roll angle of the meridian that points up [rad]; 0 with +z up, pi/2 with +y (starboard) up.
    nose_elevation : of the nose above the horizontal [rad].
    gravity : [m/s2].
    """

    up_roll_angle: float = 0.0
    nose_elevation: float = 0.0
    gravity: float = STANDARD_GRAVITY

    def __post_init__(self) -> None:
        _check(
            "weight", up_roll_angle=self.up_roll_angle, nose_elevation=self.nose_elevation, gravity=self.gravity
        )

    @property
    def acceleration(self) -> FloatArray:
        """(3,) acceleration of gravity in body axes [m/s2]."""
        level = np.cos(self.nose_elevation)
        up = [-np.sin(self.nose_elevation), level * np.sin(self.up_roll_angle), level * np.cos(self.up_roll_angle)]
        return -self.gravity * np.array(up)


@dataclass(frozen=True, kw_only=True)
class Acceleration:
    """Inertia of the structure and its point masses while the body accelerates; slow rotation, no spin.

    A body that stands under its weight strains as one that accelerates upwards with g.

    Attributes
    ----------
    linear : acceleration of the nose tip's point x = y = z = 0 [m/s2].
    angular : angular acceleration about body axes [rad/s2].
    """

    linear: Vector = NO_VECTOR
    angular: Vector = NO_VECTOR

    def __post_init__(self) -> None:
        _check("acceleration", linear=self.linear, angular=self.angular)


@dataclass(frozen=True, eq=False, kw_only=True)
class ApparentStrain:
    """Readings that are no strain: zeros, or what a gauge shows by its own temperature.

    Attributes
    ----------
    strain : (n_d,) [m/m].
    """

    strain: FloatArray

    def __post_init__(self) -> None:
        _check("apparent strain", strain=self.strain)


Load = (
    PointForce
    | PadForce
    | PadPressure
    | SurfacePressure
    | SurfaceForce
    | DistributedForce
    | SectionLoad
    | Weight
    | Acceleration
    | TemperatureField
    | ApparentStrain
)


def load_kind(load: Load) -> str:
    """Return what a load is, as text for a reader: the words of its class, such as "pad force"."""
    return re.sub("(?<=[a-z])(?=[A-Z])", " ", type(load).__name__).lower()


def _check(what: str, **values: float | Vector | FloatArray) -> None:
    for name, value in values.items():
        if not np.isfinite(value).all():
            raise InputError(f"{what}: {name} {value} must be finite")


def _check_pad(half_length: float, half_angle: float) -> None:
    if not (np.isfinite(half_length) and half_length > 0.0):
        raise InputError(f"pad: half_length {half_length:g} m must be greater than 0")
    if not 0.0 < half_angle <= np.pi:
        raise InputError(f"pad: half_angle {half_angle:g} rad must be greater than 0 and at most pi")
