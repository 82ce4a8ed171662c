"""Errors of a map in the flights of a vehicle whose strain is known."""

from __future__ import annotations

from typing import Any

import numpy as np

from builder.calibration.score.setup import Flights
from builder.calibration.score.summary import errors_of
from builder.trial.estimators import of_map
from builder.trial.readings import Readings, navigation_at
from strainfmu.arrays import FloatArray
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE
from strainfmu.estimator.map.inverse_map import InverseMap


def flown_errors(
    inverse_map: InverseMap, flights: Flights, strain: FloatArray, draws: int, random: np.random.Generator
) -> dict[str, Any]:
    """Return :func:`~builder.calibration.score.summary.errors_of` a map; ``strain`` (k, n_d) is read [m/m].

    Each flight has ``draws`` draws of the map's gauge noise.
    """
    read = np.repeat(strain, draws, axis=0)
    read = read + inverse_map.noise_std * random.standard_normal(read.shape)
    known = navigation_at(flights.conditions)
    known[DYNAMIC_PRESSURE] = np.array([one.dynamic_pressure for one in flights.conditions])
    every = {name: np.repeat(value, draws) if np.ndim(value) else value for name, value in known.items()}
    truth, flight = np.repeat(flights.coefficients, draws, axis=0), np.repeat(np.arange(len(strain)), draws)
    readings = Readings(strain=read, known=every, truth=truth, vehicle=0 * flight, flight=flight)
    made = of_map(inverse_map)(readings)
    return errors_of(made.value - truth, made.std, made.health)
