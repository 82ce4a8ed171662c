"""Each guard of the bridge is needed: without it, the oracle of the campaigns finds something wrong."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from can_case import CYCLE, GAP, N_GAUGES, SIZES, Campaign, Projection, layout_of, run_campaign
from can_faults import Fault, FaultKind, random_faults
from weakened_bus import WITHOUT, MakeCore, core_without
from weakened_parts import TakesPartByPart

from strainfmu.can.cycle.core import bridge_core
from strainfmu.can.cycle.frames.account import FrameClass
from strainfmu.can.cycle.states.quality import Cause, Quality
from strainfmu.can.settings import BridgeSettings
from strainfmu.can.wire.frame import Frame
from strainfmu.cosim.estimators.step import StepResult
from strainfmu.estimator.health import HealthState


class SickStep(Projection):
    """An estimator that reports ill health, or whose outputs are not finite."""

    def __init__(self, n_gauges: int, health: HealthState, coefficient: float) -> None:
        super().__init__(n_gauges)
        self._sick, self._coefficient = health, coefficient

    def __call__(self, strain: np.ndarray, dynamic_pressure: float, step_size: float) -> StepResult:
        good = super().__call__(strain, dynamic_pressure, step_size)
        return replace(good, health=int(self._sick), coefficients=good.coefficients + self._coefficient)


def of_kind(
    *kinds: FaultKind, cycles: int = 12, step: Projection | None = None, profile: str = "fd64"
) -> Callable[[MakeCore], Campaign]:
    """Return a run of single faults of ``kinds`` through a core that is made for it."""

    def run(make_core: MakeCore) -> Campaign:
        faults = [
            Fault(kind=kind, start=40 + 80 * index, cycles=cycles, seed=index) for index, kind in enumerate(kinds)
        ]
        n_cycles = 40 + 80 * len(kinds) + cycles
        return run_campaign(layout_of(profile), faults, n_cycles, step=step, make_core=make_core)

    return run


def has_false_valid(run: Campaign) -> bool:
    return bool(run.false_valid)


def count(run: Campaign, kind: FrameClass) -> int:
    return run.core.account.classes[kind]


def ill(health: HealthState = HealthState.OK, coefficient: float = 0.0) -> SickStep:
    return SickStep(N_GAUGES, health, coefficient)


# For every guard: a scenario, and what is wrong without it.
SCENARIOS: dict[str, tuple[Callable[[MakeCore], Campaign], Callable[[Campaign], bool]]] = {
    "own_frames": (of_kind(FaultKind.OWN_IDENTIFIER), lambda run: count(run, FrameClass.OWN) == 0),
    "second_bridge": (
        of_kind(FaultKind.SECOND_BRIDGE),
        lambda run: run.qualities[Quality.UNCONFIRMED] < 10 or count(run, FrameClass.SECOND_BRIDGE) != 12,
    ),
    "second_sender": (of_kind(FaultKind.CONFLICT), has_false_valid),
    "creep": (lambda make_core: slow_creep(make_core), has_false_valid),
    "restart_proof": (lambda make_core: recording(make_core), has_false_valid),
    "error_frames": (of_kind(FaultKind.ERROR_FRAMES), lambda run: count(run, FrameClass.CORRUPT) > 0),
    "remote_frames": (of_kind(FaultKind.REMOTE_FRAMES), lambda run: count(run, FrameClass.WRONG_FORMAT) > 0),
    "format": (of_kind(FaultKind.IDENTIFIER_WIDTH), lambda run: run.qualities[Quality.STALE] == 0),
    "babbling": (of_kind(FaultKind.BABBLING), lambda run: count(run, FrameClass.CORRUPT) > 1000),
    "crc": (of_kind(FaultKind.CORRUPTION), has_false_valid),
    "counter": (of_kind(FaultKind.REPETITION), lambda run: pressure_used_twice(run)),
    "configuration": (of_kind(FaultKind.CONFIGURATION), has_false_valid),
    "state_machine": (of_kind(), lambda run: run.results[0].quality is Quality.VALID),
    "order": (of_kind(FaultKind.SEQUENCE), lambda run: count(run, FrameClass.LATE) == 0),
    "completeness": (of_kind(FaultKind.LOSS), has_false_valid),
    "silence": (of_kind(FaultKind.SILENCE), lambda run: run.qualities[Quality.STALE] == 0),
    "age": (of_kind(FaultKind.DELAY, cycles=30), has_false_valid),
    # Without a guard of the period, which finds the pace of the gateway too, once it has lasted for 33 cycles.
    "pace": (lambda make_core: held_back(make_core, BridgeSettings(period_tolerance=1e3)), has_false_valid),
    "clock_jump": (
        of_kind(FaultKind.CLOCK_JUMP),
        lambda run: not any(result.causes & Cause.CLOCK_JUMP for result in run.results),
    ),
    "frozen": (of_kind(FaultKind.FREEZE), has_false_valid),
    "partial_freeze": (of_kind(FaultKind.PARTIAL_FREEZE), has_false_valid),
    "dither": (of_kind(FaultKind.DITHER, cycles=30), has_false_valid),
    "stuck": (of_kind(FaultKind.STUCK_GAUGE, cycles=60), has_false_valid),
    "zero": (of_kind(FaultKind.ZERO_GAUGE), has_false_valid),
    "not_available": (lambda make_core: value_inside_the_range(make_core), has_false_valid),
    "range": (of_kind(FaultKind.OUT_OF_RANGE), has_false_valid),
    "rate": (of_kind(FaultKind.JUMP), has_false_valid),
    "sender_status": (of_kind(FaultKind.SENDER_STATUS), has_false_valid),
    "pressure_age": (of_kind(FaultKind.PRESSURE_SILENCE, cycles=30), has_false_valid),
    "health": (of_kind(step=ill(HealthState.INCONSISTENT)), lambda run: run.qualities[Quality.VALID] > 0),
    "finite_output": (of_kind(step=ill(coefficient=np.nan)), lambda run: run.qualities[Quality.VALID] > 0),
    "authenticator": (of_kind(FaultKind.FORGERY, profile="fd64-sec"), has_false_valid),
    "freshness": (of_kind(FaultKind.EARLIER_RUN, profile="fd64-sec"), has_false_valid),
}


def pressure_used_twice(run: Campaign) -> bool:
    """Return whether more frames of q_inf were used than were sent: one per cycle, on an identifier of its own."""
    used = count(run, FrameClass.USED)
    sent = run.core.layout.cycle_length * (40 + 80 + 12)
    return used > sent - 9


def value_inside_the_range(make_core: MakeCore) -> Campaign:
    """A layout whose "not available" lies among the strains: only its code distinguishes it."""
    layout = layout_of("fd64")
    marker = 1500
    frames = tuple(
        replace(
            frame,
            layout=replace(
                frame.layout,
                signals=tuple(
                    replace(s, not_available=marker) if s.not_available is not None else s
                    for s in frame.layout.signals
                ),
            ),
        )
        for frame in layout.strain_frames
    )
    faults = [Fault(kind=FaultKind.NO_VALUE, start=40, cycles=12, seed=1)]
    return run_campaign(replace(layout, strain_frames=frames), faults, 80, make_core=make_core)


def recording(make_core: MakeCore) -> Campaign:
    """Forty cycles that were sent before the sender was switched off; strains may repeat themselves."""
    faults = [Fault(kind=FaultKind.RECORDING, start=80, cycles=40, seed=48)]
    settings = BridgeSettings(stuck_cycles=0)
    return run_campaign(layout_of("fd64"), faults, 160, settings=settings, make_core=make_core)


def slow_creep(make_core: MakeCore) -> Campaign:
    """A gateway whose queue grows by 190 ppm for 200 s."""

    def gateway(number: int, frames: list[Frame]) -> list[Frame]:
        return [replace(frame, time=frame.time * (1.0 + 190e-6)) for frame in frames]

    return run_campaign(layout_of("fd64", 4, 0.1), [], 2000, change=gateway, make_core=make_core)


def held_back(make_core: MakeCore, settings: BridgeSettings | None = None) -> Campaign:
    """Frames without a sample time that a gateway keeps for half a second, then sends one behind the other."""
    timed = layout_of("fd64")
    frames = tuple(replace(frame, sample_time=None) for frame in timed.strain_frames)
    kept: list[Frame] = []

    def gateway(number: int, frames: list[Frame]) -> list[Frame]:
        kept.extend(frames)
        if 60 <= number < 110:
            return []
        sent = [replace(frame, time=number * CYCLE + 20e-6 * index) for index, frame in enumerate(kept)]
        kept.clear()
        return sent

    layout = replace(timed, strain_frames=frames)
    return run_campaign(layout, [], 160, settings=settings, change=gateway, make_core=make_core)


def test_held_back_cycles_are_stale_and_live_ones_are_trusted_at_once() -> None:
    run = held_back(bridge_core)
    at_once = [result.quality for result in run.results if result.arrival and 1.1 <= result.arrival < 1.105]
    assert Quality.STALE in at_once
    assert not any(quality.has_coefficients for quality in at_once)
    # The first live cycle still comes close behind the others.
    assert [r.quality for r in run.results if r.arrival and r.arrival > 1.115] == [Quality.VALID] * 48


@pytest.mark.parametrize("guard", WITHOUT)
def test_every_guard_is_needed(guard: str) -> None:
    scenario, is_wrong = SCENARIOS[guard]
    assert not is_wrong(scenario(bridge_core))
    assert is_wrong(scenario(WITHOUT[guard]))


def test_every_guard_has_its_scenario() -> None:
    assert set(SCENARIOS) == set(WITHOUT)
    assert len(WITHOUT) == 33


def test_a_core_with_nothing_replaced_is_the_shipped_one() -> None:
    """What the weakened cores differ in is the replaced part alone."""
    for profile in ("fd64-sec", "classic-le"):
        faults = random_faults(8, tuple(FaultKind), seed=5, gap=GAP)
        runs = [
            run_campaign(layout_of(profile, SIZES[profile]), faults, 300, make_core=make_core)
            for make_core in (bridge_core, core_without())
        ]
        shipped, composed = ([repr(result) for result in run.results] for run in runs)
        assert shipped == composed
        assert runs[0].core.account == runs[1].core.account


@pytest.mark.parametrize("profile", ["fd64", "classic-le"])
def test_frames_taken_in_at_once_and_part_by_part_come_to_the_same(profile: str) -> None:
    """Frames with an authenticator or a multiplexer take the second way alone."""
    faults = random_faults(12, tuple(FaultKind), seed=6, gap=GAP)
    runs = [
        run_campaign(layout_of(profile, SIZES[profile]), faults, 400, make_core=make_core)
        for make_core in (core_without(), core_without(TakesPartByPart))
    ]
    at_once, part_by_part = ([repr(result) for result in run.results] for run in runs)
    assert at_once == part_by_part
    assert runs[0].core.account == runs[1].core.account


def test_the_oracle_sees_a_single_wrong_strain() -> None:
    """The oracle itself: 20 um/m on one of 30 gauges are found."""
    layout = layout_of("fd64")
    shifted = run_campaign(layout, [], 60, step=Shifted(layout.n_gauges))
    assert len(shifted.false_valid) >= 50


class Shifted(Projection):
    """An estimator that adds 20 um/m to one gauge: what the oracle expects is left alone."""

    def __call__(self, strain: np.ndarray, dynamic_pressure: float, step_size: float) -> StepResult:
        wrong = strain.copy()
        wrong[7] += 20e-6
        return super().__call__(wrong, dynamic_pressure, step_size)
