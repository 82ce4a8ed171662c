"""Maps for the native run-time: both cases, few and many gauges."""

from __future__ import annotations

import pytest
from native_case import NativeCase
from random_map import map_of, random_map, random_model
from raw_fmu import write_resource

from strainfmu.estimator.inverse_map import InverseMap

MAPS = ("few gauges", "case 1", "case 2", "case 2, gamma 1")


def make_map(name: str) -> InverseMap:
    """One of :data:`MAPS`."""
    if name == "few gauges":
        return random_map()
    gamma, n_gauges, n_states = {
        "case 1": (0.0, 54, 5),
        "case 2": (1e-2, 54, 30),
        "case 2, gamma 1": (1.0, 27, 40),
    }[name]
    return map_of(random_model(gamma, n_gauges=n_gauges, n_states=n_states))


@pytest.fixture(scope="session")
def cases(tmp_path_factory: pytest.TempPathFactory) -> dict[str, NativeCase]:
    """Every map of :data:`MAPS` with its resources."""
    made = {name: make_map(name) for name in MAPS}
    return {
        name: NativeCase(one, write_resource(one, tmp_path_factory.mktemp("native"))) for name, one in made.items()
    }


@pytest.fixture(params=MAPS)
def case(request: pytest.FixtureRequest, cases: dict[str, NativeCase]) -> NativeCase:
    """Each of :data:`MAPS` in turn."""
    return cases[request.param]


@pytest.fixture
def small(cases: dict[str, NativeCase]) -> NativeCase:
    """The smallest map."""
    return cases["few gauges"]
