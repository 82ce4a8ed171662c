"""Cases of shipped trials by name, and worlds with other parts."""

from __future__ import annotations

from dataclasses import replace

from builder.trial.cases import Case, cases_for, load_trial, trial_path
from builder.trial.world import World
from builder.vehicle.file import Vehicle


def other_world(world: World, **changes: object) -> World:
    """Return a world with other parts, and nothing made yet."""
    return replace(world, **changes, _flights={}, _bounds={})  # type: ignore[arg-type]


def case_of(vehicle: Vehicle, error: str, size: str = "", trial: str = "stress") -> Case:
    """Return a case of a shipped trial."""
    cases = cases_for(vehicle, load_trial(trial_path(trial)))
    return next(case for case in cases if case.error == error and size in ("", case.size))
