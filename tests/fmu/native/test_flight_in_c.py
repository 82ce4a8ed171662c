"""The nonlinear estimator of the native library: equal to numpy cold and warm, its state, what it refuses."""

from __future__ import annotations

import zlib
from ctypes import byref
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from damaged_resource import put, refusal, with_arrays
from flight_fmu import (
    FIRST,
    N_D,
    FlightFmu,
    FlightSample,
    check,
    fresh_tracker,
    random_flight,
    tracked,
)
from raw_fmu import ERROR, N_OUTPUTS, OK, write_resource

from strainfmu.estimator.health import HealthState
from strainfmu.estimator.manifold.ambiguity import N_WIDENING
from strainfmu.estimator.manifold.tracker import SEARCH_EVERY
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.settings import default_settings
from strainfmu.estimator.tables.channel_tables import channel_tables

pytestmark = pytest.mark.fast


def compare(fmu: FlightFmu, inverse_map: InverseMap, samples: list[FlightSample]) -> list[HealthState]:
    """Assert that all steps are those of numpy; their states of health."""
    tracker, seen = fresh_tracker(inverse_map), []
    for sample in samples:
        found = tracked(tracker, sample)
        check(fmu.advance(sample), found)
        seen.append(HealthState(found.health))
    return seen


@pytest.mark.parametrize("seed", range(4))
def test_cold_and_warm_steps_are_those_of_numpy(fmu: FlightFmu, inverse_map: InverseMap, seed: int) -> None:
    assert HealthState.OK in compare(fmu, inverse_map, random_flight(inverse_map, 8, seed))


def test_a_shape_with_ranges_of_both_angles(inverse_map: InverseMap, tmp_path: Path) -> None:
    """Priors and searches are about the middle of the ranges; beyond them it is outside."""
    assert inverse_map.manifold is not None
    ranges = np.radians([[-3.0, 9.0], [-2.0, 2.0]])
    of_shape = replace(inverse_map, manifold=replace(inverse_map.manifold, crossflow_range=ranges))
    fmu, seen = FlightFmu(write_resource(of_shape, tmp_path).as_uri(), N_D), []
    fmu.start()
    for seed in range(6):
        assert fmu.call("Reset") == OK
        fmu.start()
        samples = random_flight(of_shape, 3, seed)
        seen += compare(fmu, of_shape, [replace(one, flow={}) if seed % 2 else one for one in samples])
    fmu.free()
    assert {HealthState.OK, HealthState.OUTSIDE} <= set(seen)


def test_unknown_navigation(fmu: FlightFmu, inverse_map: InverseMap) -> None:
    samples = random_flight(inverse_map, 6, seed=11)
    kept: list[tuple[str, ...]] = [(), ("mach_number",), ("static_pressure",), ("dynamic_pressure",)]
    blind = [replace(one, flow={name: one.flow[name] for name in kept[k % 4]}) for k, one in enumerate(samples)]
    compare(fmu, inverse_map, [*blind, replace(samples[0], flow={"altitude": 20e3, "mach_number": np.nan})])


def test_without_a_pressure(fmu: FlightFmu, inverse_map: InverseMap) -> None:
    """States that fit are searched for every eleven steps or where strain does not fit, and held between."""
    samples = [one for seed in range(5) for one in random_flight(inverse_map, 15, 60 + seed)]
    for k, one in enumerate(samples):
        kept = ("static_pressure",) if 40 < k < 55 or k % 13 == 3 else ("mach_number",) if k % 30 < 20 else ()
        samples[k] = replace(one, flow={name: one.flow[name] for name in kept})
    tracker, held = fresh_tracker(inverse_map), []
    for sample in samples:
        found = tracked(tracker, sample)
        check(fmu.advance(sample), found)
        held.append(tracker.track.widening)
    most = 1 + len(samples) // (1 + SEARCH_EVERY) + 3  # and some steps that only fit by a search
    assert 6 <= len({one.tobytes() for one in held if one is not None}) <= most
    assert max(one.max() for one in held if one is not None) > 1.5


@pytest.mark.parametrize("told", [1, 4])
def test_a_pressure_that_is_lost_soon_after_a_search(fmu: FlightFmu, inverse_map: InverseMap, told: int) -> None:
    """The first step without one searches for what else fits, however near the last search is."""
    samples = random_flight(inverse_map, told + 3, 62)
    tracker, held = fresh_tracker(inverse_map), []
    for k, sample in enumerate(samples):
        one = sample if k < told else replace(sample, flow={})
        check(fmu.advance(one), tracked(tracker, one))
        held.append(tracker.track.widening)
    assert all(one is None for one in held[:told])
    first = held[told]
    assert first is not None
    assert first.max() > 1.5
    assert all(one is not None and np.array_equal(one, first) for one in held[told:])


