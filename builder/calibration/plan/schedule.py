"""How a planned test is run: steps of loading and unloading, zero readings between, and the time that it takes."""

from __future__ import annotations

from dataclasses import dataclass

from builder.calibration.ground_test.candidate_cases import PlannedCase
from builder.calibration.ground_test.load_changes import cell_force
from builder.calibration.plan.load_plan import LoadPlan
from builder.structure.loads.applied import SurfacePressure


@dataclass(frozen=True, kw_only=True)
class Schedule:
    """How the cases are run.

    Attributes
    ----------
    steps : of loading, and as many of unloading; 1 reads without load, under the whole load, and without load.
    setup_time : to set up a case or an attitude [s].
    reading_time : to apply a load, wait until it stands and record it [s].
    """

    steps: int = 2
    setup_time: float = 900.0
    reading_time: float = 60.0

    def steps_of(self, case: PlannedCase) -> list[tuple[float, bool]]:
        """Return part of the load [1] of each step, and whether it is taken off; none where no load can be
        changed."""
        loading = [round(k / self.steps, 4) for k in range(self.steps)] if changes(case) else []
        return [*((part, False) for part in loading), *((part, True) for part in loading[::-1])]

    def time_of(self, case: PlannedCase) -> float:
        """Return the time of a case [s]."""
        return self.setup_time + self.reading_time * (1 + len(self.steps_of(case)))


@dataclass(frozen=True, kw_only=True)
class RunCase:
    """A case as it is run.

    Attributes
    ----------
    case : name and loads.
    kind : "attitude", "zero reading", "load", "repeat" or "check".
    number : of a load or a repeat, in the plan; of others -1.
    """

    case: PlannedCase
    kind: str
    number: int = -1


def changes(case: PlannedCase) -> bool:
    """Return whether a load of a case can be applied step by step."""
    return any(cell_force(load) > 0.0 or isinstance(load, SurfacePressure) for load in case.loads)


def run_order(plan: LoadPlan) -> list[RunCase]:
    """Return the cases in the order in which they are run: zero readings at the start, between and at the end.

    The zero readings are of the vehicle as it lies under the loads; names are unique.
    """
    lead = plan.attitudes or (PlannedCase(name="no load", loads=()),)
    first = len(plan.cases) - plan.repeats
    loads = [
        RunCase(case=case, kind="load" if number < first else "repeat", number=number)
        for number, case in enumerate(plan.cases)
    ]
    loads += [
        RunCase(case=PlannedCase(name=f"check, {case.name}", loads=case.loads), kind="check")
        for case in plan.checks
    ]
    middle = (len(loads) + 1) // 2
    again = [
        RunCase(case=PlannedCase(name=f"{lead[0].name}, {when}", loads=lead[0].loads), kind="zero reading")
        for when in ("between", "at the end")
    ]
    # Turned to all attitudes first, and back to the one of the loads.
    order = [RunCase(case=case, kind="attitude") for case in lead]
    return [*order, *loads[:middle], again[0], *loads[middle:], again[1]]


def whole_time(plan: LoadPlan, schedule: Schedule) -> float:
    """Return the time of all cases [s]; zero readings need no set-up."""
    return sum(
        schedule.reading_time if run.kind == "zero reading" else schedule.time_of(run.case)
        for run in run_order(plan)
    )
