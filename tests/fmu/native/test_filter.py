"""The filter over time of the native library: equal to numpy over flights, its state, what turns it off."""

from __future__ import annotations

import zlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from damaged_resource import put, refusal, with_arrays
from flight_fmu import (
    FILTER,
    N_D,
    FlightFmu,
    FlightSample,
    check,
    fresh_tracker,
    random_flight,
    tracked,
)
from flight_maps import NOISE_STD, flight_map
from raw_fmu import ERROR, OK, write_resource

from strainfmu.estimator.filter.flight_filter import FlightFilter
from strainfmu.estimator.filter.settings import FilterSettings
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.manifold.estimator import ManifoldEstimator
from strainfmu.estimator.manifold.flight_estimate import FlightEstimate
from strainfmu.estimator.map.inverse_map import InverseMap

pytestmark = pytest.mark.fast
STEP = 0.01

TOLERANCE = 1e-8
"""Relative to the largest value of a unit. Most agree to 1e-10; the chi-square of a sample that the prediction
meets nearly exactly has fewer digits in either code."""


def numpy_step(flight: FlightFilter, sample: FlightSample, time_step: float) -> FlightEstimate:
    return flight.recorded(time_step, sample.strain, sample.flow, valid=sample.valid).estimate[0]


def compare(
    fmu: FlightFmu, flight: FlightFilter, samples: list[FlightSample], sizes: np.ndarray
) -> list[FlightEstimate]:
    """Assert that all steps, of ``sizes`` [s], are those of numpy; the latter."""
    time, before, found = 3.0, STEP, []
    for sample, size in zip(samples, sizes.tolist(), strict=True):
        found.append(numpy_step(flight, sample, before))
        check(fmu.advance_over(sample, time, size), found[-1], tolerance=TOLERANCE)
        time, before = time + size, size
    return found


def poor_flight(inverse_map: InverseMap, steps: int, seed: int) -> list[FlightSample]:
    """Gauges, whole samples and quantities of navigation get lost."""
    random, samples = np.random.default_rng(seed), []
    for k, one in enumerate(random_flight(inverse_map, steps, seed)):
        valid = random.random(N_D) > 0.1 * (k % 7)
        flow = {name: value for name, value in one.flow.items() if random.random() > 0.4}
        samples.append(replace(one, valid=valid & (k % 13 < 11), flow=flow))
    return samples


@pytest.mark.parametrize("time_constant", [1e-9, 0.01, 1.0, 10.0])
def test_a_flight_is_that_of_numpy(fmu: FlightFmu, inverse_map: InverseMap, time_constant: float) -> None:
    """Variable steps, up to 5 s without gauges, lost gauges and navigation."""
    steps = 150 if time_constant == 1.0 else 40
    sizes = np.random.default_rng(1).uniform(0.002, 0.05, steps)
    sizes[25::50] = 5.0
    assert fmu.filter(time_constant) == OK
    flight = FlightFilter(ManifoldEstimator(inverse_map), FilterSettings(time_constant=time_constant))
    found = compare(fmu, flight, poor_flight(inverse_map, steps, seed=2), sizes)
    seen = {HealthState(one.health) for one in found}
    assert {HealthState.OK, HealthState.DEGRADED} <= seen
    assert flight.track.law is not None


@pytest.mark.parametrize("discrepancy", [0.0, 1e-3])
def test_a_map_without_errors_of_hardware(inverse_map: InverseMap, tmp_path: Path, discrepancy: float) -> None:
    """Nothing is considered, and without discrepancy nothing but the flight state and navigation is estimated."""
    bare = replace(inverse_map, manifold=flight_map(discrepancy=discrepancy))
    flight = FlightFilter(ManifoldEstimator(bare), FilterSettings(time_constant=1.0))
    assert flight.model.of_gauge.shape[1] == 0
    fmu = FlightFmu(write_resource(bare, tmp_path).as_uri(), N_D).start()
    assert isinstance(fmu, FlightFmu)
    assert fmu.filter(1.0) == OK
    compare(fmu, flight, poor_flight(bare, 20, seed=5), np.full(20, STEP))
    fmu.free()


def test_errors_that_last_and_follow_no_strain(inverse_map: InverseMap, tmp_path: Path) -> None:
    manifold = inverse_map.manifold
    assert manifold is not None
    covariance = np.diag(NOISE_STD**2 * np.linspace(1.0, 3.0, N_D))
    other = replace(inverse_map, manifold=replace(manifold, gauge_covariance=covariance))
    flight = FlightFilter(ManifoldEstimator(other), FilterSettings(time_constant=1.0))
    assert flight.model.own.any()
    fmu = FlightFmu(write_resource(other, tmp_path).as_uri(), N_D).start()
    assert isinstance(fmu, FlightFmu)
    assert fmu.filter(1.0) == OK
    compare(fmu, flight, poor_flight(other, 20, seed=6), np.full(20, STEP))
    fmu.free()


