"""A filter over time with zeros of unknown errors: constant, considered, others where the zeros are others."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import linear_kinds
import nonlinear_kinds
import numpy as np
import pytest
from test_filter_reference import flight, read, with_zeros, zeros_of

from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.zeros.gauge_zeros import no_zeros

KINDS = {"linear": ("case_2", "scaled_case_2"), "nonlinear": ("surface", "surface")}
SECONDS = 5.0


def case(kind: str) -> tuple[Estimator, dict[str, Any]]:
    """Return a filter of ``kind``, whose zeros have deviations, and the samples of a flight."""
    name, file = KINDS[kind]
    kinds: Any = linear_kinds if kind == "linear" else nonlinear_kinds
    inverse_map, given = kinds.KINDS[name].make(), flight(file, slice(20))
    names = ("dynamic_pressure", "dynamic_pressure_std") if kind == "linear" else nonlinear_kinds.AIR
    zeros = zeros_of(inverse_map, own=1.0, common=2.0)
    samples = {name: given[name] for name in ("valid", "time", *names)}
    samples["strain"] = read(inverse_map, given["strain"], zeros)
    return with_zeros(inverse_map, zeros).filter(SECONDS), samples


def track(estimator: Estimator, samples: dict[str, Any], part: slice) -> Estimate:
    found: Estimate = estimator.track(**{name: values[part] for name, values in samples.items()})
    return found


@pytest.mark.parametrize("kind", KINDS)
def test_memory_holds_them(kind: str) -> None:
    estimator, samples = case(kind)
    whole, zeros = track(estimator, samples, slice(20)), estimator.zeros
    other = estimator.with_zeros(zeros)
    track(other, samples, slice(8))
    again = estimator.with_zeros(zeros)
    again.memory = other.memory
    later = track(again, samples, slice(8, 20))
    np.testing.assert_array_equal(later.loads, whole.loads[8:])
    np.testing.assert_array_equal(later.loads_std, whole.loads_std[8:])


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("change", ["value", "std", "common_std", "none"])
def test_other_zeros_begin_again(kind: str, change: str) -> None:
    estimator, samples = case(kind)
    zeros = estimator.zeros
    if change == "none":
        other = no_zeros(len(zeros.value))
    else:
        other = replace(zeros, **{change: 1.1 * getattr(zeros, change)})
    track(estimator, samples, slice(8))
    after = estimator.with_zeros(other)
    after.memory = estimator.memory
    fresh = estimator.with_zeros(other)
    for one in (slice(8, 9), slice(9, 12)):
        found, expected = track(after, samples, one), track(fresh, samples, one)
        np.testing.assert_array_equal(found.loads, expected.loads)
        np.testing.assert_array_equal(found.loads_std, expected.loads_std)


@pytest.mark.parametrize("kind", KINDS)
def test_exactly_known_zeros_leave_no_trace(kind: str) -> None:
    """The memory of a filter whose zeros had deviations before is that of one whose zeros never had any."""
    estimator, samples = case(kind)
    exact = no_zeros(len(estimator.zeros.value))
    track(estimator, samples, slice(8))
    after, fresh = estimator.with_zeros(exact), estimator.with_zeros(exact)
    after.memory = estimator.memory
    for one in (after, fresh):
        one.restart()
        track(one, samples, slice(8, 12))
    assert after.memory == fresh.memory


def test_an_error_in_common_is_not_averaged() -> None:
    """What all gauges read too much stays an error, however long the flight is, and the filter expects it."""
    estimator, samples = case("nonlinear")
    zeros = replace(estimator.zeros, std=0.0 * estimator.zeros.std, common_std=0.0)
    common = 30.0 * estimator.zeros.std.max()
    wrong = samples | {"strain": samples["strain"] + common}
    offsets = replace(zeros, common_std=common)
    plain, aware = (track(estimator.with_zeros(one), wrong, slice(20)) for one in (zeros, offsets))
    right = track(estimator.with_zeros(zeros), samples, slice(20))
    apart, expected = (np.abs((one.loads - right.loads) / one.loads_std).max() for one in (plain, aware))
    assert apart > 3.0
    assert expected < 3.0
