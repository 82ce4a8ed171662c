"""The table of what a vehicle as built, and its test, may have different from what the files state.

A kind has one name, one unit and one size in all uses: the prior of a calibration ([calibration] of the vehicle
file), vehicles that are drawn as truth and error columns of a map ([noise]), cases of the fault detection study at
twice the stated size, and errors of the loads of a ground test ([errors] of its file). The sections state standard
deviations, with their defaults; the table says which entry belongs to which kind.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

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
UNIT_OF_END = {"_percent": "%", "_um_per_m": "um/m", "_mm": "mm", "_deg": "deg", "_N": "N", "_kg": "kg"}
"""Units by the ends of entries' names."""


@dataclass(frozen=True, kw_only=True)
class ParameterKind:
    """One kind of error.

    Attributes
    ----------
    name : of the kind, and of the field that holds it.
    error : name of the kind in the fault detection study; empty where that has no case of it.
    column : name of its error columns in a map, where that is another than the kind's own in words.
    extent : what has its own parameter of this kind.
    acts_on : what it changes, for pages.
    relative_to : what a size in percent is a part of, where the kind's name does not say so.
    entry : of each of the ``sections`` of the vehicle file or of a test's file that states its standard deviation.
    step : of central differences of the readings by it; 0 where the derivative has a closed form.
    flight : whether strain in flight depends on it; a ground test alone does otherwise.
    taken_for_zero : whether the standard deviation is 0 by default, and the test says whether that holds.
    alike_in_flight : whether [noise] states one number for all regions alike, not one for each.
    role : in maps. The gain corrects errors of single gauges, of gains and of zeros, and does not know errors of
        the layout and the wall.
    """

    name: str
    extent: Extent
    acts_on: str
    entry: str
    sections: tuple[str, ...] = ("calibration", "noise")
    error: str = ""
    column: str = ""
    relative_to: str = ""
    step: float = 0.0
    flight: bool = True
    taken_for_zero: bool = False
    alike_in_flight: bool = False
    role: Role = "estimated"

    @cached_property
    def unit(self) -> str:
        """Unit of the entry, by its end; parameters themselves are in SI."""
        return next(unit for end, unit in UNIT_OF_END.items() if self.entry.endswith(end))

    @cached_property
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

    def std(self, section: object) -> float:
        """Return the standard deviation that a section states, in SI."""
        return self.scale * float(getattr(section, self.entry))


def _of_layout_or_wall(**kind: Any) -> ParameterKind:
    return ParameterKind(step=1e-3, role="considered", **kind)


AS_BUILT = (
    ParameterKind(
        name="gauge_gain",
        error="gain of each gauge",
        extent="gauge",
        acts_on="reading of the gauge",
        entry="gauge_gain_percent",
    ),
    ParameterKind(
        name="orientation",
        error="orientation of each gauge",
        column="gauge orientation",
        extent="gauge",
        acts_on="direction of the gauge in the surface",
        entry="gauge_orientation_deg",
        step=1e-3,
    ),
    ParameterKind(
        name="axial_shift",
        error="axial position of each gauge",
        column="gauge position, axial",
        extent="gauge",
        acts_on="place of the gauge along the surface",
        entry="gauge_position_mm",
        step=1e-4,
    ),
    ParameterKind(
        name="circumferential_shift",
        error="circumferential position of each gauge",
        column="gauge position, circumferential",
        extent="gauge",
        acts_on="place of the gauge round the body",
        entry="gauge_position_mm",
        step=1e-4,
    ),
    ParameterKind(
        name="transverse_sensitivity",
        error="transverse sensitivity of each gauge",
        extent="gauge",
        acts_on="reading of strain across the gauge",
        entry="transverse_sensitivity_percent",
        step=1e-3,
    ),
    ParameterKind(
        name=ZERO,
        extent="gauge",
        acts_on="reading without load",
        entry="zero_um_per_m",
        sections=("calibration",),
    ),
    ParameterKind(
        name="common_gain",
        error="gain of all gauges",
        extent="vehicle",
        acts_on="readings of all gauges",
        entry="common_gain_percent",
    ),
    _of_layout_or_wall(
        name="layout_roll",
        error="roll of the layout",
        extent="vehicle",
        acts_on="roll angle of all gauges",
        entry="layout_roll_deg",
    ),
    ParameterKind(
        name="youngs_modulus",
        extent="vehicle",
        acts_on="stiffness of the whole wall",
        entry="youngs_modulus_percent",
        sections=("calibration",),
    ),
    _of_layout_or_wall(
        name="wall_thickness",
        error="wall thickness",
        extent="region",
        acts_on="mean thickness round the body",
        entry="wall_thickness_percent",
        alike_in_flight=True,
    ),
    _of_layout_or_wall(
        name="wall_cosine",
        error="wall thickness as the cosine of the roll angle",
        extent="region",
        acts_on="thickness as cos phi",
        entry="wall_harmonic_percent",
    ),
    _of_layout_or_wall(
        name="wall_sine",
        error="wall thickness as the sine of the roll angle",
        extent="region",
        acts_on="thickness as sin phi",
        entry="wall_harmonic_percent",
    ),
    _of_layout_or_wall(
        name="wall_taper",
        error="taper of each region of the wall",
        extent="region",
        acts_on="thickness from the fore to the aft end",
        entry="wall_taper_percent",
        taken_for_zero=True,
    ),
    _of_layout_or_wall(
        name="wall_second_cosine",
        error="wall thickness as the cosine of twice the roll angle",
        extent="region",
        acts_on="thickness as cos 2 phi",
        entry="wall_second_harmonic_percent",
        taken_for_zero=True,
    ),
    _of_layout_or_wall(
        name="wall_second_sine",
        error="wall thickness as the sine of twice the roll angle",
        extent="region",
        acts_on="thickness as sin 2 phi",
        entry="wall_second_harmonic_percent",
        taken_for_zero=True,
    ),
    ParameterKind(
        name="mass",
        extent="vehicle",
        acts_on="own weight and inertia",
        entry="mass_percent",
        sections=("calibration",),
        step=1e-3,
        flight=False,
    ),
    ParameterKind(
        name="region_mass",
        extent="region",
        acts_on="own weight and inertia of the region",
        entry="region_mass_percent",
        sections=("calibration",),
        step=1e-3,
        flight=False,
    ),
    _of_layout_or_wall(
        name="clamp_axial",
        error="clamp that yields along the body",
        column="clamp, along",
        extent="vehicle",
        acts_on="support: length of wall that yields along the body as the clamp does",
        entry="clamp_compliance_mm",
    ),
    _of_layout_or_wall(
        name="clamp_transverse",
        error="clamp that yields across the body",
        column="clamp, across",
        extent="vehicle",
        acts_on="support: length of wall that yields across the body as the clamp does",
        entry="clamp_compliance_mm",
    ),
    _of_layout_or_wall(
        name="region_modulus",
        error="stiffness of each region of the wall",
        extent="region",
        acts_on="stiffness of the region",
        entry="region_modulus_percent",
    ),
    _of_layout_or_wall(
        name="row_orientation",
        error="orientation of each row of gauges",
        extent="row",
        acts_on="direction of all gauges at one roll angle",
        entry="row_orientation_deg",
    ),
    _of_layout_or_wall(
        name="joint_softness",
        error="softness of each joint",
        extent="joint",
        acts_on="length of wall that yields as the joint does",
        entry="joint_softness_mm",
    ),
)
"""Kinds of the vehicle as a calibration estimates it, in the order of its vector. New ones go to the end, so that
the same seed draws the same vehicle."""

