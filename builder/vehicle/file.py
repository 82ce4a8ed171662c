"""The vehicle file as a whole: read, checked, and what follows from its entries (TOML, checked by pydantic).

Every number's unit is part of its key. A wrong key, unit or value is refused in one line that names the
file, the entry, what was found and what is allowed. ``vehicles/ic3x.toml`` is the commented example.
"""

from __future__ import annotations

import tomllib
from math import pi, radians
from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, Field, PrivateAttr, ValidationError, model_validator

from builder.vehicle.faults import first_fault
from builder.vehicle.flight_conditions import condition_grid
from builder.vehicle.geometry import BodyOfRevolution, chain_segments
from builder.vehicle.map_options import MapEntry, Noise
from builder.vehicle.reference_quantities import ReferenceQuantities
from builder.vehicle.sections import (
    Aerodynamics,
    Arc,
    Conditions,
    Cone,
    Gauges,
    MaterialEntry,
    Reference,
    Resolutions,
    Section,
    Structure,
    Truth,
)
from strainfmu.errors import InputError
from strainfmu.flight_condition import FlightCondition

VEHICLES = Path(__file__).parents[1] / "vehicles"
IC3X = VEHICLES / "ic3x.toml"


def one_line(text: str) -> str:
    """Refuse text that a file name, a table or XML could not hold: control characters, line breaks."""
    if not text.isprintable():
        raise ValueError(f"{text!r} found, must be printable text on one line")
    return text


class Vehicle(Section):
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
            entry.mach_number,
            entry.angle_of_attack_deg,
            entry.sideslip_angle_deg,
            [1e3 * altitude for altitude in entry.altitudes_km],
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

    Example
    -------
    >>> import builder
    >>> vehicle = builder.load_vehicle(builder.IC3X)
    >>> print(f"{vehicle.name}, {vehicle.body().length} m, {len(vehicle.flight_conditions())} conditions")
    IC3X surrogate, 3.6 m, 90 conditions
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