def test_navigation_that_counts_for_nothing_leaves_the_search_as_it_is(
    fmu: FlightFmu, inverse_map: InverseMap
) -> None:
    """A Mach number so large that its square is no number, in the first step."""
    sample = replace(random_flight(inverse_map, 1, 5)[0], flow={})
    expected = fmu.advance(sample)
    assert fmu.call("Reset") == OK
    fmu.start()
    wrong = replace(sample, flow={"mach_number": 1e300})
    found = fmu.advance(wrong)
    check(found, tracked(fresh_tracker(inverse_map), wrong))
    assert found[:20].tobytes() == expected[:20].tobytes()


def refused_state(fmu: FlightFmu, content: bytearray) -> str:
    """The message about a serialised state whose checksum is right."""
    content[12:16] = zlib.crc32(content[16:]).to_bytes(4, "little")
    assert fmu.deserialise(bytes(content))[0] == ERROR
    return fmu.messages[-1][2]


def test_the_state_keeps_what_else_fits(fmu: FlightFmu, inverse_map: InverseMap) -> None:
    """Serialised between two searches; factors that cannot be are refused."""
    samples = [replace(one, flow={}) for one in random_flight(inverse_map, 16, 77)]
    for sample in samples[:5]:
        fmu.advance(sample)
    kept = fmu.serialise(fmu.get_state())
    first = [fmu.advance(sample) for sample in samples[5:]]
    status, state = fmu.deserialise(kept)
    assert status == OK
    assert fmu.call("SetFMUstate", state) == OK
    assert np.array_equal([fmu.advance(sample) for sample in samples[5:]], first)
    for at, factor in ((3, 0.9), (0, 0.0), (13, np.inf), (5, np.nan)):
        changed = bytearray(kept)
        factors = np.frombuffer(changed, dtype=np.uint8)[-8 * (N_WIDENING + 1) : -8].view(np.float64)
        assert factors.min() >= 1.0
        factors[at] = factor
        assert "flight state that cannot be" in refused_state(fmu, changed)


def test_stated_deviations(fmu: FlightFmu, inverse_map: InverseMap) -> None:
    stated = {"mach_number_std": 0.01, "static_pressure_std": 300.0, "dynamic_pressure_std": 1e-3}
    samples = [replace(one, flow=one.flow | stated) for one in random_flight(inverse_map, 5, seed=12)]
    compare(fmu, inverse_map, samples)


@pytest.mark.parametrize("name", ["mach_number", "static_pressure", "dynamic_pressure"])
def test_wrong_navigation(fmu: FlightFmu, inverse_map: InverseMap, name: str) -> None:
    right = random_flight(inverse_map, 4, seed=13)
    samples = [replace(one, flow=one.flow | {name: 1.25 * one.flow[name]}) for one in right]
    assert HealthState.DEGRADED in compare(fmu, inverse_map, samples)


@pytest.mark.parametrize("value", [np.finfo(float).max, np.finfo(float).smallest_subnormal])
@pytest.mark.parametrize("name", ["mach_number", "static_pressure", "dynamic_pressure"])
def test_navigation_at_the_ends_of_numbers(
    fmu: FlightFmu, inverse_map: InverseMap, name: str, value: float
) -> None:
    """One such reading leaves nothing behind that is not finite: the steps after it are those of numpy."""
    samples = random_flight(inverse_map, 8, seed=12)
    samples[2] = replace(samples[2], flow={**samples[2].flow, name: value})
    seen = compare(fmu, inverse_map, samples)
    assert seen[-1] == HealthState.OK, seen


@pytest.mark.parametrize("orders", [-30.0, -7.0, 7.0, 30.0])
def test_a_search_does_not_start_far_beyond_the_pressures_of_the_tables(
    fmu: FlightFmu, inverse_map: InverseMap, orders: float
) -> None:
    """p_inf of navigation, taken for exact, e^orders times the true one: searched alike from the first step on."""
    samples = random_flight(inverse_map, 3, seed=12)
    wrong = {"static_pressure": float(np.exp(orders)) * 5500.0, "static_pressure_std": 1e-3}
    compare(fmu, inverse_map, [replace(one, flow=wrong) for one in samples])


