"""The same numbers from every kind: the estimator in Python, native FMU of FMI 2.0 and 3.0, Python FMU."""

import csv
import zipfile
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmu_host import STRAINS, VALID, Host, loaded
from synthetic_vehicle import N_GAUGES, SyntheticFiles

from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import load_inverse_map
from strainfmu.estimator.settings import default_settings
from strainfmu.fmu.reference_run.run import N_ROWS
from strainfmu.interface.estimator_variables import (
    FLOW_INPUTS,
    PARAMETERS,
    output_values,
)
from strainfmu.interface.input_names import given_flow

pytestmark = pytest.mark.fast

FLOW = list(FLOW_INPUTS)
INTEGERS = ("health.state", "health.valid_gauges", "health.suspect_gauge", "health.suspects")


class Hosts:
    """Both maps' estimators and the FMUs of map 1, all in this process at once."""

    def __init__(self, files: SyntheticFiles, native: Host, python: Host, other: Host) -> None:
        self.estimator = Estimator(load_inverse_map(files.map_1))
        self.native, self.python, self.other = native, python, other


@pytest.fixture(scope="module")
def hosts(
    synthetic: SyntheticFiles, fmus: dict[str, Path], tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Hosts]:
    with ExitStack() as stack:
        folder = tmp_path_factory.mktemp("hosts")
        opened = [stack.enter_context(loaded(fmus[n], folder / n)) for n in ("native", "python", "native_2")]
        for host in opened:
            host.initialize()
        yield Hosts(synthetic, *opened)


def outputs_of(host: Host) -> np.ndarray:
    """(27,) outputs in the order of value references; golden streams compare those behind all inputs."""
    names = list(host.references)[:27]
    values = np.empty(27)
    is_integer = np.isin(names, INTEGERS)
    values[~is_integer] = host.get([name for name in names if name not in INTEGERS])
    values[is_integer] = host.integers(INTEGERS)
    return values


def test_native_and_python_kind_equal_the_estimator(hosts: Hosts) -> None:
    """Strains, masks, flow and settings at random, such among them that cannot be: equal bits."""
    random, default = np.random.default_rng(4), default_settings(hosts.estimator.inverse_map)
    broken = [np.nan, np.inf, -np.inf, 0.05, -0.051, 1e308, 1e-3]
    choices = {
        "sensor_range": [0.05, 1e-4],
        "alarm_scale": [1.0, 4.0, 1e3],
        "reference_area": [0.2, 3.0],
        "reference_length": [0.5, 1.5],
        "moment_station": [0.0, -1.25, 2.0],
    }
    of_flow = (
        [9e4, 1e3, 1e7, 1.1e7, 0.0, -1.0, np.nan, np.inf],
        [0.0, 1e-3, 1e3, -1.0, np.nan, np.inf],
        [np.nan, 0.0, 6.0, 4.0, -1.0],
        [np.nan, 0.0, 2e4, 1e5, -1.0],
    )
    for _ in range(100):
        strain = np.where(
            random.random(N_GAUGES) < 0.2, random.choice(broken, N_GAUGES), random.uniform(-1e-5, 1e-5, N_GAUGES)
        )
        valid, flow = random.random(N_GAUGES) < 0.8, [float(random.choice(values)) for values in of_flow]
        chosen = replace(default, **{name: float(random.choice(values)) for name, values in choices.items()})
        known = given_flow(dict(zip(FLOW, flow, strict=True)))
        expected = output_values(hosts.estimator.with_settings(chosen).step(strain, valid=valid, **known))[:27]
        for host in (hosts.native, hosts.python):
            host.set(PARAMETERS, [getattr(chosen, name) for name in PARAMETERS])
            host.set([*STRAINS, *FLOW], [*strain, *flow])
            host.set_booleans(VALID, valid.tolist())
            np.testing.assert_array_equal(outputs_of(host), expected)


def test_maps_do_not_mix_in_one_process(
    hosts: Hosts, synthetic: SyntheticFiles, fmus: dict[str, Path], tmp_path: Path
) -> None:
    """Two maps of each kind, set and read in turn."""
    pairs = [(fmus[kind], 1) for kind in ("native", "python")]
    pairs += [(fmus[f"{kind}_2"], 2) for kind in ("native", "python")]
    maps = {1: synthetic.map_1, 2: synthetic.map_2}
    estimators = {number: Estimator(load_inverse_map(path)) for number, path in maps.items()}
    with ExitStack() as stack:
        opened = [(stack.enter_context(loaded(p, tmp_path / p.stem)), number) for p, number in pairs]
        for host, _ in opened:
            host.initialize()
        for round_ in range(3):
            strain = np.random.default_rng(round_).normal(size=N_GAUGES) * 1e-6
            for host, _ in opened:
                host.set([*STRAINS, "dynamic_pressure"], [*strain, 9e4])
            for host, number in reversed(opened):
                expected = output_values(estimators[number].estimate(strain, 9e4))[:27]
                np.testing.assert_array_equal(outputs_of(host), expected)


@pytest.mark.parametrize("kind", ["native", "native_3"])
def test_model_exchange_gives_what_co_simulation_does(fmus: dict[str, Path], kind: str) -> None:
    """There is no state to integrate: at each point outputs belong to the inputs of that point."""
    name = "C_A" if kind == "native" else "coefficients"
    strain = 1e-6 * np.arange(1.0, N_GAUGES + 1)
    start = dict(zip(STRAINS, strain, strict=True)) if kind == "native" else {"strain": strain}
    results = [
        fmpy.simulate_fmu(
            str(fmus[kind]), stop_time=0.2, output_interval=0.1, fmi_type=fmi_type, start_values=start
        )[name]
        for fmi_type in ("CoSimulation", "ModelExchange")
    ]
    np.testing.assert_array_equal(*results)
    assert np.isfinite(results).all()


def test_the_reference_table_is_as_the_rules_want_it(fmus: dict[str, Path]) -> None:
    with zipfile.ZipFile(fmus["native"]) as archive:
        text = archive.read("extra/org.fmi-standard.fmi-ls-ref/reference_in.csv").decode()
    assert text.startswith('"time","strain[1]",')
    rows = list(csv.reader(text.splitlines()))
    assert len(rows) == N_ROWS + 1
    assert {len(row) for row in rows} == {N_GAUGES + 2}
    assert len(text) < 1_000_000
    assert list(rows[0][1:]) == [*STRAINS, "dynamic_pressure"]
