"""The message to displays with the pressure on the unrolled body.

It is computed in the publisher's thread from the strains of a result, by an estimator of its own: the bridge's
cycle has no part in it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from strainfmu.can.cycle.result import CycleResult
from strainfmu.errors import InputError
from strainfmu.estimator.inverse_map import InverseMap, load_inverse_map
from strainfmu.estimator.manifold.estimator import ManifoldEstimator
from strainfmu.estimator.manifold.tracker import FlightTracker

FIELD_PERIOD = 0.1
"""Shortest time from one field to the next [s]."""

_STATIONS, _ROLLS = 60, 36
"""Largest number of stations and roll angles of a message: it fits one datagram."""


class FieldMessages:
    """The pressure of results by a map with tables that holds the field."""

    def __init__(self, inverse_map: InverseMap) -> None:
        """Prepare ``inverse_map``; raises InputError without tables."""
        estimator = ManifoldEstimator(inverse_map)
        held = estimator.manifold.pressure_field
        if held is None:
            raise ValueError("inverse_map: expected one that holds the pressure field")
        self._tracker = FlightTracker(estimator)
        self._rows = _thinned(len(held.station), _STATIONS)
        self._columns = _thinned(len(held.roll_angle), _ROLLS)
        self._shape = (len(held.station), len(held.roll_angle))
        self._places = {
            "x": np.round(held.station[self._rows], 4).tolist(),
            "roll_angle": np.round(np.degrees(held.roll_angle[self._columns]), 3).tolist(),
        }

    def message(self, result: CycleResult, timestamp: float) -> dict[str, Any]:
        """Return the message of ``result``; without values where there is no estimate."""
        values = self._pressure(result) if result.quality.has_coefficients else []
        return {"field": {"timestamp": timestamp, **self._places, "pressure_Pa": values}}

    def _pressure(self, result: CycleResult) -> list[int]:
        try:
            found = self._tracker.step(
                result.strain,
                result.dynamic_pressure,
                result.valid,
                mach_number=result.mach_number,
                altitude=result.altitude,
            )
            pressure = found.pressure(with_std=False).pressure.reshape(self._shape)
        except np.linalg.LinAlgError:  # the results themselves must go on
            return []
        chosen = pressure[np.ix_(self._rows, self._columns)]
        return np.rint(chosen).astype(int).ravel().tolist() if np.all(np.isfinite(chosen)) else []


def field_messages(path: Path, gauge_names: tuple[str, ...]) -> FieldMessages:
    """Return the messages of the map at ``path``.

    Raises
    ------
    InputError
        The file is missing or damaged, its gauges are not ``gauge_names``, or it holds no tables with the field.
    """
    held = load_inverse_map(path)
    if held.gauge_names != gauge_names:
        raise InputError(f"--publish-field {path}: expected a map of the estimator's gauges, got others")
    if held.manifold is None or held.manifold.pressure_field is None:
        raise InputError(
            f"--publish-field {path}: expected a map built with estimator = 'manifold' and keep_field = true"
        )
    return FieldMessages(held)


def _thinned(n: int, most: int) -> np.ndarray:
    """Return at most ``most`` of the numbers 0 .. n - 1, evenly."""
    return np.arange(0, n, -(-n // most))
