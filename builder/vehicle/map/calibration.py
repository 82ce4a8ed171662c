"""The section [calibration] of a vehicle file: what drawing and workshop promise before a ground test."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated

from pydantic import Field, model_validator

from builder.vehicle.toml.toml_sections import Section, Station

Percent = Annotated[float, Field(ge=0.0, le=50.0)]


class Calibration(Section):
    """Tolerances of the vehicle as built, one standard deviation each: the prior of `strainfmu calibrate`.

    Gain, orientation, position, transverse sensitivity and zero offset are independent from gauge to gauge; common
    gain and clocking error are of all gauges together. The default of the zero offset leaves it free. The wall's
    thickness is one number for each region of the wall, and so are cosine and sine part of its first harmonic
    round the body. The taper of a region, its extra thickness at the aft end, and both parts of the second
    harmonic are 0 unless the readings contradict. ``mass_percent`` is of the vehicle's own weight and inertia,
    ``region_mass_percent`` of each region's. The clamp yields along and across the body as ``clamp_compliance_mm``
    of the wall's material would under the same traction; its rigid motion gives no strain.
    ``region_modulus_percent`` is the error of Young's modulus of each region in addition to the common one.
    ``row_orientation_deg`` turns all gauges at one roll angle. Joints at ``joint_stations_m`` of the wall yield as
    ``joint_softness_mm`` of its material would in addition; there are none by default. ``wall_region_ends_m`` are
    the stations between the regions behind the solid tip; by default there are four regions of one length.
    """

    gauge_gain_percent: Percent = 1.0
    common_gain_percent: Percent = 2.0
    gauge_orientation_deg: float = Field(default=1.5, ge=0.0, le=45.0)
    gauge_position_mm: float = Field(default=1.0, ge=0.0, le=100.0)
    layout_roll_deg: float = Field(default=0.5, ge=0.0, le=45.0)
    transverse_sensitivity_percent: Percent = 1.0
    zero_um_per_m: float = Field(default=2000.0, ge=0.0, le=1e5)
    youngs_modulus_percent: Percent = 3.0
    wall_thickness_percent: Percent = 4.0
    wall_harmonic_percent: Percent = 2.0
    wall_taper_percent: Percent = 0.0
    wall_second_harmonic_percent: Percent = 0.0
    mass_percent: Percent = 3.0
    region_mass_percent: Percent = 0.0
    clamp_compliance_mm: float = Field(default=2.0, ge=0.0, le=1e3)
    region_modulus_percent: Percent = 0.0
    row_orientation_deg: float = Field(default=0.0, ge=0.0, le=45.0)
    joint_stations_m: tuple[Station, ...] = Field(default=(), max_length=50)
    joint_softness_mm: float = Field(default=5.0, ge=0.0, le=1e3)
    wall_region_ends_m: Annotated[list[Station], Field(max_length=50)] | None = None

    @model_validator(mode="after")
    def _ends_rise(self) -> Calibration:
        ends = self.wall_region_ends_m or []
        if any(b <= a for a, b in pairwise(ends)):
            raise ValueError(f"wall_region_ends_m: expected increasing stations, got {ends}")
        return self
