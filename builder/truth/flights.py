"""Flights of an independent model, whatever the shape of the vehicle: what any vehicle as built reads there."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from builder.structure.as_built.vehicle import AsBuilt, Counts
from builder.vehicle.file import Vehicle
from strainfmu.arrays import FloatArray
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE
from strainfmu.flight_condition import FlightCondition


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
        self, built: AsBuilt, rows: slice = slice(None), random: np.random.Generator | None = None
    ) -> FloatArray:
        """Return (k, n_d) strain [m/m], without noise, that a vehicle as ``built`` reads in the flights ``rows``;
        (v, n_d) of v vehicles in one flight. ``random`` draws what a vehicle does not state, where there is
        more."""


def pressures_at(vehicle: Vehicle, conditions: Sequence[FlightCondition]) -> dict[str, Any]:
    """Return ``conditions`` and the pressures of flights there, by the attributes of :class:`Flights`."""
    return {
        "conditions": tuple(conditions),
        "ambient_pressure": np.array([one.ambient_pressure for one in conditions]),
        DYNAMIC_PRESSURE: np.array([one.dynamic_pressure for one in conditions]),
        "internal_pressure": np.array([vehicle.internal_pressure(one) for one in conditions]),
    }
