"""A tare by the input of the FMU: every kind takes the same zeros, and tells what became of it."""

from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmu_host import COEFFICIENTS, OPTIONS, STRAINS, Host, loaded
from synthetic_vehicle import N_GAUGES, SyntheticFiles

from strainfmu.cosim.estimators.zeros_file import write_zeros
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.gauge_zeros import GaugeZeros
from strainfmu.estimator.map.inverse_map import load_inverse_map
from strainfmu.estimator.tare import KnownStrain, TareState
from strainfmu.fmu.export import export_estimator
from strainfmu.interface.zero_variables import zero_in_use_names, zero_names

pytestmark = pytest.mark.fast

IN_USE = zero_in_use_names(N_GAUGES)
N = 90

RENEWAL = 24
"""Steps in which a native FMU makes the matrices for other zeros."""


def readings(seed: int = 0) -> np.ndarray:
    """(n, n_d) of random zeros."""
    random = np.random.default_rng(seed)
    return 1e-4 * random.normal(size=N_GAUGES) + 1e-7 * random.normal(size=(N, N_GAUGES))


@pytest.fixture(scope="module")
def hosts(fmus: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Iterator[list[Host]]:
    with ExitStack() as stack:
        folder = tmp_path_factory.mktemp("tare")
        yield [stack.enter_context(loaded(fmus[kind], folder / kind)) for kind in ("native", "python")]


def begin(host: Host) -> None:
    host.fmu.reset()
    host.initialize()


def window(host: Host, strain: np.ndarray, pressure: float, *, asked: bool = True) -> None:
    """Steps with the flag up, and one with it down."""
    host.set(["dynamic_pressure"], [pressure])
    host.set_booleans(["tare"], [asked])
    for row in strain:
        host.set(STRAINS, row.tolist())
        host.fmu.doStep(0.0, 0.1)
    host.set_booleans(["tare"], [False])


def settle(host: Host) -> None:
    """Steps until the zeros of the window are in use."""
    for _ in range(RENEWAL):
        host.fmu.doStep(0.0, 0.1)


def state(host: Host) -> TareState:
    return TareState(host.integers(["tare_state"])[0])


def test_every_kind_takes_the_zeros_of_the_window(hosts: list[Host], synthetic: SyntheticFiles) -> None:
    held, strain = load_inverse_map(synthetic.map_1), readings()
    expected = Estimator(held).tare(strain, 0.0).zeros
    for host in hosts:
        begin(host)
        assert state(host) == TareState.IDLE
        window(host, strain, 0.0)
        assert state(host) == TareState.AVERAGING
        assert not host.get(IN_USE).any()
        host.fmu.doStep(0.0, 0.1)
        assert state(host) == TareState.DONE
        settle(host)
        found = host.get(IN_USE)
        np.testing.assert_allclose(found[:N_GAUGES], expected.value, rtol=1e-12)
        np.testing.assert_allclose(found[N_GAUGES:-1], expected.std, rtol=1e-12)
        assert found[-1] == pytest.approx(expected.common_std, rel=1e-12)
        assert not host.get(zero_names(N_GAUGES)).any()  # parameters are the host's
        reading = held.mean_strain + expected.value
        host.set([*STRAINS, "dynamic_pressure"], [*reading, 9e4])
        known = Estimator(held).with_zeros(expected).estimate(reading, 9e4)
        np.testing.assert_allclose(host.get(COEFFICIENTS), known.coefficients, rtol=1e-10)
        host.set([zero_names(N_GAUGES)[0]], [1e-5])
        assert state(host) == TareState.IDLE
        settle(host)
        assert host.get(IN_USE).tolist() == [1e-5, *[0.0] * (2 * N_GAUGES)]


@pytest.mark.parametrize("kind", ["native", "python"])
def test_without_zero_inputs_too(kind: str, synthetic: SyntheticFiles, tmp_path: Path) -> None:
    """The zeros change inside; the state says so."""
    held, strain = load_inverse_map(synthetic.map_1), readings()
    expected = Estimator(held).tare(strain, 0.0).zeros
    export_estimator(synthetic.map_1, tmp_path / "plain.fmu", replace(OPTIONS[kind], zero_inputs=False))
    with loaded(tmp_path / "plain.fmu", tmp_path / "x") as host:
        assert not {*IN_USE, *zero_names(N_GAUGES)} & host.references.keys()
        host.initialize()
        window(host, strain, 0.0)
        host.fmu.doStep(0.0, 0.1)
        assert state(host) == TareState.DONE
        settle(host)
        reading = held.mean_strain + expected.value
        host.set([*STRAINS, "dynamic_pressure"], [*reading, 9e4])
        known = Estimator(held).with_zeros(expected).estimate(reading, 9e4)
        np.testing.assert_allclose(host.get(COEFFICIENTS), known.coefficients, rtol=1e-10)


@pytest.mark.parametrize("kind", ["native", "python"])
def test_known_loads_are_taken_off(kind: str, synthetic: SyntheticFiles, tmp_path: Path) -> None:
    """Exported with the strain of own weight: zeros of a tare with the same, its deviation in theirs."""
    held, random = load_inverse_map(synthetic.map_1), np.random.default_rng(5)
    known = KnownStrain(value=3e-5 * random.normal(size=N_GAUGES), own_std=np.full(N_GAUGES, 2e-7))
    stated = GaugeZeros(value=known.value, std=known.std, common_std=0.0)
    write_zeros(tmp_path / "known.toml", held.gauge_names, stated, {})
    plain, fmu = tmp_path / "plain.fmu", tmp_path / "known.fmu"
    export_estimator(synthetic.map_1, plain, OPTIONS[kind])
    export_estimator(synthetic.map_1, fmu, replace(OPTIONS[kind], tare_known=tmp_path / "known.toml"))
    guids = [fmpy.read_model_description(str(path)).guid for path in (plain, fmu)]
    assert guids[0] != guids[1]
    strain = readings()
    expected = Estimator(held).tare(strain, 0.0, known=known).zeros
    assert np.abs(expected.value - Estimator(held).tare(strain, 0.0).zeros.value).max() > 1e-5
    steps = N + 1 + RENEWAL
    signals = np.zeros(steps, dtype=[("time", float), ("tare", bool), *((name, float) for name in STRAINS)])
    signals["time"] = 0.1 * np.arange(steps)
    signals["tare"] = signals["time"] < 0.1 * N - 0.05
    for name, one in zip(STRAINS, strain.T, strict=True):
        signals[name] = [*one, *[one[-1]] * (steps - N)]
    result = fmpy.simulate_fmu(
        str(fmu),
        start_values={"dynamic_pressure": 0.0},
        input=signals,
        stop_time=0.1 * steps,
        output_interval=0.1,
        output=["tare_state", *IN_USE],
    )
    found = np.array([result[name][-1] for name in IN_USE])
    assert result["tare_state"][-1] == TareState.DONE
    np.testing.assert_allclose(found[:N_GAUGES], expected.value, rtol=1e-9)
    np.testing.assert_allclose(found[N_GAUGES:-1], expected.std, rtol=1e-9)
    assert np.all(expected.std > 2e-7)


def test_refused_in_flight_and_where_pressure_is_not_known(hosts: list[Host]) -> None:
    for host in hosts:
        for pressure in (5e3, np.nan, -9999.0):
            begin(host)
            window(host, readings(), pressure)
            assert state(host) == TareState.REFUSED
            host.fmu.doStep(0.0, 0.1)
            assert state(host) == TareState.REFUSED
            assert not host.get(IN_USE).any()
        window(host, readings(), 0.0, asked=False)
        assert state(host) == TareState.REFUSED  # what became of the last one


def test_a_state_within_a_window_goes_on(hosts: list[Host]) -> None:
    strain = readings()
    for host in hosts:
        begin(host)
        host.set(["dynamic_pressure"], [0.0])
        host.set_booleans(["tare"], [True])
        for row in strain[:50]:
            host.set(STRAINS, row.tolist())
            host.fmu.doStep(0.0, 0.1)
        kept = host.fmu.serializeFMUstate(host.fmu.getFMUstate())
        found = []
        for _ in range(2):
            host.fmu.setFMUstate(host.fmu.deSerializeFMUstate(kept))
            assert state(host) == TareState.AVERAGING
            window(host, strain[50:], 0.0)
            settle(host)
            found.append(host.get(IN_USE))
        assert found[0].any()
        assert found[0].tobytes() == found[1].tobytes()


@pytest.mark.parametrize("kind", ["native", "native_3", "python"])
def test_a_host_asks_by_a_table_of_inputs(
    fmus: dict[str, Path], kind: str, capfd: pytest.CaptureFixture[str]
) -> None:
    """At rest with strains of exactly 0, in which no loads are estimated."""
    zeros = {"strain": np.zeros(N_GAUGES)} if kind == "native_3" else dict.fromkeys(STRAINS, 0.0)
    signals = np.array(
        [(0.0, True, 0.0), (1.0, False, 0.0), (2.0, False, 9e4)],
        dtype=[("time", float), ("tare", bool), ("dynamic_pressure", float)],
    )
    result = fmpy.simulate_fmu(
        str(fmus[kind]),
        stop_time=2.0,
        output_interval=0.01,
        input=signals,
        start_values=zeros,
        output=["tare_state"],
        debug_logging=True,
    )
    states = result["tare_state"].astype(int).tolist()
    assert sorted(set(states)) == [TareState.IDLE, TareState.AVERAGING, TareState.DONE]
    assert states == sorted(states)
    said = "".join(capfd.readouterr())
    assert said.count("tare taken: 6 zeros from ") == 1


def test_gauges_that_were_never_set_are_no_zeros(hosts: list[Host]) -> None:
    """Start values are no readings: the tare is refused as where all gauges but one are lost."""
    for host in hosts:
        begin(host)
        host.set(["dynamic_pressure"], [0.0])
        host.set_booleans(["tare"], [True])
        for row in readings():
            host.set(STRAINS[:1], row[:1].tolist())
            host.fmu.doStep(0.0, 0.1)
        host.set_booleans(["tare"], [False])
        host.fmu.doStep(0.0, 0.1)
        assert state(host) == TareState.REFUSED
