"""Settings of an estimator that need no other map: one table, which Python, the core's record and FMUs follow."""

from dataclasses import MISSING, dataclass, field, fields
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


SETTING_NAMES = OF_READINGS, OF_ALARMS, OF_AREA, OF_LENGTH, OF_STATION = (
    "sensor_range",
    "alarm_scale",
    "reference_area",
    "reference_length",
    "moment_station",
)
"""In their order in a record of the core."""

SENSOR_RANGE = 0.05
"""|strain| [m/m] that foil gauges bear, 5 %: what reads more is broken. Amplifiers often end far earlier."""

GAUGE_RANGE = "gauge_range_um_per_m"
"""Entry of a map's provenance: the range that the vehicle file states of its gauges [um/m]."""

SMALLEST_SETTING, LARGEST_SETTING = 1e-9, 1e9
"""Bounds on every setting, in its unit: beyond what any vehicle has, and no product with loads overflows."""


def _setting(label: str, unit: str, text: str, note: str, shown: str | None = None, default: Any = MISSING) -> Any:
    about = {"label": label, "unit": unit, "text": text, "note": note, "shown": shown}
    return field(default=default, metadata=about)


@dataclass(frozen=True)
class EstimatorSettings:
    """Settings of an estimator."""

    # fmt: off
    reference_area: float = _setting("Reference area", "m2", "Area S that coefficients are referred to", "[m2]")
    reference_length: float = _setting("Reference length", "m",
        "Length L that moment coefficients are referred to besides", "[m]")
    moment_station: float = _setting("Moment station", "m",
        "Station x of the moment point, aft from the nose tip", "[m] x of the point that moments refer to")
    sensor_range: float = _setting("Sensor range", "1",
        "Largest |strain| of a working gauge; one beyond it is left out",
        "[m/m] largest |strain| of a gauge that works", shown="um/m", default=SENSOR_RANGE)
    alarm_scale: float = _setting("Alarm scale", "1",
        "Factor on the limit of chi-square, and on the square of the limit of one gauge",
        "[1] factor on the detection thresholds", default=1.0)
    # fmt: on

    def __post_init__(self) -> None:
        for name in SETTING_NAMES:
            fault = setting_fault(name, getattr(self, name))
            if fault:
                raise InputError(fault)


_ABOUT = {item.name: item.metadata for item in fields(EstimatorSettings)}
SETTING_INPUTS = tuple(SettingInput(name=name, **_ABOUT[name]) for name in SETTING_NAMES)
EstimatorSettings.__doc__ = "Settings of an estimator.\n\n    Attributes\n    ----------\n" + "".join(
    f"    {name} : {about['text']} [{about['unit']}].\n" for name, about in _ABOUT.items()
)


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
