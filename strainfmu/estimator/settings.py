"""Settings of an estimator that need no other map: one table, which Python, the core's record and FMUs follow."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

from strainfmu.errors import InputError


@dataclass(frozen=True, kw_only=True)
class SettingInput:
    """A setting as an input: ``name`` everywhere, ``unit`` as FMI has it, ``shown`` to people, ``text`` its
    description, ``note`` what a C program reads of it."""

    name: str
    label: str
    unit: str
    text: str
    shown: str | None = None
    note: str = ""


SETTING_INPUTS = (
    SettingInput(
        name="sensor_range",
        label="Sensor range",
        unit="1",
        shown="um/m",
        text="Largest |strain| of a working gauge; one beyond it is left out",
        note="[m/m] largest |strain| of a gauge that works",
    ),
    SettingInput(
        name="alarm_scale",
        label="Alarm scale",
        unit="1",
        text="Factor on the limit of chi-square, and on the square of the limit of one gauge",
        note="[1] factor on the detection thresholds",
    ),
    SettingInput(
        name="reference_area",
        label="Reference area",
        unit="m2",
        text="Area S that coefficients are referred to",
        note="[m2]",
    ),
    SettingInput(
        name="reference_length",
        label="Reference length",
        unit="m",
        text="Length L that moment coefficients are referred to besides",
        note="[m]",
    ),
    SettingInput(
        name="moment_station",
        label="Moment station",
        unit="m",
        text="Station x of the moment point, aft from the nose tip",
        note="[m] x of the point that moments refer to",
    ),
)
"""Fields of :class:`EstimatorSettings`, in their order in a record of the core."""

SETTING_NAMES = tuple(setting.name for setting in SETTING_INPUTS)
OF_READINGS, OF_ALARMS, OF_AREA, OF_LENGTH, OF_STATION = SETTING_NAMES

SENSOR_RANGE = 0.05
"""|strain| [m/m] that foil gauges bear, 5 %: what reads more is broken. Amplifiers often end far earlier."""

GAUGE_RANGE = "gauge_range_um_per_m"
"""Entry of a map's provenance: the range that the vehicle file states of its gauges [um/m]."""

SMALLEST_SETTING, LARGEST_SETTING = 1e-9, 1e9
"""Bounds on every setting, in its unit: beyond what any vehicle has, and no product with loads overflows."""


@dataclass(frozen=True)
class EstimatorSettings:
    """Settings of an estimator.

    Attributes
    ----------
    reference_area : S [m2] that coefficients are referred to.
    reference_length : L [m] that moment coefficients are also referred to.
    moment_station : x [m] of the moment point on the axis, aft from the nose tip.
    sensor_range : largest |strain| of a working gauge [m/m].
    alarm_scale : factor on the detection threshold of chi-square, and on the square of the one of |z| [1]. 4
        allows twice the noise in every gauge.
    """

    reference_area: float
    reference_length: float
    moment_station: float
    sensor_range: float = SENSOR_RANGE
    alarm_scale: float = 1.0

    def __post_init__(self) -> None:
        for entry in fields(self):
            fault = setting_fault(entry.name, getattr(self, entry.name))
            if fault:
                raise InputError(fault)


def setting_fault(name: str, value: float) -> str:
    """Return what is wrong with ``value`` for the setting ``name``, in one line; "" if nothing is."""
    smallest = setting_minimum(name)
    if smallest <= value <= LARGEST_SETTING:
        return ""
    return f"{name}: {value} found, must be between {smallest:g} and {LARGEST_SETTING:g}"


def setting_minimum(name: str) -> float:
    """Return the smallest value of the setting ``name``, in its unit."""
    return -LARGEST_SETTING if name == OF_STATION else SMALLEST_SETTING


def default_settings(inverse_map: Any) -> EstimatorSettings:
    """Return the settings that ``inverse_map`` was built with.

    A map that does not state its moment point counts stations from that point. One that does not state the range
    of its gauges has :data:`SENSOR_RANGE`.
    """
    facts = inverse_map.provenance
    return EstimatorSettings(
        inverse_map.reference_area,
        inverse_map.reference_length,
        float(facts.get("moment_station_m", 0.0)),
        1e-6 * float(facts[GAUGE_RANGE]) if GAUGE_RANGE in facts else SENSOR_RANGE,
    )
