"""The independent model of a vehicle: whether it has one, and whether that has the physics of the map."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from builder.structure.fourier.fourier_model import refuse_beyond_fourier
from builder.truth.shape import refuse_without_other_model
from builder.vehicle.file import Vehicle

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


def refuse_without_independent_model(vehicle: Vehicle) -> None:
    """Refuse a vehicle that has no independent model, before anything is solved."""
    if vehicle.is_axisymmetric:
        refuse_beyond_fourier(vehicle, [vehicle.gauges.layout])
    else:
        refuse_without_other_model(vehicle)
