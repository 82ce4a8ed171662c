"""Entries of [structure] beyond one wall of one material: thickness along the body, regions, frames, masses."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field, field_validator, model_validator

from builder.vehicle.toml.sections import Section, Station

Thickness = Field(ge=0.01, le=1e3)


class ThicknessEntry(Section):
    """Thickness of the wall at a station of the outer surface; linear between, constant beyond the stations."""

    x_m: Station
    thickness_mm: float = Thickness


class RegionEntry(Section):
    """Part of the wall, between two stations of the outer surface, of another material of [materials]."""

    start_x_m: float = Field(ge=0.0, le=1e3)
    end_x_m: Station
    material: str = Field(min_length=1)

    @model_validator(mode="after")
    def _has_length(self) -> RegionEntry:
        if self.end_x_m <= self.start_x_m:
            raise ValueError(
                f"end_x_m: expected a station behind start_x_m {self.start_x_m:g}, got {self.end_x_m:g}"
            )
        return self


class FrameEntry(Section):
    """A ring of rectangular section on the inner surface; ``depth_mm`` "closed" makes a bulkhead.

    The station is the ring's middle on the inner surface. Without ``material`` the ring has the wall's there.
    """

    x_m: Station
    width_mm: float = Field(ge=0.1, le=1e4)
    depth_mm: float | Literal["closed"]
    material: str | None = Field(default=None, min_length=1)

    @field_validator("depth_mm", mode="before")
    @classmethod
    def _number_or_closed(cls, value: Any) -> Any:
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if value != "closed" and not (number and 0.1 <= value <= 1e4):
            raise ValueError(f"expected 0.1 .. 10000 or 'closed', got {value!r}")
        return value


class PointMassEntry(Section):
    """A mass without size: of a profile on the axis, carried by the wall round it.

    On an imported mesh it may be anywhere, and ``on`` names the surface of the mesh that carries it.
    """

    x_m: Station
    y_m: float = Field(default=0.0, ge=-1e3, le=1e3)
    z_m: float = Field(default=0.0, ge=-1e3, le=1e3)
    mass_kg: float = Field(ge=1e-6, le=1e7)
    on: str | None = Field(default=None, min_length=1)


class CoverEntry(Section):
    """Mass per outer area between two stations that stiffens nothing, such as thermal protection."""

    start_x_m: float = Field(ge=0.0, le=1e3)
    end_x_m: Station
    mass_kg_per_m2: float = Field(ge=1e-6, le=1e5)

    @model_validator(mode="after")
    def _has_length(self) -> CoverEntry:
        if self.end_x_m <= self.start_x_m:
            raise ValueError(
                f"end_x_m: expected a station behind start_x_m {self.start_x_m:g}, got {self.end_x_m:g}"
            )
        return self
