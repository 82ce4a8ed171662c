"""FMUs of every kind whose maps know of the wall's temperature: valid, and the numbers of numpy."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest
from flight_fmu import N_D, random_flight, whole_map
from fmpy import read_model_description, simulate_fmu
from fmpy.validation import validate_fmu
from fmu_host import OPTIONS, Host, loaded
from linear_fmu import LinearReference, LinearSample
from scaled_maps import NOMINAL, whole_scaled_map
from thermal_maps import REFERENCE, with_temperature
from warm_flights import warm_flight

from strainfmu.estimator.filter.switched import SwitchedFilter, TimedTrack
from strainfmu.estimator.linear.estimator import Estimator
from strainfmu.estimator.manifold.estimator import ManifoldEstimator
from strainfmu.estimator.manifold.tracker import FlightTracker
from strainfmu.estimator.map.inverse_map import InverseMap, save_inverse_map
from strainfmu.fmu.export import export_estimator
from strainfmu.interface.estimator_variables import FLOW_INPUTS, output_values
from strainfmu.interface.filter_variables import FILTER_TIME_CONSTANT
from strainfmu.interface.temperature_variables import temperature_names

pytestmark = pytest.mark.fast

N, N_T = 9, 4


def of_both() -> dict[str, InverseMap]:
    """A linear map, and one with tables over the flight state."""
    held = whole_map()
    manifold = held.manifold
    assert manifold is not None
    same = replace(held, manifold=replace(manifold, gauge_covariance=held.gauge_covariance))
    return {
        "linear": with_temperature(whole_scaled_map(1, seed=3, n=N, n_states=3)),
        "flight": with_temperature(same),
    }


@pytest.fixture(scope="module")
def paths(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder, found = tmp_path_factory.mktemp("warm"), {}
    for name, one in of_both().items():
        save_inverse_map(one, folder / f"{name}.h5")
        for kind, options in OPTIONS.items():
            found[f"{name} {kind}"] = folder / f"{name}_{kind}.fmu"
            export_estimator(folder / f"{name}.h5", found[f"{name} {kind}"], options)
    return found


@pytest.fixture(scope="module")
def hosts(paths: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, Host]]:
    folder = tmp_path_factory.mktemp("loaded")
    with ExitStack() as stack:
        found = {}
        for name in (f"{name} {kind}" for name in ("linear", "flight") for kind in ("native", "python")):
            found[name] = stack.enter_context(loaded(paths[name], folder / name.replace(" ", "_")))
            found[name].initialize()
        yield found


@pytest.mark.parametrize("name", [f"{name} {kind}" for name in ("linear", "flight") for kind in OPTIONS])
def test_fmpy_finds_no_fault_and_simulates(paths: dict[str, Path], name: str) -> None:
    assert validate_fmu(str(paths[name])) == []
    if name.startswith("linear"):
        strain = of_both()["linear"].mean_strain
        is_array = name.endswith("_3")
        start = {"strain": strain} if is_array else {f"strain[{i}]": one for i, one in enumerate(strain, start=1)}
        result = simulate_fmu(str(paths[name]), stop_time=0.2, output_interval=0.1, start_values=start)
        assert np.isfinite(result["health.envelope_score"]).all()


def test_the_page_names_the_sensors(paths: dict[str, Path]) -> None:
    with ZipFile(paths["linear native_3"]) as archive:
        page = archive.read("documentation/index.html").decode()
    assert "Sensors in the order of temperature" in page
    assert all(f"<td>{name}</td>" in page for name in ("T0", "T3"))


@pytest.mark.parametrize("kind", OPTIONS)
def test_every_output_depends_on_temperatures_but_one(paths: dict[str, Path], kind: str) -> None:
    description = read_model_description(str(paths[f"linear {kind}"]))
    names = {"temperature"} if kind == "native_3" else {f"temperature[{i + 1}]" for i in range(N_T)}
    inputs = {one.name: one for one in description.modelVariables if one.name in names}
    assert {one.unit for one in inputs.values()} == {"K"}
    assert set(inputs) == names
    for unknown in description.outputs:
        depends = names <= {one.name for one in unknown.dependencies}
        assert depends == (unknown.variable.name not in ("health.valid_gauges", "tare_state"))


def drawn(k: int, random: np.random.Generator) -> np.ndarray:
    temperature = REFERENCE + 30.0 * random.normal(size=N_T)
    temperature[: k % (N_T + 1)] = random.choice([0.0, -1.0, np.nan])
    return temperature


def test_linear_kinds_give_what_numpy_does(hosts: dict[str, Host]) -> None:
    held = of_both()["linear"]
    random, estimator = np.random.default_rng(1), Estimator(held)
    for k in range(20):
        temperature = drawn(k, random)
        strain = held.mean_strain + 1e-6 * random.normal(size=N)
        known = None if k % (N_T + 1) == N_T else temperature
        expected = output_values(estimator.step(strain, NOMINAL, temperature=known))
        for kind in ("native", "python"):
            host = hosts[f"linear {kind}"]
            host.set([*(f"strain[{i + 1}]" for i in range(N)), *FLOW_INPUTS], [*strain, NOMINAL, 0.0, 0.0, 0.0])
            host.set(temperature_names(held.thermal), temperature)
            found = host.get(list(host.references)[:20])
            np.testing.assert_allclose(found, expected[:20], rtol=1e-11)


def test_linear_kinds_filter_as_numpy_does(paths: dict[str, Path], tmp_path: Path) -> None:
    """Sensors come and go; a state in between holds what was known of the temperature."""
    held = of_both()["linear"]
    names = [f"strain[{i + 1}]" for i in range(N)]
    inputs = [*names, *FLOW_INPUTS, *temperature_names(held.thermal)]
    for kind, tolerance in (("native", 1e-10), ("python", 1e-10)):
        random, reference = np.random.default_rng(3), LinearReference(Estimator(held), 0.5)
        with loaded(paths[f"linear {kind}"], tmp_path / kind) as host:
            host.initialize()
            filtered = 0
            host.set([FILTER_TIME_CONSTANT], [0.5])
            for k in range(12):
                temperature = drawn(k // 2, random)
                known = np.abs(temperature - REFERENCE) < 1e3
                temperature[known] = REFERENCE + 0.02 * (temperature[known] - REFERENCE)
                strain = held.mean_strain + 1e-6 * random.normal(size=N)
                host.set(inputs, [*strain, NOMINAL, 0.0, 0.0, 0.0, *temperature])
                if k == 7:
                    state = host.fmu.getFMUState()
                    host.fmu.doStep(k * 0.125, 0.125)
                    host.fmu.setFMUState(state)
                    host.fmu.freeFMUState(state)
                host.fmu.doStep(k * 0.125, 0.125)
                sample = LinearSample(
                    strain=strain,
                    valid=np.ones(N, dtype=bool),
                    pressure=NOMINAL,
                    deviation=np.nan,
                    temperature=temperature if known.any() else None,
                )
                expected, alone = reference.advance(sample, k * 0.125)
                filtered += not np.array_equal(expected.loads, alone.loads)
                found = host.get(list(host.references)[:20])
                np.testing.assert_allclose(found, output_values(expected)[:20], rtol=tolerance)
        assert filtered > 6


def test_flight_kinds_filter_as_numpy_does(paths: dict[str, Path], tmp_path: Path) -> None:
    """Sensors come and go; a state in between holds what was known of the temperature."""
    held = of_both()["flight"]
    estimator, seconds, step = ManifoldEstimator(held), 0.5, 0.0625
    switched, names = SwitchedFilter(estimator, seconds), [f"strain[{i + 1}]" for i in range(N_D)]
    for kind, tolerance in (("native", 1e-8), ("python", 1e-8)):
        random, track, continued = np.random.default_rng(3), TimedTrack(), 0
        with loaded(paths[f"flight {kind}"], tmp_path / kind) as host:
            host.initialize()
            host.set([FILTER_TIME_CONSTANT], [seconds])
            for k, sample in enumerate(warm_flight(held, 12, 7, step)):
                lost = random.random(N_T) < (1.0 if k in (4, 5) else 0.3)
                assert sample.temperature is not None
                temperature = np.where(lost, random.choice([0.0, -1.0, np.nan]), sample.temperature)
                inputs = [*names, *sample.flow, *temperature_names(held.thermal)]
                host.set(inputs, [*sample.strain, *sample.flow.values(), *temperature])
                if k == 7:
                    state = host.fmu.getFMUState()
                    host.fmu.doStep(k * step, step)
                    host.fmu.setFMUState(state)
                    host.fmu.freeFMUState(state)
                host.fmu.doStep(k * step, step)
                unknown = dict.fromkeys((f"{name}_std" for name in sample.flow), np.nan) | {"altitude": np.nan}
                checked = estimator.checked_inputs(sample.strain, None, sample.flow | unknown)
                known = None if lost.all() else temperature
                expected, after = switched.step(checked, track, k * step, known)
                continued += after.track.law is not None
                track = after
                found = host.get(list(host.references)[:20])
                np.testing.assert_allclose(found, output_values(expected)[:20], rtol=tolerance)
        assert continued == 12


def test_flight_kinds_give_what_the_tracker_does(hosts: dict[str, Host]) -> None:
    held = of_both()["flight"]
    random, tracker = np.random.default_rng(1), FlightTracker(ManifoldEstimator(held))
    for k, sample in enumerate(random_flight(held, 8, seed=3)):
        temperature = drawn(k, random)
        q = sample.flow["dynamic_pressure"]
        known = None if k % (N_T + 1) == N_T else temperature
        expected = output_values(tracker.step(sample.strain, q, temperature=known))
        for kind in ("native", "python"):
            host = hosts[f"flight {kind}"]
            host.set([*(f"strain[{i + 1}]" for i in range(N_D)), "dynamic_pressure"], [*sample.strain, q])
            host.set(temperature_names(held.thermal), temperature)
            host.fmu.doStep(0.05 * k, 0.05)
            found = host.get(list(host.references)[:20])
            np.testing.assert_allclose(found, expected[:20], rtol=1e-8)
