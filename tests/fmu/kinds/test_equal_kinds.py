"""The same numbers from every kind: numpy estimator, native FMU of FMI 2.0 and 3.0, Python FMU."""

from __future__ import annotations

import csv
import zipfile
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.fmi3 import FMU3Slave
from fmu_host import STRAINS, VALID, Host, loaded
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic_vehicle import N_GAUGES, SyntheticFiles

from strainfmu.estimator.linear.estimator import Estimator
from strainfmu.estimator.map.inverse_map import InverseMap, load_inverse_map
from strainfmu.estimator.settings import EstimatorSettings, default_settings
from strainfmu.fmu.reference_run.run import N_ROWS
from strainfmu.interface.estimator_variables import (
    FLOW_INPUTS,
    PARAMETERS,
    output_values,
)
from strainfmu.interface.input_names import given_flow

pytestmark = pytest.mark.fast

REALS = slice(0, 20)
CHI_SQUARE, LIMIT = 21, 22
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
    """(27,) outputs in the order of value references."""
    names = list(host.references)[:27]
    values = np.empty(27)
    is_integer = np.isin(names, INTEGERS)
    values[~is_integer] = host.get([name for name in names if name not in INTEGERS])
    values[is_integer] = host.integers(INTEGERS)
    return values


strain_values = st.one_of(
    st.floats(-1e-5, 1e-5), st.sampled_from([np.nan, np.inf, -np.inf, 0.05, -0.051, 1e308, 1e-3])
)
STEPS = st.tuples(
    st.lists(strain_values, min_size=N_GAUGES, max_size=N_GAUGES),
    st.lists(st.sampled_from([True, True, True, False]), min_size=N_GAUGES, max_size=N_GAUGES),
    st.tuples(
        st.sampled_from([9e4, 1e3, 1e7, 1.1e7, 0.0, -1.0, np.nan, np.inf]),
        st.sampled_from([0.0, 1e-3, 1e3, -1.0, np.nan, np.inf]),
        st.sampled_from([np.nan, 0.0, 6.0, 4.0, -1.0]),
        st.sampled_from([np.nan, 0.0, 2e4, 1e5, -1.0]),
    ),
    st.tuples(
        st.sampled_from([0.05, 1e-4]),
        st.sampled_from([1.0, 4.0, 1e3]),
        st.sampled_from([0.2, 3.0]),
        st.sampled_from([0.5, 1.5]),
        st.sampled_from([0.0, -1.25, 2.0]),
    ),
)


@settings(max_examples=150, deadline=None)
@given(step=STEPS)
def test_native_and_python_kind_equal_the_estimator(hosts: Hosts, step: tuple) -> None:
    """1e-12 of each output, or of what it is the difference of; the Python kind runs the same code: equal bits."""
    strain, valid, flow, values = step
    q, q_std, mach_number, altitude = given_flow(dict(zip(FLOW, flow, strict=True))).values()
    inverse_map = hosts.estimator.inverse_map
    chosen = replace(default_settings(inverse_map), **dict(zip(PARAMETERS, values, strict=True)))
    reference = hosts.estimator.with_settings(chosen).step(
        strain, q, np.array(valid), q_std, mach_number=mach_number, altitude=altitude
    )
    expected = np.array(output_values(reference))
    for host in (hosts.native, hosts.python):
        host.set(PARAMETERS, values)
        host.set([*STRAINS, *FLOW], [*strain, *flow])
        host.set_booleans(VALID, valid)
    np.testing.assert_array_equal(outputs_of(hosts.python), expected)
    found = outputs_of(hosts.native)
    np.testing.assert_array_equal(np.isfinite(found), np.isfinite(expected))
    finite = np.isfinite(expected)
    # Round-off of chi-square is that of its root, relative to the whitened strain before its projection.
    found[CHI_SQUARE], expected[CHI_SQUARE] = np.sqrt(found[CHI_SQUARE]), np.sqrt(expected[CHI_SQUARE])
    error = np.abs(np.subtract(found, expected, where=finite, out=np.zeros(27)))
    assert np.all(error <= 1e-12 * sizes(inverse_map, expected, strain, reference.valid, q, chosen) + 1e-300)


def sizes(
    inverse_map: InverseMap,
    expected: np.ndarray,
    strain: list[float],
    valid: np.ndarray,
    q: float,
    chosen: EstimatorSettings,
) -> np.ndarray:
    """(27,) what the round-off of each output is relative to: loads are differences of larger terms."""
    size = np.where(np.isfinite(expected), np.abs(expected), 0.0)
    residual = np.where(valid, np.array(strain) - inverse_map.mean_strain, 0.0)
    terms = np.abs(inverse_map.load_gain) @ np.abs(residual) + np.abs(inverse_map.load_of_mean)
    loads = terms.max() * (1.0 + abs(chosen.moment_station))
    size[10:15] = np.maximum(size[10:15], loads)
    if np.isfinite(expected[0]):
        size[:5] = np.maximum(size[:5], loads / (q * chosen.reference_area * min(1.0, chosen.reference_length)))
    size[CHI_SQUARE] = np.linalg.norm(residual / inverse_map.noise_std)
    return size


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
                expected = output_values(estimators[number].estimate(strain, 9e4))
                np.testing.assert_allclose(outputs_of(host)[REALS], expected[REALS], rtol=1e-10)


def test_arrays_equal_the_scalars(hosts: Hosts, fmus: dict[str, Path], tmp_path: Path) -> None:
    """FMI 3.0 and FMI 2.0 of the native kind run one core: equal bits."""
    description = fmpy.read_model_description(str(fmus["native_3"]))
    fmpy.extract(str(fmus["native_3"]), str(tmp_path))
    fmu = FMU3Slave(
        guid=description.instantiationToken,
        modelIdentifier=description.coSimulation.modelIdentifier,
        unzipDirectory=str(tmp_path),
        instanceName="x",
    )
    fmu.instantiate()
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    references = {v.name: v.valueReference for v in description.modelVariables}
    strain = np.random.default_rng(5).normal(size=N_GAUGES) * 1e-6
    valid = [True] * N_GAUGES
    hosts.native.set(PARAMETERS, [getattr(default_settings(hosts.estimator.inverse_map), n) for n in PARAMETERS])
    for lost in (None, 2):
        if lost is not None:
            valid[lost] = False
        fmu.setFloat64([references["strain"], references["dynamic_pressure"]], [*strain, 9e4])
        fmu.setBoolean([references["valid"]], valid)
        hosts.native.set([*STRAINS, *FLOW], [*strain, 9e4, np.nan, np.nan, np.nan])
        hosts.native.set_booleans(VALID, valid)
        names = ("coefficients", "sigma.coefficients", "force", "moment", "sigma.force", "sigma.moment")
        sizes = (5, 5, 3, 2, 3, 2)
        found = [
            value
            for name, size in zip(names, sizes, strict=True)
            for value in fmu.getFloat64([references[name]], nValues=size)
        ]
        expected = outputs_of(hosts.native)
        np.testing.assert_array_equal(found, expected[REALS])
        reals = ("health.chi_square", "health.chi_square_limit", "health.envelope_score")
        assert fmu.getFloat64([references[name] for name in reals]) == list(expected[[CHI_SQUARE, LIMIT, 26]])
        assert fmu.getInt64([references["health.state"]]) == [expected[20]]
        counts = [references[f"health.{name}"] for name in ("valid_gauges", "suspect_gauge", "suspects")]
        assert fmu.getInt32(counts) == list(expected[23:26])
    fmu.terminate()
    fmu.freeInstance()


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