def test_off_the_tables_and_back(fmu: FlightFmu, inverse_map: InverseMap) -> None:
    """The law is predicted, the loads are linear; then the filter begins again, and steps must fit for a while."""
    samples = random_flight(inverse_map, 40, seed=15)
    bent = np.random.default_rng(6).normal(size=N_D) * 0.2 * np.abs(samples[0].strain).max()
    off = [replace(one, strain=one.strain + bent) if 3 <= k < 20 else one for k, one in enumerate(samples)]
    assert fmu.filter(1.0) == OK
    flight = FlightFilter(ManifoldEstimator(inverse_map), FilterSettings(time_constant=1.0))
    linear = [one.is_linear for one in compare(fmu, flight, off, np.full(40, STEP))]
    assert not any(linear[:3])
    assert all(linear[3:22])
    assert not any(linear[30:])
    assert flight.track.consistency.mean > 1.0


def test_a_jump_begins_again(fmu: FlightFmu, inverse_map: InverseMap) -> None:
    whole = random_flight(inverse_map, 800, seed=3)
    samples = [*whole[:6], *whole[-6:]]
    assert fmu.filter(1.0) == OK
    flight = FlightFilter(ManifoldEstimator(inverse_map), FilterSettings(time_constant=1.0))
    found = compare(fmu, flight, samples, np.full(12, STEP))
    assert all(one.fits for one in found)
    # A law that had gone on would know the loads as well as before.
    assert np.any(found[6].loads_std > 1.02 * found[5].loads_std)


def test_wrong_navigation(fmu: FlightFmu, inverse_map: InverseMap) -> None:
    right = random_flight(inverse_map, 8, seed=13)
    samples = [replace(one, flow=one.flow | {"mach_number": 1.25 * one.flow["mach_number"]}) for one in right]
    assert fmu.filter(1.0) == OK
    flight = FlightFilter(ManifoldEstimator(inverse_map), FilterSettings(time_constant=1.0))
    found = compare(fmu, flight, samples, np.full(8, STEP))
    assert not any(one.navigation_used[0] for one in found)


@pytest.mark.parametrize("known", [3, 2])
def test_navigation_that_jumps(fmu: FlightFmu, inverse_map: InverseMap, known: int) -> None:
    """Named while it is wrong; back where a third quantity tells that it is right, and not without one."""
    samples = []
    for k, one in enumerate(random_flight(inverse_map, 44, seed=29)):
        flow = dict(list(one.flow.items())[:known])
        flow["mach_number"] += 0.5 if 12 <= k < 30 else 0.0
        samples.append(replace(one, flow=flow))
    assert fmu.filter(1.0) == OK
    flight = FlightFilter(ManifoldEstimator(inverse_map), FilterSettings(time_constant=1.0))
    found = compare(fmu, flight, samples, np.full(44, STEP if known == 3 else 10.0 * STEP))
    used = [bool(one.navigation_used[0]) for one in found]
    assert not any(used[12:30])
    assert any(used[30:]) == (known == 3)


def test_evidence_over_time_widens_the_discrepancy(fmu: FlightFmu, inverse_map: InverseMap) -> None:
    """Chi-square stays below the alarm, but above its mean for more than a window."""
    random = np.random.default_rng(8)
    samples = [
        replace(one, strain=one.strain + 1.2e-7 * random.standard_normal(N_D))
        for one in random_flight(inverse_map, 130, seed=21)
    ]
    assert fmu.filter(1.0) == OK
    flight = FlightFilter(ManifoldEstimator(inverse_map), FilterSettings(time_constant=1.0))
    compare(fmu, flight, samples, np.full(130, STEP))
    assert flight.track.consistency.widening > 1.0


def test_outputs_follow_what_is_set_without_a_step(fmu: FlightFmu, inverse_map: InverseMap) -> None:
    """A sample is that at the start of a step, however often inputs are set and read before it is taken."""
    samples = random_flight(inverse_map, 6, seed=17)
    assert fmu.filter(1.0) == OK
    flight = FlightFilter(ManifoldEstimator(inverse_map), FilterSettings(time_constant=1.0))
    for k, sample in enumerate(samples):
        fmu.give(samples[0])
        fmu.all_outputs()
        fmu.give(sample)
        before = fmu.all_outputs()
        assert fmu.step(k * 0.02, 0.02) == OK
        assert fmu.all_outputs().tobytes() == before.tobytes()
        check(before, numpy_step(flight, sample, 0.02), tolerance=TOLERANCE)


