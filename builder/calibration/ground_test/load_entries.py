"""Loads of a ground test as entries of its file, and the known loads that they are."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal, get_args

import numpy as np
from pydantic import Field, model_validator

from builder.structure.as_built_kinds import UNIT
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
    Weight,
)
from builder.structure.loads.temperature import TemperatureField, temperature_mode
from builder.vehicle.toml.toml_sections import Section

NO_LOAD_CELL = ("weight", "acceleration", "temperature")
"""Kinds whose size no load cell or pressure sensor reads: the error common to all cases does not touch them."""

IN_SI = {
    "x_m": ("station", 1.0),
    "roll_angle_deg": ("roll_angle", UNIT["deg"]),
    "half_length_mm": ("half_length", UNIT["mm"]),
    "half_angle_deg": ("half_angle", UNIT["deg"]),
    "force_N": ("force", 1.0),
    "moment_N_m": ("moment", 1.0),
    "push_N": ("push", 1.0),
    "pressure_Pa": ("pressure", 1.0),
    "up_roll_angle_deg": ("up_roll_angle", UNIT["deg"]),
    "nose_elevation_deg": ("nose_elevation", UNIT["deg"]),
    "linear_m_per_s2": ("linear", 1.0),
    "surface": ("surface", 1.0),
}
"""Field of a load that an entry states, and the size of the entry's unit in SI."""

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
    applied: ClassVar[Any]
    """Class of the load."""

    def load(self) -> Any:
        """Return the load in SI."""
        stated = {IN_SI[name]: value for name, value in self if name in IN_SI and value is not None}
        return self.applied(**{field: times(value, unit) for (field, unit), value in stated.items()})

    @classmethod
    def of(cls, load: Load) -> dict[str, Any]:
        """Return the entries that are ``load``, rounded to 12 digits."""
        (kind,) = get_args(cls.model_fields["kind"].annotation)
        stated = {name: IN_SI[name] for name in cls.model_fields if name in IN_SI}
        values = {
            name: _rounded(times(getattr(load, field), 1.0 / unit)) for name, (field, unit) in stated.items()
        }
        return {"kind": kind, **values}


class PadPlace(LoadEntry):
    """A pad: where its centre is, and half the length and the angle that it spans."""

    x_m: Station
    roll_angle_deg: RollAngle
    half_length_mm: float = Field(ge=0.1, le=1e4)
    half_angle_deg: float = Field(ge=0.1, le=180.0)


class PadEntry(PadPlace):
    """A force spread over a pad, everywhere in the same direction: a bonded pad, a strap."""

    applied = PadForce
    kind: Literal["pad"]
    force_N: BodyForce


class PushEntry(PadPlace):
    """A soft pad without friction that presses along the normal; ``push_N`` is what a load cell behind it
    reads."""

    applied = PadPressure
    kind: Literal["push"]
    half_angle_deg: float = Field(ge=0.1, le=90.0)
    push_N: ForceN


class PointEntry(LoadEntry):
    """A force on one point of the outer surface."""

    applied = PointForce
    kind: Literal["point"]
    x_m: Station
    roll_angle_deg: RollAngle
    force_N: BodyForce


class SectionEntry(LoadEntry):
    """A force and a moment on the ring at a station, as an end fitting applies them; the moment about the axis
    there."""

    applied = SectionLoad
    kind: Literal["section"]
    x_m: Station
    force_N: BodyForce | None = None
    moment_N_m: BodyMoment | None = None

    @model_validator(mode="after")
    def _has_one(self) -> SectionEntry:
        if self.force_N is None and self.moment_N_m is None:
            raise ValueError("expected force_N or moment_N_m, got neither")
        return self

    @classmethod
    def of(cls, load: Load) -> dict[str, Any]:
        entries = super().of(load)
        zero = [name for name in ("moment_N_m", "force_N") if not any(entries[name])]
        return {name: value for name, value in entries.items() if name not in zero[:1]}


