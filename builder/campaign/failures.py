"""Conditions of a campaign that could not be solved: named in the result, in notes and in errors.

Reach of an engine: the extreme flows of a set of conditions are solved ahead of the campaign.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import degrees
from typing import Any

from builder.aero.engine import Engine, FlowKey, cap_line
from builder.campaign.snapshots import Snapshots
from builder.reporting import Reporter
from strainfmu.errors import FlowReachError, InputError, StrainfmuError
from strainfmu.flight_condition import FlightCondition

LISTED = 20
"""Flows that are listed one by one in notes; the file holds all."""


class ConditionsMissing(StrainfmuError):
    """A campaign is finished and written, without the conditions that are outside the engine's reach."""

    exit_code = 3


@dataclass(frozen=True)
class FailedCondition:
    """One condition outside the engine's reach.

    Attributes
    ----------
    number : in the campaign's list of conditions, from 0.
    condition : the condition.
    cause : why, in one line; conditions of one flow have the same.
    """

    number: int
    condition: FlightCondition
    cause: str

    def as_entry(self) -> dict[str, Any]:
        """Return it as the settings of a snapshot file hold it: Mach number [1], angles [rad], altitude [m]."""
        return {"number": self.number, "condition": list(self.condition.as_row()), "cause": self.cause}


def failed_conditions(snapshots: Snapshots) -> tuple[FailedCondition, ...]:
    """Return the conditions that the campaign of ``snapshots`` had and could not solve."""
    return tuple(
        FailedCondition(int(entry["number"]), FlightCondition.of_row(entry["condition"]), str(entry["cause"]))
        for entry in snapshots.settings.get("failed", ())
    )


def name_of(condition: FlightCondition) -> str:
    """Return a condition as notes name it."""
    alpha, beta = degrees(condition.angle_of_attack), degrees(condition.sideslip_angle)
    height = 1e-3 * condition.altitude
    return f"M {condition.mach_number:g}, alpha {alpha:.4g} deg, beta {beta:.4g} deg, {height:g} km"


def failure_lines(failed: Sequence[FailedCondition]) -> list[str]:
    """Return one line per flow that failed: its conditions and the cause; the first LISTED of them."""
    by_cause: dict[str, list[FailedCondition]] = {}
    for failure in failed:
        by_cause.setdefault(failure.cause, []).append(failure)
    lines = [
        f"not solved: {'; '.join(name_of(flow.condition) for flow in same)}: {cause}"
        for cause, same in list(by_cause.items())[:LISTED]
    ]
    if len(by_cause) > LISTED:
        lines.append(f"not solved: {len(by_cause) - LISTED} further flows; the file's settings name them")
    return lines


def missing_line(failed: Sequence[FailedCondition], conditions: int) -> str:
    """Return in one line that ``conditions`` were solved without the ``failed`` ones, and the first cause."""
    return f"{len(failed)} of {len(failed) + conditions} conditions not solved; the first: {failed[0].cause}"


def refuse_missing(snapshots: Snapshots) -> None:
    """Refuse snapshots that lack conditions of their campaign, where every row counts.

    Raises
    ------
    FlowReachError
        Names the first of them.
    """
    failed = failed_conditions(snapshots)
    if failed:
        raise FlowReachError(missing_line(failed, len(snapshots.condition)))


def extreme_conditions(conditions: Sequence[FlightCondition]) -> list[FlightCondition]:
    """Return the conditions of largest and smallest total incidence, at the smallest and largest Mach number.

    The largest comes first: a refusal there states what all other incidences need, too.
    """
    mach = [condition.mach_number for condition in conditions]
    chosen = []
    for mach_number in (min(mach), max(mach)):
        alike = [condition for condition in conditions if condition.mach_number == mach_number]
        alike.sort(key=lambda condition: condition.total_incidence)
        chosen += [alike[-1], alike[0]]
    return chosen


def flows_out_of_reach(engine: Engine, keys: Sequence[FlowKey], reporter: Reporter, title: str) -> list[str]:
    """Solve the distinct flows of ``keys`` and return, a line each, why some cannot be solved.

    Once a flow failed, those after it at the same Mach number, the first number of a key, are passed over: they
    fail for the same reason, some of them after a minute.
    """
    out_of_reach, flows, wanted, failed = [], [], list(dict.fromkeys(keys)), set()
    with reporter.stage(title) as progress:
        for number, key in enumerate(wanted):
            progress(number, len(wanted))
            if key[0] in failed:
                continue
            try:
                flows.append(engine.solve(key))
            except InputError as error:
                out_of_reach.append(str(error))
                failed.add(key[0])
    if (line := cap_line(flows)) is not None:
        reporter.note(line)
    return out_of_reach
