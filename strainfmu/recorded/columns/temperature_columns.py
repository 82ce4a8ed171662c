"""Columns of temperatures: which is which sensor of the map, and in which unit."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.units import TEMPERATURE_UNITS

_INDEX = re.compile(r"(?:.*\.)?temperature\[([0-9]+)\]")


@dataclass(frozen=True)
class TemperatureColumn:
    """A column with the temperature of a sensor: value [K] = factor * number + offset."""

    column: int
    factor: float
    offset: float


def is_temperature(name: str) -> bool:
    """Return whether a column of this name is ``temperature[k]``, of an instance or not."""
    return _INDEX.fullmatch(name) is not None


def sensor_of(name: str, sensors: Sequence[str]) -> int | None:
    """Return the index of the sensor that a column of this name is of: its name, or ``temperature[k]`` from 1."""
    if name in sensors:
        return list(sensors).index(name)
    match = _INDEX.fullmatch(name)
    number = 0 if match is None else int(match[1])
    return number - 1 if 1 <= number <= len(sensors) else None


def temperature_quantities(sensors: Sequence[str]) -> tuple[str, ...]:
    """Return ``temperature[1]`` .. of the sensors."""
    return tuple(f"temperature[{i}]" for i in range(1, len(sensors) + 1))


def kelvin(path: Path, name: str, unit: str | None) -> tuple[float, float]:
    """Return factor and offset from ``unit`` to K; without a unit it is K.

    Raises
    ------
    InputError
        There is no such unit.
    """
    text = "K" if unit is None or not unit.strip() else unit.strip()
    if text not in TEMPERATURE_UNITS:
        raise InputError(
            f"{path}: column '{name}': unit: expected one of {', '.join(TEMPERATURE_UNITS)}, got '{text}'"
        )
    return TEMPERATURE_UNITS[text]


def temperature_columns(
    path: Path, names: Sequence[str], units: Sequence[str | None], read: Sequence[int], sensors: Sequence[str]
) -> tuple[TemperatureColumn | None, ...]:
    """Return the column of each of ``sensors`` among the columns ``read``, None of one that has none.

    Raises
    ------
    InputError
        Two columns are of one sensor, or a unit is unknown.
    """
    found: list[TemperatureColumn | None] = [None] * len(sensors)
    for column in read:
        sensor = sensor_of(names[column], sensors)
        if sensor is None:
            continue
        other = found[sensor]
        if other is not None:
            same = f"'{names[other.column]}' and '{names[column]}'"
            raise InputError(f"{path}: expected one column for sensor {sensors[sensor]}, got 2: {same}")
        found[sensor] = TemperatureColumn(column, *kelvin(path, names[column], units[column]))
    return tuple(found)


def temperatures(held: Sequence[TemperatureColumn | None], numbers: FloatArray) -> FloatArray | None:
    """Return (n, n_t) temperatures [K] of ``numbers`` (n, k), a column of each that is there; None if none is."""
    if not any(held):
        return None
    found, place = np.full((len(numbers), len(held)), np.nan), 0
    for sensor, one in enumerate(held):
        if one is not None:
            found[:, sensor] = one.factor * numbers[:, place] + one.offset
            place += 1
    return found


def temperature_note(path: Path, held: Sequence[TemperatureColumn | None], sensors: Sequence[str]) -> list[str]:
    """Return what to say of sensors without a column."""
    missing = [name for name, one in zip(sensors, held, strict=True) if one is None]
    if not missing:
        return []
    shown = ", ".join(missing[:6]) + (" .." if len(missing) > 6 else "")
    what = (
        "temperature sensors"
        if len(missing) < len(held)
        else "temperature sensors, the map's modes stay nuisances"
    )
    return [f"{path}: no column for {len(missing)} of {len(held)} {what}: {shown}"]
