"""The page on sigma lists every error of the one list under its role."""

from __future__ import annotations

from pathlib import Path

import pytest

from builder.inverse.noise.error_list import ERRORS, ESTIMATED_PART

PAGE = Path(__file__).parents[2] / "docs/explanation/sigma.md"


@pytest.mark.fast
@pytest.mark.parametrize("role", ["estimated", "considered", "split"])
def test_the_page_lists_the_errors_of_a_role(role: str) -> None:
    (row,) = (line for line in PAGE.read_text(encoding="utf-8").splitlines() if line.startswith(f"| {role} |"))
    listed = row.split("|")[2].strip()
    assert listed == ", ".join(one.name for one in ERRORS.values() if one.role == role)


@pytest.mark.fast
def test_the_page_states_the_part_of_split_errors() -> None:
    assert f"estimated at {100.0 * ESTIMATED_PART:g} % of its" in PAGE.read_text(encoding="utf-8")
