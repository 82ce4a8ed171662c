"""What a trial shows first: in each class what is missed, then cases with the most undetected samples."""

from __future__ import annotations

from typing import Any

import pytest

from builder.figures.comparison.trial import trial_figure
from builder.trial.table import in_order

pytestmark = pytest.mark.fast


def rows(error: str, of: str, flagged: float, undetected: float, verdict: str = "ok") -> list[dict[str, Any]]:
    shares = {"right_ok": 100.0 - flagged - undetected, "right_flagged": flagged, "undetected": undetected}
    parts = {f"{name}_percent": shares.get(name, 0.0) for name in (*shares, "wrong_flagged", "no_estimate")}
    row = {"case": error, "error": error}
    row |= {"class": of, "estimator": "map", "verdict": verdict, "undetected_percent_error": 0.1}
    return [{**row, **parts, "load": "all"}, {**row, **parts, "load": "C_N", "rms": 1.0, "rms_z": 0.8}]


ROWS = [
    *rows("a", "beyond", 0.0, 0.0),
    *rows("b", "alone", 0.0, 0.0),
    *rows("c", "beyond", 90.0, 0.01),
    *rows("d", "beyond", 10.0, 2.0),
    *rows("e", "beyond", 0.0, 0.02, "missed"),
]


def test_what_is_missed_comes_first_then_what_is_undetected() -> None:
    groups = in_order(ROWS)
    assert list(groups) == ["alone", "beyond"]
    assert [row["case"] for row in groups["beyond"]] == ["e", "d", "c", "a"]


def test_the_figure_has_the_same_order_and_a_band_of_sigma() -> None:
    figure = trial_figure([*ROWS, *rows("f", "drawn", 0.0, 0.0)], "vehicle")
    axes = figure.axes
    assert [label.get_text() for label in axes[4].get_yticklabels()] == ["e", "d", "c", "a"]
    assert len(axes[1].patches) == 1  # of the class "drawn" alone
    assert [len(axis.patches) for axis in axes[3::2]] == [0, 0]
