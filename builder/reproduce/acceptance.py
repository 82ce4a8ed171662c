"""The criteria of the reproduction, and whether each holds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from builder.reproduce.paper_readings import SHIPPED
from builder.reproduce.parity import Found, our_value
from builder.reproduce.published import PUBLISHED
from builder.reproduce.setups import TITLES
from builder.reproduce.strain_models import HEXAHEDRA, TETRAHEDRA
from builder.reproduce.studies import Studies


@dataclass(frozen=True)
class Criterion:
    """One criterion.

    Attributes
    ----------
    text : the criterion in words.
    key : the number that it applies to (:data:`builder.reproduce.published.PUBLISHED`).
    holds : whether our number fulfils it.
    """

    text: str
    key: str
    holds: Callable[[Found], bool]


RATIO_LIMIT = 0.2
"""Difference of K1/K2 from the published one, over it, up to which they agree."""


def _within_factor(key: str, factor: float) -> Callable[[Found], bool]:
    published = PUBLISHED[key].low or 0.0
    return lambda ours: published / factor <= ours.low <= published * factor


CRITERIA = (
    Criterion("five modes hold at least 99 % of the energy", "energy", lambda ours: ours.low >= 99.0),
    Criterion(
        "Case 1, Configuration 1: median within a factor 1.5 of 7.5 %", "field_1", _within_factor("field_1", 1.5)
    ),
    Criterion(
        "Case 1, Configuration 2: median within a factor 1.5 of 5.5 %", "field_2", _within_factor("field_2", 1.5)
    ),
    Criterion("M6 a0 b5: range overlaps 4 to 12 %", "off_set", lambda ours: ours.low <= 12.0 and ours.high >= 4.0),
    Criterion("M5 a6 b6: C_N under 2 %", "c_n", lambda ours: ours.high < 2.0),
    Criterion("M5 a6 b6: C_Y under 2 %", "c_y", lambda ours: ours.high < 2.0),
    Criterion("M5 a6 b6: M_P under 3.4 %", "m_p", lambda ours: ours.high < 3.4),
    Criterion("M5 a6 b6: M_Y under 3.4 %", "m_y", lambda ours: ours.high < 3.4),
    Criterion("M5 a6 b6: mean error of C_A 5 +- 3 %", "c_a_mean", lambda ours: 2.0 <= ours.low <= 8.0),
    Criterion("gamma by the source's rule in [1, 10]", "gamma", lambda ours: 1.0 <= ours.low <= 10.0),
    Criterion("lambda_1 / lambda_8 at least 1e4", "decay", lambda ours: ours.low >= 1e4),
)


@dataclass(frozen=True)
class Verdict:
    """A criterion, our numbers and whether it holds, by set-up."""

    text: str
    ours: dict[str, str]
    holds: dict[str, bool]


def verdicts(studies: Studies) -> list[Verdict]:
    """Return all criteria; K1/K2 is judged by the shipped reading of the gauges' rows."""
    rows = []
    for criterion in CRITERIA:
        ours = {key: our_value(studies, key, criterion.key) for key in TITLES}
        unit = PUBLISHED[criterion.key].unit
        rows.append(
            Verdict(
                criterion.text,
                {key: number.shown(unit) for key, number in ours.items()},
                {key: criterion.holds(number) for key, number in ours.items()},
            )
        )
    return [rows[0], _of_ratio(studies), *rows[1:]]


def _of_ratio(studies: Studies) -> Verdict:
    """Return the criterion of K1/K2; the other readings of the rows are listed and decide nothing."""
    published = PUBLISHED["k_ratio"].low or 0.0
    ours, holds = {}, {}
    for key in TITLES:
        model = TETRAHEDRA if key == "paper_like" else HEXAHEDRA
        ratios = {row.reading: row.ratio for row in studies.measured.readings if row.model == model}
        holds[key] = abs(ratios[SHIPPED.name] / published - 1.0) <= RATIO_LIMIT
        inside = [ratio for ratio in ratios.values() if abs(ratio / published - 1.0) <= RATIO_LIMIT]
        ours[key] = f"{ratios[SHIPPED.name]:.2f}; within it {len(inside)} of {len(ratios)} readings: " + (
            ", ".join(f"{ratio:.2f}" for ratio in inside) or "none"
        )
    return Verdict(f"K1/K2 of the shipped rows within {100.0 * RATIO_LIMIT:g} % of {published:.2f}", ours, holds)
