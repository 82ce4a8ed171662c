"""The comparison: every published number next to ours in three set-ups, with the reason for a difference.

The criteria of the reproduction, and whether each holds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from builder.reproduce.case_2 import COEFFICIENTS
from builder.reproduce.paper_readings import SHIPPED
from builder.reproduce.published import PUBLISHED, Published
from builder.reproduce.reasons import REASONS, crime
from builder.reproduce.setups import TITLES
from builder.reproduce.strain_models import FOURIER, HEXAHEDRA, TETRAHEDRA
from builder.reproduce.studies import Studies
from strainfmu.arrays import FloatArray

BY_MESH = 0.5
"""Part of the symmetric model's error below which an error is taken for an effect of the mesh's asymmetry."""

LITERAL_READING = 0
"""Index of the load reading that follows the source's words."""


@dataclass(frozen=True)
class Found:
    """Our number, or both ends of our range; NaN where a set-up has none."""

    low: float
    high: float

    def shown(self, unit: str) -> str:
        """Return it as text in ``unit``."""
        if np.isnan(self.low):
            return "–"
        end = " %" if unit == "%" else ""
        if self.low == self.high:
            return f"{_digits(self.low)}{end}"
        return f"{_digits(self.low)} to {_digits(self.high)}{end}"


@dataclass(frozen=True)
class ParityRow:
    """One published number and ours.

    Attributes
    ----------
    published : the source's number.
    ours : by set-up.
    why : reason for a difference, with its measurement; empty where the difference is negligible.
    symmetric : our number on the exactly symmetric model, where map and data of one asymmetric mesh hide it; NaN
        of other rows.
    """

    published: Published
    ours: dict[str, Found]
    why: str
    symmetric: float = np.nan

    def shown(self, setup: str) -> str:
        """Return our number in ``setup`` as text, with the symmetric model's where the mesh makes the number."""
        text = self.ours[setup].shown(self.published.unit)
        if not self.ours[setup].high < BY_MESH * self.symmetric:
            return text
        return f"{text} by the mesh's asymmetry; {_one(self.symmetric).shown('%')} on a symmetric model"


def parity_rows(studies: Studies) -> list[ParityRow]:
    """Return one row per published number, in the order of the source."""
    rows = []
    for key, published in PUBLISHED.items():
        ours = {setup: our_value(studies, setup, key) for setup in TITLES}
        reason = REASONS.get(key)
        symmetric = 100.0 * crime(studies, FOURIER, FOURIER).field_error if key == "noise_free" else np.nan
        rows.append(ParityRow(published, ours, reason(studies) if reason else "", symmetric))
    return rows


def our_value(studies: Studies, setup: str, key: str) -> Found:
    """Return our value of a published number in one set-up, in the unit of the published one."""
    if key == "surface_nodes":
        return _one(studies.measured.surface_nodes)
    if key == "structure_dofs":
        return _one(studies.measured.dofs["tetrahedra" if setup == "paper_like" else "hexahedra"])
    if key in _OF_CASE_1:
        number, value = _OF_CASE_1[key]
        return _one(value(studies, setup, number))
    if key in ("example_1", "example_2"):
        errors = studies.examples[f"{setup}-{'m5_a6_b5' if key == 'example_1' else 'm7_a2_b8'}"].errors
        return _range(errors)
    if key in ("eigenvalues", "decay", "gamma", "modes_kept"):
        return _of_spectrum(studies, setup, key)
    if key in ("noise_free", "noisy", "off_set"):
        return _range(studies.fields[f"{setup}-{key}"].errors)
    return _of_loads(studies, setup, key)


def _energy(studies: Studies, setup: str, number: int) -> float:
    return 100.0 * float(studies.case_1[f"{setup}-{number}"].energy[4])


def _k(studies: Studies, setup: str, number: int) -> float:
    return studies.case_1[f"{setup}-{number}"].relative_condition


def _ratio(studies: Studies, setup: str, number: int) -> float:
    return _k(studies, setup, 1) / _k(studies, setup, 2)


def _median(studies: Studies, setup: str, number: int) -> float:
    return 100.0 * float(np.median(studies.case_1[f"{setup}-{number}"].field_error))


def _worst(studies: Studies, setup: str, number: int) -> float:
    return 100.0 * float(np.max(studies.case_1[f"{setup}-{number}"].field_error))


_OF_CASE_1 = {
    "energy": (2, _energy),
    "k_1": (1, _k),
    "k_2": (2, _k),
    "k_ratio": (2, _ratio),
    "field_1": (1, _median),
    "field_1_worst": (1, _worst),
    "field_2": (2, _median),
    "field_2_worst": (2, _worst),
}


def _of_spectrum(studies: Studies, setup: str, key: str) -> Found:
    gamma = studies.gamma[setup]
    if key == "eigenvalues":
        return _one(len(gamma.eigenvalues))
    if key == "decay":
        return _one(gamma.eigenvalues[0] / gamma.eigenvalues[7])
    if key == "gamma":
        return _one(gamma.by_rule["morozov"])
    return _one(int(np.sum(gamma.eigenvalues >= (PUBLISHED["gamma"].low or 0.0))))


def _of_loads(studies: Studies, setup: str, key: str) -> Found:
    """Return errors of the coefficients of the noisy example, by the reading that the source's words give."""
    error = 100.0 * studies.fields[f"{setup}-noisy"].load_error[:, :, LITERAL_READING]
    name = {"c_a": "C_A", "c_n": "C_N", "c_y": "C_Y", "m_p": "M_P", "m_y": "M_Y"}[key[:3]]
    column = error[:, COEFFICIENTS.index(name)]
    return _one(column.mean() if key.endswith("_mean") else column.max())


def _one(value: float) -> Found:
    return Found(float(value), float(value))


def _range(errors: FloatArray) -> Found:
    return Found(100.0 * float(errors.min()), 100.0 * float(errors.max()))


def _digits(value: float) -> str:
    if value >= 1e5 and value != round(value):
        return f"{value:.1e}"
    if value == round(value) and value >= 6:
        return f"{value:,.0f}"
    return f"{value:.3g}" if value < 100 else f"{value:.0f}"


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
