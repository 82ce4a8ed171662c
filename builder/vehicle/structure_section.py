"""Sections of a vehicle file on its structure.

[structure] holds wall, support, the model that the map is built on, and entries beyond one wall of one material:
thickness along the body, regions, frames, masses. [material] has its own section. [mass] states how fast masses
may be accelerated, [temperature] how warm the wall may become; both state what measures it.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, field_validator, model_validator

from builder.vehicle.toml.toml_sections import INTERNAL_PRESSURE_PA, FileName, Section, Station
from strainfmu.arrays import FloatArray
from strainfmu.flight_condition import FlightCondition


class MaterialEntry(Section):
    """Isotropic linear elasticity."""

    youngs_modulus_GPa: float = Field(ge=0.1, le=2e3)
    poisson_ratio: float = Field(ge=0.0, le=0.499)
    density_kg_per_m3: float | None = Field(default=None, ge=10.0, le=3e4)


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


FoundationStiffness = Annotated[float, Field(ge=1e3, le=1e18)]

EXTERNAL_STRUCTURES = ("strain_per_snapshot", "influence")
"""Entries of [structure] that name a file of another structural code."""


class Structure(Section):
    """Wall, support, internal pressure, and the model that the map is built on.

    ``wall_thickness_at``, ``regions`` and ``frames`` describe a wall of several thicknesses and materials;
    ``point_masses`` and ``covers`` are masses in free flight. ``resolution`` is the resolution of the solid model.
    The foundation's stiffnesses are per area, along and across the normal of the aft ring. In ``free_flight`` the
    aft ring of the ``base`` "open" is a free edge, which pressure bends; a "stiff" one keeps its shape, as on a
    bulkhead or a motor.

    ``strain_per_snapshot`` is a table of strain that another code computed under the snapshots' pressures,
    ``influence`` one of strains under unit forces, ``influence_facets`` the facets between its nodes where it is a
    CSV file (:mod:`builder.structure.external`). They replace any model. Strains of either may stand in
    ``nastran_results``, OP2 or punch files, by the elements of ``nastran_gauges``. ``checked_by`` is a second mesh
    of the solid model, whose difference is the error of the first. ``mesh`` is the volume mesh, or the STEP file,
    of a vehicle given by a surface; it and ``checked_by`` are in ``mesh_length_unit``, and the wall's thickness is
    the nominal one. ``mesh_materials`` gives regions of the mesh a material of [materials].
    """

    wall_thickness_mm: float = Field(ge=0.01, le=1e3)
    solid_tip_length_m: Station | None = None
    mesh: FileName | None = None
    mesh_length_unit: Literal["m", "mm", "cm", "in", "ft"] = "m"
    mesh_materials: dict[str, str] = Field(default_factory=dict)
    model: Literal["fourier", "solid"] = "fourier"
    resolution: Literal["paper", "medium", "coarse"] = "medium"
    support: Literal["clamped_aft", "elastic_foundation", "free_flight"] = "clamped_aft"
    base: Literal["open", "stiff"] = "open"
    foundation_normal_N_per_m3: FoundationStiffness | None = None
    foundation_tangential_N_per_m3: FoundationStiffness | None = None
    internal_pressure_Pa: float | Literal["ambient"] = "ambient"
    wall_thickness_at: list[ThicknessEntry] = Field(default_factory=list)
    regions: list[RegionEntry] = Field(default_factory=list)
    frames: list[FrameEntry] = Field(default_factory=list)
    point_masses: list[PointMassEntry] = Field(default_factory=list)
    covers: list[CoverEntry] = Field(default_factory=list)
    strain_per_snapshot: FileName | None = None
    influence: FileName | None = None
    influence_facets: FileName | None = None
    nastran_results: list[FileName] = Field(default_factory=list, max_length=1000)
    nastran_gauges: FileName | None = None
    checked_by: FileName | None = None

    @property
    def external(self) -> str | None:
        """Name of the entry by which another structural code takes the place of our models, or None."""
        return next((name for name in EXTERNAL_STRUCTURES if getattr(self, name) is not None), None)

    @model_validator(mode="before")
    @classmethod
    def _external_is_no_model_of_ours(cls, values: Any) -> Any:
        entries = [
            name for name in EXTERNAL_STRUCTURES if isinstance(values, dict) and values.get(name) is not None
        ]
        if not entries:
            return values
        if len(entries) > 1:
            raise ValueError(f"expected one of {' and '.join(entries)}, got both")
        if values.get("checked_by") is not None:
            raise ValueError(f"checked_by: expected none with {entries[0]}, got {values['checked_by']!r}")
        if values.get("model", "solid") != "solid":
            raise ValueError(f"model: expected none with {entries[0]}, got '{values['model']}'")
        return values | {"model": "solid"}

    @model_validator(mode="after")
    def _stations_rise(self) -> Structure:
        stations = [point.x_m for point in self.wall_thickness_at]
        for before, after in pairwise(stations):
            if after <= before:
                raise ValueError(f"wall_thickness_at: expected stations that rise, got {after:g} after {before:g}")
        return self

    @model_validator(mode="after")
    def _facets_are_of_a_matrix(self) -> Structure:
        if self.influence_facets is not None and self.influence is None:
            raise ValueError("influence_facets: expected influence with it, got none")
        return self

    @model_validator(mode="after")
    def _results_are_of_a_table(self) -> Structure:
        if bool(self.nastran_results) != (self.nastran_gauges is not None):
            raise ValueError("nastran_results, nastran_gauges: expected both or neither, got one")
        if self.nastran_results and self.external is None:
            raise ValueError(f"nastran_results: expected {' or '.join(EXTERNAL_STRUCTURES)} with it, got none")
        return self

    @model_validator(mode="after")
    def _foundation_has_stiffness(self) -> Structure:
        stated = [self.foundation_normal_N_per_m3 is not None, self.foundation_tangential_N_per_m3 is not None]
        if self.support == "elastic_foundation" and not all(stated):
            raise ValueError(
                "support 'elastic_foundation' needs foundation_normal_N_per_m3 and foundation_tangential_N_per_m3"
            )
        if self.support != "elastic_foundation" and any(stated):
            raise ValueError(f"foundation stiffness found with support '{self.support}', it has no foundation")
        return self

    @model_validator(mode="after")
    def _base_is_of_a_free_body(self) -> Structure:
        if self.base == "stiff" and (self.support != "free_flight" or self.model != "fourier"):
            raise ValueError(
                f"base: 'stiff' needs support 'free_flight' and model 'fourier', got '{self.support}' and "
                f"'{self.model}'"
            )
        return self

    def internal_pressure(self, conditions: Sequence[FlightCondition]) -> FloatArray:
        """Return (n,) the pressure inside the body at n ``conditions`` [Pa]."""
        inside = self.internal_pressure_Pa
        return np.array(
            [condition.ambient_pressure if inside == "ambient" else inside for condition in conditions]
        )

    @field_validator("internal_pressure_Pa", mode="before")
    @classmethod
    def _ambient_or_number(cls, value: Any) -> Any:
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if value != "ambient" and not (number and INTERNAL_PRESSURE_PA.holds(value)):
            raise ValueError(f"expected 'ambient' or {INTERNAL_PRESSURE_PA}, got {value!r}")
        return value


Percent = Annotated[float, Field(ge=0.0, le=100.0)]
LoadFactor = Annotated[float, Field(ge=0.01, le=1e3)]
Std = Annotated[float, Field(ge=1e-6, le=1e3)]


class Mass(Section):
    """Strain by the inertia of the structure in flight.

    Masses follow from the material's density, ``structure.covers`` and ``structure.point_masses``, known to
    ``structure_percent`` and ``equipment_percent``; ``unlisted_kg`` is the standard deviation of unlisted mass at
    each of five stations. Without an inertial unit motions have standard deviations: specific force of ``axial_g``
    along the body and ``lateral_g`` across it, ``angular_acceleration_rad_per_s2``, angular rates of
    ``roll_rate_rad_per_s`` about the axis and ``rate_rad_per_s`` across it. Errors of masses count at the same
    specific force. Measurements of the unit at ``unit_x_m`` on the axis (default: the moment reference) have the
    standard deviations ``.._std_..``. ``vibration_um_per_m`` is the standard deviation of the strain by the first
    bending modes, at the gauge with most of it, where the input ``vibration`` does not state it. The strain of a
    gauge by specific force is known to ``inertia_strain_percent``; that by a point mass within three times the
    root of radius times wall thickness is not known, as it depends on how the mass is attached. In ``free_flight``
    accelerations follow from the load, and the strain is that in a held body. ``vehicle_kg`` is the mass of all
    that flies: where it is stated, a specific force across the axis that contradicts the lateral force is
    INCONSISTENT.
    """

    structure_percent: Percent = 2.0
    equipment_percent: Percent = 2.0
    inertia_strain_percent: Percent = 5.0
    unlisted_kg: float = Field(default=0.2, ge=0.0, le=1e6)
    lateral_g: LoadFactor = 5.0
    axial_g: LoadFactor = 5.0
    angular_acceleration_rad_per_s2: Annotated[float, Field(ge=0.01, le=1e3)] = 5.0
    roll_rate_rad_per_s: Annotated[float, Field(ge=0.01, le=200.0)] = 1.0
    rate_rad_per_s: Annotated[float, Field(ge=0.01, le=200.0)] = 1.0
    vibration_um_per_m: Annotated[float, Field(ge=1e-3, le=1e4)] = 2.5
    unit_x_m: Annotated[float, Field(ge=-1e3, le=1e3)] | None = None
    specific_force_std_m_per_s2: Std = 0.1
    angular_rate_std_rad_per_s: Std = 0.01
    angular_acceleration_std_rad_per_s2: Std = 0.5
    vehicle_kg: Annotated[float, Field(gt=0.0, le=1e7)] | None = None


Rise = Annotated[float, Field(ge=0.0, le=2000.0)]


class TemperatureSensor(Section):
    """A temperature sensor on the wall."""

    name: Annotated[str, Field(min_length=1, max_length=100)]
    x_m: Station
    roll_angle_deg: float = Field(default=0.0, ge=-360.0, le=360.0)
    surface: Literal["inner", "outer"] = "inner"
    std_K: float = Field(default=1.0, ge=1e-3, le=100.0)


class Temperature(Section):
    """Temperature of the wall above ``reference_degC``, at which zeros, gauge factors and modulus hold.

    The rise is a sum of modes along the body, linear between ``stations_m`` (default: five, evenly spaced): in
    the middle of the wall of all its roll angles (``rise_K``), with the first and the second harmonic round the
    body (``side_K``, ``second_harmonic_K``); the difference from the inner to the outer surface
    (``through_wall_K``) and its first harmonic (``through_wall_side_K``). Each is one standard deviation of the
    mode's amplitude at each station; 0 leaves a kind of modes out.

    Gauges cancel ``compensation_um_per_m_per_K`` (default: the expansion of the material);
    ``apparent_strain_um_per_m`` are the coefficients of rise, rise^2 .. of their data sheet [um/m, K], the same of
    all gauges of the lot, ``apparent_strain_scatter_um_per_m_per_K`` the standard deviation of the first of them
    from gauge to gauge. ``gauge_factor_percent_per_100K`` and ``modulus_percent_per_100K`` are changes with
    temperature.
    """

    reference_degC: float = Field(default=20.0, ge=-200.0, le=1000.0)
    expansion_um_per_m_per_K: float = Field(ge=-100.0, le=100.0)
    compensation_um_per_m_per_K: float | None = Field(default=None, ge=-100.0, le=100.0)
    apparent_strain_um_per_m: tuple[Annotated[float, Field(ge=-1e3, le=1e3)], ...] = Field(
        default=(), max_length=6
    )
    apparent_strain_scatter_um_per_m_per_K: float = Field(default=0.0, ge=0.0, le=100.0)
    gauge_factor_percent_per_100K: float = Field(default=0.0, ge=-50.0, le=50.0)
    modulus_percent_per_100K: float = Field(default=0.0, ge=-50.0, le=50.0)
    stations_m: Annotated[list[Station], Field(min_length=1, max_length=50)] | None = None
    rise_K: Rise = 40.0
    side_K: Rise = 2.0
    second_harmonic_K: Rise = 0.2
    through_wall_K: Rise = 1.0
    through_wall_side_K: Rise = 0.2
    sensor: Annotated[list[TemperatureSensor], Field(max_length=200)] = Field(default_factory=list)

    @field_validator("apparent_strain_um_per_m", mode="before")
    @classmethod
    def _tuple(cls, value: object) -> object:
        return tuple(value) if isinstance(value, list) else value

    @model_validator(mode="after")
    def _check(self) -> Temperature:
        stations, names = self.stations_m or [], [sensor.name for sensor in self.sensor]
        if any(b <= a for a, b in pairwise(stations)):
            raise ValueError(f"stations_m: expected increasing stations, got {stations}")
        if len(set(names)) < len(names):
            raise ValueError(f"sensor: expected names once each, got {names}")
        if not any((self.rise_K, self.side_K, self.second_harmonic_K, self.through_wall_K)):
            raise ValueError("rise_K: expected some mode above 0, got none")
        return self
