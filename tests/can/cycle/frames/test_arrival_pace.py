"""Cycles without a sample time behind a pause: which may have been held back."""

from __future__ import annotations

import pytest

from strainfmu.can.cycle.frames.arrival_pace import ArrivalPace

pytestmark = pytest.mark.fast

CYCLE = 0.01


def doubted(times: list[float]) -> list[bool]:
    """Return which cycles at ``times`` [in cycles] may have been held back: pause 5 cycles, at most 3 a cycle."""
    pace = ArrivalPace(5.0 * CYCLE, 3.0 / CYCLE)
    return [pace.take(CYCLE * time) for time in times]


def test_without_a_pause_bursts_are_as_young_as_they_can_be() -> None:
    assert not any(doubted([0.0, 0.0, 0.0, 4.9, 4.9, 4.9, 4.9]))


def test_all_of_a_burst_behind_a_pause_are_doubted() -> None:
    times = [0.0] + [100.0 + 0.002 * k for k in range(200)]
    assert doubted(times) == [False] + [True] * 200


@pytest.mark.parametrize(
    "live",
    [
        [100.0, 101.0, 102.0, 103.0, 104.0],
        [100.0, 100.0, 102.0, 102.0, 104.0],  # an interface that hands frames over by the pair
        [100.0, 100.34, 100.68, 101.02, 101.36],  # no faster than what is not yet babbling
    ],
)
def test_cycles_at_a_senders_pace_are_trusted_from_the_fourth_on(live: list[float]) -> None:
    assert doubted([0.0, *live]) == [False, True, True, True, False, False]


def test_frames_handed_over_in_heaps_are_trusted_in_the_end() -> None:
    heaps = [100.0 + 4.0 * (k // 8) for k in range(24)]  # heap behind heap sooner than a pause
    assert doubted([0.0, *heaps])[9:] == [False] * 16
