"""FMUs of the nonlinear estimator with further sensors: every kind valid, and all give what numpy does."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from flight_fmu import N_D, random_flight, whole_map
from fmpy import read_model_description
from fmpy.validation import validate_fmu
from fmu_host import OPTIONS, exported_kinds, loaded
from sensor_maps import ROWS, with_sensors

from strainfmu.estimator.filter.switched import SwitchedFilter, TimedTrack
from strainfmu.estimator.manifold.estimator import ManifoldEstimator
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.fmu.checks.crosscheck import write_crosscheck
from strainfmu.interface.estimator_variables import NOT_KNOWN, estimator_interface, output_values
from strainfmu.interface.filter_variables import FILTER_TIME_CONSTANT
from strainfmu.interface.sensor_variables import reading_names, sensor_names

pytestmark = pytest.mark.fast

N_S = len(ROWS)
STEP = 0.01


def held_map() -> InverseMap:
    return with_sensors(whole_map())


@pytest.fixture(scope="module")
def paths(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    return exported_kinds(held_map(), tmp_path_factory.mktemp("sensors"))


@pytest.mark.parametrize("kind", OPTIONS)
def test_no_faults(paths: dict[str, Path], kind: str) -> None:
    """Sensors and thrust are inputs beside the filter's time constant; outputs depend on all sensors."""
    assert validate_fmu(str(paths[kind])) == []
    description = read_model_description(str(paths[kind]))
    variables = {one.name: one for one in description.modelVariables}
    assert variables["thrust"].causality == "input"
    assert variables[FILTER_TIME_CONSTANT].causality == "parameter"
    air = next(one for one in description.outputs if one.variable.name == "air_data.angle_of_attack")
    assert {*sensor_names(held_map()), "thrust"} <= {one.name for one in air.dependencies}


@pytest.mark.parametrize("kind", OPTIONS)
def test_an_importer_finds_the_reference(paths: dict[str, Path], tmp_path: Path, kind: str) -> None:
    results = write_crosscheck(paths[kind], tmp_path)
    assert [one.outcome for one in results if one.importer.startswith("FMPy")] == ["passed"], results


@pytest.mark.parametrize("seconds", [0.0, 0.4])
@pytest.mark.parametrize("kind", ["native", "python"])
def test_kinds_give_what_numpy_does(paths: dict[str, Path], tmp_path: Path, kind: str, seconds: float) -> None:
    """Sensors and thrust come and go, filtered or not."""
    held, random = held_map(), np.random.default_rng(1)
    sensors = held.sensors
    assert sensors is not None
    estimator = ManifoldEstimator(held)
    switched, track = SwitchedFilter(estimator, seconds), TimedTrack()
    outputs = [one.name for one in estimator_interface(held) if one.causality == "output"]
    outputs.remove("tare_state")
    with loaded(paths[kind], tmp_path / kind) as host:
        host.initialize()
        host.set([FILTER_TIME_CONSTANT], [seconds])
        for k, sample in enumerate(random_flight(held, 3 * N_S, seed=3)):
            thrust = float(random.choice([0.0, 500.0, np.nan, NOT_KNOWN]))
            known = np.nan if thrust == NOT_KNOWN else thrust
            readings = sample.strain * sensors.scale + np.nan_to_num(known) * sensors.thrust_response
            valid, lost = np.ones(N_D, dtype=bool), N_D - 1 - k % N_S
            if k < N_S:
                readings[lost] = random.choice([np.nan, -1.01 * sensors.largest[lost]])
            elif k < 2 * N_S:
                valid[lost] = False
            flow = {"static_pressure": np.nan, **sample.flow}
            host.set([*reading_names(held), *flow, "thrust"], [*readings, *flow.values(), thrust])
            host.set_booleans([f"valid[{i + 1}]" for i in range(N_D)], valid.tolist())
            host.fmu.doStep(k * STEP, STEP)
            unknown = dict.fromkeys((f"{name}_std" for name in flow), np.nan) | {"altitude": np.nan}
            inputs = estimator.checked_inputs(sensors.without_thrust(readings, known), valid, flow | unknown)
            found, track = switched.step(inputs, track, k * STEP)
            expected = dict(zip(outputs, output_values(found), strict=True))
            assert host.integers(["health.valid_gauges"])[0] == int(found.valid.sum())
            names = ["C_A", "C_N", "C_Y", "M_P", "M_Y"]
            std = np.array([expected[f"sigma.{name}"] for name in names])
            apart = host.get(names) - [expected[name] for name in names]
            np.testing.assert_allclose(apart / std, 0.0, atol=1e-8)
            np.testing.assert_allclose(host.get([f"sigma.{name}" for name in names]), std, rtol=1e-8)
            chi = host.get(["health.chi_square"])[0]
            assert chi == pytest.approx(expected["health.chi_square"], rel=1e-8)


def test_derivatives_by_sensors_and_thrust(paths: dict[str, Path], tmp_path: Path) -> None:
    """Differences of outputs once steps have ended; by thrust the sum over the sensors that it moves."""
    held = held_map()
    sensors, sample = held.sensors, random_flight(held, 1, seed=4)[0]
    assert sensors is not None
    names, readings = ["C_A", "C_N", "C_Y", "M_P", "M_Y"], reading_names(held)
    with loaded(paths["native"], tmp_path / "x") as host:
        host.initialize()

        def ended(change: np.ndarray) -> np.ndarray:
            host.set([*readings, *sample.flow], [*(sample.strain * sensors.scale + change), *sample.flow.values()])
            for k in range(40):
                host.fmu.doStep(k * STEP, STEP)
            return np.array(host.get(names))

        def derivative(known: list[str], direction: np.ndarray) -> np.ndarray:
            references = [[host.references[name] for name in one] for one in (names, known)]
            return np.array(host.fmu.getDirectionalDerivative(*references, direction.tolist()))

        ended(np.zeros(N_D))
        along = 1e-7 * sensors.scale * np.random.default_rng(2).normal(size=N_D)
        found, by_thrust = derivative(readings, along), derivative(["thrust"], np.ones(1))
        of_sensors = -derivative(readings, sensors.thrust_response)
        expected = (ended(0.02 * along) - ended(-0.02 * along)) / 0.04
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-5 * np.abs(expected).max())
    np.testing.assert_allclose(by_thrust, of_sensors, rtol=0.0, atol=1e-6 * np.abs(of_sensors).max())
