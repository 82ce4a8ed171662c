"""The section [mass] of a vehicle file: how fast masses may be accelerated, and what measures it."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from builder.vehicle.toml.toml_sections import Section

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
