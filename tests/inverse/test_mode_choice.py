"""Modes that are no states of a map: which, and why, in the same words everywhere."""

from typing import Any

import pytest

from builder.inverse.mode_choice import choice_record, mode_choice_lines
from strainfmu.cli.inspection.provenance import provenance_rows

pytestmark = pytest.mark.fast

FRACTION = (0.5, 0.3, 0.1, 0.06, 0.0395, 0.0004, 0.0001)


def choice(wanted: int, states: tuple[int, ...], *left_out: int) -> dict[str, Any]:
    sizes = {"strain_over_noise": 4.25, "strain_over_errors": 12.0}
    modes = [
        {"mode": mode, "fraction_of_variance": FRACTION[(mode - 1) % len(FRACTION)], **sizes} for mode in left_out
    ]
    return choice_record(wanted, states, modes)


def test_every_mode_that_went_is_named_with_its_reason() -> None:
    """Two of five: modes 1 and 3. Those behind the last state are named where they hold 0.1 % of the variance."""
    found = choice(5, (1, 3), 2, 4, 5, 6, 7)
    lines = mode_choice_lines({"mode_choice": found})
    assert lines[0].startswith("2 of the 5 modes that map.modes requests are states of the linear map: 1 and 3;")
    assert "10 times the gauges' noise and 3 times all errors together" in lines[0]
    of_mode = (
        "left out: mode {}, {} % of the variance, strain 4.2 times the gauges' noise, 12 times all errors together"
    )
    expected = [of_mode.format(mode, percent) for mode, percent in ((2, 30), (4, 6), (5, 4))]
    assert lines[1:] == [*expected, "left out: 2 weaker modes"]


def test_a_mode_ahead_of_the_last_state_is_named_however_weak() -> None:
    lines = mode_choice_lines({"mode_choice": choice(2, (1, 7), 6)})
    assert lines[0].startswith("2 modes are states of the linear map: 1 and 7;")
    assert lines[1].startswith("left out: mode 6, 0.04 % of the variance")


def test_of_many_modes_twelve_are_named() -> None:
    found = choice(30, (30,), *range(1, 30))
    lines = mode_choice_lines({"mode_choice": found})
    assert len(lines) == 14
    assert lines[-1] == "left out: 17 weaker modes"


def test_nothing_is_said_where_no_mode_went() -> None:
    assert mode_choice_lines({"mode_choice": choice(2, (1, 2))}) == []
    assert mode_choice_lines({"modes": 90, "case": 2}) == []


def test_the_inspection_of_a_map_has_the_same_lines() -> None:
    record = choice(5, (1, 3), 2, 4)
    rows = dict(provenance_rows({"mode_choice": record}, ()))
    assert rows["choice of modes"].splitlines() == mode_choice_lines({"mode_choice": record})
    none_left = {"mode_choice": choice(2, (1, 2))}
    assert dict(provenance_rows(none_left, ()))["choice of modes"] == "every mode that was tried is a state"
