"""The settings of an estimator as inputs: one table, which Python, the core's record and FMUs follow."""

from __future__ import annotations

from dataclasses import dataclass


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
"""Fields of :class:`~strainfmu.estimator.settings.EstimatorSettings`, in their order in a record of the core."""

SETTING_NAMES = tuple(one.name for one in SETTING_INPUTS)
OF_READINGS, OF_ALARMS, OF_AREA, OF_LENGTH, OF_STATION = SETTING_NAMES
