"""Cases of shipped trials by name, vehicles with other entries, worlds with other parts, health of a row."""

from dataclasses import replace

from builder.trial.cases import Case, cases_for, load_trial
from builder.trial.readings import World
from builder.trial.score import Row
from builder.vehicle.file import Vehicle


def other_world(world: World, **changes: object) -> World:
    """Return a world with other parts, and nothing made yet."""
    return replace(world, **changes, _made={})  # type: ignore[arg-type]  # changes are of any field


def with_entries(vehicle: Vehicle, section: str, **entries: object) -> Vehicle:
    """Return a vehicle with other values in a section."""
    return vehicle.model_copy(update={section: getattr(vehicle, section).model_copy(update=entries)})


def case_of(vehicle: Vehicle, error: str, size: str = "", trial: str = "stress") -> Case:
    """Return a case of a shipped trial."""
    cases = cases_for(vehicle, load_trial(trial))
    return next(case for case in cases if case.error == error and size in ("", case.size))


def health_of(row: Row) -> dict[str, float]:
    """Return how many samples [%] are in each state of health."""
    words = row["health"].split()
    return {name: float(share) for name, share in zip(words[::2], words[1::2], strict=True)}