IN_FLIGHT = (
    ParameterKind(
        name="apparent_strain",
        error="apparent strain of all gauges",
        extent="vehicle",
        acts_on="readings of all gauges",
        entry="apparent_strain_um_per_m",
        sections=("noise",),
    ),
    ParameterKind(
        name="internal_pressure",
        error="internal pressure",
        extent="vehicle",
        acts_on="pressure inside",
        relative_to="p_inf",
        entry="internal_pressure_percent",
        sections=("noise",),
    ),
    ParameterKind(
        name=DYNAMIC_PRESSURE,
        error="dynamic pressure",
        extent="vehicle",
        acts_on="stated q_inf",
        entry="dynamic_pressure_percent",
        sections=("noise",),
    ),
)
"""Kinds that no ground test knows."""


def _of_load(**kind: Any) -> ParameterKind:
    return ParameterKind(sections=("errors",), flight=False, **kind)


OF_LOADS = (
    _of_load(
        name="load",
        extent="load",
        acts_on="size of each load",
        entry="load_percent",
    ),
    _of_load(
        name="common",
        extent="vehicle",
        acts_on="size of all loads of a load cell",
        entry="load_cell_percent",
    ),
    _of_load(
        name="cell_offset",
        extent="vehicle",
        acts_on="reading of a load cell without load",
        entry="load_cell_offset_N",
    ),
    _of_load(
        name="cell_curve",
        extent="vehicle",
        acts_on="nonlinearity of a load cell",
        relative_to="full scale",
        entry="load_cell_nonlinearity_percent",
    ),
    _of_load(
        name="rig_mass",
        extent="vehicle",
        acts_on="weight of the rig on every pad and point",
        entry="rig_mass_kg",
    ),
    _of_load(
        name="drift",
        extent="gauge",
        acts_on="zero from the first load case to the last",
        entry="drift_um_per_m",
    ),
    _of_load(
        name="pad_position",
        extent="load",
        acts_on="station of each load",
        entry="pad_position_mm",
        step=1e-3,
    ),
    _of_load(
        name="pad_roll",
        extent="load",
        acts_on="roll angle of each load",
        entry="pad_roll_deg",
        step=5e-3,
    ),
    _of_load(
        name="pad_shape",
        extent="load",
        acts_on="length of each pad",
        entry="pad_shape_percent",
        step=0.02,
    ),
    _of_load(
        name="tilt",
        extent="load",
        acts_on="direction of each force, about both axes across it",
        entry="load_direction_deg",
        step=1e-3,
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
    for name in dict.fromkeys(
        (*ALWAYS_DRAWN, *(kind.name for kind in (*AS_BUILT, *IN_FLIGHT) if "noise" in kind.sections))
    )
)
"""Kinds that [noise] states, in the order in which vehicles are drawn.

Young's modulus is in the common gain there, zeros are subtracted, and mass does not change strain under pressure:
inertia is no load of a map.
"""

BY_REGION = tuple(
    kind.name for kind in IN_NOISE if kind.extent in ("region", "joint") and not kind.alike_in_flight
)
"""Kinds of [noise] of which each region of the wall, or each joint, has its own."""
