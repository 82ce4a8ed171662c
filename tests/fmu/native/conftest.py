"""Maps for the native run-time: both cases, few and many gauges."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from flight_fmu import N_D, FlightFmu, whole_map
from native_case import NativeCase
from random_map import map_of, random_map, random_model
from raw_fmu import write_resource
from scaled_maps import whole_scaled_map, with_envelope

from strainfmu.estimator.map.inverse_map import InverseMap

SCALED = ("scaled, few gauges", "scaled, case 1", "scaled, case 2")
"""In form "dynamic_pressure"."""

MAPS = ("few gauges", "case 1", "case 2", "case 2, gamma 1", "envelope", *SCALED)


def make_map(name: str) -> InverseMap:
    """One of :data:`MAPS`."""
    if name == "few gauges":
        return random_map()
    if name == "envelope":
        wide = {
            name: value for name, value in with_envelope(n=21, size=0.02).items() if not name.endswith("error")
        }
        return replace(random_map(2), **wide)
    if name in SCALED:
        n_gauges, case, n_states = {SCALED[0]: (9, 1, 3), SCALED[1]: (54, 1, 5), SCALED[2]: (27, 2, 40)}[name]
        return whole_scaled_map(case, seed=4, n=n_gauges, n_states=n_states)
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


@pytest.fixture(params=SCALED)
def scaled(request: pytest.FixtureRequest, cases: dict[str, NativeCase]) -> NativeCase:
    """Each map in form "dynamic_pressure" in turn."""
    return cases[request.param]


@pytest.fixture
def small(cases: dict[str, NativeCase]) -> NativeCase:
    """The smallest map."""
    return cases["few gauges"]


@pytest.fixture(scope="module")
def inverse_map() -> InverseMap:
    """The map of ``fmu``: both estimators; a module may have another one."""
    return whole_map()


@pytest.fixture(scope="module")
def resources(inverse_map: InverseMap, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of resources of ``inverse_map``."""
    return write_resource(inverse_map, tmp_path_factory.mktemp("flight"))


@pytest.fixture
def fmu(resources: Path) -> Iterator[FlightFmu]:
    """A started instance with the map ``inverse_map``."""
    one = FlightFmu(resources.as_uri(), N_D)
    one.start()
    yield one
    one.free()
