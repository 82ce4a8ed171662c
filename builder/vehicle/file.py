"""The vehicle file: its entries, their units and limits (TOML, checked by pydantic).

Every number's unit is part of its key. A wrong key, unit or value is refused in one line that names the
file, the entry, what was found and what is allowed. ``vehicles/ic3x.toml`` is the commented example.
"""

from __future__ import annotations

import tomllib
from math import pi, radians
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    PositiveFloat,
    PrivateAttr,
    ValidationError,
    field_validator,
    model_validator,
)

from builder.vehicle.faults import first_fault
from builder.vehicle.flight_conditions import condition_grid
from builder.vehicle.geometry import BodyOfRevolution, chain_segments
from builder.vehicle.map_options import MapEntry, Noise
from builder.vehicle.reference_quantities import ReferenceQuantities
from strainfmu.errors import InputError
from strainfmu.flight_condition import FlightCondition

VEHICLES = Path(__file__).parents[1] / "vehicles"
IC3X = VEHICLES / "ic3x.toml"

ENGINE_NAMES = ("euler", "newtonian", "table")
"""Sources of surface pressure by name; :data:`builder.aero.engines.ENGINES` makes them."""


def one_line(text: str) -> str:
    """Refuse text that a file name, a table or XML could not hold: control characters, line breaks."""
    if not text.isprintable():
        raise ValueError(f"{text!r} found, must be printable text on one line")
    return text


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=True)


class Cone(_Section):
    """A straight piece of the meridian."""

    kind: Literal["cone"]
    half_angle_deg: float = Field(gt=-45.0, lt=45.0)
    end_x_m: PositiveFloat


class Arc(_Section):
    """A circular arc of the meridian, such as a tangent ogive."""

    kind: Literal["arc"]
    start_half_angle_deg: float = Field(gt=-45.0, lt=45.0)
    end_half_angle_deg: float = Field(gt=-45.0, lt=45.0)
    end_x_m: PositiveFloat


class Structure(_Section):
    """Wall, support and what is inside; and the model that the map is built on.

    ``resolution`` is the solid model's. The foundation's stiffnesses are those along and across the normal of the
    aft ring, per area.
    """

    wall_thickness_mm: PositiveFloat
    solid_tip_length_m: PositiveFloat
    model: Literal["fourier", "solid"] = "fourier"
    resolution: Literal["paper", "medium", "coarse"] = "medium"
    support: Literal["clamped_aft", "elastic_foundation", "free_flight"] = "clamped_aft"
    foundation_normal_N_per_m3: PositiveFloat | None = None
    foundation_tangential_N_per_m3: PositiveFloat | None = None
    internal_pressure_Pa: float | Literal["ambient"] = "ambient"

    @model_validator(mode="after")
    def _foundation_has_stiffness(self) -> Structure:
        given = [self.foundation_normal_N_per_m3 is not None, self.foundation_tangential_N_per_m3 is not None]
        if self.support == "elastic_foundation" and not all(given):
            raise ValueError(
                "support 'elastic_foundation' needs foundation_normal_N_per_m3 and foundation_tangential_N_per_m3"
            )
        if self.support != "elastic_foundation" and any(given):
            raise ValueError(f"foundation stiffness found with support '{self.support}', it has no foundation")
        return self

    @field_validator("internal_pressure_Pa", mode="before")
    @classmethod
    def _ambient_or_number(cls, value: Any) -> Any:
        number = isinstance(value, int | float) and not isinstance(value, bool) and 0.0 <= value < float("inf")
        if value != "ambient" and not number:
            raise ValueError(f"{value!r} found, must be 'ambient' or a number of at least 0")
        return value


class MaterialEntry(_Section):
    """Isotropic linear elasticity."""

    youngs_modulus_GPa: float = Field(ge=1e-3, le=1e4)
    poisson_ratio: float = Field(ge=0.0, lt=0.5)
    density_kg_per_m3: float | None = Field(default=None, ge=1.0, le=1e5)


class Reference(_Section):
    """What coefficients are referred to; area and length default to base area and base diameter."""

    area_m2: PositiveFloat | None = None
    length_m: PositiveFloat | None = None
    moment_station_m: float


