"""Cases of shipped trials by name, worlds with other parts, health of a row."""

from __future__ import annotations

from dataclasses import replace

from builder.trial.cases import Case, cases_for, load_trial
from builder.trial.readings import World
from builder.trial.score import Row
from builder.vehicle.file import Vehicle


def other_world(world: World, **changes: object) -> World:
    """Return a world with other parts, and nothing made yet."""
    return replace(world, **changes, _made={})  # type: ignore[arg-type]  # changes are of any field


def case_of(vehicle: Vehicle, error: str, size: str = "", trial: str = "stress") -> Case:
    """Return a case of a shipped trial."""
    cases = cases_for(vehicle, load_trial(trial))
    return next(case for case in cases if case.error == error and size in ("", case.size))


def health_of(row: Row) -> dict[str, float]:
    """Return how many samples [%] are in each state of health."""
    words = row["health"].split()
    return {name: float(share) for name, share in zip(words[::2], words[1::2], strict=True)}
