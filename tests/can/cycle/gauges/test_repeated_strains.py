"""A buffer of cycles that a sender repeats under new counters: named where noise does not allow it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from can_case import CYCLE, NOISE, QUANTUM, Projection, layout_of

from strainfmu.can.cycle.core import bridge_core
from strainfmu.can.cycle.estimate.result import CycleResult
from strainfmu.can.cycle.states.quality import Cause, Quality
from strainfmu.can.settings import BridgeSettings
from strainfmu.can.wire.strain_encoder import StrainEncoder

N_GAUGES = 54


def results_of(
    numbers: list[int], noise: float = NOISE, settings: BridgeSettings | None = None, confirmed_at: int = -1
) -> list[CycleResult]:
    """Return results of cycles whose readings are those of ``numbers``; counter and time always go on."""
    layout = layout_of("fd64", N_GAUGES)
    step, encoder = Projection(N_GAUGES), StrainEncoder(layout)
    step.noise_std = np.full(N_GAUGES, noise)
    core = bridge_core(layout, step, settings or BridgeSettings(), start=0.0)
    found = []
    for k, number in enumerate(numbers):
        random = np.random.default_rng((7, number))
        strain = 4e-4 + 1e-5 * np.arange(N_GAUGES) + noise * random.normal(size=N_GAUGES)
        if k == confirmed_at:
            core.confirm_sender()
        for index, frame in enumerate(encoder.encode(strain, 9e4, cycle=k, sample_time=k * CYCLE)):
            found += core.receive(replace(frame, time=k * CYCLE + 1e-6 * index))
    return found


BUFFER = [*range(100), *(list(range(90, 100)) * 5)]


def test_a_repeated_buffer_is_stale_and_named_at_once() -> None:
    results = results_of(BUFFER)
    assert {result.quality for result in results[10:100]} == {Quality.VALID}
    assert {result.quality for result in results[100:]} == {Quality.STALE}
    assert all(result.causes == Cause.REPEATS for result in results[100:])


def test_new_strains_behind_a_buffer_are_valid_again_soon() -> None:
    results = results_of([*BUFFER, *range(200, 260)])
    assert {result.quality for result in results[len(BUFFER) + 12 :]} == {Quality.VALID}


@pytest.mark.parametrize("first", [1, 40])
def test_a_cycle_of_a_buffer_that_never_came_is_no_way_out(first: int) -> None:
    """The buffer was filled while frames were lost: its first pass is new, all later ones are not."""
    unheard = list(range(500, 503))
    buffer = [*range(first, first + 7), *unheard]
    results = results_of([*range(60), *buffer, *buffer])
    assert all(result.causes & Cause.REPEATS for result in results[60:])


@pytest.mark.parametrize("noise", [0.05e-6, 0.1e-6, 0.24e-6, 1e-6])
def test_live_gauges_are_never_taken_for_a_buffer(noise: float) -> None:
    """However quiet: 0.2 of a bit and less repeats whole cycles by chance."""
    results = results_of(list(range(3000)), noise)
    assert not any(result.causes & Cause.REPEATS for result in results)
    assert sum(result.quality is Quality.VALID for result in results) >= 2990
    assert noise > QUANTUM or {result.quality for result in results[10:]} <= {Quality.VALID, Quality.DEGRADED}


def test_a_sender_that_samples_more_slowly_than_it_sends_repeats_nothing() -> None:
    results = results_of([k // 3 for k in range(300)])
    assert not any(result.causes & Cause.REPEATS for result in results)


def test_a_stand_that_repeats_its_stimulus_says_so() -> None:
    for settings in (BridgeSettings(restart="accept"), BridgeSettings(stuck_cycles=0)):
        assert not any(result.causes & Cause.REPEATS for result in results_of(BUFFER, settings=settings))


def test_what_somebody_has_confirmed_may_repeat_what_was_before() -> None:
    results = results_of([*range(100), *range(100)], confirmed_at=100)
    assert not any(result.causes & Cause.REPEATS for result in results)


def test_a_buffer_of_cycles_that_were_refused_is_known() -> None:
    """Their counters were wrong, but their strains came."""
    layout = layout_of("fd64", N_GAUGES)
    step, encoder = Projection(N_GAUGES), StrainEncoder(layout)
    step.noise_std = np.full(N_GAUGES, NOISE)
    core = bridge_core(layout, step, BridgeSettings(), start=0.0)

    def sent(k: int, number: int, counter: int) -> list[CycleResult]:
        random = np.random.default_rng((7, number))
        strain = 4e-4 + 1e-5 * np.arange(N_GAUGES) + NOISE * random.normal(size=N_GAUGES)
        frames = encoder.encode(strain, 9e4, cycle=counter, sample_time=k * CYCLE)
        return [r for i, f in enumerate(frames) for r in core.receive(replace(f, time=k * CYCLE + 1e-6 * i))]

    for k in range(40):
        sent(k, k, k)
    sent(40, 40, 100)  # refused: out of sequence
    for k in range(41, 60):
        sent(k, k, k + 60)
    assert sent(60, 40, 120)[-1].causes & Cause.REPEATS


def test_one_frame_of_a_buffer_beside_a_lost_one_is_known() -> None:
    layout = layout_of("fd64", N_GAUGES)
    step, encoder = Projection(N_GAUGES), StrainEncoder(layout)
    step.noise_std = np.full(N_GAUGES, NOISE)
    core = bridge_core(layout, step, BridgeSettings(), start=0.0)
    results: list[CycleResult] = []
    for k in range(80):
        random = np.random.default_rng((7, k - 30 if k >= 50 else k))
        strain = 4e-4 + 1e-5 * np.arange(N_GAUGES) + NOISE * random.normal(size=N_GAUGES)
        frames = list(encoder.encode(strain, 9e4, cycle=k, sample_time=k * CYCLE))
        for index, frame in enumerate(frames[:-1] if k >= 50 else frames):
            results += core.receive(replace(frame, time=k * CYCLE + 1e-6 * index))
        results += core.advance(k * CYCLE + 0.6 * CYCLE)
    assert all(result.causes & Cause.REPEATS for result in results[-25:])
