"""Mach number and altitude from the bus: what reaches the estimator is right or not known, whatever happens."""

from collections.abc import Callable
from dataclasses import replace
from math import isnan, nan

import numpy as np
import pytest
from can_case import CYCLE, OWN, Ears, Projection, Truth, layout_of
from can_faults import Fault, FaultKind
from fault_injection import FaultySender

from strainfmu.can.frame_layout import ALTITUDE, MACH_NUMBER, InputLayout
from strainfmu.can.machine import Machine, Result
from strainfmu.can.options import BridgeSettings
from strainfmu.can.profiles import PROFILES
from strainfmu.can.quality import Cause, Quality
from strainfmu.cosim.estimators.step import ENVELOPE_SCORE, StepResult
from strainfmu.errors import InputError
from strainfmu.estimator.health import HealthState

pytestmark = pytest.mark.fast

N = 4
SETTINGS = BridgeSettings()


def mach_number(cycle: int) -> float:
    """Return a Mach number that no other cycle of the run has."""
    return 3.0 + 0.004 * cycle


def altitude(cycle: int) -> float:
    return 12e3 + 20.0 * cycle


class Navigated(Projection):
    """An estimator that takes navigation and keeps what it was given."""

    other_inputs = (MACH_NUMBER, ALTITUDE)

    def __init__(self, n_gauges: int) -> None:
        super().__init__(n_gauges)
        self.given: list[tuple[float, float]] = []

    def __call__(  # type: ignore[override]  # a step of further inputs
        self, strain: np.ndarray, dynamic_pressure: float, step_size: float, *, mach_number: float, altitude: float
    ) -> StepResult:
        self.given.append((mach_number, altitude))
        return replace(super().__call__(strain, dynamic_pressure, step_size), other_outputs={ENVELOPE_SCORE: 1.25})


def fly(
    layout: InputLayout,
    step: Projection,
    n_cycles: int,
    *faults: Fault,
    known: Callable[[int], bool] = lambda _: True,
) -> list[Result]:
    """Send cycles with navigation where it is ``known``; return all results."""
    core = Machine(layout, step, SETTINGS, start=0.0, own=[OWN.key])
    sender, truth, results = FaultySender(layout, list(faults), OWN), Truth(N, 1), list[Result]()
    ears = Ears(sender)
    for k in range(n_cycles):
        frames = sender.cycle(
            k,
            k * CYCLE,
            *truth.cycle(k),
            mach_number=mach_number(k) if known(k) else nan,
            altitude=altitude(k) if known(k) else nan,
        )
        for frame in frames:
            results += ears.hear(core.receive(frame))
        results += ears.hear(core.advance((k + 0.99) * CYCLE))
    core.finish(n_cycles * CYCLE)
    assert core.account.unaccounted == 0
    return results


def wrong(results: list[Result]) -> list[str]:
    """Return results whose navigation is that of no cycle young enough; half a bit of 0.001 and 2 m is allowed."""
    found = []
    for result in results:
        last = int(result.time / CYCLE + 1e-9)
        oldest = max(int((result.time - (SETTINGS.navigation_max_age + 1.5) * CYCLE) / CYCLE), 0)
        cycles = range(oldest, last + 1)
        for value, of, close in ((result.mach_number, mach_number, 5.1e-4), (result.altitude, altitude, 1.01)):
            if not isnan(value) and min(abs(value - of(k)) for k in cycles) > close:
                found.append(f"{of.__name__} {value:g} at {result.time:.4f} s")
    return found


@pytest.mark.parametrize("profile", PROFILES)
def test_navigation_reaches_an_estimator_that_takes_it(profile: str) -> None:
    step = Navigated(N)
    results = fly(layout_of(profile, N), step, 40)
    assert results[-1].quality is Quality.VALID
    assert step.given[-1] == (results[-1].mach_number, results[-1].altitude)
    assert results[-1].mach_number == pytest.approx(mach_number(39), abs=5.1e-4)
    assert results[-1].altitude == pytest.approx(altitude(39), abs=1.01)
    assert results[-1].envelope_score == 1.25
    # Three cycles until the frame is trusted, as of all others.
    assert sum(isnan(mach) for mach, _ in step.given) <= 1
    assert not any(result.causes & Cause.NAVIGATION for result in results)


