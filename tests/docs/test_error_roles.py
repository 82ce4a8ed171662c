"""The page on sigma states the part of split errors that the gain may correct."""

from pathlib import Path

import pytest

from builder.inverse.noise.error_list import ESTIMATED_PART

PAGE = Path(__file__).parents[2] / "docs/explanation/sigma.md"


@pytest.mark.fast
def test_the_page_states_the_part_of_split_errors() -> None:
    assert f"estimated at {100.0 * ESTIMATED_PART:g} % of its" in PAGE.read_text(encoding="utf-8")
