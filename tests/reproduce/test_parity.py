"""The table of published numbers: as printed, with reasons and criteria for its entries only."""

from __future__ import annotations

import pytest

from builder.reproduce.acceptance import CRITERIA
from builder.reproduce.parity import Found
from builder.reproduce.published import PUBLISHED
from builder.reproduce.reasons import REASONS

pytestmark = pytest.mark.fast


def test_published_numbers_as_printed() -> None:
    # Table 1, the text of Case 1 and of Case 2.
    assert PUBLISHED["k_ratio"].low == pytest.approx(89.61 / 47.96)
    assert (PUBLISHED["noisy"].low, PUBLISHED["noisy"].high) == (13.3, 27.9)
    assert (PUBLISHED["off_set"].low, PUBLISHED["off_set"].high) == (4.0, 12.0)
    assert PUBLISHED["gamma"].low == pytest.approx(3.1623, abs=1e-4)


def test_reasons_and_criteria_are_of_published_numbers() -> None:
    assert set(REASONS) <= set(PUBLISHED)
    assert {one.key for one in CRITERIA} <= set(PUBLISHED)


@pytest.mark.parametrize(
    ("key", "inside", "outside"),
    [
        ("energy", 99.0, 98.9),
        ("field_1", 11.2, 11.3),
        ("field_2", 8.2, 8.3),
        ("gamma", 10.0, 10.1),
        ("c_a_mean", 2.0, 1.9),
        ("decay", 1e4, 9.9e3),
    ],
)
def test_criteria_at_their_limits(key: str, inside: float, outside: float) -> None:
    holds = next(one.holds for one in CRITERIA if one.key == key)
    assert holds(Found(inside, inside))
    assert not holds(Found(outside, outside))
    assert not holds(Found(float("nan"), float("nan")))


def test_ranges_and_missing_numbers_are_shown_as_such() -> None:
    assert Found(4.0, 12.04).shown("%") == "4 to 12 %"
    assert Found(2.8, 2.8).shown("%") == "2.8 %"
    assert Found(60480.0, 60480.0).shown("1") == "60,480"
    assert Found(float("nan"), float("nan")).shown("%") == "–"
