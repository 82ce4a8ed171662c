"""Loads of a ground test as entries of its file, and the known loads that they are."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from builder.structure.loads.applied import (
    Acceleration,
    DistributedForce,
    Load,
    PadForce,
    PadPressure,
    PointForce,
    SectionLoad,
    SurfaceForce,
    SurfacePressure,
    Vector,
    Weight,
)
from builder.structure.loads.temperature import TemperatureField, temperature_mode
from builder.vehicle.toml.toml_sections import Section

NO_LOAD_CELL = ("weight", "acceleration", "temperature")
"""Kinds whose size no load cell or pressure sensor reads: the error common to all cases does not touch them."""

Stations = Annotated[list[Annotated[float, Field(ge=-1e3, le=1e3)]], Field(min_length=1, max_length=1000)]
ForceN = Annotated[float, Field(ge=-1e8, le=1e8)]
MomentNm = Annotated[float, Field(ge=-1e9, le=1e9)]
RollAngle = Annotated[float, Field(ge=-360.0, le=360.0)]
BodyForce = Annotated[list[ForceN], Field(min_length=3, max_length=3)]
BodyMoment = Annotated[list[MomentNm], Field(min_length=3, max_length=3)]
Station = Annotated[float, Field(ge=-1e3, le=1e3)]


class LoadEntry(Section):
    """What every load has: how exactly it is known, one standard deviation (None takes the file's), and the
    load cell that reads it: loads of one name have the errors of that load cell in common."""

    std_percent: float | None = Field(default=None, ge=0.0, le=100.0)
    load_cell: str = Field(default="1", min_length=1, max_length=200)


class PadPlace(LoadEntry):
    """A pad: where its centre is, and half the length and the angle that it spans."""

    x_m: Station
    roll_angle_deg: RollAngle
    half_length_mm: float = Field(ge=0.1, le=1e4)
    half_angle_deg: float = Field(ge=0.1, le=180.0)


class PadEntry(PadPlace):
    """A force spread over a pad, everywhere in the same direction: a bonded pad, a strap."""

    kind: Literal["pad"]
    force_N: BodyForce

    def load(self) -> PadForce:
        return PadForce(
            station=self.x_m,
            roll_angle=float(np.deg2rad(self.roll_angle_deg)),
            half_length=1e-3 * self.half_length_mm,
            half_angle=float(np.deg2rad(self.half_angle_deg)),
            force=_vector(self.force_N),
        )


class PushEntry(PadPlace):
    """A soft pad without friction that presses along the normal; ``push_N`` is what a load cell behind it
    reads."""

    kind: Literal["push"]
    half_angle_deg: float = Field(ge=0.1, le=90.0)
    push_N: ForceN

    def load(self) -> PadPressure:
        return PadPressure(
            station=self.x_m,
            roll_angle=float(np.deg2rad(self.roll_angle_deg)),
            half_length=1e-3 * self.half_length_mm,
            half_angle=float(np.deg2rad(self.half_angle_deg)),
            push=self.push_N,
        )


class PointEntry(LoadEntry):
    """A force on one point of the outer surface."""

    kind: Literal["point"]
    x_m: Station
    roll_angle_deg: RollAngle
    force_N: BodyForce

    def load(self) -> PointForce:
        roll = float(np.deg2rad(self.roll_angle_deg))
        return PointForce(station=self.x_m, roll_angle=roll, force=_vector(self.force_N))


class SectionEntry(LoadEntry):
    """A force and a moment on the ring at a station, as an end fitting applies them; the moment about the axis
    there."""

    kind: Literal["section"]
    x_m: Station
    force_N: BodyForce | None = None
    moment_N_m: BodyMoment | None = None

    @model_validator(mode="after")
    def _has_one(self) -> SectionEntry:
        if self.force_N is None and self.moment_N_m is None:
            raise ValueError("expected force_N or moment_N_m, got neither")
        return self

    def load(self) -> SectionLoad:
        none = [0.0, 0.0, 0.0]
        return SectionLoad(
            station=self.x_m, force=_vector(self.force_N or none), moment=_vector(self.moment_N_m or none)
        )


class SurfaceEntry(LoadEntry):
    """A force spread evenly over a named surface: ``outer``, ``inner``, or one of a three-dimensional mesh."""

    kind: Literal["surface"]
    surface: str = Field(min_length=1, max_length=200)
    force_N: BodyForce

    def load(self) -> SurfaceForce:
        return SurfaceForce(surface=self.surface, force=_vector(self.force_N))


class DistributedEntry(LoadEntry):
    """A force per length along the body, evenly round it, linear between stations."""

    kind: Literal["distributed"]
    x_m: Stations
    force_N_per_m: list[BodyForce] = Field(min_length=2, max_length=1000)

    @model_validator(mode="after")
    def _one_for_each_station(self) -> DistributedEntry:
        if len(self.x_m) != len(self.force_N_per_m):
            raise ValueError(
                f"force_N_per_m: expected {len(self.x_m)}, as many as x_m, got {len(self.force_N_per_m)}"
            )
        _check_rising(self.x_m)
        return self

    def load(self) -> DistributedForce:
        return DistributedForce(station=np.array(self.x_m), force_per_length=np.array(self.force_N_per_m))


class PressureEntry(LoadEntry):
    """Internal pressure over the ambient one."""

    kind: Literal["internal_pressure"]
    pressure_Pa: float = Field(ge=-1e7, le=1e8)

    def load(self) -> SurfacePressure:
        return SurfacePressure(surface="inner", pressure=self.pressure_Pa)


class WeightEntry(LoadEntry):
    """Own weight: ``up_roll_angle_deg`` is the meridian that points up, 0 with +z, 90 with +y (starboard) up."""

    kind: Literal["weight"]
    up_roll_angle_deg: RollAngle = 0.0
    nose_elevation_deg: float = Field(default=0.0, ge=-90.0, le=90.0)

    def load(self) -> Weight:
        return Weight(
            up_roll_angle=float(np.deg2rad(self.up_roll_angle_deg)),
            nose_elevation=float(np.deg2rad(self.nose_elevation_deg)),
        )


class AccelerationEntry(LoadEntry):
    """Inertia while the body accelerates, without its weight."""

    kind: Literal["acceleration"]
    linear_m_per_s2: BodyForce

    def load(self) -> Acceleration:
        return Acceleration(linear=_vector(self.linear_m_per_s2))


class TemperatureEntry(LoadEntry):
    """A temperature rise from the gauges' zero, going round the body as cos(m (phi - roll_angle)).

    ``temperature_K`` is the temperature of the middle of the wall at each station, ``through_wall_K`` the
    temperature of the outer face less the inner face's.
    """

    kind: Literal["temperature"]
    x_m: Stations
    temperature_K: list[Annotated[float, Field(ge=-300.0, le=3000.0)]] = Field(min_length=1)
    through_wall_K: list[Annotated[float, Field(ge=-2000.0, le=2000.0)]] | None = None
    harmonic: int = Field(default=0, ge=0, le=20)
    roll_angle_deg: RollAngle = 0.0

    @model_validator(mode="after")
    def _one_for_each_station(self) -> TemperatureEntry:
        for name in ("temperature_K", "through_wall_K"):
            values = getattr(self, name)
            if values is not None and len(values) != len(self.x_m):
                raise ValueError(f"{name}: expected {len(self.x_m)}, as many as x_m, got {len(values)}")
        _check_rising(self.x_m)
        return self

    def load(self) -> TemperatureField:
        return temperature_mode(
            np.array(self.x_m),
            np.array(self.temperature_K),
            self.harmonic,
            float(np.deg2rad(self.roll_angle_deg)),
            None if self.through_wall_K is None else np.array(self.through_wall_K),
        )


AnyLoadEntry = Annotated[
    PadEntry
    | PushEntry
    | PointEntry
    | SectionEntry
    | SurfaceEntry
    | DistributedEntry
    | PressureEntry
    | WeightEntry
    | AccelerationEntry
    | TemperatureEntry,
    Field(discriminator="kind"),
]


def entry_of(load: Load) -> dict[str, object]:
    """Return the entries of a file that are ``load``, rounded to 12 digits.

    Raises
    ------
    TypeError
        The load has no entry: fields of temperature, apparent strain.
    """
    match load:
        case PadForce():
            return {"kind": "pad", **_pad_place(load), "force_N": _numbers(load.force)}
        case PadPressure():
            return {"kind": "push", **_pad_place(load), "push_N": _number(load.push)}
        case PointForce():
            place = {"x_m": _number(load.station), "roll_angle_deg": _degrees(load.roll_angle)}
            return {"kind": "point", **place, "force_N": _numbers(load.force)}
        case SectionLoad():
            parts = {"force_N": load.force, "moment_N_m": load.moment}
            acting = {name: _numbers(part) for name, part in parts.items() if any(part)}
            return {"kind": "section", "x_m": _number(load.station), **(acting or {"force_N": [0.0] * 3})}
        case SurfaceForce():
            return {"kind": "surface", "surface": load.surface, "force_N": _numbers(load.force)}
        case SurfacePressure(surface="inner"):
            return {"kind": "internal_pressure", "pressure_Pa": _number(load.pressure)}
        case Weight():
            up, nose = _degrees(load.up_roll_angle), _degrees(load.nose_elevation)
            return {"kind": "weight", "up_roll_angle_deg": up, "nose_elevation_deg": nose}
        case _:
            raise TypeError(f"{type(load).__name__} has no entry")


def _pad_place(load: PadForce | PadPressure) -> dict[str, object]:
    return {
        "x_m": _number(load.station),
        "roll_angle_deg": _degrees(load.roll_angle),
        "half_length_mm": _number(1e3 * load.half_length),
        "half_angle_deg": _degrees(load.half_angle),
    }


def _number(value: float) -> float:
    return float(f"{value:.12g}")


def _numbers(vector: Vector) -> list[float]:
    return [_number(value) for value in vector]


def _degrees(angle: float) -> float:
    return _number(float(np.rad2deg(angle)))


def _vector(values: list[float]) -> Vector:
    return values[0], values[1], values[2]


def _check_rising(stations: list[float]) -> None:
    if np.any(np.diff(stations) <= 0.0):
        raise ValueError(f"x_m: expected increasing stations, got {stations}")
