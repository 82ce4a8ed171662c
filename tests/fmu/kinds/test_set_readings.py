"""Start values of strains are no readings: FMUs whose inputs a host has not set, or has set to exactly zero."""

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmu_host import COEFFICIENTS, STRAINS, VALID, Host, loaded
from native_case import NativeCase
from random_map import random_map
from raw_fmu import Fmu2, write_resource
from synthetic_vehicle import N_GAUGES, SyntheticFiles

from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import load_inverse_map

pytestmark = pytest.mark.fast

COUNT = "health.valid_gauges"
Q = 9e4


@pytest.fixture(scope="module")
def hosts(fmus: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Iterator[list[Host]]:
    with ExitStack() as stack:
        folder = tmp_path_factory.mktemp("set")
        yield [stack.enter_context(loaded(fmus[kind], folder / kind)) for kind in ("native", "python")]


def begun(host: Host, **values: float) -> Host:
    """``host`` from its start values on, with q_inf."""
    host.fmu.reset()
    host.initialize()
    host.set(["dynamic_pressure", *values], [Q, *values.values()])
    return host


def test_nothing_set_is_invalid(hosts: list[Host]) -> None:
    for host in hosts:
        for pressure in (Q, 0.0):
            begun(host, dynamic_pressure=pressure)
            assert host.health() == HealthState.INVALID
            assert host.integers([COUNT]) == [0]
            assert np.isnan(host.get(COEFFICIENTS)).all()
            host.fmu.doStep(0.0, 0.1)
            assert host.health() == HealthState.INVALID
            assert not host.get(STRAINS).any()  # as the description has it


@pytest.mark.parametrize("kind", ["native", "native_3", "python"])
def test_an_importer_that_ignores_the_names(fmus: dict[str, Path], kind: str) -> None:
    signals = np.array([(0.0, Q), (1.0, Q)], dtype=[("time", float), ("dynamic_pressure", float)])
    result = fmpy.simulate_fmu(str(fmus[kind]), stop_time=0.2, output_interval=0.1, input=signals)
    assert set(result["health.state"].astype(int)) == {int(HealthState.INVALID)}


def test_strains_set_to_zero_in_a_flow_are_invalid(hosts: list[Host]) -> None:
    for host in hosts:
        host = begun(host)
        host.set(STRAINS, [0.0] * N_GAUGES)
        assert host.health() == HealthState.INVALID
        host.set(["zero[1]"], [1e-5])  # the reading counts
        assert host.health() == HealthState.INVALID
        host.set(["dynamic_pressure"], [0.0])
        assert host.health() == HealthState.NO_COEFFICIENTS
        host.set(["dynamic_pressure", STRAINS[3]], [Q, 1e-9])
        assert host.health() != HealthState.INVALID
        host.set_booleans(VALID[3:4], [False])
        assert host.health() == HealthState.INVALID
        host.set_booleans(VALID[3:4], [True])


def test_gauges_that_were_not_set_are_left_out(hosts: list[Host], synthetic: SyntheticFiles) -> None:
    """As Python does without them; each one that is set joins."""
    held = load_inverse_map(synthetic.map_1)
    estimator, strain = Estimator(held), held.mean_strain + 1e-6
    for host in hosts:
        host = begun(host)
        for k, one in enumerate(strain):
            host.set(STRAINS[k : k + 1], [one])
            expected = estimator.estimate(strain, Q, valid=np.arange(N_GAUGES) <= k)
            assert host.health() == expected.health
            assert host.integers([COUNT]) == [k + 1]
            np.testing.assert_allclose(host.get(COEFFICIENTS), expected.coefficients, rtol=1e-9)


def test_states_know_what_was_set(hosts: list[Host]) -> None:
    for host in hosts:
        host = begun(host)
        empty = host.fmu.serializeFMUstate(host.fmu.getFMUstate())
        host.set(STRAINS, (1e-6 * np.arange(1.0, N_GAUGES + 1)).tolist())
        full = host.fmu.serializeFMUstate(host.fmu.getFMUstate())
        found = host.get(COEFFICIENTS)
        for state, count in ((empty, 0), (full, N_GAUGES)):
            host.fmu.setFMUstate(host.fmu.deSerializeFMUstate(state))
            assert host.integers([COUNT]) == [count]
        np.testing.assert_array_equal(host.get(COEFFICIENTS), found)


def test_the_log_names_the_cause(tmp_path: Path) -> None:
    held = random_map()
    case = NativeCase(held, write_resource(held, tmp_path))
    fmu = Fmu2(case.uri, case.n, logging=True).start()
    fmu.step()
    assert fmu.messages[-1][2].endswith("; no strain was set")
    fmu.set_strain(held.mean_strain)
    fmu.step(0.01)
    fmu.set_strain(np.zeros(case.n))
    fmu.step(0.02)
    assert fmu.messages[-1][2].startswith("health INVALID at ")
    assert fmu.messages[-1][2].endswith("; all strains are exactly 0")
    fmu.free()
