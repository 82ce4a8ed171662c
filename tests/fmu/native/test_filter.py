"""The filter over time of the native library: its state, what turns it off; its numbers: tests/golden."""

from __future__ import annotations

import zlib

import numpy as np
import pytest
from agreement import assert_same, tracked
from flight_fmu import (
    FILTER,
    FlightFmu,
    random_flight,
)
from raw_fmu import ERROR, OK

from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import InverseMap

pytestmark = pytest.mark.fast
STEP = 0.01


def test_outputs_follow_what_is_set_without_a_step(fmu: FlightFmu, inverse_map: InverseMap) -> None:
    """A sample is that at the start of a step, however often inputs are set and read before it is taken."""
    samples, estimator = random_flight(inverse_map, 6, seed=17), Estimator(inverse_map).filter(1.0)
    assert fmu.filter(1.0) == OK
    for k, sample in enumerate(samples):
        fmu.give(samples[0])
        fmu.all_outputs()
        fmu.give(sample)
        before = fmu.all_outputs()
        assert fmu.step(k * 0.02, 0.02) == OK
        assert fmu.all_outputs().tobytes() == before.tobytes()
        assert_same(before, tracked(estimator, sample, k * 0.02))


def test_a_state_with_a_track_that_cannot_be(fmu: FlightFmu, inverse_map: InverseMap) -> None:
    assert fmu.filter(1.0) == OK
    fmu.advance_over(random_flight(inverse_map, 1, seed=22)[0], 0.0, STEP)
    content = bytearray(fmu.serialise(fmu.get_state()))
    content[-8:] = np.float64(np.inf).tobytes()
    content[12:16] = zlib.crc32(content[16:]).to_bytes(4, "little")
    assert fmu.deserialise(bytes(content))[0] == ERROR
    assert "flight state that cannot be" in fmu.messages[-1][2]


def test_without_the_filter_nothing_is_remembered(fmu: FlightFmu, inverse_map: InverseMap) -> None:
    """Off at first, on, off again by the parameter; begun again by a zero that is no longer known exactly."""
    samples, estimator = random_flight(inverse_map, 12, seed=23), Estimator(inverse_map)
    for k, sample in enumerate(samples):
        on = k in (4, 5, 6)
        assert fmu.filter(1.0 if on else 0.0) == OK
        estimator = estimator.filter(1.0 if on else 0.0)
        assert_same(fmu.advance_over(sample, k * STEP, STEP), tracked(estimator, sample, k * STEP))
    assert fmu.filter(1.0) == OK
    for k in range(8):
        with_filter = fmu.advance_over(samples[0], 1.0 + 0.01 * k, STEP)
    assert fmu.set_reals([FILTER - 2], [1e-12]) == OK
    steps = 0
    while True:  # until the matrices for it are made
        steps, without = steps + 1, fmu.advance_over(samples[0], 1.08 + 0.01 * steps, STEP)
        if without[20] == HealthState.OK:
            break
        assert without[20] == HealthState.DEGRADED
        assert steps < 24
    assert np.all(with_filter[5:10] < without[5:10])
    assert fmu.filter(0.0) == OK
    assert fmu.advance_over(samples[0], 1.5, STEP)[5:10] == pytest.approx(without[5:10], rel=1e-3)
    assert steps > 1


@pytest.mark.parametrize("value", [-1.0, 1e-10, 2e6, np.nan, np.inf])
def test_time_constants_that_cannot_be(fmu: FlightFmu, value: float) -> None:
    assert fmu.filter(value) == ERROR
    assert "filter_time_constant" in fmu.messages[-1][2]
