"""Maps for the native run-time: both cases, few and many gauges."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

# Random maps are those of the tests of the numpy estimator.
sys.path.insert(0, str(Path(__file__).parents[2] / "runtime"))

from raw_fmu import write_resource
from runtime_map import map_of, random_map, random_model

from strainfmu.estimator.inverse_map import InverseMap

MAPS = ("few gauges", "case 1", "case 2", "case 2, gamma 1")


@dataclass(frozen=True)
class NativeCase:
    """A map and the folder of resources that holds it."""

    inverse_map: InverseMap
    resources: Path

    @property
    def n(self) -> int:
        """Number of gauges."""
        return self.inverse_map.n_gauges

    @property
    def uri(self) -> str:
        """The folder as FMI 2.0 has it."""
        return self.resources.as_uri()


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
