"""Navigation of the nonlinear estimator: what is not given, what cannot be, and deviations that are none."""

from collections.abc import Iterator
from contextlib import suppress

import numpy as np
import pytest
from flight_fmu import N_D, random_flight, whole_map
from fmpy.fmi1 import FMICallException
from fmu_host import COEFFICIENTS, OPTIONS, Host, loaded

from strainfmu.estimator.air_inputs import QSource
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import save_inverse_map
from strainfmu.fmu.export import export_estimator

pytestmark = pytest.mark.fast

STRAINS = [f"strain[{i + 1}]" for i in range(N_D)]


@pytest.fixture(scope="module", params=["native", "python"])
def host(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Host]:
    folder = tmp_path_factory.mktemp("flight")
    save_inverse_map(whole_map(), folder / "map.h5")
    export_estimator(folder / "map.h5", folder / "flight.fmu", OPTIONS[request.param])
    with loaded(folder / "flight.fmu", folder / "unzipped") as one:
        yield one


def stepped(host: Host, strain: np.ndarray, flow: dict[str, float]) -> None:
    """A first step."""
    host.fmu.reset()
    host.initialize()
    host.set(STRAINS, strain)
    host.set(list(flow), list(flow.values()))
    host.set_integers(["q_source"], [QSource.INDEPENDENT])
    host.fmu.doStep(0.0, 0.01)


def test_the_source_of_the_dynamic_pressure_is_an_enumeration(host: Host) -> None:
    """Computed from Mach number and static pressure it is no measurement, which is used no more."""
    sample, used = random_flight(whole_map(), 1, seed=5)[0], host.references["navigation_used.dynamic_pressure"]
    for source in QSource:
        stepped(host, sample.strain, sample.flow)
        host.set_integers(["q_source"], [source])
        assert host.integers(["q_source"]) == [source]
        assert host.fmu.getBoolean([used]) == [source == QSource.INDEPENDENT]
    for wrong in (-1, len(QSource)):
        with suppress(FMICallException):  # PythonFMU lets no slave refuse a value
            host.set_integers(["q_source"], [wrong])
        assert host.integers(["q_source"]) == [QSource.MACH_AND_ALTITUDE]
    with suppress(FMICallException):
        host.set(["q_source"], [0.0])
    assert host.integers(["q_source"]) == [QSource.MACH_AND_ALTITUDE]


def test_a_deviation_that_is_not_given_is_the_map_s(host: Host) -> None:
    """0, which hosts fill in, below, or NaN; with an infinite one its value counts as not known."""
    sample = random_flight(whole_map(), 1, seed=5)[0]
    outputs = ["C_A", "sigma.C_A", "air_data.mach_number", "sigma.air_data.mach_number", "health.chi_square"]

    def found(name: str, deviation: float) -> list[float]:
        stepped(host, sample.strain, sample.flow | {f"{name}_std": deviation})
        return [*host.get(outputs), *host.fmu.getBoolean([host.references[f"navigation_used.{name}"]])]

    for name in sample.flow:
        own, unknown = found(name, np.nan), found(name, np.inf)
        assert own[-1]
        assert not unknown[-1]
        assert np.isfinite([*own, *unknown]).all()
        assert [found(name, value) for value in (0.0, -1.0, -np.inf)] == [own, own, own]


SAMPLE = random_flight(whole_map(), 1, seed=5)[0]
UNKNOWN: dict[str, dict[str, float]] = {name: {name: np.nan} for name in SAMPLE.flow}
CHANGES = {f"{name} {value}": {name: value} for name in SAMPLE.flow for value in (0.0, -6.0, np.inf)} | {
    f"altitude {value}": {"static_pressure": 0.0, "altitude": value} for value in (np.nan, 0.0, 72e3)
}
"""The last one is above the atmosphere."""


def check(found: dict[str, tuple[object, ...]]) -> None:
    """What is not given, 0, below or NaN, costs sigma alone; what is impossible is a fault, with the loads
    without it."""
    for name, change in CHANGES.items():
        given = any(value > 0.0 for value in change.values())
        as_without = found["static_pressure" if "altitude" in change else next(iter(change))]
        assert as_without[0] == "OK"
        assert found[name] == (("DEGRADED", *as_without[1:]) if given else as_without), name


def test_navigation_that_is_not_given_or_impossible(host: Host) -> None:
    found: dict[str, tuple[object, ...]] = {}
    for name, change in (UNKNOWN | CHANGES).items():
        stepped(host, SAMPLE.strain, SAMPLE.flow | change)
        found[name] = (HealthState(host.health()).name, *host.get(COEFFICIENTS))
    check(found)


def test_navigation_that_is_not_given_or_impossible_in_python() -> None:
    estimator, found = Estimator(whole_map()), dict[str, tuple[object, ...]]()
    for name, change in (UNKNOWN | CHANGES).items():
        one = estimator.step(SAMPLE.strain, **(SAMPLE.flow | change), q_source=1.0)
        found[name] = (one.health.name, *one.coefficients)
    check(found)
