"""Reach of an engine: the extreme flows of a set of conditions are solved ahead of the campaign."""

from __future__ import annotations

from collections.abc import Sequence

from builder.aero.engine import Engine, FlowKey, cap_line
from builder.reporting import Reporter
from strainfmu.errors import InputError
from strainfmu.flight_condition import FlightCondition


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
