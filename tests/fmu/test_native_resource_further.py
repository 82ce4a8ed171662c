"""The resource of the native FMU holds the five loads: what a map has beside them leaves it unchanged."""

from __future__ import annotations

import pytest
from further_maps import with_further
from random_map import map_of, random_model
from scaled_maps import whole_scaled_map

from strainfmu.fmu.native_resource import native_resource

pytestmark = pytest.mark.fast


@pytest.mark.parametrize("kind", ["case 1", "case 2", "absolute"])
def test_further_loads_leave_the_resource_unchanged(kind: str) -> None:
    plain = (
        map_of(random_model(gamma=0.7, n_gauges=18)) if kind == "absolute" else whole_scaled_map(int(kind[-1]), 3)
    )
    assert native_resource(with_further(plain), "guid") == native_resource(plain, "guid")