def test_lost_gauges(fmu: FlightFmu, inverse_map: InverseMap) -> None:
    random = np.random.default_rng(5)
    samples = []
    for k, one in enumerate(random_flight(inverse_map, 10, seed=14)):
        valid = random.random(N_D) > 0.1 * k
        strain = np.where(random.random(N_D) < 0.05, np.nan, one.strain)
        samples.append(replace(one, strain=strain, valid=valid if k != 7 else np.zeros(N_D, dtype=bool)))
    seen = compare(fmu, inverse_map, samples)
    assert seen[7] == HealthState.INVALID
    assert HealthState.DEGRADED in seen


def test_off_the_tables_and_back(fmu: FlightFmu, inverse_map: InverseMap) -> None:
    """Loads of the linear map while strain does not fit, and for a few steps after; a search every tenth step."""
    samples = random_flight(inverse_map, 30, seed=15)
    bent = np.random.default_rng(6).normal(size=N_D) * 0.05 * np.abs(samples[0].strain).max()
    off = [replace(one, strain=one.strain + bent) if 2 <= k < 16 else one for k, one in enumerate(samples)]
    tracker, linear = fresh_tracker(inverse_map), []
    for sample in off:
        found = tracked(tracker, sample)
        check(fmu.advance(sample), found, tolerance=1e-7)
        linear.append(found.is_linear)
    assert not any(linear[:2])
    assert all(linear[2:18])
    assert not any(linear[20:])


def test_jumps_and_spikes(fmu: FlightFmu, inverse_map: InverseMap) -> None:
    """A search in the step that loses the fit; what it does not mend leaves the state as it was."""
    samples = [one for seed in range(6) for one in random_flight(inverse_map, 12, 40 + seed)]
    for k in (25, 39):
        samples[k] = replace(samples[k], strain=samples[k].strain + 5e-5 * (np.arange(N_D) == k))
    samples = [replace(one, flow={} if 12 <= k < 36 else one.flow) for k, one in enumerate(samples)]
    seen = compare(fmu, inverse_map, samples)
    assert {HealthState.OK, HealthState.INCONSISTENT} <= set(seen)


def test_one_gauge_that_does_not_fit(fmu: FlightFmu, inverse_map: InverseMap) -> None:
    samples = random_flight(inverse_map, 3, seed=16)
    samples[1].strain[5] += 6e-6
    assert compare(fmu, inverse_map, samples)[1] in (HealthState.SUSPECT, HealthState.INCONSISTENT)


def test_a_shape_of_pressure_off_the_tables(fmu: FlightFmu, inverse_map: InverseMap) -> None:
    """Chi-square stays below its level."""
    assert inverse_map.manifold is not None
    shape, tracker, fits = inverse_map.manifold.shapes[:, 1], fresh_tracker(inverse_map), []
    for k, one in enumerate(random_flight(inverse_map, 6, seed=18)):
        sample = replace(one, strain=one.strain + (0.18 * shape if k == 3 else 0.0))
        found = tracked(tracker, sample)
        check(fmu.advance(sample), found)
        assert found.chi_square < found.chi_square_limit
        fits.append(found.fits)
    assert fits == [k != 3 for k in range(6)]


def test_navigation_that_may_be_correct_widens_the_others(fmu: FlightFmu, inverse_map: InverseMap) -> None:
    right = random_flight(inverse_map, 4, seed=19)
    samples = [
        replace(one, flow=one.flow | {"mach_number": one.flow["mach_number"] + 0.05 * off})
        for one, off in zip(right, (3.0, 4.0, -4.0, 5.0), strict=True)
    ]
    assert compare(fmu, inverse_map, samples).count(HealthState.OK) >= 1


def test_outputs_follow_what_is_set_without_a_step(fmu: FlightFmu, inverse_map: InverseMap) -> None:
    """What is set after a step belongs to the next one, however often it is set or read before that is taken."""
    samples, tracker = random_flight(inverse_map, 6, seed=17), fresh_tracker(inverse_map)
    for sample in samples:
        fmu.give(samples[0])
        fmu.all_outputs()
        fmu.give(sample)
        before = fmu.all_outputs()
        assert fmu.step() == OK
        assert fmu.all_outputs().tobytes() == before.tobytes()
        check(before, tracked(tracker, sample))


def test_a_step_with_the_same_inputs_goes_on(fmu: FlightFmu, inverse_map: InverseMap) -> None:
    sample, tracker = random_flight(inverse_map, 1, seed=18)[0], fresh_tracker(inverse_map)
    fmu.give(sample)
    for _ in range(3):
        assert fmu.step() == OK
        check(fmu.all_outputs(), tracked(tracker, sample))


