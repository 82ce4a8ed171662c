"""Vehicles that fly on the independent model: what alarm levels are set from."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from builder.truth.as_built import drawn_many
from builder.truth.flights import Flights, RevolvedFlights
from builder.truth.revolution.flow_table import FlowTable
from builder.truth.revolution.strain import TrueStructure, true_flights, without_faint_harmonics
from builder.vehicle.file import Vehicle
from builder.vehicle.map.options import Noise
from strainfmu.arrays import FloatArray
from strainfmu.flight_condition import FlightCondition


class FlownVehicles(Protocol):
    """Vehicles at k flight conditions, each with errors of its own.

    Attributes
    ----------
    conditions : k flight conditions.
    dynamic_pressure : (k,) q_inf [Pa].
    coefficients : (k, 5) the truth [1].
    """

    @property
    def conditions(self) -> Sequence[FlightCondition]: ...

    @property
    def dynamic_pressure(self) -> FloatArray: ...

    @property
    def coefficients(self) -> FloatArray: ...

    def read(self, number: int, count: int, random: np.random.Generator) -> tuple[FloatArray, FloatArray]:
        """Return what ``count`` vehicles read in flight ``number``: strain (count, n_d) [m/m] without the noise of
        the gauges, and the stated over the true q_inf (count,) [1]."""


Fly = Callable[[list[FlightCondition]], FlownVehicles]
"""Lets vehicles fly at conditions."""


@dataclass(frozen=True, eq=False, kw_only=True)
class DrawnVehicles:
    """Vehicles whose hardware errors are drawn at the sizes of ``noise``."""

    noise: Noise
    flights: Flights

    @property
    def conditions(self) -> Sequence[FlightCondition]:
        return self.flights.conditions

    @property
    def dynamic_pressure(self) -> FloatArray:
        return self.flights.dynamic_pressure

    @property
    def coefficients(self) -> FloatArray:
        return self.flights.coefficients

    def read(self, number: int, count: int, random: np.random.Generator) -> tuple[FloatArray, FloatArray]:
        built = drawn_many(self.noise, self.flights.counts, count, random)
        strain = self.flights.read(built, slice(number, number + 1))
        return strain, 1.0 + np.reshape(built.dynamic_pressure, -1)


def drawn_vehicles(
    vehicle: Vehicle, structure: TrueStructure, table: FlowTable, conditions: list[FlightCondition]
) -> DrawnVehicles:
    """Return vehicles of the section [noise] at ``conditions``.

    Raises
    ------
    InputError
        A condition is outside the table.
    """
    flights = without_faint_harmonics(true_flights(vehicle, structure, table, conditions))
    return DrawnVehicles(
        noise=vehicle.noise,
        flights=RevolvedFlights(structure=structure, flown=flights),
    )
