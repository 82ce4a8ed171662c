"""Estimators under trial by name: each takes readings and returns estimates of the loads that are scored.

``map``
    The estimator of the map: the nonlinear one where it has tables.
``linear``, ``nonlinear``
    One of them.
``... 10 s``
    One of these with a filter over time of that time constant, along a flight in time.
``... stepping``
    The nonlinear one as it steps along a flight: from the state that it estimates from the true one. Weights at
    the true states would give other tests: errors of a vehicle last, and its estimates are wrong by as much in
    every step.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from builder.processors import processors
from builder.trial.readings import ANGLES, Readings, chosen, stacked
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import AIR_DATA_NAMES, ALTITUDE, DYNAMIC_PRESSURE, Q_SOURCE, STATIC_PRESSURE
from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import InverseMap

STEPPING = "stepping"

NAME = re.compile(rf"(map|linear|nonlinear)(?: ({STEPPING}|(\d*\.?\d+)(?: s)?))?")
"""Kind, and how it steps or the time constant of its filter [s]."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Estimates:
    """Estimates of n samples.

    Attributes
    ----------
    value, std : (n, m) of the loads.
    health : (n,); None where none is stated.
    extras : value and standard deviation (n,) of what is no load, by name: air data, errors of a field.
    """

    value: FloatArray
    std: FloatArray
    health: IntArray | None = None
    extras: Mapping[str, tuple[FloatArray, FloatArray]] = field(default_factory=dict)

    def rows(self, rows: IntArray) -> Estimates:
        """Return the samples ``rows`` alone."""
        return Estimates(**{name: chosen(value, rows) for name, value in vars(self).items()})


EstimateReadings = Callable[[Readings], Estimates]
"""An estimator under trial."""


def of_map(inverse_map: InverseMap, name: str = "map") -> EstimateReadings:
    """Return the estimator ``name`` of a map.

    Raises
    ------
    InputError
        There is none of this name, or the map has no tables for it.
    """
    if (parts := NAME.fullmatch(name)) is None:
        raise InputError(f"estimators: expected 'map', 'linear' or 'nonlinear', or 'linear 10 s', got '{name}'")
    kind, how, seconds = parts.groups()
    available(inverse_map, [name])
    estimator = Estimator(inverse_map.without_tables() if kind == "linear" else inverse_map)
    if how == STEPPING:
        # From the state that is estimated from the true one.
        return lambda read: estimates_from(
            estimate_of(estimator, read, estimate_of(estimator, read, read.states).state)
        )
    return of_estimator(estimator.filter(float(seconds)) if seconds else estimator)


def available(inverse_map: InverseMap, names: Sequence[str]) -> list[str]:
    """Return the estimators of ``names`` that a map has, all of them where it has tables.

    Raises
    ------
    InputError
        It has none of them.
    """
    linear = inverse_map.manifold is None
    known = [name for name in names if not (linear and (name.startswith("nonlinear") or name.endswith(STEPPING)))]
    if not known:
        raise InputError(f"estimators: {', '.join(names)}: expected a map with tables, got one without")
    return known


def of_estimator(estimator: Estimator) -> EstimateReadings:
    """Return ``estimator``: of single samples, along flights in time, or at the ends of short flights."""

    def estimate(read: Readings) -> Estimates:
        if read.time is None:
            return estimates_from(estimate_of(estimator, read))
        given = replace(read, known=known_by(estimator, read.known))
        return _at_ends(estimator, given) if read.strain.ndim > 2 else _along(estimator, given)

    return estimate


def with_inputs(estimate: EstimateReadings, names: Sequence[str]) -> EstimateReadings:
    """Return ``estimate`` that is given the air data ``names`` alone, and a dynamic pressure of NaN without it."""

    def of_some(read: Readings) -> Estimates:
        known = {name: value for name, value in read.known.items() if name in (*names, Q_SOURCE)}
        return estimate(replace(read, known={DYNAMIC_PRESSURE: np.nan, **known}))

    return of_some


def known_by(estimator: Estimator, known: Mapping[str, Any]) -> dict[str, Any]:
    """Return what ``estimator`` takes of p_inf and altitude, where both are given."""
    needless = ALTITUDE if estimator.is_nonlinear else STATIC_PRESSURE
    both = ALTITUDE in known and STATIC_PRESSURE in known
    return {name: value for name, value in known.items() if not (both and name == needless)}


def estimate_of(estimator: Estimator, read: Readings, start: FloatArray | None = None) -> Estimate:
    """Return the estimate of the last reading of each sample, in a step from states ``start`` (n, 4) if given."""
    return estimator.estimate(read.last, **known_by(estimator, read.known), start=start)


def estimates_from(made: Estimate, air_data: Sequence[str] = ()) -> Estimates:
    """Return the loads of estimates, and the ``air_data`` of these names where some are known."""
    value, std = made.coefficients, made.coefficients_std
    columns = [AIR_DATA_NAMES.index(name) for name in air_data]
    if columns and not np.isnan(made.air_data.value[:, columns]).all():
        value = np.hstack([value, made.air_data.value[:, columns]])
        std = np.hstack([std, made.air_data.std[:, columns]])
    return Estimates(value=value, std=std, health=np.asarray(made.health, dtype=np.int64))


def _along(estimator: Estimator, read: Readings) -> Estimates:
    """Return the estimates along the flight of each vehicle."""
    tracks = []
    for number in dict.fromkeys(read.vehicle.tolist()):
        of_flight, rows = read.rows(np.flatnonzero(read.vehicle == number)), read.vehicle == number
        track = estimator.filter(estimator.filter_time_constant)
        made = track.track(of_flight.strain, time=np.asarray(read.time)[rows], **of_flight.known)
        tracks.append(estimates_from(made, ANGLES))
    return together(tracks)


def _at_ends(estimator: Estimator, read: Readings) -> Estimates:
    """Return the estimates at the ends of short flights, each processor a part of them with a track of its own."""

    def of_part(rows: IntArray) -> list[Estimates]:
        track, part = estimator.filter(estimator.filter_time_constant), read.rows(rows)
        ends = list[Estimates]()
        for k in range(len(rows)):
            track.restart()
            made = track.track(part.strain[k], time=np.asarray(read.time), **chosen(part.known, k))
            ends.append(estimates_from(made[-1:]))
        return ends

    parts = np.array_split(np.arange(len(read.strain)), processors())
    with ThreadPoolExecutor(len(parts)) as pool:
        return together([end for part in pool.map(of_part, parts) for end in part])


def together(parts: list[Estimates]) -> Estimates:
    """Return the estimates of ``parts`` one after another."""
    return Estimates(**{name: stacked([getattr(part, name) for part in parts]) for name in vars(parts[0])})
