"""How a planned test is run: the order of its cases, their steps, the time, and what stays as it was."""

import numpy as np
import pytest

from builder.calibration.ground_test.candidate_cases import PlannedCase
from builder.calibration.plan.load_plan import (
    KindSigmas,
    LoadPlan,
    Schedule,
    established,
    kind_sigmas,
    run_order,
    undetermined,
    whole_time,
)
from builder.structure.as_built.as_built_vehicle import Counts, parameter_names
from builder.structure.loads.applied import PadPressure, Weight
from strainfmu.estimator.signal_names import ZERO

pytestmark = pytest.mark.fast

PAD = PadPressure(station=1.0, roll_angle=0.0, half_length=0.05, half_angle=0.5, push=100.0)


def plan(attitudes: int) -> LoadPlan:
    cases = tuple(PlannedCase(name=name, loads=(Weight(), PAD)) for name in ("a", "b", "a (2)"))
    return LoadPlan(
        attitudes=tuple(PlannedCase(name=f"attitude {k}", loads=(Weight(),)) for k in range(attitudes)),
        cases=cases,
        sigmas=np.ones((3, 5)),
        before=np.ones(5),
        after_attitudes=np.ones(5),
        exact=np.ones(5),
        candidates=8,
        repeats=1,
        checks=(PlannedCase(name="c", loads=(Weight(), PAD)),),
        kinds=(),
        noise_std=np.ones(3),
        samples=25,
    )


@pytest.mark.parametrize("attitudes", [0, 2])
def test_zero_readings_stand_between_and_at_the_end(attitudes: int) -> None:
    order = run_order(plan(attitudes))
    first = [f"attitude {k}" for k in range(attitudes)] or ["no load"]
    again = [f"{first[0]}, between", f"{first[0]}, at the end"]
    assert [one.case.name for one in order] == [*first, "a", "b", again[0], "a (2)", "check, c", again[1]]
    kinds = ["load", "load", "zero reading", "repeat", "check", "zero reading"]
    assert [one.kind for one in order][len(first) :] == kinds


def test_time_is_of_set_ups_and_readings() -> None:
    """Two attitudes and four loads are set up; loads have seven readings, attitudes and zeros one."""
    schedule = Schedule(steps=3, setup_time=600.0, reading_time=30.0)
    steps = schedule.steps_of(plan(2).cases[0])
    assert [part for part, _ in steps] == pytest.approx(
        [0.0, 1.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0, 1.0 / 3.0, 0.0], abs=1e-4
    )
    assert [unloading for _, unloading in steps] == [False] * 3 + [True] * 3
    assert whole_time(plan(2), schedule) == 6 * 600.0 + (2 + 2 + 4 * 7) * 30.0
    assert Schedule(steps=1).steps_of(plan(2).cases[0]) == [(0.0, False), (0.0, True)]


def test_kinds_are_established_or_stay_as_they_were() -> None:
    """A gauge that was left out does not count for the kinds of gauges."""
    counts = Counts(gauge=2)
    names = parameter_names(("g", "h"), counts)
    before = np.array([1e-2 if name.startswith(("gauge gain", "gauge_gain", "mass")) else 0.0 for name in names])
    after = before.copy()
    after[int(np.flatnonzero(before)[0])] = 1e-3
    both, one = (kind_sigmas(counts, before, after, used) for used in (None, np.array([True, False])))
    assert established(both) == ""
    assert established(one) == "of the vehicle, 1 sigma (before the test): gauge gain 0.1 % (1 %)"
    assert undetermined(one) == "as uncertain as before the test: mass (1 %)"
    assert KindSigmas(kind=ZERO, before=2e-3, after=5e-8).size(2e-3) == "2000 um/m"
