"""The table of what a vehicle as built, and its test, may have different from what the files state.

A kind has one name, one unit and one size in all uses: the prior of a calibration ([calibration] of the vehicle
file), vehicles that are drawn as truth and error columns of a map ([noise]), cases of the fault detection study at
twice the stated size, and errors of the loads of a ground test ([errors] of its file). The sections state standard
deviations, with their defaults; the table says which entry belongs to which kind.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE
from strainfmu.estimator.signal_names import ZERO

Extent = Literal["gauge", "vehicle", "region", "row", "joint", "load"]
"""What has its own parameter: each gauge, the vehicle, each region of the wall, each row of gauges at one roll
angle, each joint, or each load."""

Role = Literal["estimated", "considered", "split"]
"""What the gain of a map may do about an error, see :mod:`builder.inverse.noise.error_list`."""

UNIT = {"%": 0.01, "mm": 1e-3, "um/m": 1e-6, "deg": float(np.pi / 180.0), "N": 1.0, "kg": 1.0}
"""Size of the units of entries, in SI."""


@dataclass(frozen=True, kw_only=True)
class ParameterKind:
    """One kind of error.

    Attributes
    ----------
    name : of the kind, and of the field that holds it.
    error : name of the kind in the fault detection study; empty where that has no case of it.
    column : name of its error columns in a map, where that is another than the kind's own in words.
    extent : what has its own parameter of this kind.
    unit : of its entries, one of :data:`UNIT`; parameters themselves are in SI.
    acts_on : what it changes, for pages.
    relative_to : what a size in percent is a part of, where the kind's name does not say so.
    calibration, noise, errors : entry of the section of this name that states its standard deviation; empty where
        the section has none.
    step : of central differences of the readings by it; 0 where the derivative has a closed form.
    flight : whether strain in flight depends on it; a ground test alone does otherwise.
    taken_for_zero : whether the standard deviation is 0 by default, and the test says whether that holds.
    alike_in_flight : whether [noise] states one number for all regions alike, not one for each.
    role : in maps. The gain corrects errors of single gauges, of gains and of zeros, and does not know errors of
        the layout and the wall.
    """

    name: str
    extent: Extent
    unit: str
    acts_on: str
    error: str = ""
    column: str = ""
    relative_to: str = ""
    calibration: str = ""
    noise: str = ""
    errors: str = ""
    step: float = 0.0
    flight: bool = True
    taken_for_zero: bool = False
    alike_in_flight: bool = False
    role: Role = "estimated"

    @property
    def scale(self) -> float:
        """Size of the unit, in SI."""
        return UNIT[self.unit]

    @property
    def in_words(self) -> str:
        """The name as it is printed."""
        return self.name.replace("_", " ")

    @property
    def column_name(self) -> str:
        """Name of its error columns in a map."""
        return self.column or self.in_words

    @property
    def is_one_in_flight(self) -> bool:
        """Whether [noise] states one error of the whole vehicle."""
        return self.extent == "vehicle" or self.alike_in_flight

    def prior_std(self, section: object) -> float:
        """Return the standard deviation before a test, in SI, from the section [calibration]."""
        return self.scale * float(getattr(section, self.calibration))

    def noise_std(self, section: object) -> float:
        """Return the standard deviation in flight, in SI, from the section [noise]."""
        return self.scale * float(getattr(section, self.noise))

    def error_std(self, section: object) -> float:
        """Return the standard deviation in a ground test, in SI, from the section [errors]."""
        return self.scale * float(getattr(section, self.errors))


AS_BUILT = (
    ParameterKind(
        name="gauge_gain",
        error="gain of each gauge",
        extent="gauge",
        unit="%",
        acts_on="reading of the gauge",
        calibration="gauge_gain_percent",
        noise="gauge_gain_percent",
    ),
    ParameterKind(
        name="orientation",
        error="orientation of each gauge",
        column="gauge orientation",
        extent="gauge",
        unit="deg",
        acts_on="direction of the gauge in the surface",
        calibration="gauge_orientation_deg",
        noise="gauge_orientation_deg",
        step=1e-3,
    ),
    ParameterKind(
        name="axial_shift",
        error="axial position of each gauge",
        column="gauge position, axial",
        extent="gauge",
        unit="mm",
        acts_on="place of the gauge along the surface",
        calibration="gauge_position_mm",
        noise="gauge_position_mm",
        step=1e-4,
    ),
    ParameterKind(
        name="circumferential_shift",
        error="circumferential position of each gauge",
        column="gauge position, circumferential",
        extent="gauge",
        unit="mm",
        acts_on="place of the gauge round the body",
        calibration="gauge_position_mm",
        noise="gauge_position_mm",
        step=1e-4,
    ),
    ParameterKind(
        name="transverse_sensitivity",
        error="transverse sensitivity of each gauge",
        extent="gauge",
        unit="%",
        acts_on="reading of strain across the gauge",
        calibration="transverse_sensitivity_percent",
        noise="transverse_sensitivity_percent",
        step=1e-3,
    ),
    ParameterKind(
        name=ZERO,
        extent="gauge",
        unit="um/m",
        acts_on="reading without load",
        calibration="zero_um_per_m",
    ),
    ParameterKind(
        name="common_gain",
        error="gain of all gauges",
        extent="vehicle",
        unit="%",
        acts_on="readings of all gauges",
        calibration="common_gain_percent",
        noise="common_gain_percent",
    ),
    ParameterKind(
        name="layout_roll",
        error="roll of the layout",
        extent="vehicle",
        unit="deg",
        acts_on="roll angle of all gauges",
        calibration="layout_roll_deg",
        noise="layout_roll_deg",
        step=1e-3,
        role="considered",
    ),
    ParameterKind(
        name="youngs_modulus",
        extent="vehicle",
        unit="%",
        acts_on="stiffness of the whole wall",
        calibration="youngs_modulus_percent",
    ),
    ParameterKind(
        name="wall_thickness",
        error="wall thickness",
        extent="region",
        unit="%",
        acts_on="mean thickness round the body",
        calibration="wall_thickness_percent",
        noise="wall_thickness_percent",
        step=1e-3,
        alike_in_flight=True,
        role="considered",
    ),
    ParameterKind(
        name="wall_cosine",
        error="wall thickness as the cosine of the roll angle",
        extent="region",
        unit="%",
        acts_on="thickness as cos phi",
        calibration="wall_harmonic_percent",
        noise="wall_harmonic_percent",
        step=1e-3,
        role="considered",
    ),
    ParameterKind(
        name="wall_sine",
        error="wall thickness as the sine of the roll angle",
        extent="region",
        unit="%",
        acts_on="thickness as sin phi",
        calibration="wall_harmonic_percent",
        noise="wall_harmonic_percent",
        step=1e-3,
        role="considered",
    ),
    ParameterKind(
        name="wall_taper",
        error="taper of each region of the wall",
        extent="region",
        unit="%",
        acts_on="thickness from the fore to the aft end",
        calibration="wall_taper_percent",
        noise="wall_taper_percent",
        step=1e-3,
        taken_for_zero=True,
        role="considered",
    ),
    ParameterKind(
        name="wall_second_cosine",
        error="wall thickness as the cosine of twice the roll angle",
        extent="region",
        unit="%",
        acts_on="thickness as cos 2 phi",
        calibration="wall_second_harmonic_percent",
        noise="wall_second_harmonic_percent",
        step=1e-3,
        taken_for_zero=True,
        role="considered",
    ),
    ParameterKind(
        name="wall_second_sine",
        error="wall thickness as the sine of twice the roll angle",
        extent="region",
        unit="%",
        acts_on="thickness as sin 2 phi",
        calibration="wall_second_harmonic_percent",
        noise="wall_second_harmonic_percent",
        step=1e-3,
        taken_for_zero=True,
        role="considered",
    ),
    ParameterKind(
        name="mass",
        extent="vehicle",
        unit="%",
        acts_on="own weight and inertia",
        calibration="mass_percent",
        step=1e-3,
        flight=False,
    ),
    ParameterKind(
        name="region_mass",
        extent="region",
        unit="%",
        acts_on="own weight and inertia of the region",
        calibration="region_mass_percent",
        step=1e-3,
        flight=False,
    ),
    ParameterKind(
        name="clamp_axial",
        error="clamp that yields along the body",
        column="clamp, along",
        extent="vehicle",
        unit="mm",
        acts_on="support: length of wall that yields along the body as the clamp does",
        calibration="clamp_compliance_mm",
        noise="clamp_compliance_mm",
        step=1e-3,
        role="considered",
    ),
    ParameterKind(
        name="clamp_transverse",
        error="clamp that yields across the body",
        column="clamp, across",
        extent="vehicle",
        unit="mm",
        acts_on="support: length of wall that yields across the body as the clamp does",
        calibration="clamp_compliance_mm",
        noise="clamp_compliance_mm",
        step=1e-3,
        role="considered",
    ),
    ParameterKind(
        name="region_modulus",
        error="stiffness of each region of the wall",
        extent="region",
        unit="%",
        acts_on="stiffness of the region",
        calibration="region_modulus_percent",
        noise="region_modulus_percent",
        step=1e-3,
        role="considered",
    ),
    ParameterKind(
        name="row_orientation",
        error="orientation of each row of gauges",
        extent="row",
        unit="deg",
        acts_on="direction of all gauges at one roll angle",
        calibration="row_orientation_deg",
        noise="row_orientation_deg",
        step=1e-3,
        role="considered",
    ),
    ParameterKind(
        name="joint_softness",
        error="softness of each joint",
        extent="joint",
        unit="mm",
        acts_on="length of wall that yields as the joint does",
        calibration="joint_softness_mm",
        noise="joint_softness_mm",
        step=1e-3,
        role="considered",
    ),
)
"""Kinds of the vehicle as a calibration estimates it, in the order of its vector. New ones go to the end, so that
the same seed draws the same vehicle."""

IN_FLIGHT = (
    ParameterKind(
        name="apparent_strain",
        error="apparent strain of all gauges",
        extent="vehicle",
        unit="um/m",
        acts_on="readings of all gauges",
        noise="apparent_strain_um_per_m",
    ),
    ParameterKind(
        name="internal_pressure",
        error="internal pressure",
        extent="vehicle",
        unit="%",
        acts_on="pressure inside",
        relative_to="p_inf",
        noise="internal_pressure_percent",
    ),
    ParameterKind(
        name=DYNAMIC_PRESSURE,
        error="dynamic pressure",
        extent="vehicle",
        unit="%",
        acts_on="stated q_inf",
        noise="dynamic_pressure_percent",
    ),
)
"""Kinds that no ground test knows."""

OF_LOADS = (
    ParameterKind(
        name="load",
        extent="load",
        unit="%",
        acts_on="size of each load",
        errors="load_percent",
        flight=False,
    ),
    ParameterKind(
        name="common",
        extent="vehicle",
        unit="%",
        acts_on="size of all loads of a load cell",
        errors="load_cell_percent",
        flight=False,
    ),
    ParameterKind(
        name="cell_offset",
        extent="vehicle",
        unit="N",
        acts_on="reading of a load cell without load",
        errors="load_cell_offset_N",
        flight=False,
    ),
    ParameterKind(
        name="cell_curve",
        extent="vehicle",
        unit="%",
        acts_on="nonlinearity of a load cell",
        relative_to="full scale",
        errors="load_cell_nonlinearity_percent",
        flight=False,
    ),
    ParameterKind(
        name="rig_mass",
        extent="vehicle",
        unit="kg",
        acts_on="weight of the rig on every pad and point",
        errors="rig_mass_kg",
        flight=False,
    ),
    ParameterKind(
        name="drift",
        extent="gauge",
        unit="um/m",
        acts_on="zero from the first load case to the last",
        errors="drift_um_per_m",
        flight=False,
    ),
    ParameterKind(
        name="pad_position",
        extent="load",
        unit="mm",
        acts_on="station of each load",
        errors="pad_position_mm",
        step=1e-3,
        flight=False,
    ),
    ParameterKind(
        name="pad_roll",
        extent="load",
        unit="deg",
        acts_on="roll angle of each load",
        errors="pad_roll_deg",
        step=5e-3,
        flight=False,
    ),
    ParameterKind(
        name="pad_shape",
        extent="load",
        unit="%",
        acts_on="length of each pad",
        errors="pad_shape_percent",
        step=0.02,
        flight=False,
    ),
    ParameterKind(
        name="tilt",
        extent="load",
        unit="deg",
        acts_on="direction of each force, about both axes across it",
        errors="load_direction_deg",
        step=1e-3,
        flight=False,
    ),
)
"""Kinds of the loads of a ground test."""


def by_name(kinds: Iterable[ParameterKind]) -> dict[str, ParameterKind]:
    """Return kinds by their names, in order."""
    return {kind.name: kind for kind in kinds}


KINDS = by_name((*AS_BUILT, *IN_FLIGHT, *OF_LOADS))
"""The whole table."""

ALWAYS_DRAWN = (
    "gauge_gain",
    "common_gain",
    "axial_shift",
    "circumferential_shift",
    "orientation",
    "layout_roll",
    "wall_thickness",
    "apparent_strain",
    "internal_pressure",
    DYNAMIC_PRESSURE,
)
"""Kinds whose numbers are drawn first, and even at size 0: the vehicles of a seed stay the same."""

IN_NOISE = tuple(
    KINDS[name]
    for name in dict.fromkeys((*ALWAYS_DRAWN, *(kind.name for kind in (*AS_BUILT, *IN_FLIGHT) if kind.noise)))
)
"""Kinds that [noise] states, in the order in which vehicles are drawn.

Young's modulus is in the common gain there, zeros are subtracted, and mass does not change strain under pressure:
inertia is no load of a map.
"""

BY_REGION = tuple(
    kind.name for kind in IN_NOISE if kind.extent in ("region", "joint") and not kind.alike_in_flight
)
"""Kinds of [noise] of which each region of the wall, or each joint, has its own."""
