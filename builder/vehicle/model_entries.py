"""Sections [aerodynamics], [resolution] and [truth] of the vehicle file: its models, and how fine they are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field, field_validator, model_validator

from builder.vehicle.toml.toml_sections import STREAM_ANGLE_DEG, FileName, MachNumber, Section, once_each
from strainfmu.flight_condition import MACH_COLUMN

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


@dataclass(frozen=True)
class NeededBy:
    """Mark of an entry that is required where the vehicle has what needs it; elsewhere its default is not used.

    Attributes
    ----------
    what : needs the entry, as the reference and the message of a missing entry say it.
    """

    what: str


EULER = NeededBy("engine 'euler'")
NODES = NeededBy("a profile or sections")
FOURIER = NeededBy("a profile")
ELEMENTS = NeededBy("a profile, and for the vehicle that flies with sections")


class Resolution(Section):
    """Numerical resolution of one model of the vehicle. A vehicle given by a surface has its files instead."""

    radial_cells: Annotated[int, EULER] = Field(default=16, ge=8, le=400)
    circumferential_cells: Annotated[int, EULER] = Field(default=24, ge=8, le=400)
    surface_stations: Annotated[int, NODES] = Field(default=100, ge=10, le=2000)
    surface_roll_angles: Annotated[int, NODES] = Field(default=72, ge=16, le=720)
    harmonics: Annotated[int, FOURIER] = Field(default=4, ge=4, le=200)
    element_length_mm: Annotated[float, ELEMENTS] = Field(default=10.0, ge=0.1, le=1e4)
    wall_layers: Annotated[int, ELEMENTS] = Field(default=1, ge=1, le=8)

    @property
    def surface_nodes(self) -> tuple[int, int]:
        """Stations and roll angles of the pressure nodes."""
        return self.surface_stations, self.surface_roll_angles

    @model_validator(mode="after")
    def _harmonics_fit(self) -> Resolution:
        if "harmonics" in self.model_fields_set and 2 * self.harmonics >= self.surface_roll_angles:
            raise ValueError(
                f"harmonics: expected less than half of surface_roll_angles {self.surface_roll_angles}, "
                f"got {self.harmonics}"
            )
        return self


class Resolutions(Section):
    """Resolution of the model that builds the map and of the one that plays the vehicle."""

    map: Resolution = Resolution()
    truth: Resolution = Resolution()


MIN_KNOTS = 4


KNOTS = (MACH_COLUMN, "total_incidence_deg")
"""Entries of [truth] at which the flows of a body of revolution that flies are solved."""


class Truth(Section):
    """The independent model that plays the vehicle in system simulations.

    ``engine`` is "euler" by default; "newtonian" where the tip is blunt and the map's engine is not "euler".
    ``mach_number`` (one, or four and more) and ``total_incidence_deg`` are used for a profile alone, ``manoeuvre``
    in demonstrations.
    """

    engine: Literal["euler", "newtonian"] | None = None
    mach_number: list[MachNumber] | None = None
    total_incidence_deg: list[Annotated[float, Field(ge=0.01, le=STREAM_ANGLE_DEG.high)]] | None = Field(
        default=None, min_length=MIN_KNOTS
    )
    manoeuvre: FileName | None = None

    @field_validator(MACH_COLUMN)
    @classmethod
    def _one_or_a_spline(cls, values: list[float] | None) -> list[float] | None:
        if values is not None and not (len(values) == 1 or len(values) >= MIN_KNOTS):
            raise ValueError(f"expected 1 value, or at least {MIN_KNOTS}, got {values}")
        return values

    @field_validator(*KNOTS)
    @classmethod
    def _each_value_once(cls, values: list[float] | None) -> list[float] | None:
        return None if values is None else once_each(values)