class SurfaceEntry(LoadEntry):
    """A force spread evenly over a named surface: ``outer``, ``inner``, or one of a three-dimensional mesh."""

    applied = SurfaceForce
    kind: Literal["surface"]
    surface: str = Field(min_length=1, max_length=200)
    force_N: BodyForce


class PressureEntry(LoadEntry):
    """Internal pressure over the ambient one."""

    applied = SurfacePressure
    kind: Literal["internal_pressure"]
    pressure_Pa: float = Field(ge=-1e7, le=1e8)

    def load(self) -> SurfacePressure:
        return SurfacePressure(surface="inner", pressure=self.pressure_Pa)


class WeightEntry(LoadEntry):
    """Own weight: ``up_roll_angle_deg`` is the meridian that points up, 0 with +z, 90 with +y (starboard) up."""

    applied = Weight
    kind: Literal["weight"]
    up_roll_angle_deg: RollAngle = 0.0
    nose_elevation_deg: float = Field(default=0.0, ge=-90.0, le=90.0)


class AccelerationEntry(LoadEntry):
    """Inertia while the body accelerates, without its weight."""

    applied = Acceleration
    kind: Literal["acceleration"]
    linear_m_per_s2: BodyForce


class EntryAlongBody(LoadEntry):
    """A load that is linear between stations: entries ``by_station`` have a value for each."""

    by_station: ClassVar[tuple[str, ...]]
    x_m: Stations

    @model_validator(mode="after")
    def _one_for_each_station(self) -> EntryAlongBody:
        for name in self.by_station:
            values = getattr(self, name)
            if values is not None and len(values) != len(self.x_m):
                raise ValueError(f"{name}: expected {len(self.x_m)}, as many as x_m, got {len(values)}")
        if np.any(np.diff(self.x_m) <= 0.0):
            raise ValueError(f"x_m: expected increasing stations, got {self.x_m}")
        return self


class DistributedEntry(EntryAlongBody):
    """A force per length along the body, evenly round it, linear between stations."""

    by_station = ("force_N_per_m",)
    kind: Literal["distributed"]
    force_N_per_m: list[BodyForce] = Field(min_length=2, max_length=1000)

    def load(self) -> DistributedForce:
        return DistributedForce(station=np.array(self.x_m), force_per_length=np.array(self.force_N_per_m))


class TemperatureEntry(EntryAlongBody):
    """A temperature rise from the gauges' zero, going round the body as cos(m (phi - roll_angle)).

    ``temperature_K`` is the temperature of the middle of the wall at each station, ``through_wall_K`` the
    temperature of the outer face less the inner face's.
    """

    by_station = ("temperature_K", "through_wall_K")
    kind: Literal["temperature"]
    temperature_K: list[Annotated[float, Field(ge=-300.0, le=3000.0)]] = Field(min_length=1)
    through_wall_K: list[Annotated[float, Field(ge=-2000.0, le=2000.0)]] | None = None
    harmonic: int = Field(default=0, ge=0, le=20)
    roll_angle_deg: RollAngle = 0.0

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

WRITTEN = (PadEntry, PushEntry, PointEntry, SectionEntry, SurfaceEntry, PressureEntry, WeightEntry)
"""Kinds that are written as well."""


def entry_of(load: Load) -> dict[str, object]:
    """Return the entries of a file that are ``load``, rounded to 12 digits.

    Raises
    ------
    TypeError
        The load is of a kind that is not written.
    """
    entries = [entry for entry in WRITTEN if isinstance(load, entry.applied)]
    if not entries or (isinstance(load, SurfacePressure) and load.surface != "inner"):
        raise TypeError(f"{type(load).__name__} has no entry")
    return entries[0].of(load)


def times(value: Any, factor: float) -> Any:
    """Return a number, or a vector as a tuple, times ``factor``; a name stays."""
    if isinstance(value, str):
        return value
    return tuple(factor * number for number in value) if isinstance(value, list | tuple) else factor * value


def _rounded(value: Any) -> Any:
    if isinstance(value, str):
        return value
    return [_rounded(number) for number in value] if isinstance(value, tuple) else float(f"{value:.12g}")
