"""What an FMU of this project states in addition to its model description: the entries of ``contents.json``.

:func:`estimator_contents` makes the entries of an estimator from its map, :func:`stated_contents` reads them.
Programs take names, positions and limits from here: descriptions are for people.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from math import atan2, degrees, isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar
from zipfile import BadZipFile, ZipFile

from strainfmu.estimator.map.inverse_map import groups_of_outputs
from strainfmu.estimator.valid_ranges import all_ranges
from strainfmu.interface.estimator_variables import estimator_arrays, estimator_interface
from strainfmu.interface.fmi_variables import Variable
from strainfmu.interface.sensor_variables import sensor_names

if TYPE_CHECKING:
    from strainfmu.estimator.map.inverse_map import InverseMap

CONTENTS = "extra/strainfmu/contents.json"
"""The entry of the FMU that holds them."""

_Value = TypeVar("_Value")


@dataclass(frozen=True)
class Position:
    """Position of a gauge: ``x`` [m] aft of the nose tip, ``roll_angle`` [deg]; None where it is not known."""

    x: float | None = None
    roll_angle: float | None = None


@dataclass(frozen=True, kw_only=True)
class FmuContents:
    """What an FMU states of itself; each entry is empty, or None, where it does not.

    Attributes
    ----------
    vehicle : its name.
    gauges : names of the gauges, order of the strains.
    gauge_noise : standard deviation of the noise of each gauge [m/m].
    gauge_zeros : zero offsets that are subtracted unless others are given [m/m]; none where they are 0.
    positions : of each gauge, order of the strains.
    temperature_sensors : names of the temperature sensors, order of the inputs.
    envelope_score_limit : envelope score above which the estimator says OUTSIDE [1].
    places : places of the loads behind the five by the first output of their family, without its number.
    ranges : smallest and largest value that the snapshots cover, by quantity, in the unit of ``validity``.
    validity : the same as texts with their units.
    """

    vehicle: str = ""
    gauges: tuple[str, ...] = ()
    gauge_noise: tuple[float, ...] = ()
    gauge_zeros: tuple[float, ...] = ()
    positions: tuple[Position, ...] = ()
    temperature_sensors: tuple[str, ...] = ()
    envelope_score_limit: float | None = None
    places: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    validity: Mapping[str, str] = field(default_factory=dict)


def estimator_contents(inverse_map: InverseMap) -> dict[str, Any]:
    """Return the entries of the estimator of a map. A later version may add entries; it changes none."""
    n, limit = inverse_map.n_strain_gauges, inverse_map.outside_score
    ranges, groups = all_ranges(inverse_map), groups_of_outputs(inverse_map)
    zeros = inverse_map.zero_offset[:n].tolist()
    return {
        "vehicle": inverse_map.vehicle,
        "gauges": list(inverse_map.gauge_names[:n]),
        "gauge_noise_um_per_m": [float(f"{1e6 * std:.6g}") for std in inverse_map.noise_std[:n]],
        **({"gauge_zeros_um_per_m": [1e6 * zero for zero in zeros]} if any(zeros) else {}),
        "gauge_positions": [_stated_position(*position) for position in inverse_map.gauge_position[:n].tolist()],
        "sensors": dict(zip(inverse_map.gauge_names[n:], sensor_names(inverse_map), strict=True)),
        "temperature_sensors": list(inverse_map.thermal.sensor_names),
        "validity": {span.quantity: span.text for span in ranges},
        "ranges": {
            span.quantity: {"minimum": span.minimum, "maximum": span.maximum, "unit": span.unit} for span in ranges
        },
        "envelope_score_limit": float(limit) if isfinite(limit) else None,
        "load_places": {group.family.loads[0].output: list(group.places) for group in groups},
        "signals": [_stated_signal(array) for array in estimator_arrays(estimator_interface(inverse_map))],
    }


_LARGEST = 50_000_000
"""Bytes of the entry; what is larger is not read."""


def stated_contents(path: Path) -> FmuContents:
    """Return what the FMU at ``path`` states; nothing of one of another program, or that cannot be read."""
    try:
        with ZipFile(path) as archive, archive.open(CONTENTS) as entry:
            text = entry.read(_LARGEST + 1)
    except (OSError, BadZipFile, KeyError, RuntimeError, EOFError, zlib.error):
        return FmuContents()
    return contents_from(text) if len(text) <= _LARGEST else FmuContents()


def contents_from(text: bytes) -> FmuContents:
    """Return what the entry ``text`` states; what is not of the expected form is not stated."""
    try:
        contents = json.loads(text)
    except (ValueError, RecursionError):
        return FmuContents()
    if not isinstance(contents, dict):
        return FmuContents()
    noise = _list(contents.get("gauge_noise_um_per_m"), _number)
    zeros = _list(contents.get("gauge_zeros_um_per_m"), _number)
    limit = contents.get("envelope_score_limit")
    return FmuContents(
        vehicle=str(contents.get("vehicle", "")),
        gauges=_list(contents.get("gauges"), _text),
        gauge_noise=tuple(1e-6 * value for value in noise),
        gauge_zeros=tuple(1e-6 * value for value in zeros),
        positions=_list(contents.get("gauge_positions"), _position),
        temperature_sensors=_list(contents.get("temperature_sensors"), _text),
        envelope_score_limit=limit if _number(limit) is not None else None,
        places={name: _list(places, _text) for name, places in _entries(contents, "load_places")},
        ranges={name: bounds for name, entry in _entries(contents, "ranges") if (bounds := _range(entry))},
        validity={name: str(statement) for name, statement in _entries(contents, "validity")},
    )


def _stated_position(x: float, y: float, z: float) -> dict[str, float]:
    return {"x_m": round(x, 6), "roll_angle_deg": round(degrees(atan2(y, z)) % 360.0, 4) % 360.0}


def _stated_signal(signal: Variable) -> dict[str, Any]:
    """Return an entry of the table of signals; what it does not have is left out."""
    start = list(signal.start) if isinstance(signal.start, tuple) else signal.start
    known = {
        "name": signal.name,
        "label": signal.label,
        "symbol": signal.symbol,
        "kind": signal.kind,
        "causality": signal.causality,
        "type": signal.fmi_type,
        "unit": signal.unit,
        "unit_shown": signal.display_unit,
        "description": signal.description,
        "size": signal.dimension or 1,
        "minimum": signal.minimum,
        "maximum": signal.maximum,
        "start": start,
        "depends_on": list(signal.depends_on),
    }
    return {name: value for name, value in known.items() if value not in (None, "", [])}


def _entries(contents: dict[str, Any], name: str) -> list[tuple[str, Any]]:
    entries = contents.get(name)
    return list(entries.items()) if isinstance(entries, dict) else []


def _list(entries: Any, read: Any) -> tuple[Any, ...]:
    """Return what ``read`` makes of each of a list; nothing if one of them is of another form."""
    values = [read(entry) for entry in entries] if isinstance(entries, list) else []
    return () if any(value is None for value in values) else tuple(values)


def _text(value: Any) -> str | None:
    return value if isinstance(value, str) else None


def _number(value: Any) -> float | None:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return float(value) if is_number and isfinite(value) else None


def _position(value: Any) -> Position | None:
    if not isinstance(value, dict):
        return None
    return Position(_number(value.get("x_m")), _number(value.get("roll_angle_deg")))


def _range(value: Any) -> tuple[float, float] | None:
    if not isinstance(value, dict):
        return None
    low, high = _number(value.get("minimum")), _number(value.get("maximum"))
    return None if low is None or high is None else (low, high)