class GaugeRow(_Section):
    """Gauges along one meridian of a surface, axial, hoop or both; of length 0 read strain at a point."""

    roll_angle_deg: float
    surface: Literal["inner", "outer"] = "inner"
    length_mm: float = Field(default=0.0, ge=0.0)
    directions: list[Literal["axial", "hoop"]] = Field(min_length=1, max_length=2)
    x_m: list[PositiveFloat] | None = Field(default=None, min_length=1)
    first_x_m: PositiveFloat | None = None
    last_x_m: PositiveFloat | None = None
    count: int | None = Field(default=None, ge=2)

    @model_validator(mode="after")
    def _one_way_to_give_stations(self) -> GaugeRow:
        spread = [self.first_x_m, self.last_x_m, self.count]
        if (self.x_m is None) != all(value is not None for value in spread) or (
            self.x_m is not None and any(value is not None for value in spread)
        ):
            raise ValueError("stations must be given either as x_m or as first_x_m, last_x_m and count")
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


class GaugeLayoutEntry(_Section):
    """One layout: rows, or a CSV file of positions and directions; surface and length are of all its gauges."""

    rows: list[GaugeRow] | None = Field(default=None, min_length=1)
    file: str | None = None
    surface: Literal["inner", "outer"] | None = None
    length_mm: float | None = Field(default=None, ge=0.0)

    @model_validator(mode="after")
    def _rows_or_file(self) -> GaugeLayoutEntry:
        if (self.rows is None) == (self.file is None):
            raise ValueError("a layout needs either rows or file")
        if self.rows is not None and (self.surface is not None or self.length_mm is not None):
            raise ValueError("surface and length_mm stand in each row; beside rows they have no meaning")
        return self


class Gauges(_Section):
    """Named layouts and the one in use."""

    layout: str
    layouts: dict[str, GaugeLayoutEntry] = Field(min_length=1)

    @model_validator(mode="after")
    def _layout_exists(self) -> Gauges:
        if self.layout not in self.layouts:
            raise ValueError(f"layout '{self.layout}' is not among the layouts {sorted(self.layouts)}")
        return self


class Conditions(_Section):
    """Flight conditions of the snapshots: all combinations."""

    mach_number: list[Annotated[float, Field(gt=1.0)]] = Field(min_length=1)
    angle_of_attack_deg: list[Annotated[float, Field(gt=-60.0, lt=60.0)]] = Field(min_length=1)
    sideslip_angle_deg: list[Annotated[float, Field(gt=-60.0, lt=60.0)]] = Field(min_length=1)
    altitude_km: float = Field(ge=0.0, le=71.0)


class Aerodynamics(_Section):
    """Where surface pressure comes from, and what that engine needs beside the rest of the file.

    ``surface``, ``stagnation`` and ``leeward`` are the newtonian engine's, ``manifest`` the table's; files lie
    beside the vehicle file.
    """

    engine: str = "euler"
    surface: str | None = None
    surface_length_unit: str = "m"
    stagnation: str | None = None
    leeward: str | None = None
    manifest: str | None = None

    @field_validator("engine")
    @classmethod
    def _engine_exists(cls, value: str) -> str:
        if value not in ENGINE_NAMES:
            raise ValueError(f"'{value}' found, must be one of {', '.join(ENGINE_NAMES)}")
        return value


class Resolution(_Section):
    """Numerical resolution of one model of the vehicle."""

    radial_cells: int = Field(ge=8, le=400)
    circumferential_cells: int = Field(ge=8, le=400)
    surface_stations: int = Field(ge=10, le=2000)
    surface_roll_angles: int = Field(ge=16, le=720)
    harmonics: int = Field(ge=4, le=200)
    element_length_mm: PositiveFloat
    wall_layers: int = Field(ge=1, le=8)

    @model_validator(mode="after")
    def _harmonics_fit(self) -> Resolution:
        if 2 * self.harmonics >= self.surface_roll_angles:
            raise ValueError("harmonics must be less than half of surface_roll_angles")
        return self


