"""The message to displays with the pressure on the unrolled body.

It is computed in the publisher's thread from the strains of a result, by an estimator of its own: the bridge's
cycle has no part in it.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from strainfmu.arrays import FloatArray, IntArray
from strainfmu.can.cycle.estimate.result import CycleResult
from strainfmu.errors import InputError
from strainfmu.estimator.estimates.unrolled_surface import SurfacePlaces, outermost_places
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import InverseMap, load_inverse_map
from strainfmu.estimator.signal_names import TEMPERATURE
from strainfmu.estimator.tables.flight_field import FlightField
from strainfmu.estimator.zeros.gauge_zeros import GaugeZeros
from strainfmu.interface.input_names import given_flow, given_thrust, other_air_data
from strainfmu.interface.parameter_variables import PREFIX, STD_PREFIX
from strainfmu.interface.sensor_variables import has_thrust, sensor_names
from strainfmu.interface.temperature_variables import temperature_names

FIELD_PERIOD = 0.1
"""Shortest time from one field to the next [s]."""

_STATIONS, _ROLLS = 60, 36
"""Largest number of stations and roll angles of a message: it fits one datagram."""


class FieldMessages:
    """The pressure of results by a map with tables that holds the field."""

    def __init__(self, inverse_map: InverseMap) -> None:
        """Prepare ``inverse_map``; raises InputError without tables."""
        estimator = Estimator(inverse_map)
        held = None if inverse_map.manifold is None else inverse_map.manifold.surface_field
        if held is None:
            raise ValueError("inverse_map: expected one that holds the pressure field")
        self._estimator, self._zeros = estimator, estimator.zeros
        self._air_data = other_air_data(is_nonlinear=True, has_masses=inverse_map.has_masses)
        self._temperatures = temperature_names(inverse_map.thermal)
        self._parameters = estimator.parameters.names
        self._sensors, self._has_thrust = sensor_names(inverse_map), has_thrust(inverse_map)
        if isinstance(held, FlightField):
            row, column = _thinned(held.station, _STATIONS), _thinned(held.roll_angle, _ROLLS)
            node = np.arange(held.n_nodes).reshape(len(held.station), -1)[np.ix_(row, column)]
            station, roll_angle = held.station[row], held.roll_angle[column]
            self._seen = SurfacePlaces(node[..., None], np.ones((*node.shape, 1)))
        else:
            station, roll_angle, self._seen = _unrolled(inverse_map)
        self._places = {
            "x": np.round(station, 4).tolist(),
            "roll_angle": np.round(np.degrees(roll_angle), 3).tolist(),
        }

    def set_zeros(self, zeros: GaugeZeros) -> None:
        """Take ``zeros`` off the strains from the next message on; any thread may say so."""
        self._zeros = zeros

    def message(self, result: CycleResult, timestamp: float) -> dict[str, Any]:
        """Return the message of ``result``; without values where there is no estimate."""
        values = self._pressure(result) if result.quality.has_coefficients else []
        return {"field": {"timestamp": timestamp, **self._places, "pressure_Pa": values}}

    def _pressure(self, result: CycleResult) -> list[int]:
        zeros, given = self._zeros, result.other_inputs
        readings = [given.get(name, np.nan) for name in self._sensors]
        if zeros is not self._estimator.zeros:
            self._estimator = self._estimator.with_zeros(zeros)
        try:
            found = self._estimator.track(
                np.append(result.strain, readings),
                result.dynamic_pressure,
                valid=np.append(result.valid, np.isfinite(readings)),
                mach_number=result.mach_number,
                altitude=result.altitude,
                **self._other_inputs(given),
            )
            chosen = self._seen.of(found.pressure(with_std=False).pressure)
        except np.linalg.LinAlgError:  # the results themselves must go on
            return []
        return np.rint(chosen).astype(int).ravel().tolist() if np.all(np.isfinite(chosen)) else []

    def _other_inputs(self, given: Mapping[str, float]) -> dict[str, Any]:
        """Return the arguments of a step for what is ``given`` besides q_inf, Mach number and altitude."""
        found: dict[str, Any] = given_flow({name: given.get(name, np.nan) for name in self._air_data})
        if self._temperatures:
            found[TEMPERATURE] = np.array([given.get(name, np.nan) for name in self._temperatures])
        found["parameters"] = {name: given.get(PREFIX + name, np.nan) for name in self._parameters}
        stds = {name: given.get(STD_PREFIX + name, np.nan) for name in self._parameters}
        found["parameters_std"] = given_flow(stds)
        return found | (given_thrust(given) if self._has_thrust else {})


def field_messages(path: Path, gauge_names: tuple[str, ...]) -> FieldMessages:
    """Return the messages of the map at ``path``.

    Raises
    ------
    InputError
        The file is missing or damaged, its gauges are not ``gauge_names``, or it holds no tables with the field.
    """
    held = load_inverse_map(path)
    if held.gauge_names[: held.n_strain_gauges] != gauge_names:
        raise InputError(f"page.field {path}: expected a map of the estimator's gauges, got others")
    if held.manifold is None or held.manifold.surface_field is None:
        raise InputError(
            f"page.field {path}: expected a map built with estimator = 'nonlinear' and keep_field = true"
        )
    return FieldMessages(held)


def _thinned(values: FloatArray, most: int) -> IntArray:
    """Return at most ``most`` of the numbers of ``values``, evenly."""
    return np.arange(0, len(values), -(-len(values) // most))


def _unrolled(inverse_map: InverseMap) -> tuple[FloatArray, FloatArray, SurfacePlaces]:
    """Return stations [m], roll angles [rad] and the places of any surface that are seen from outside there."""
    if not inverse_map.has_field:
        raise ValueError("inverse_map: expected one that holds the surface of its pressure field")
    point, triangle = inverse_map.point, inverse_map.triangle
    surface = point.astype(np.float64), triangle.astype(np.int64)
    first, last = float(point[:, 0].min()), float(point[:, 0].max())
    station = first + (last - first) * (np.arange(_STATIONS) + 0.5) / _STATIONS
    roll_angle = 2.0 * np.pi * np.arange(_ROLLS) / _ROLLS
    return station, roll_angle, outermost_places(*surface, station, roll_angle)
