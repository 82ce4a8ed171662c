"""Estimators for readings with temperatures: one for each set of known sensors, and its strains."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError
from strainfmu.estimator.arguments import real_numbers
from strainfmu.estimator.map.added_noise import with_gauge_covariance
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.temperature import (
    SensorSet,
    ThermalMap,
    known_sensors,
    sensor_set,
    strain_at_reference,
)

CACHED_SETS = 8
"""Sets of known sensors whose estimators are kept."""

Kind = TypeVar("Kind")


@dataclass(kw_only=True, eq=False)
class SensorSets(Generic[Kind]):
    """Estimators of the sets of known sensors of one map.

    Attributes
    ----------
    inverse_map : the map, without zeros.
    make : an estimator of a map for readings whose zeros are taken off.
    """

    inverse_map: InverseMap
    make: Callable[[InverseMap], Kind]
    _kept: dict[bytes, tuple[SensorSet, Kind]] = field(default_factory=dict)

    @property
    def thermal(self) -> ThermalMap:
        """The modes of the map.

        Raises
        ------
        InputError
            It has none.
        """
        thermal = self.inverse_map.thermal
        if thermal is None:
            raise InputError("temperature: expected none, the map was built without [temperature]")
        return thermal

    def readings(self, temperature: ArrayLike, samples: int) -> FloatArray:
        """Return ``temperature``, (n_t,) or (samples, n_t), as (samples, n_t).

        Raises
        ------
        InputError
            It has another shape, holds something else than real numbers, or the map knows no sensors.
        """
        values, n_t = real_numbers("temperature", temperature), self.thermal.n_sensors
        if values.shape not in ((n_t,), (samples, n_t)):
            raise InputError(f"temperature: expected ({n_t},) or ({samples}, {n_t}) values, got {values.shape}")
        return np.broadcast_to(values, (samples, n_t))

    def groups(self, temperature: FloatArray) -> Iterator[tuple[IntArray, bytes]]:
        """Yield the samples of each set of known sensors, and its key."""
        known = known_sensors(self.thermal, temperature)
        sets, which = np.unique(known, axis=0, return_inverse=True)
        for number, one in enumerate(sets):
            yield np.flatnonzero(which.reshape(-1) == number), one.tobytes()

    def of_set(self, key: bytes, strain: FloatArray, temperature: FloatArray) -> tuple[Kind, FloatArray]:
        """Return the estimator of the set ``key``, and strains (k, n_d) less zeros as at the reference."""
        sensors, estimator = self.held(key)
        return estimator, strain_at_reference(self.thermal, sensors, strain, temperature)

    def held(self, key: bytes) -> tuple[SensorSet, Kind]:
        """Return what the set ``key`` tells, and its estimator."""
        if key not in self._kept:
            found = sensor_set(self.thermal, np.frombuffer(key, dtype=bool))
            made = self.make(with_gauge_covariance(self.inverse_map, found.gauge_covariance))
            self._kept[key] = found, made
            if len(self._kept) > CACHED_SETS:
                self._kept.pop(next(iter(self._kept)))
        return self._kept[key]


def scattered(parts: list[tuple[IntArray, Any]], samples: int) -> Any:
    """Return the estimates ``parts`` of rows of one series as one; pressure is that of no sample of several."""
    if len(parts) == 1:
        return parts[0][1]
    first = parts[0][1]
    values: dict[str, Any] = {}
    for entry in fields(first):
        of_part = [getattr(part, entry.name) for _, part in parts]
        if entry.name == "field_inputs" or of_part[0] is None:
            values[entry.name] = None
        elif is_dataclass(of_part[0]):
            values[entry.name] = scattered(
                [(rows, one) for (rows, _), one in zip(parts, of_part, strict=True)], samples
            )
        elif isinstance(of_part[0], np.ndarray) and entry.name != "section_station":
            whole = np.empty((samples, *of_part[0].shape[1:]), dtype=of_part[0].dtype)
            for (rows, _), one in zip(parts, of_part, strict=True):
                whole[rows] = one
            values[entry.name] = whole
        else:
            values[entry.name] = of_part[0]
    return type(first)(**values)
