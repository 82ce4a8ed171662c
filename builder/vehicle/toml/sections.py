"""Sections of the vehicle file: their entries, units and limits. [map] and [noise] are in
:mod:`builder.vehicle.map.options`, [structure] in :mod:`builder.vehicle.structure.section`."""

from __future__ import annotations

from itertools import product
from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, field_validator, model_validator

from builder.vehicle.toml.limits import (
    ALTITUDE_KM,
    HALF_ANGLE_DEG,
    MACH_NUMBER,
    STATION_M,
    STREAM_ANGLE_DEG,
    once_each,
    one_line,
)

ENGINE_NAMES = ("euler", "newtonian", "table")
"""Sources of surface pressure by name; :data:`builder.aero.engines.ENGINES` makes them."""


class Section(BaseModel):
    """A table of a file: unknown entries, wrong types, NaN and infinity are refused; it never changes."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=True)


MachNumber = Annotated[float, Field(ge=MACH_NUMBER.low, le=MACH_NUMBER.high)]
StreamAngle = Annotated[float, Field(ge=STREAM_ANGLE_DEG.low, le=STREAM_ANGLE_DEG.high)]
Altitude = Annotated[float, Field(ge=ALTITUDE_KM.low, le=ALTITUDE_KM.high)]
HalfAngle = Annotated[float, Field(ge=HALF_ANGLE_DEG.low, le=HALF_ANGLE_DEG.high)]
Station = Annotated[float, Field(ge=STATION_M.low, le=STATION_M.high)]
GaugeLength = Annotated[float, Field(ge=0.0, le=100.0)]
FileName = Annotated[str, Field(min_length=1, max_length=1000), AfterValidator(one_line)]
"""Relative to the vehicle file."""


class MaterialEntry(Section):
    """Isotropic linear elasticity."""

    youngs_modulus_GPa: float = Field(ge=0.1, le=2e3)
    poisson_ratio: float = Field(ge=0.0, le=0.499)
    density_kg_per_m3: float | None = Field(default=None, ge=10.0, le=3e4)


class Reference(Section):
    """Reference quantities of the coefficients; area and length default to base area and base diameter."""

    area_m2: float | None = Field(default=None, ge=1e-6, le=1e6)
    length_m: Station | None = None
    moment_station_m: float = Field(ge=-1e3, le=1e3)


class GaugeRow(Section):
    """Gauges along one meridian of a surface, axial, hoop or both; of length 0 read strain at a point."""

    roll_angle_deg: float = Field(ge=-360.0, le=360.0)
    surface: Literal["inner", "outer"] = "inner"
    length_mm: GaugeLength = 0.0
    directions: list[Literal["axial", "hoop"]] = Field(min_length=1, max_length=2)
    x_m: Annotated[list[Station], AfterValidator(once_each)] | None = Field(default=None, min_length=1)
    first_x_m: Station | None = None
    last_x_m: Station | None = None
    count: int | None = Field(default=None, ge=2, le=1000)

    @model_validator(mode="after")
    def _one_way_to_give_stations(self) -> GaugeRow:
        spread = [self.first_x_m, self.last_x_m, self.count]
        if (self.x_m is None) != all(value is not None for value in spread) or (
            self.x_m is not None and any(value is not None for value in spread)
        ):
            raise ValueError("stations must be given either as x_m or as first_x_m, last_x_m and count")
        if self.first_x_m is not None and self.first_x_m == self.last_x_m:
            raise ValueError(f"first_x_m, last_x_m: expected two stations, got {self.first_x_m:g} twice")
        return self

    @property
    def stations(self) -> list[float]:
        """Axial stations [m]."""
        if self.x_m is not None:
            return self.x_m
        assert self.first_x_m is not None
        assert self.last_x_m is not None
        assert self.count is not None
        step = (self.last_x_m - self.first_x_m) / (self.count - 1)
        return [self.first_x_m + step * i for i in range(self.count)]


class GaugeLayoutEntry(Section):
    """One layout: rows, or a CSV file of positions and directions; surface and length are of all its gauges.

    Gauges of a file on a vehicle of another shape than a profile are moved to the surface from
    ``largest_distance_mm`` at most.
    """

    rows: list[GaugeRow] | None = Field(default=None, min_length=1)
    file: FileName | None = None
    surface: Literal["inner", "outer"] | None = None
    length_mm: GaugeLength | None = None
    largest_distance_mm: float = Field(default=0.5, ge=1e-3, le=1e3)

    @model_validator(mode="after")
    def _rows_or_file(self) -> GaugeLayoutEntry:
        if (self.rows is None) == (self.file is None):
            raise ValueError("a layout needs either rows or file")
        if self.rows is not None and (self.surface is not None or self.length_mm is not None):
            raise ValueError("surface and length_mm belong in each row; beside rows they have no meaning")
        known: dict[tuple[float, str, float, str], int] = {}
        for number, row in enumerate(self.rows or (), start=1):
            roll = round(row.roll_angle_deg % 360.0, 6) % 360.0
            for kind, x in product(row.directions, row.stations):
                first = known.setdefault((roll, row.surface, round(x, 6), kind), number)
                if first != number or row.directions.count(kind) > 1:
                    raise ValueError(
                        f"rows.{number}: expected each gauge once, got the {kind} one at {x:g} m of rows.{first} "
                        "again"
                    )
        return self


class Gauges(Section):
    """Named layouts and the one in use."""

    layout: str
    layouts: dict[str, GaugeLayoutEntry] = Field(min_length=1)

    @model_validator(mode="after")
    def _layout_exists(self) -> Gauges:
        if self.layout not in self.layouts:
            raise ValueError(f"layout '{self.layout}' is not among the layouts {sorted(self.layouts)}")
        return self


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


class Resolutions(Section):
    """Resolution of the model that builds the map and of the one that plays the vehicle."""

    map: Resolution
    truth: Resolution
