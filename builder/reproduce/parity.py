"""The comparison: every published number next to ours in three set-ups, with the reason for a difference."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from builder.reproduce.case_2 import COEFFICIENTS
from builder.reproduce.published import PUBLISHED, Published
from builder.reproduce.reasons import REASONS, crime
from builder.reproduce.setups import TITLES
from builder.reproduce.strain_models import FOURIER
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
