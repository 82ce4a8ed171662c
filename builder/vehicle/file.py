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

from builder.vehicle.faults import Faults, all_faults
from builder.vehicle.flight_conditions import condition_grid
from builder.vehicle.geometry import BodyOfRevolution, chain_segments
from builder.vehicle.limits import one_line
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
from builder.vehicle.sizes import size_faults
from strainfmu.errors import FaultsError, InputError
from strainfmu.flight_condition import FlightCondition

VEHICLES = Path(__file__).parents[1] / "vehicles"
IC3X = VEHICLES / "ic3x.toml"

_MOST_FAULTS = 40
"""Lines of faults that are shown."""


class Vehicle(Section):
    """A vehicle file, whole."""

    name: Annotated[str, Field(min_length=1, max_length=200), AfterValidator(one_line)]
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
    def _sections_fit_each_other(self) -> Vehicle:
        faults = []
        if self.structure.support == "free_flight" and self.material.density_kg_per_m3 is None:
            faults.append("structure.support 'free_flight' needs material.density_kg_per_m3")
        if self.noise.of_layout is not None and self.noise.of_layout not in self.gauges.layouts:
            faults.append(
                f"noise.of_layout '{self.noise.of_layout}' is not among the layouts {sorted(self.gauges.layouts)}"
            )
        if faults:
            raise Faults(faults)
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
    FaultsError
        Entries are unknown, missing or outside their limits, or sizes that follow from them are: one line each.
    InputError
        The file is missing or no TOML.

    Example
    -------
    >>> import builder
    >>> vehicle = builder.load_vehicle(builder.IC3X)
    >>> print(f"{vehicle.name}, {vehicle.body().length} m, {len(vehicle.flight_conditions())} conditions")
    IC3X surrogate, 3.6 m, 90 conditions
    """
    path = Path(path)
    try:
        entries = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    except (ValueError, RecursionError) as error:  # of TOML, of UTF-8, of a number with thousands of digits
        raise InputError(f"{path}: not a TOML file: {error}") from error
    try:
        vehicle = Vehicle.model_validate(entries)
        faults = size_faults(vehicle)
    except ValidationError as error:
        faults = all_faults(error, Vehicle)
    if faults:
        raise FaultsError("\n".join(f"{path}: {line}" for line in _limited(faults)))
    vehicle._folder = path.parent
    return vehicle


def _limited(faults: list[str]) -> list[str]:
    """Return ``faults``, or the first of them and how many more there are."""
    more = len(faults) - _MOST_FAULTS
    return faults if more <= 0 else [*faults[:_MOST_FAULTS], f"{more} more entries are wrong"]