def test_state_holds_the_law(fmu: FlightFmu, inverse_map: InverseMap, resources: Path) -> None:
    samples = poor_flight(inverse_map, 24, seed=19)
    assert fmu.filter(1.0) == OK
    for k, sample in enumerate(samples[:14]):
        fmu.advance_over(sample, k * STEP, STEP)
    at, state = fmu.all_outputs(), fmu.get_state()
    content = fmu.serialise(state)
    later = [(sample, 0.14 + k * STEP, STEP) for k, sample in enumerate(samples[14:])]
    after = [fmu.advance_over(*one).tobytes() for one in later]
    assert fmu.call("SetFMUstate", state) == OK
    assert fmu.all_outputs().tobytes() == at.tobytes()
    assert [fmu.advance_over(*one).tobytes() for one in later] == after
    other = FlightFmu(resources.as_uri(), N_D)
    status, moved = other.deserialise(content)
    assert status == OK
    assert other.call("SetFMUstate", moved) == OK
    assert [other.advance_over(*one).tobytes() for one in later] == after
    other.free()
    assert fmu.call("Reset") == OK
    fmu.start()
    assert [fmu.advance_over(*one).tobytes() for one in later] != after


def test_a_state_with_a_law_that_cannot_be(fmu: FlightFmu, inverse_map: InverseMap) -> None:
    assert fmu.filter(1.0) == OK
    fmu.advance_over(random_flight(inverse_map, 1, seed=22)[0], 0.0, STEP)
    content = bytearray(fmu.serialise(fmu.get_state()))
    content[-80 * 8 : -79 * 8] = np.float64(np.inf).tobytes()
    content[12:16] = zlib.crc32(content[16:]).to_bytes(4, "little")
    assert fmu.deserialise(bytes(content))[0] == ERROR
    assert "flight state that cannot be" in fmu.messages[-1][2]


def test_without_the_filter_nothing_is_remembered(fmu: FlightFmu, inverse_map: InverseMap) -> None:
    """Off at first, on, off again by the parameter and by a zero that is not known exactly."""
    samples, static = random_flight(inverse_map, 12, seed=23), fresh_tracker(inverse_map)
    flight = FlightFilter(ManifoldEstimator(inverse_map), FilterSettings(time_constant=1.0))
    for k, sample in enumerate(samples):
        assert fmu.filter(1.0 if k in (4, 5, 6) else 0.0) == OK
        found = fmu.advance_over(sample, k * STEP, STEP)
        if k in (4, 5, 6):
            flight.track = replace(flight.track, state=static.track.state if k == 4 else flight.track.state)
            check(found, numpy_step(flight, sample, STEP), tolerance=TOLERANCE)
            static.track = replace(static.track, state=flight.track.state)
        else:
            check(found, tracked(static, sample))
    assert fmu.filter(1.0) == OK
    fmu.advance_over(samples[0], 1.0, STEP)  # the filter begins with the sample on its own
    with_filter = fmu.advance_over(samples[0], 1.01, STEP)
    assert fmu.set_reals([FILTER - 2], [1e-12]) == OK
    without = fmu.advance_over(samples[0], 1.02, STEP)
    assert fmu.filter(0.0) == OK
    assert fmu.advance_over(samples[0], 1.03, STEP)[5:10] == pytest.approx(without[5:10], rel=1e-3)
    assert np.any(with_filter[5:10] < 0.99 * without[5:10])


@pytest.mark.parametrize("value", [-1.0, 1e-10, 2e6, np.nan, np.inf])
def test_time_constants_that_cannot_be(fmu: FlightFmu, value: float) -> None:
    assert fmu.filter(value) == ERROR
    assert "filter_time_constant" in fmu.messages[-1][2]


@pytest.mark.parametrize(
    ("name", "change", "expected"),
    [
        ("seen_load", lambda old: old[:-1], "expected "),
        ("own", lambda old: np.ones((2, N_D)), "expected 0 to 1 values along axis 0, found 2"),
        ("further_variance", lambda old: np.ones(999), "expected "),
        ("rate", put(0, 0.0), "expected numbers above zero, found 0"),
        ("white_navigation", np.float64(1.5), "expected a number from "),
        ("noise", put((1, 1), 0.0), "expected numbers above zero, found 0"),
        ("rest_load", put((-1, -1), np.nan), "holds a value that is not finite (number 24)"),
    ],
)
def test_what_cannot_be_is_refused(
    inverse_map: InverseMap, tmp_path: Path, name: str, change: Any, expected: str
) -> None:
    location = with_arrays(inverse_map, tmp_path, {f"filter.{name}": change})
    assert f"'filter.{name}': {expected}" in refusal(FlightFmu(location, N_D))
