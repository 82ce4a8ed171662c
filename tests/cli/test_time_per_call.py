"""The clock of ``strainfmu bench``: long calls are timed fewer times."""

from time import sleep

import pytest

from strainfmu.cli.bench import FEWEST_CALLS, time_per_call

pytestmark = pytest.mark.fast


@pytest.mark.parametrize(("duration", "most"), [(0.0, 4 * 500), (1e-3, 4 * FEWEST_CALLS)])
def test_long_calls_are_timed_fewer_times(duration: float, most: int) -> None:
    count = 0

    def call() -> None:
        nonlocal count
        count += 1
        sleep(duration)

    assert time_per_call(call, repeats=3) >= duration
    assert count <= most
    assert count >= 4 * FEWEST_CALLS


def test_one_call_may_be_requested() -> None:
    seen: list[int] = []
    time_per_call(lambda: seen.append(1), repeats=10, calls=1)
    assert len(seen) == 11