class Truth(_Section):
    """The independent model that plays the vehicle in system simulations."""

    mach_number: list[Annotated[float, Field(gt=1.0)]] = Field(min_length=4)
    total_incidence_deg: list[Annotated[float, Field(gt=0.0, lt=60.0)]] = Field(min_length=4)
    manoeuvre: str

    @model_validator(mode="after")
    def _distinct(self) -> Truth:
        for name in ("mach_number", "total_incidence_deg"):
            values = getattr(self, name)
            if len(set(values)) < len(values):
                raise ValueError(f"{name} holds a value twice")
        return self


class Resolutions(_Section):
    """Resolution of the model that builds the map and of the one that plays the vehicle."""

    map: Resolution
    truth: Resolution


class Vehicle(_Section):
    """A vehicle file, whole."""

    name: Annotated[str, Field(min_length=1), AfterValidator(one_line)]
    description: str = ""
    profile: list[Annotated[Cone | Arc, Field(discriminator="kind")]] = Field(min_length=1)
    structure: Structure
    material: MaterialEntry
    reference: Reference
    gauges: Gauges
    conditions: Conditions
    aerodynamics: Aerodynamics = Aerodynamics()
    noise: Noise
    map: MapEntry
    truth: Truth
    resolution: Resolutions
    _folder: Path = PrivateAttr(default=Path())

    @model_validator(mode="after")
    def _free_flight_has_mass(self) -> Vehicle:
        if self.structure.support == "free_flight" and self.material.density_kg_per_m3 is None:
            raise ValueError("structure.support 'free_flight' needs material.density_kg_per_m3")
        return self

    @model_validator(mode="after")
    def _noise_layout_exists(self) -> Vehicle:
        if self.noise.of_layout is not None and self.noise.of_layout not in self.gauges.layouts:
            raise ValueError(
                f"noise.of_layout '{self.noise.of_layout}' is not among the layouts {sorted(self.gauges.layouts)}"
            )
        return self

    def beside(self, name: str) -> Path:
        """Return the path of a file named in the vehicle file, relative to it."""
        return self._folder / name

    def body(self) -> BodyOfRevolution:
        """Return the outer surface."""
        pieces = []
        for entry in self.profile:
            if isinstance(entry, Cone):
                pieces.append((entry.end_x_m, radians(entry.half_angle_deg), radians(entry.half_angle_deg)))
            else:
                angles = radians(entry.start_half_angle_deg), radians(entry.end_half_angle_deg)
                pieces.append((entry.end_x_m, *angles))
        return chain_segments(pieces)

    def reference_quantities(self) -> ReferenceQuantities:
        """Return S, L and the moment point."""
        radius = self.body().base_radius
        return ReferenceQuantities(
            area=self.reference.area_m2 or pi * radius**2,
            length=self.reference.length_m or 2.0 * radius,
            moment_station=self.reference.moment_station_m,
        )

    def flight_conditions(self) -> list[FlightCondition]:
        """Return the snapshots' conditions in the order of the file."""
        entry = self.conditions
        return condition_grid(
            entry.mach_number, entry.angle_of_attack_deg, entry.sideslip_angle_deg, 1e3 * entry.altitude_km
        )

    def internal_pressure(self, condition: FlightCondition) -> float:
        """Return the pressure inside the body [Pa]."""
        inside = self.structure.internal_pressure_Pa
        return condition.ambient_pressure if inside == "ambient" else inside

    def _repr_html_(self) -> str:
        from builder.vehicle.notebook_view import vehicle_html  # imports this module

        return vehicle_html(self)


def load_vehicle(path: str | Path) -> Vehicle:
    """Read and check a vehicle file.

    Raises
    ------
    InputError
        The file is missing or no TOML, or an entry is unknown, missing or outside its limits.
    """
    path = Path(path)
    try:
        entries = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: not a TOML file: {error}") from error
    try:
        vehicle = Vehicle.model_validate(entries)
        vehicle._folder = path.parent
        vehicle.body()
    except ValidationError as error:
        raise InputError(f"{path}: {first_fault(error, Vehicle)}") from error
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    return vehicle
