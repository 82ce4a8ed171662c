"""Modes that are no states of a map: which, and why, in the same words everywhere."""

from __future__ import annotations

import pytest

from builder.inverse.modes.mode_choice import LeftOutMode, ModeChoice, mode_choice_lines
from strainfmu.cli.inspection.provenance import provenance_rows

pytestmark = pytest.mark.fast

FRACTION = (0.5, 0.3, 0.1, 0.06, 0.0395, 0.0004, 0.0001)


def choice(wanted: int, kept: tuple[int, ...], *left_out: int) -> ModeChoice:
    modes = tuple(
        LeftOutMode(mode=mode, fraction=FRACTION[mode % len(FRACTION)], over_noise=4.25, over_errors=12.0)
        for mode in left_out
    )
    return ModeChoice(wanted=wanted, kept=kept, left_out=modes)


def test_every_mode_that_went_is_named_with_its_reason() -> None:
    """Two of five: modes 1 and 3. Those behind the last state are named where they hold 0.1 % of the variance."""
    found = choice(5, (0, 2), 1, 3, 4, 5, 6)
    lines = mode_choice_lines({"mode_choice": found.record()})
    assert lines[0].startswith("2 of the 5 modes that map.modes requests are states of the linear map: 1 and 3;")
    assert "10 times the gauges' noise and 3 times all errors together" in lines[0]
    of_mode = (
        "left out: mode {}, {} % of the variance, strain 4.2 times the gauges' noise, 12 times all errors together"
    )
    expected = [of_mode.format(mode, percent) for mode, percent in ((2, 30), (4, 6), (5, 4))]
    assert lines[1:] == [*expected, "left out: 2 weaker modes"]
    assert found.skipped == (1,)


def test_a_mode_ahead_of_the_last_state_is_named_however_weak() -> None:
    lines = mode_choice_lines({"mode_choice": choice(2, (0, 6), 5).record()})
    assert lines[0].startswith("2 modes are states of the linear map: 1 and 7;")
    assert lines[1].startswith("left out: mode 6, 0.04 % of the variance")


def test_of_many_modes_twelve_are_named() -> None:
    found = choice(30, (29,), *range(29))
    lines = mode_choice_lines({"mode_choice": found.record()})
    assert len(lines) == 14
    assert lines[-1] == "left out: 17 weaker modes"


def test_nothing_is_said_where_no_mode_went() -> None:
    assert mode_choice_lines({"mode_choice": choice(2, (0, 1)).record()}) == []
    assert mode_choice_lines({"modes": 90, "case": 2}) == []


def test_the_inspection_of_a_map_has_the_same_lines() -> None:
    record = choice(5, (0, 2), 1, 3).record()
    rows = dict(provenance_rows({"mode_choice": record}, ()))
    assert rows["choice of modes"].splitlines() == mode_choice_lines({"mode_choice": record})
    none_left = {"mode_choice": choice(2, (0, 1)).record()}
    assert dict(provenance_rows(none_left, ()))["choice of modes"] == "every mode that was tried is a state"