def test_state_holds_the_track(fmu: FlightFmu, inverse_map: InverseMap, resources: Path) -> None:
    samples = random_flight(inverse_map, 8, seed=19)
    for sample in samples[:4]:
        fmu.advance(sample)
    at, state = fmu.all_outputs(), fmu.get_state()
    content = fmu.serialise(state)
    after = [fmu.advance(sample).tobytes() for sample in samples[4:]]
    assert fmu.call("SetFMUstate", state) == OK
    assert fmu.all_outputs().tobytes() == at.tobytes()
    assert [fmu.advance(sample).tobytes() for sample in samples[4:]] == after
    other = FlightFmu(resources.as_uri(), N_D)
    status, moved = other.deserialise(content)
    assert status == OK
    assert other.call("SetFMUstate", moved) == OK
    assert [other.advance(sample).tobytes() for sample in samples[4:]] == after
    assert fmu.call("FreeFMUstate", byref(state)) == OK
    other.free()


def test_reset_forgets_the_track(fmu: FlightFmu, inverse_map: InverseMap) -> None:
    samples = random_flight(inverse_map, 3, seed=20)
    first = [fmu.advance(sample).tobytes() for sample in samples]
    assert fmu.call("Reset") == OK
    fmu.start()
    assert [fmu.advance(sample).tobytes() for sample in samples] == first


def test_settings(fmu: FlightFmu, inverse_map: InverseMap) -> None:
    sample = random_flight(inverse_map, 1, seed=21)[0]
    before = fmu.advance(sample)
    settings = default_settings(inverse_map)
    area, length = 2.0 * settings.reference_area, 0.5 * settings.reference_length
    assert fmu.set_scalars(5, 2.0, area, length, settings.moment_station + 0.5) == OK
    after = fmu.advance(sample)
    assert after[22] == pytest.approx(2.0 * before[22])
    assert after[0] == pytest.approx(0.5 * before[0], rel=1e-3)
    assert after[13] == pytest.approx(before[13] + 0.5 * before[11], rel=1e-3)


def test_start_values(fmu: FlightFmu) -> None:
    assert fmu.get_reals([N_OUTPUTS + 2 * N_D, *range(FIRST, FIRST + 3)]).tolist() == [0.0] * 4


def test_refuses_model_exchange(resources: Path) -> None:
    other = FlightFmu(resources.as_uri(), N_D, co_simulation=False)
    assert other.instance.value is None
    assert other.messages[-1][2] == "this FMU is for co-simulation"


@pytest.mark.parametrize(
    ("name", "change", "text"),
    [
        ("mach_knots", put(1, 0.0), "expected numbers that increase"),
        ("table", lambda old: old[1:], "expected "),
        ("row", put(1, 5.0), "expected rows that ascend without a gap"),
        ("channel", put(0, 0.5), "expected channels of the table"),
        ("channel", put(0, -1.0), "expected channels of the table"),
        ("start_iterations", np.int32(3), "expected an even number"),
        ("warm_iterations", np.int32(-1), "expected a whole number from 0 to 1000, found -1"),
        ("pressure_range", put(0, 0.0), "expected a range above zero"),
        ("gauge_covariance", put((2, 2), 0.0), "expected numbers above zero, found 0"),
        ("shapes", lambda old: np.ones((17, old.shape[1])), "expected 0 to 16 values along axis 0, found 17"),
        ("common_gain", None, "is missing"),
    ],
)
def test_what_cannot_be_is_refused(
    inverse_map: InverseMap, tmp_path: Path, name: str, change: Any, text: str
) -> None:
    location = with_arrays(inverse_map, tmp_path, {f"flight.{name}": change})
    assert f"'flight.{name}': {text}" in refusal(FlightFmu(location, N_D))


def test_wrong_value_in_a_state(fmu: FlightFmu, inverse_map: InverseMap) -> None:
    fmu.advance(random_flight(inverse_map, 1, seed=22)[0])
    content = bytearray(fmu.serialise(fmu.get_state()))
    content[-8:] = np.float64(0.5).tobytes()
    assert "flight state that cannot be" in refused_state(fmu, content)


@pytest.mark.parametrize("turn", [0.0, 0.3])
def test_channels_are_the_tables(inverse_map: InverseMap, turn: float) -> None:
    """Whatever the stated roll angles are; gauges that are rotations of each other have one channel."""
    manifold = inverse_map.manifold
    assert manifold is not None
    found = channel_tables(manifold.response, turn + np.arange(N_D))
    again = np.zeros_like(manifold.response)
    for row, channel, *factors in zip(found.row, found.channel, found.cosine, found.sine, strict=True):
        again[:, :, int(row)] += found.table[:, :, int(channel), :, None] * np.stack(factors, axis=-1)
    assert np.max(np.abs(again - manifold.response)) < 1e-13 * np.max(np.abs(manifold.response))
    assert found.table.shape[2] < N_D / 2
