"""The resource of the native FMU: loads beside the five are a section behind what every map has."""

from __future__ import annotations

import pytest
from further_maps import with_further
from random_map import map_of, random_model
from scaled_maps import whole_scaled_map

from strainfmu.estimator.resource.further_loads import SECTION
from strainfmu.estimator.resource.map_file import native_resource

pytestmark = pytest.mark.fast

VALUES_AT = 128 + 32
"""Header and sizes are those of the whole file."""


@pytest.mark.parametrize("case", [1, 2])
def test_further_loads_leave_the_rest_unchanged(case: int) -> None:
    plain = whole_scaled_map(case, 3)
    before, after = native_resource(plain, "guid"), native_resource(with_further(plain), "guid")
    assert SECTION not in before
    assert after[VALUES_AT : len(before)] == before[VALUES_AT:]
    assert after[len(before) :].startswith(SECTION)


def test_form_absolute_has_no_such_section() -> None:
    plain = map_of(random_model(gamma=0.7, n_gauges=18))
    assert native_resource(with_further(plain), "guid") == native_resource(plain, "guid")
