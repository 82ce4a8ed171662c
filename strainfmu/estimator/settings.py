"""Settings of an estimator that need no other map: sensor range, alarm level, references."""

from __future__ import annotations

from dataclasses import dataclass, fields

from strainfmu.errors import InputError
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.setting_inputs import OF_STATION

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


def default_settings(inverse_map: InverseMap) -> EstimatorSettings:
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
