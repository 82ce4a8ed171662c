"""Each guard of the machine is needed: without it, the oracle of the campaigns finds something wrong."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from can_case import CYCLE, SIZES, Campaign, Projection, layout_of, run_campaign
from can_faults import Fault, FaultKind

from strainfmu.can.frame import Frame
from strainfmu.can.machine import Machine
from strainfmu.can.quality import Cause, FrameClass, Quality
from strainfmu.cosim.estimators.step import StepResult

HUGE = 1e300


def without(**weak: dict[str, Any]) -> Callable[..., Machine]:
    """Return what makes a machine in whose tables ``record``, ``slots`` and ``signals`` have other entries."""

    def made(*given: Any, **stated: Any) -> Machine:
        machine = Machine(*given, **stated)
        tables = {"record": machine.plan.record, "slots": machine.plan._slots, "signals": machine.plan._signals}
        for name, entries in weak.items():
            for entry, value in entries.items():
                tables[name][entry] = value
        return machine

    return made


def run_of(
    kind: FaultKind, make_core: Callable[..., Machine], cycles: int = 12, profile: str = "fd64"
) -> Campaign:
    """Return a run of one fault that begins with cycle 40."""
    faults = [Fault(kind=kind, start=40, cycles=cycles, seed=0)]
    return run_campaign(layout_of(profile, SIZES[profile]), faults, 120 + cycles, make_core=make_core)


def has_false_valid(run: Campaign) -> bool:
    return bool(run.false_valid)


def count(kind: FrameClass) -> Callable[[Campaign], int]:
    return lambda run: run.core.account.classes[kind]


GUARDS: dict[str, tuple[Callable[..., Machine], FaultKind, int, Callable[[Campaign], Any]]] = {
    "configuration": (without(slots={"configuration": -1}), FaultKind.CONFIGURATION, 12, has_false_valid),
    "age": (without(record={"max_age": HUGE}), FaultKind.DELAY, 30, has_false_valid),
    "frozen": (without(record={"stuck": 0}), FaultKind.FREEZE, 12, has_false_valid),
    "partial_freeze": (without(record={"stuck": 0}), FaultKind.PARTIAL_FREEZE, 12, has_false_valid),
    "stuck": (without(record={"stuck": 0}), FaultKind.STUCK_GAUGE, 60, has_false_valid),
    "range": (
        without(
            record={"sensor_range": HUGE, "rate_limit": HUGE},
            signals={"has_ends": 0, "low": -HUGE, "high": HUGE},
        ),
        FaultKind.OUT_OF_RANGE,
        12,
        has_false_valid,
    ),
    "rate": (without(record={"rate_limit": HUGE}), FaultKind.JUMP, 12, has_false_valid),
    "sender_status": (without(slots={"status": -1}), FaultKind.SENDER_STATUS, 12, has_false_valid),
    "pressure_age": (without(signals={"max_age": HUGE}), FaultKind.PRESSURE_SILENCE, 30, has_false_valid),
    "babbling": (
        without(record={"burst": 1e9}, slots={"rate": 1e9}),
        FaultKind.BABBLING,
        12,
        lambda run: count(FrameClass.CORRUPT)(run) > 1000,
    ),
    "silence": (
        without(record={"timeout": 1e9}),
        FaultKind.SILENCE,
        12,
        lambda run: run.qualities[Quality.STALE] == 0,
    ),
}
"""For every guard: a machine without it, a fault, how long it lasts, and what is wrong."""


@pytest.mark.parametrize("guard", GUARDS)
def test_every_guard_is_needed(guard: str) -> None:
    weak, kind, cycles, is_wrong = GUARDS[guard]
    assert not is_wrong(run_of(kind, Machine, cycles))
    assert is_wrong(run_of(kind, weak, cycles))


@pytest.mark.parametrize("kind", [FaultKind.FORGERY, FaultKind.EARLIER_RUN])
def test_the_authenticator_is_needed(kind: FaultKind) -> None:
    weak = without(slots={"is_secured": 0})
    assert not has_false_valid(run_of(kind, Machine, profile="fd64-sec"))
    if kind is FaultKind.FORGERY:
        assert has_false_valid(run_of(kind, weak, profile="fd64-sec"))


def test_a_code_for_no_value_inside_the_range_is_needed() -> None:
    """A layout whose "not available" lies among the strains: only its code distinguishes it."""
    layout, marker = layout_of("fd64"), 1500

    def marked(frame: Any) -> Any:
        signals = tuple(
            replace(s, not_available=marker) if s.not_available is not None else s for s in frame.layout.signals
        )
        return replace(frame, layout=replace(frame.layout, signals=signals))

    layout = replace(layout, strain_frames=tuple(map(marked, layout.strain_frames)))
    faults = [Fault(kind=FaultKind.NO_VALUE, start=40, cycles=12, seed=1)]
    assert not run_campaign(layout, faults, 80).false_valid
    assert run_campaign(layout, faults, 80, make_core=without(signals={"n_codes": 0})).false_valid


def test_held_back_cycles_are_stale_and_live_ones_are_trusted_at_once() -> None:
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

    run = run_campaign(replace(timed, state=None, strain_frames=frames), [], 160, change=gateway)
    at_once = [result.quality for result in run.results if 1.1 <= result.arrival < 1.105]
    assert Quality.STALE in at_once
    assert not any(quality.has_coefficients for quality in at_once)
    later = [result for result in run.results if result.arrival > 1.155]
    assert all(result.quality is Quality.VALID for result in later)
    assert len(later) >= 43
    assert not run.false_valid


class Shifted(Projection):
    """An estimator that adds 20 um/m to one gauge: what the oracle expects is left alone."""

    def __call__(self, strain: np.ndarray, dynamic_pressure: float, step_size: float) -> StepResult:
        wrong = strain.copy()
        wrong[7] += 20e-6
        return super().__call__(wrong, dynamic_pressure, step_size)


def test_the_oracle_sees_a_single_wrong_strain() -> None:
    """The oracle itself: 20 um/m on one of 30 gauges are found."""
    layout = layout_of("fd64")
    shifted = run_campaign(layout, [], 60, step=Shifted(layout.n_gauges))
    assert len(shifted.false_valid) >= 50


def test_an_estimate_that_is_not_finite_is_invalid() -> None:
    class Sick(Projection):
        def __call__(self, strain: np.ndarray, dynamic_pressure: float, step_size: float) -> StepResult:
            good = super().__call__(strain, dynamic_pressure, step_size)
            return replace(good, coefficients=good.coefficients + np.nan)

    run = run_campaign(layout_of("fd64", 4), [], 30, step=Sick(4))
    assert {result.quality for result in run.results[3:]} == {Quality.INVALID}
    assert all(result.causes & Cause.STEP_FAILED for result in run.results[3:])
