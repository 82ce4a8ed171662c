"""A vehicle as built, its errors drawn at the sizes that the section [noise] states, its physics, and its flights:
what it reads there, whatever the shape of the vehicle."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from builder.structure.as_built.as_built_vehicle import AsBuilt, Counts
from builder.structure.as_built_kinds import ALWAYS_DRAWN, IN_NOISE
from builder.vehicle.file import Vehicle
from builder.vehicle.map_options import Noise
from builder.vehicle.structure_section import Structure
from strainfmu.arrays import FloatArray
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE
from strainfmu.flight_condition import FlightCondition

ENGINES_IN_WORDS = {
    "euler": "the marching Euler solver",
    "newtonian": "local inclination (newtonian)",
    "table": "imported results (table)",
}


@dataclass(frozen=True, kw_only=True)
class FlownPhysics:
    """Flow models by the names of their engines: what ``flies``, and what the snapshots ``of_map`` are made by."""

    flies: str
    of_map: str

    @property
    def is_that_of_map(self) -> bool:
        """Whether both are of one kind, so that what flies differs from the map by meshes and errors alone."""
        return self.flies == self.of_map

    @property
    def model(self) -> str:
        """What flies, in a few words."""
        another = f"another physics, {ENGINES_IN_WORDS[self.flies]}"
        return "independent finer model" if self.is_that_of_map else another

    @property
    def sentence(self) -> str:
        """What flies, and what its score says of the map."""
        flies, of_map = ENGINES_IN_WORDS[self.flies], ENGINES_IN_WORDS[self.of_map]
        if self.is_that_of_map:
            return f"The vehicle that flies has the physics of the map, {flies}, on finer meshes."
        return (
            f"warning: the vehicle that flies has another physics than the map: its flow is of {flies}, the map's "
            f"of {of_map}; errors and coverage in flight include the difference of the two, which no sigma does"
        )

    def record(self) -> dict[str, Any]:
        """Return it for a file of results."""
        return {"flies": self.flies, "map": self.of_map, "same": self.is_that_of_map}


def flown_physics(vehicle: Vehicle, engine: str) -> FlownPhysics:
    """Return the physics of the vehicle that flies, and of a map of snapshots by ``engine``."""
    return FlownPhysics(flies=vehicle.truth_engine() if vehicle.is_axisymmetric else engine, of_map=engine)


def other_physics(vehicle: Vehicle) -> list[str]:
    """Return a line where the independent model has another physics than the engine of ``vehicle``, else none."""
    physics = flown_physics(vehicle, vehicle.aerodynamics.engine)
    return [] if physics.is_that_of_map else [physics.sentence]


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
    coefficients : (k, 5) C_A, C_N, C_Y, M_P, M_Y [1]; (k, 6) with M_R of a shape that is none of revolution.
    ambient_pressure, dynamic_pressure, internal_pressure : (k,) p_inf, q_inf and that stated inside [Pa].
    """

    conditions: tuple[FlightCondition, ...]
    counts: Counts
    coefficients: FloatArray
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


def pressures_at(entry: Structure, conditions: Sequence[FlightCondition]) -> dict[str, Any]:
    """Return ``conditions`` and the pressures of flights there, by the attributes of :class:`Flights`."""
    return {
        "conditions": tuple(conditions),
        "ambient_pressure": np.array([condition.ambient_pressure for condition in conditions]),
        DYNAMIC_PRESSURE: np.array([condition.dynamic_pressure for condition in conditions]),
        "internal_pressure": entry.internal_pressure(conditions),
    }
