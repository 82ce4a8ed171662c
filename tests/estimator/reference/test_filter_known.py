"""A filter over time with flow parameters that are known: memory, what is lost and found, what it says."""

from __future__ import annotations

import nonlinear_kinds
import numpy as np
import pytest
from test_filter_reference import Deflected, deflected_flight

from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import InverseMap

N = 16


@pytest.fixture(scope="module")
def inverse_map() -> InverseMap:
    return nonlinear_kinds.KINDS["parameters"].make()


@pytest.fixture
def given(inverse_map: InverseMap) -> Deflected:
    return deflected_flight(inverse_map, N, seed=3)


def test_memory_holds_what_was_known(inverse_map: InverseMap, given: Deflected) -> None:
    estimator = Estimator(inverse_map).filter(5.0)
    whole = given.track(estimator)
    first, second = Estimator(inverse_map).filter(5.0), Estimator(inverse_map).filter(5.0)
    given.track(first, slice(6))
    second.memory = first.memory
    later = given.track(second, slice(6, N))
    np.testing.assert_array_equal(later.loads, whole.loads[6:])
    np.testing.assert_array_equal(later.other_loads_std, whole.other_loads_std[6:])


@pytest.mark.parametrize("change", ["deviation", "lost", "all lost", "found"])
def test_other_knowledge_begins_again(inverse_map: InverseMap, given: Deflected, change: str) -> None:
    part = slice(8) if change == "found" else slice(8, N)
    if change == "deviation":
        given.std[part, 0] *= 1.5
    elif change == "lost":
        given.value[part, 0] = np.nan
    else:
        given.value[part] = np.nan
    after, fresh = Estimator(inverse_map).filter(5.0), Estimator(inverse_map).filter(5.0)
    found, expected = given.track(after), given.track(fresh, slice(8, N))
    np.testing.assert_array_equal(found.loads[8:], expected.loads)
    np.testing.assert_array_equal(found.loads_std[8:], expected.loads_std)


def test_a_value_that_moves_goes_on(inverse_map: InverseMap, given: Deflected) -> None:
    estimator = Estimator(inverse_map)
    each, filtered = (given.track(one) for one in (estimator, estimator.filter(5.0)))
    smaller = filtered.loads_std[4:, 1:] / each.loads_std[4:, 1:]
    assert smaller.max() < 0.95


def test_a_value_of_any_deviation_is_none(inverse_map: InverseMap, given: Deflected) -> None:
    """The less a value is known, the less it says; in the end as little as none."""
    std = []
    for factor in (1.0, 1e2, 1e9, np.nan):
        one = Deflected(samples=given.samples, value=given.value, std=given.std * factor)
        std.append(one.track(Estimator(inverse_map).filter(5.0)).other_loads_std[4:])
    assert np.all(std[0] <= std[1])
    np.testing.assert_allclose(std[2], std[3], rtol=1e-2)
