"""What is aimed at, from both sides: a verdict for each case and estimator, with the reason.

A limit is missed where a value is off by more than two standard errors, met where it is inside by as much;
otherwise it is open: there are too few samples to say.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf

from builder.trial.cases import Case
from builder.trial.score import ALL, Row
from strainfmu.estimator.health import FALSE_ALARM_PROBABILITY

OK, OPEN, MISSED, NONE = "ok", "open", "missed", "-"

ERRORS = 2.0
"""Standard errors by which a value is off a limit or inside."""


@dataclass(frozen=True, kw_only=True)
class Limit:
    """``column`` of each load, or of all together, is at least ``low`` and at most ``high``; ``within_error``: no
    sample is enough to say that a rate is so small, so it is met unless it is missed."""

    column: str
    of_each: bool = False
    low: float = -inf
    high: float = inf
    within_error: bool = False

    def verdict(self, rows: Sequence[Row]) -> tuple[str, str]:
        """Return the worst verdict over ``rows``, and what is off."""
        worst = OK, ""
        for row in (one for one in rows if (one["load"] != ALL) == self.of_each):
            value, error = row.get(self.column), row.get(f"{self.column}_error") or 0.0
            if value is None or value != value:
                continue
            excess = max(value - self.high, self.low - value)
            margin = -ERRORS * error if self.within_error else ERRORS * error
            verdict = MISSED if excess > ERRORS * error else OK if excess + margin <= 0.0 else OPEN
            if (OK, OPEN, MISSED).index(verdict) > (OK, OPEN, MISSED).index(worst[0]):
                worst = verdict, self._text(row["load"], value, error)
        return worst

    def _text(self, load: str, value: float, error: float) -> str:
        of = f" of {load}" if self.of_each else ""
        name, unit = (
            self.column.removesuffix("_percent").replace("_", " "),
            " %" if "percent" in self.column else "",
        )
        aim = f"at most {self.high:g}" if value - self.high >= self.low - value else f"at least {self.low:g}"
        return f"{name}{of} {value:.3g} +- {error:.2g}{unit}, {aim}{unit} aimed at"


COVERED = Limit(column="covered_percent", of_each=True, low=99.0)

LIMITS: dict[str, tuple[Limit, ...]] = {
    "drawn": (
        Limit(column="rms_z", of_each=True, low=0.7, high=1.1),
        COVERED,
        Limit(column="alarm_percent", high=100.0 * FALSE_ALARM_PROBABILITY, within_error=True),
        Limit(column="flagged_percent", high=0.2),
    ),
    "alone": (COVERED, Limit(column="flagged_percent", high=1.0)),
    "beyond": (Limit(column="undetected_percent", high=5.0),),
    "unobservable": (),
}
"""By class."""


def judged(case: Case, rows: Sequence[Row]) -> tuple[str, str]:
    """Return the verdict of the ``rows`` of a case by one estimator, and why."""
    limits = LIMITS[case.group]
    if case.flagged_at_least is not None:
        limits = (*limits, Limit(column="flagged_percent", low=case.flagged_at_least))
    if case.covered_at_least is not None:
        limits = (*limits, Limit(column="covered_percent", of_each=True, low=case.covered_at_least))
    if case.over_single_at_most is not None:
        limits = (*limits, Limit(column="over_single", of_each=True, high=case.over_single_at_most))
    if case.over_exact_at_most is not None:
        limits = (*limits, Limit(column="over_exact", of_each=True, high=case.over_exact_at_most))
    verdicts = [limit.verdict(rows) for limit in limits]
    for verdict in (MISSED, OPEN):
        if texts := [text for name, text in verdicts if name == verdict]:
            return verdict, "; ".join(texts)
    return (OK if limits else NONE), ""