@pytest.mark.parametrize("profile", PROFILES)
def test_an_estimator_without_navigation_is_stepped_as_before(profile: str) -> None:
    results = fly(layout_of(profile, N), Projection(N), 40)
    assert [result.quality for result in results[3:]] == [Quality.VALID] * 37
    assert isnan(results[-1].envelope_score)


OF_FRAMES = (
    FaultKind.LOSS,
    FaultKind.CORRUPTION,
    FaultKind.SEQUENCE,
    FaultKind.NAVIGATION_SILENCE,
    FaultKind.RESTART,
)


@pytest.mark.parametrize(
    ("kind", "profile"),
    [*((kind, "fd64") for kind in FaultKind), *((kind, "classic-le") for kind in OF_FRAMES)],
)
def test_under_every_fault_navigation_is_right_or_not_known(kind: FaultKind, profile: str) -> None:
    faults = [Fault(kind=kind, start=20, cycles=1, seed=3), Fault(kind=kind, start=40, cycles=25, seed=8)]
    step = Navigated(N)
    results = fly(layout_of(profile, N), step, 100, *faults)
    assert wrong(results) == []
    assert not isnan(results[-1].mach_number)


def test_navigation_times_out_by_itself() -> None:
    """Silence of 30 cycles: held for 10, then not known with its cause; the quality of the strains stays."""
    fault = Fault(kind=FaultKind.NAVIGATION_SILENCE, start=30, cycles=30)
    results = fly(layout_of("fd64", N), Navigated(N), 80, fault)
    unknown = [k for k, result in enumerate(results) if k >= 4 and isnan(result.mach_number)]
    # 10 cycles after the last of cycle 29; the first frame behind the gap is out of sequence.
    assert unknown == list(range(39, 61))
    assert all(isnan(results[k].altitude) and results[k].causes == Cause.NAVIGATION for k in unknown)
    assert all(result.quality is Quality.VALID for result in results[3:])
    assert not results[70].causes


def test_navigation_that_is_not_available_any_more_is_not_known_at_once() -> None:
    results = fly(layout_of("fd64", N), Navigated(N), 60, known=lambda k: k < 30 or k >= 50)
    assert [k for k, result in enumerate(results) if k >= 4 and isnan(result.mach_number)] == list(range(30, 50))
    assert results[30].causes == Cause.NAVIGATION


def test_a_sender_without_navigation_sends_no_frame_of_it_and_lacks_nothing() -> None:
    results = fly(layout_of("fd64", N), Navigated(N), 40, known=lambda _: False)
    assert all(result.quality is Quality.VALID and not result.causes for result in results[3:])
    assert all(isnan(result.mach_number) for result in results)


@pytest.mark.parametrize(
    ("health", "quality"),
    [
        (HealthState.OK, Quality.VALID),
        (HealthState.DEGRADED, Quality.DEGRADED),
        (HealthState.INCONSISTENT, Quality.SUSPECT),
        (HealthState.SUSPECT, Quality.SUSPECT),
        (HealthState.OUTSIDE, Quality.SUSPECT),
        (HealthState.NO_COEFFICIENTS, Quality.INVALID),
        (HealthState.INVALID, Quality.INVALID),
        (HealthState.UNIDENTIFIED, Quality.INVALID),
    ],
)
def test_every_state_of_health_has_its_quality(health: HealthState, quality: Quality) -> None:
    step = Navigated(N)
    step.health = health
    last = fly(layout_of("fd64", N), step, 10)[-1]
    assert (last.quality, bool(last.causes & Cause.HEALTH)) == (quality, health is not HealthState.OK)
    assert np.isfinite(last.coefficients).all() == quality.has_coefficients


@pytest.mark.parametrize("pressure", [0.0, -1.0, nan, 1.001e7, 9e9])
def test_an_absurd_fixed_dynamic_pressure_is_refused(pressure: float) -> None:
    with pytest.raises(InputError, match=r"dynamic pressure: expected a positive number up to 1e\+07 Pa, got "):
        Machine(layout_of("fd64", N), Projection(N), SETTINGS, start=0.0, dynamic_pressure=pressure)
