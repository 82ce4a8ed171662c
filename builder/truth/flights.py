"""A vehicle as built, its errors drawn at the sizes that the section [noise] states, and its flights: what it
reads there, whatever the shape of the vehicle."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from builder.structure.as_built.as_built_vehicle import AsBuilt, Counts
from builder.structure.as_built_kinds import ALWAYS_DRAWN, IN_NOISE
from builder.vehicle.file import Vehicle
from builder.vehicle.map.options import Noise
from strainfmu.arrays import FloatArray
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE
from strainfmu.flight_condition import FlightCondition


def drawn_vehicle(
    entry: Noise,
    counts: Counts | int,
    random: np.random.Generator,
    scale: float = 1.0,
    count: int | None = None,
) -> AsBuilt:
    """Return a vehicle whose errors are drawn from normal distributions of ``scale`` times the sizes in ``entry``;
    ``counts`` may be the number of gauges alone.

    With ``count`` they are as many vehicles at once: what is (n,) of a single vehicle is (count, n) then.
    """
    numbers, errors = counts if isinstance(counts, Counts) else Counts(counts), {}
    for kind in IN_NOISE:
        size, std = (*(() if count is None else (count,)), numbers.in_flight(kind)), kind.std(entry)
        takes = scale > 0.0 and (std > 0.0 or kind.name in ALWAYS_DRAWN)
        errors[kind.name] = scale * std * random.standard_normal(size) if takes else np.zeros(size)
    return AsBuilt(numbers, errors)


@dataclass(frozen=True, eq=False, kw_only=True)
class Flights(ABC):
    """k flights.

    Attributes
    ----------
    conditions : k flight conditions.
    counts : numbers of what has errors of its own in a vehicle.
    coefficients : (k, 5) C_A, C_N, C_Y, M_P, M_Y [1].
    rolling : (k,) M_R [1]; None for a body of revolution, which has none.
    ambient_pressure, dynamic_pressure, internal_pressure : (k,) p_inf, q_inf and that stated inside [Pa].
    """

    conditions: tuple[FlightCondition, ...]
    counts: Counts
    coefficients: FloatArray
    rolling: FloatArray | None = None
    ambient_pressure: FloatArray
    dynamic_pressure: FloatArray
    internal_pressure: FloatArray

    @abstractmethod
    def read(
        self, as_built: AsBuilt, rows: slice = slice(None), random: np.random.Generator | None = None
    ) -> FloatArray:
        """Return (k, n_d) strain [m/m], without noise, that a vehicle ``as_built`` reads in the flights ``rows``;
        (v, n_d) of v vehicles in one flight. ``random`` draws what a vehicle does not state, where there is
        more."""


def pressures_at(vehicle: Vehicle, conditions: Sequence[FlightCondition]) -> dict[str, Any]:
    """Return ``conditions`` and the pressures of flights there, by the attributes of :class:`Flights`."""
    return {
        "conditions": tuple(conditions),
        "ambient_pressure": np.array([condition.ambient_pressure for condition in conditions]),
        DYNAMIC_PRESSURE: np.array([condition.dynamic_pressure for condition in conditions]),
        "internal_pressure": np.array([vehicle.internal_pressure(condition) for condition in conditions]),
    }
