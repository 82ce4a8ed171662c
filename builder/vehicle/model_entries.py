"""Sections [aerodynamics], [resolution] and [truth] of the vehicle file: its models, and how fine they are."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, field_validator, model_validator

from builder.vehicle.toml.limits import STREAM_ANGLE_DEG, once_each
from builder.vehicle.toml.sections import FileName, MachNumber, Section

ENGINE_NAMES = ("euler", "newtonian", "table")
"""Sources of surface pressure by name; :data:`builder.aero.engines.registry.ENGINES` makes them."""


class Aerodynamics(Section):
    """Source of the surface pressure, and what that engine needs beyond the rest of the file.

    ``surface``, ``stagnation`` and ``leeward`` are the newtonian engine's, ``manifest`` the table's; files are
    relative to the vehicle file.
    """

    engine: str = "euler"
    surface: FileName | None = None
    surface_length_unit: Literal["m", "mm", "cm", "in", "ft"] = "m"
    stagnation: Literal["rayleigh_pitot", "classical"] | None = None
    leeward: Literal["ambient", "prandtl_meyer", "matched"] | None = None
    manifest: FileName | None = None

    @field_validator("engine")
    @classmethod
    def _engine_exists(cls, value: str) -> str:
        if value not in ENGINE_NAMES:
            raise ValueError(f"expected one of {', '.join(ENGINE_NAMES)}, got '{value}'")
        return value


class Resolution(Section):
    """Numerical resolution of one model of the vehicle."""

    radial_cells: int = Field(ge=8, le=400)
    circumferential_cells: int = Field(ge=8, le=400)
    surface_stations: int = Field(ge=10, le=2000)
    surface_roll_angles: int = Field(ge=16, le=720)
    harmonics: int = Field(ge=4, le=200)
    element_length_mm: float = Field(ge=0.1, le=1e4)
    wall_layers: int = Field(ge=1, le=8)

    @model_validator(mode="after")
    def _harmonics_fit(self) -> Resolution:
        if 2 * self.harmonics >= self.surface_roll_angles:
            raise ValueError(
                f"harmonics: expected less than half of surface_roll_angles {self.surface_roll_angles}, "
                f"got {self.harmonics}"
            )
        return self


class Resolutions(Section):
    """Resolution of the model that builds the map and of the one that plays the vehicle."""

    map: Resolution
    truth: Resolution


class Truth(Section):
    """The independent model that plays the vehicle in system simulations.

    ``engine`` is "euler" by default; "newtonian" where the tip is blunt and the map's engine is not "euler".
    """

    engine: Literal["euler", "newtonian"] | None = None
    mach_number: list[MachNumber] = Field(min_length=4)
    total_incidence_deg: list[Annotated[float, Field(ge=0.01, le=STREAM_ANGLE_DEG.high)]] = Field(min_length=4)
    manoeuvre: FileName

    @field_validator("mach_number", "total_incidence_deg")
    @classmethod
    def _each_value_once(cls, values: list[float]) -> list[float]:
        return once_each(values)
