"""What stands in a map for data that it does not have: zeros, no rows, no bounds.

Code that reads a map then needs no case for what it lacks. A caller leaves such a field out, or gives an array
without values; a file leaves it out, too.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, fields, is_dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.inverse_map_checks import GROUPS, RANGES
from strainfmu.estimator.map.sensors import SensorRows, strain_rows
from strainfmu.estimator.map.temperature import ThermalMap, no_temperature

if TYPE_CHECKING:
    from strainfmu.estimator.map.inverse_map import InverseMap


def no_numbers() -> FloatArray:
    """Return an array without values, of double precision; defaults of a map, as the next two."""
    return np.zeros(0)


def no_singles() -> NDArray[np.float32]:
    """Return an array without values, of single precision."""
    return np.zeros(0, dtype=np.float32)


def no_indices() -> NDArray[np.int32]:
    """Return an array without indices."""
    return np.zeros(0, dtype=np.int32)


def neutral_arrays(inverse_map: InverseMap) -> dict[str, Any]:
    """Return the neutral values of the fields of ``inverse_map`` that are arrays, by name."""
    n_d, n_q = len(inverse_map.gauge_names), inverse_map.state_operator.shape[-1]
    return {
        "field_mean": np.zeros(0, dtype=np.float32),
        "field_modes": np.zeros((0, n_q), dtype=np.float32),
        "field_std": np.zeros(len(inverse_map.field_mean), dtype=np.float32),
        "point": np.zeros((0, 3), dtype=np.float32),
        "triangle": np.zeros((0, 3), dtype=np.int32),
        "fixed_strain": np.zeros(n_d),
        "fixed_load": np.zeros(len(inverse_map.load_of_mean)),
        "zero_offset": np.zeros(n_d),
        "gauge_error_product": np.zeros((21, n_d)),
        "common_error": np.zeros((0, 6, n_d)),
        "mean_product": np.zeros(21),
        "envelope_direction": np.zeros((0, 5)),
        "envelope_limit": np.zeros(0),
        **{name: np.array([-np.inf, np.inf]) for name in RANGES},
    }


def neutral_parts(inverse_map: InverseMap) -> dict[str, Any]:
    """Return the neutral values of its fields that are records: strain gauges alone, no temperature modes."""
    return {
        "sensors": strain_rows(len(inverse_map.gauge_names)),
        "thermal": no_temperature(inverse_map.gauge_covariance),
    }


def fill(inverse_map: InverseMap, neutral: Mapping[str, Any]) -> None:
    """Put the values ``neutral`` by name into the fields of ``inverse_map`` that hold nothing."""
    for name, value in neutral.items():
        if _holds_nothing(getattr(inverse_map, name)):
            object.__setattr__(inverse_map, name, value)


def nothing_of(inverse_map: InverseMap, *names: str) -> dict[str, Any]:
    """Return changes of ``inverse_map``, for :func:`dataclasses.replace`, that leave its fields ``names`` out."""
    factories = {one.name: one.default_factory for one in fields(inverse_map)}
    found = dict[str, Any]()
    for name in names:
        factory = factories[name]
        if factory is MISSING:
            raise ValueError(f"{name}: expected a field that a map may leave out")
        found[name] = factory()
    return found


def neutral_fields(inverse_map: InverseMap) -> list[str]:
    """Return the names of the fields of ``inverse_map`` that hold neutral values, which its file leaves out."""
    neutral: dict[str, Any] = {"field_is_net": False, "level_slope": 0.0}
    neutral = {**neutral_arrays(inverse_map), **neutral_parts(inverse_map), **neutral}
    found = {name for name, value in neutral.items() if _same(getattr(inverse_map, name), value)}
    for names in GROUPS:
        found -= set() if found.issuperset(names) else set(names)
    return [name for name in neutral if name in found]


def _holds_nothing(value: Any) -> bool:
    if isinstance(value, SensorRows):
        return not value.kind
    if isinstance(value, ThermalMap):
        return not (value.n_modes or value.n_sensors)
    return bool(value.size == 0)


def _same(one: Any, other: Any) -> bool:
    if is_dataclass(one):
        return all(_same(getattr(one, entry.name), getattr(other, entry.name)) for entry in fields(one))
    return bool(np.array_equal(one, other))
