"""FMUs of every kind whose maps have all that a map can have: in an importer they give the numbers of Python."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from flight_fmu import random_flight
from fmpy import read_csv, simulate_fmu
from fmu_host import COEFFICIENTS, Host, loaded
from linear_fmu import linear_flight
from parameter_maps import PARAMETERS
from scaled_maps import NOMINAL
from sensor_maps import ROWS
from thermal_maps import REFERENCE
from whole_maps import MAPS, N_T

from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.gauge_zeros import GaugeZeros
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.resource.map_file import white_noise
from strainfmu.estimator.signal_names import FILTER_TIME_CONSTANT
from strainfmu.interface.estimator_variables import NOT_KNOWN, estimator_interface, output_values
from strainfmu.interface.sensor_variables import reading_names, temperature_names
from strainfmu.interface.zero_variables import zero_names

pytestmark = pytest.mark.fast

Fmus = Callable[[str], dict[str, Path]]

STEP, SECONDS = 1.0 / 64.0, 0.5
BROKEN = 0.25
"""Strain beyond the sensor range; FMPy interpolates, which spreads NaN."""


@pytest.fixture(scope="module")
def hosts(whole_fmus: Fmus, tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[tuple[str, str], Host]]:
    """The FMUs of FMI 2.0 by map and kind."""
    with ExitStack() as stack:
        found = {
            (name, kind): stack.enter_context(loaded(whole_fmus(name)[kind], tmp_path_factory.mktemp(kind)))
            for name in MAPS
            for kind in ("native", "python")
        }
        for host in found.values():
            host.initialize()
        yield found


class Pair:
    """An FMU and the estimator in Python, fed alike by the names of variables."""

    def __init__(self, host: Host, name: str) -> None:
        self.held = MAPS[name]()
        self.host, self.estimator = host, Estimator(self.held)
        interface = [one for one in estimator_interface(self.held) if one.causality == "output"]
        self.reals = [one.name for one in interface if one.fmi_type == "Real"]
        self.counts = [one.name for one in interface if one.fmi_type in ("Integer", "Enumeration")][:4]
        self.names = [one.name for one in interface if one.name != "tare_state"]
        host.fmu.reset()
        host.initialize()

    def filter(self, seconds: float) -> None:
        self.estimator = self.estimator.filter(seconds)
        self.host.set([FILTER_TIME_CONSTANT], [seconds])

    def set_zeros(self, zeros: GaugeZeros) -> None:
        self.estimator = self.estimator.with_zeros(zeros)
        self.host.set(zero_names(len(zeros.value)), [*zeros.value, *zeros.std, zeros.common_std])

    def step(self, readings: np.ndarray, k: int, **known: Any) -> Estimate:
        """Both take the step ``k`` with ``known`` arguments of the estimator; all outputs are the same."""
        host, n = self.host, self.held.n_gauges
        valid = known.get("valid", np.ones(n, dtype=bool))
        host.set(reading_names(self.held), readings)
        host.set_booleans([f"valid[{i + 1}]" for i in range(n)], valid.tolist())
        host.set(temperature_names(self.held.thermal), known["temperature"])
        for prefix, given in (("parameter.", "parameters"), ("parameter_std.", "parameters_std")):
            for name, value in known.get(given, {}).items():
                host.set([f"{prefix}{name}"], [value])
        flow = {
            name: value for name, value in known.items() if np.ndim(value) == 0 and not isinstance(value, dict)
        }
        host.set([*flow], [*flow.values()])
        host.fmu.doStep(k * STEP, STEP)
        found = self.estimator.track(readings, time=k * STEP, **known)
        values = dict(zip(self.names, output_values(found, with_other_loads=True), strict=True))
        np.testing.assert_array_equal(
            host.get(self.reals), [values[name] for name in self.reals], err_msg=f"step {k}"
        )
        assert host.integers(self.counts) == [values[name] for name in self.counts]
        return found


def samples(name: str, n: int) -> Iterator[tuple[np.ndarray, dict[str, Any]]]:
    """Readings, and what else is known; sensors, thrust, temperatures and parameters come and go."""
    held, random = MAPS[name](), np.random.default_rng(1)
    rows = held.sensors
    assert rows is not None
    if name == "linear":
        flight = [
            (one.strain, {"dynamic_pressure": one.pressure}) for one in linear_flight(held, n, 5, poor=False)
        ]
    else:
        flight = [(one.strain, one.flow) for one in random_flight(held, n, seed=3)]
    for k, (strain, flow) in enumerate(flight):
        thrust = float(random.choice([0.0, 500.0, np.nan]))
        readings = strain * rows.scale + np.nan_to_num(thrust) * rows.thrust_response
        valid, lost = np.ones(held.n_gauges, dtype=bool), held.n_gauges - 1 - k % (2 * len(ROWS))
        if k % 3 == 0:
            readings[lost] = random.choice([np.nan, -1.01 * max(rows.largest[lost], 0.05)])
        elif k % 3 == 1:
            valid[lost] = False
        temperature = np.where(random.random(N_T) < 0.3, np.nan, REFERENCE + 0.5 * random.normal(size=N_T))
        values = dict(zip(PARAMETERS, [5.0 if k % 7 == 3 else 1.0, 0.25, np.nan if k % 2 else 2.0], strict=True))
        known = {**flow, "thrust": thrust, "valid": valid, "temperature": temperature, "parameters": values}
        if name == "flight" and k % 5 == 2:
            known["parameters_std"] = dict(zip(PARAMETERS, (0.1, np.nan, np.nan), strict=True))
        elif name == "flight":
            known["parameters_std"] = dict.fromkeys(PARAMETERS, np.nan)
        yield readings, known


@pytest.mark.parametrize("kind", ["native", "python"])
@pytest.mark.parametrize("name", MAPS)
def test_step_by_step(hosts: dict[tuple[str, str], Host], name: str, kind: str) -> None:
    """Each sample on its own, filtered, with zeros that are known exactly and such that are not."""
    pair, seen, random = Pair(hosts[name, kind], name), set(), np.random.default_rng(2)
    n_strain = pair.held.n_strain_gauges
    for k, (readings, known) in enumerate(samples(name, 36)):
        if k in (8, 24):
            pair.filter(SECONDS if k == 8 else 0.0)
        if k in (16, 28):
            value, std = 1e-6 * random.normal(size=n_strain), np.full(n_strain, 1e-7 if k == 28 else 0.0)
            pair.set_zeros(GaugeZeros(value=value, std=std, common_std=float(std[0])))
        moved = readings.copy()
        moved[:n_strain] += pair.estimator.zeros.value
        found = pair.step(moved, k, **known)
        seen.add(found.health)
        assert found.outside_parameters == (("fin_deg",) if k % 7 == 3 else ())
    assert {HealthState.DEGRADED, HealthState.OUTSIDE} <= seen


@pytest.mark.parametrize("kind", ["native", "python"])
@pytest.mark.parametrize("name", MAPS)
def test_the_state_holds_the_law(
    hosts: dict[tuple[str, str], Host], whole_fmus: Fmus, tmp_path: Path, name: str, kind: str
) -> None:
    """Back in time, and in another instance."""
    pair, flight = Pair(hosts[name, kind], name), list(samples(name, 9))
    pair.filter(SECONDS)
    for k in range(4):
        pair.step(flight[k][0], k, **flight[k][1])
    host, memory = pair.host, pair.estimator.memory
    state = host.fmu.getFMUState()
    content = host.fmu.serializeFMUState(state)

    def rest(of: Pair) -> bytes:
        of.estimator.memory = memory
        return b"".join(of.step(flight[k][0], k, **flight[k][1]).loads.tobytes() for k in range(4, 9))

    first = rest(pair)
    host.fmu.setFMUState(state)
    assert rest(pair) == first
    host.fmu.freeFMUState(state)
    with loaded(whole_fmus(name)[kind], tmp_path / "other") as another:
        other = Pair(another, name)
        other.estimator = pair.estimator
        another.fmu.setFMUState(another.fmu.deserializeFMUState(content))
        assert rest(other) == first


@pytest.mark.parametrize("kind", ["native", "python"])
def test_scores_of_parameters(hosts: dict[tuple[str, str], Host], kind: str) -> None:
    host, held = hosts["linear", kind], MAPS["linear"]()
    inputs, outputs = ([f"{prefix}{name}" for name in PARAMETERS] for prefix in ("parameter.", "health.outside."))
    host.fmu.reset()
    host.initialize()
    host.set(reading_names(held), held.mean_strain * held.sensors.scale)
    host.set(["dynamic_pressure"], [NOMINAL])
    assert host.health() == HealthState.OK
    for values, state, scores in (
        ([4.0, 0.25, 2.0], HealthState.OK, [0.0, 0.0, 0.0]),
        ([6.0, 0.25, np.nan], HealthState.OUTSIDE, [0.25, 0.0, 0.0]),
        ([np.nan, -0.25, NOT_KNOWN], HealthState.OUTSIDE, [0.0, 0.5, 0.0]),
    ):
        host.set(inputs, values)
        assert host.health() == state
        np.testing.assert_allclose(host.get(outputs), scores, rtol=1e-14)


def test_derivatives_by_sensors_and_thrust(hosts: dict[tuple[str, str], Host]) -> None:
    """Differences of outputs once steps have ended; by thrust the sum over the sensors that it moves."""
    host, held = hosts["flight", "native"], MAPS["flight"]()
    sensors, sample = held.sensors, random_flight(held, 1, seed=4)[0]
    readings, n = reading_names(held), held.n_gauges
    host.fmu.reset()
    host.initialize()

    def ended(change: np.ndarray) -> np.ndarray:
        host.set([*readings, *sample.flow], [*(sample.strain * sensors.scale + change), *sample.flow.values()])
        for k in range(40):
            host.fmu.doStep(k * STEP, STEP)
        return np.array(host.get(COEFFICIENTS))

    def derivative(known: list[str], direction: np.ndarray) -> np.ndarray:
        references = [[host.references[name] for name in one] for one in (COEFFICIENTS, known)]
        return np.array(host.fmu.getDirectionalDerivative(*references, direction.tolist()))

    ended(np.zeros(n))
    along = 1e-7 * sensors.scale * np.random.default_rng(2).normal(size=n)
    found, by_thrust = derivative(readings, along), derivative(["thrust"], np.ones(1))
    of_sensors = -derivative(readings, sensors.thrust_response)
    expected = (ended(0.02 * along) - ended(-0.02 * along)) / 0.04
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-5 * np.abs(expected).max())
    np.testing.assert_allclose(by_thrust, of_sensors, rtol=0.0, atol=1e-6 * np.abs(of_sensors).max())


@pytest.mark.parametrize("kind", ["native", "scalars", "python"])  # FMPy takes no arrays beside scalars
def test_an_importer_finds_the_filter(whole_fmus: Fmus, kind: str) -> None:
    """Its time constant is a start value; gauges, and two whole samples, get lost."""
    held, steps = MAPS["linear"](), 20
    rows = held.sensors
    assert rows is not None
    n = held.n_strain_gauges
    random, one = np.random.default_rng(4), linear_flight(held, 1, 31, poor=False)[0]
    noise = np.sqrt(white_noise(held)) * random.standard_normal((steps + 1, held.n_gauges))
    readings = (one.strain + noise) * rows.scale
    strain = readings[:, :n]
    strain[4:, [2, 5]] = BROKEN
    strain[10:12] = BROKEN
    time, names = STEP * np.arange(steps + 1), reading_names(held)
    table = np.zeros(steps + 1, dtype=[(name, float) for name in ("time", *names)])
    table["time"] = time
    for name, column in zip(names, readings.T, strict=True):
        table[name] = column
    outputs = [*COEFFICIENTS, *(f"sigma.{name}" for name in COEFFICIENTS)]
    result = simulate_fmu(
        str(whole_fmus("linear")[kind]),
        stop_time=time[-1],
        output_interval=STEP,
        input=table,
        start_values={FILTER_TIME_CONSTANT: SECONDS},
        output=outputs,
        fmi_type="CoSimulation",
    )
    found = np.column_stack([result[name] for name in outputs])[1:]
    expected, alone = (
        Estimator(held).filter(seconds).track(readings[:-1], NOMINAL, time=time[:-1]) for seconds in (SECONDS, 0.0)
    )
    known = np.isfinite(expected.coefficients)
    assert np.sum(np.any(known & (expected.coefficients != alone.coefficients), axis=1)) > 5
    np.testing.assert_array_equal(found, np.hstack([expected.coefficients, expected.coefficients_std]))


def test_model_exchange_takes_what_co_simulation_does(whole_fmus: Fmus, tmp_path: Path) -> None:
    folder = Path(fmpy.extract(str(whole_fmus("linear")["native"]), str(tmp_path)))
    signals = read_csv(str(folder / "extra/org.fmi-standard.fmi-ls-ref/reference_in.csv"))
    found = simulate_fmu(str(folder), stop_time=0.2, output_interval=0.05, input=signals, fmi_type="ModelExchange")
    assert np.isfinite(found["C_A"]).all()
    assert np.ptp(found["C_N"]) > 0.0
