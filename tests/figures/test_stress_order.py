"""What a stress test shows first: in each class the kinds with the most undetected, then detected samples."""

from __future__ import annotations

from typing import Any

import pytest

from builder.figures.comparison.stress import by_class, stress_figure

pytestmark = pytest.mark.fast


def entry(error: str, of: str, detected: float, undetected: float) -> dict[str, Any]:
    return {
        "error": error,
        "size": "1",
        "class": of,
        "detected_percent": detected,
        "undetected_percent": undetected,
        "missed": (),
    }


ENTRIES = [
    entry("a", "outside", 0.0, 0.0),
    entry("b", "within", 0.0, 0.0),
    entry("c", "outside", 90.0, 0.01),
    entry("d", "outside", 10.0, 2.0),
    entry("e", "outside", 0.0, 0.02),
]


def test_what_is_not_zero_comes_first_and_the_order_of_the_file_decides_otherwise() -> None:
    found = by_class(ENTRIES)
    assert list(found) == ["within", "outside"]
    assert [one["error"] for one in found["outside"]] == ["d", "c", "a", "e"]


def test_the_figure_has_the_same_order() -> None:
    labels = stress_figure(ENTRIES, "vehicle").axes[1].get_yticklabels()
    assert [label.get_text() for label in labels] == ["d, 1", "c, 1", "a, 1", "e, 1"]
