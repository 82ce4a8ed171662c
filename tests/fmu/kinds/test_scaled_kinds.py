"""Maps in form "dynamic_pressure" in FMUs of every kind: what they state of themselves, and the same numbers."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from fmpy import read_model_description, simulate_fmu
from fmpy.validation import validate_fmu
from fmu_host import OPTIONS, Host, loaded
from scaled_maps import NOMINAL, whole_scaled_map

from strainfmu.estimator.health import HealthState
from strainfmu.estimator.linear.estimator import Estimator
from strainfmu.estimator.map.inverse_map import InverseMap, save_inverse_map
from strainfmu.estimator.zeros.gauge_zeros import GaugeZeros
from strainfmu.fmu.export import export_estimator
from strainfmu.interface.estimator_variables import FLOW_INPUTS, output_values
from strainfmu.interface.zero_variables import zero_names

pytestmark = pytest.mark.fast

N = 9
INTEGERS = ("health.state", "health.valid_gauges", "health.suspect_gauge", "health.suspects")


class Kinds(NamedTuple):
    """A map, its FMUs by kind, and the two of FMI 2.0 loaded."""

    inverse_map: InverseMap
    paths: dict[str, Path]
    hosts: dict[str, Host]


@pytest.fixture(scope="module")
def kinds(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Kinds]:
    folder, inverse_map = tmp_path_factory.mktemp("scaled"), whole_scaled_map(1, seed=3, n=N, n_states=3)
    save_inverse_map(inverse_map, folder / "map.h5")
    paths = {kind: folder / f"{kind}.fmu" for kind in OPTIONS}
    for kind, options in OPTIONS.items():
        export_estimator(folder / "map.h5", paths[kind], options)
    with ExitStack() as stack:
        names = ("native", "python")
        hosts = {name: stack.enter_context(loaded(paths[name], folder / name)) for name in names}
        for host in hosts.values():
            host.initialize()
        yield Kinds(inverse_map, paths, hosts)


def test_both_kinds_give_what_numpy_does(kinds: Kinds) -> None:
    random, estimator, seen = np.random.default_rng(1), Estimator(kinds.inverse_map), set()
    outputs = list(kinds.hosts["native"].references)[:27]
    reals = [name for name in outputs if name not in INTEGERS]
    for k in range(120):
        q = float(random.choice([NOMINAL, 5e4, 5e5, 9e5, np.nan], p=[0.4, 0.2, 0.2, 0.1, 0.1]))
        ratio = 1.0 if np.isnan(q) else q / NOMINAL
        error = kinds.inverse_map.error_strain
        assert error is not None
        strain = ratio * (kinds.inverse_map.mean_strain + 0.5 * error @ random.normal(size=error.shape[1]))
        valid = random.uniform(size=N) > 0.1 * (k % 3)
        flow = [q, *random.choice([0.0, -1.0, np.nan], size=3)]
        if k % 4 == 0:
            flow[1:] = [0.02 * ratio * NOMINAL, float(random.choice([6.0, 8.0])), 2e4]
        q_std, mach_number, altitude = flow[1:]
        q_std = q_std if q_std > 0.0 else np.nan
        expected = estimator.step(strain, q, valid, q_std, mach_number=mach_number, altitude=altitude)
        values = dict(zip(outputs, output_values(expected), strict=True))
        seen.add(expected.health)
        for kind, host in kinds.hosts.items():
            host.set([*(f"strain[{i + 1}]" for i in range(N)), *FLOW_INPUTS], [*strain, *flow])
            host.set_booleans([f"valid[{i + 1}]" for i in range(N)], valid.tolist())
            tolerance = 0.0 if kind == "python" else 1e-11
            np.testing.assert_allclose(
                host.get(reals), [values[name] for name in reals], rtol=tolerance, atol=tolerance
            )
            assert host.integers(INTEGERS) == [values[name] for name in INTEGERS]
    assert {HealthState.OK, HealthState.DEGRADED, HealthState.OUTSIDE, HealthState.NO_COEFFICIENTS} <= seen


def test_both_kinds_take_zeros_off_as_numpy_does(kinds: Kinds) -> None:
    random, estimator = np.random.default_rng(3), Estimator(kinds.inverse_map)
    names = [f"strain[{i + 1}]" for i in range(N)]
    for size in (1e-7, 2e-6, 0.0):
        zeros = GaugeZeros(value=2e-4 * random.normal(size=N), std=size * random.uniform(size=N), common_std=size)
        strain = kinds.inverse_map.mean_strain + 1e-6 * random.normal(size=N)
        expected = output_values(estimator.with_zeros(zeros).step(strain + zeros.value, NOMINAL))
        for kind, host in kinds.hosts.items():
            host.set_booleans([f"valid[{i + 1}]" for i in range(N)], [True] * N)
            host.set([*names, *FLOW_INPUTS], [*(strain + zeros.value), NOMINAL, 0.0, 0.0, 0.0])
            host.set(zero_names(N), [*zeros.value, *zeros.std, zeros.common_std])
            found = host.get(list(host.references)[:20])
            np.testing.assert_allclose(found, expected[:20], rtol=0.0 if kind == "python" else 1e-11)
            host.set(zero_names(N), [0.0] * (2 * N + 1))


@pytest.mark.parametrize("kind", OPTIONS)
def test_loads_depend_on_the_dynamic_pressure(kinds: Kinds, kind: str) -> None:
    description = read_model_description(str(kinds.paths[kind]))
    known = {u.variable.name: {v.name for v in u.dependencies} for u in description.outputs}
    first = {u.variable.name: {v.name for v in u.dependencies} for u in description.initialUnknowns}
    load = "force" if kind == "native_3" else "force.normal"
    for name in (load, f"sigma.{load}", "health.chi_square", "health.chi_square_limit", "health.suspects"):
        assert {"dynamic_pressure", "dynamic_pressure_std"} <= known[name] & first[name]
        assert not {"mach_number", "altitude"} & known[name]
    assert {"mach_number", "altitude"} <= known["health.state"]
    assert not {"dynamic_pressure"} & known["health.valid_gauges"]


@pytest.mark.parametrize("kind", OPTIONS)
def test_fmpy_finds_no_fault_and_simulates(kinds: Kinds, kind: str) -> None:
    assert validate_fmu(str(kinds.paths[kind])) == []
    strain = kinds.inverse_map.mean_strain
    scalars = {f"strain[{i}]": one for i, one in enumerate(strain, start=1)}
    start = {"strain": strain} if kind == "native_3" else scalars
    result = simulate_fmu(str(kinds.paths[kind]), stop_time=0.2, output_interval=0.1, start_values=start)
    assert np.isfinite(result["health.envelope_score"]).all()
