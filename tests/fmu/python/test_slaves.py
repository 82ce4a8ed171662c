"""Estimators of both kinds and the plant inside their FMUs, driven by fmpy as any host does."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmu_host import COEFFICIENTS, LOADS, STRAINS, VALID, Host, loaded
from synthetic_vehicle import N_GAUGES, SyntheticFiles

from strainfmu.cosim.models.flight_model import evaluate, load_flight_model
from strainfmu.cosim.models.trajectory import load_trajectory
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import load_inverse_map
from strainfmu.estimator.settings import default_settings
from strainfmu.interface.estimator_variables import PARAMETERS

READ = 1e-6 * np.linspace(-1.0, 2.0, N_GAUGES)
"""What the gauges read [m/m]."""


@pytest.fixture(params=["native", "python"])
def estimator(request: pytest.FixtureRequest, fmus: dict[str, Path], tmp_path: Path) -> Iterator[Host]:
    with loaded(fmus[request.param], tmp_path / "unzipped") as host:
        yield host


@pytest.fixture
def plant(synthetic: SyntheticFiles, tmp_path: Path) -> Iterator[Host]:
    with loaded(synthetic.plant, tmp_path / "unzipped") as host:
        yield host


def test_outputs_are_right_at_the_start_and_after_any_set(synthetic: SyntheticFiles, estimator: Host) -> None:
    inverse_map = load_inverse_map(synthetic.map_1)
    reference = Estimator(inverse_map)
    estimator.initialize()
    assert estimator.health() == HealthState.INVALID
    assert np.all(np.isnan(estimator.get(COEFFICIENTS)))
    strain = READ.copy()
    estimator.set(STRAINS, strain.tolist())
    at_start = reference.estimate(strain, inverse_map.nominal_dynamic_pressure)
    np.testing.assert_allclose(estimator.get(COEFFICIENTS), at_start.coefficients, rtol=1e-12)
    strain[2] = 1e-6
    estimator.set(["strain[3]"], [1e-6])
    expected = reference.estimate(strain, inverse_map.nominal_dynamic_pressure)
    np.testing.assert_allclose(estimator.get(COEFFICIENTS), expected.coefficients, rtol=1e-12)
    np.testing.assert_array_equal(estimator.get(STRAINS), strain)


def test_inputs_that_are_not_finite_are_a_state_of_health(estimator: Host) -> None:
    """A gauge less leaves the numbers, no gauge none; a bad dynamic pressure or deviation only the loads."""
    estimator.initialize()
    estimator.set(STRAINS, READ.tolist())
    for bad in (np.nan, np.inf, 1.0):
        estimator.set(["strain[2]"], [bad])
        estimator.fmu.doStep(0.0, 0.1)
        assert estimator.integers(["health.valid_gauges"]) == [N_GAUGES - 1]
        assert np.all(np.isfinite(estimator.get([*COEFFICIENTS, *LOADS])))
    estimator.set(STRAINS, [np.nan] * N_GAUGES)
    assert estimator.health() == HealthState.INVALID
    assert np.all(np.isnan(estimator.get([*COEFFICIENTS, *LOADS])))
    estimator.set(STRAINS, READ.tolist())
    for name, usual, wrong in (
        ("dynamic_pressure", 1e5, (0.0, -1.0, np.nan)),
        ("dynamic_pressure_std", 0.0, (np.inf,)),
    ):
        for bad in wrong:
            estimator.set([name], [bad])
            assert estimator.health() == HealthState.NO_COEFFICIENTS
            assert np.all(np.isnan(estimator.get(COEFFICIENTS)))
            assert np.all(np.isfinite(estimator.get(LOADS)))
        estimator.set([name], [usual])
        assert estimator.health() != HealthState.NO_COEFFICIENTS


def test_strain_of_a_masked_gauge_is_without_effect(estimator: Host) -> None:
    estimator.initialize()
    estimator.set(STRAINS, READ.tolist())
    estimator.set_booleans([VALID[3]], [False])
    before = estimator.get([*COEFFICIENTS, *LOADS, "health.chi_square"])
    for garbage in (1e-3, np.nan, 1e308):
        estimator.set([STRAINS[3]], [garbage])
        np.testing.assert_array_equal(estimator.get([*COEFFICIENTS, *LOADS, "health.chi_square"]), before)
    assert estimator.integers(["health.valid_gauges"]) == [N_GAUGES - 1]
    assert estimator.fmu.getBoolean([estimator.references[name] for name in VALID]) == [
        i != 3 for i in range(N_GAUGES)
    ]


def test_parameters_are_tunable_and_refuse_what_cannot_be(synthetic: SyntheticFiles, estimator: Host) -> None:
    inverse_map = load_inverse_map(synthetic.map_1)
    estimator.initialize()
    estimator.set(STRAINS, READ.tolist())
    estimator.fmu.doStep(0.0, 0.1)
    settings = replace(default_settings(inverse_map), reference_area=0.4, reference_length=1.5, moment_station=0.3)
    for name in PARAMETERS:
        estimator.set([name], [getattr(settings, name)])
    q = inverse_map.nominal_dynamic_pressure
    expected = Estimator(inverse_map, settings).estimate(READ, q)
    np.testing.assert_allclose(estimator.get(COEFFICIENTS), expected.coefficients, rtol=1e-12)
    np.testing.assert_allclose(estimator.get(LOADS), expected.loads, rtol=1e-12)
    for name in PARAMETERS:
        with suppress(FMICallException):  # the Python kind can only log
            estimator.set([name], [np.nan])
        assert estimator.get([name]) == [getattr(settings, name)]


@pytest.mark.parametrize("kind", ["python", "plant"])
def test_misuse_does_not_end_the_fmu(kind: str, fmus: dict[str, Path], tmp_path: Path) -> None:
    with loaded(fmus[kind], tmp_path / "unzipped") as host:
        _misuse(host, reads=kind == "python")


def _misuse(host: Host, reads: bool) -> None:
    before_initialization = host.get(COEFFICIENTS)
    assert np.all(np.isfinite(before_initialization)) != reads  # strains that were not set are none
    host.fmu.setReal([0, 9999], [5.0, 5.0])
    host.fmu.setInteger([0], [5])
    assert np.isnan(host.fmu.getReal([9999])[0])
    assert host.fmu.getReal([]) == []
    assert host.fmu.getInteger([0, 9999]) == [0, 0]
    host.initialize()
    np.testing.assert_array_equal(host.get(COEFFICIENTS), before_initialization)
    host.fmu.reset()
    host.initialize()
    np.testing.assert_array_equal(host.get(COEFFICIENTS), before_initialization)


@pytest.mark.parametrize("kind", ["python", "plant"])
def test_a_state_can_be_kept_and_put_back(kind: str, fmus: dict[str, Path], tmp_path: Path) -> None:
    with loaded(fmus[kind], tmp_path / "unzipped") as host:
        _keep_and_put_back(host, can_be_set=kind != "plant")


def _keep_and_put_back(host: Host, can_be_set: bool) -> None:
    names = [*COEFFICIENTS, *STRAINS]
    host.initialize()
    host.fmu.doStep(0.0, 0.1)
    state = host.fmu.serializeFMUstate(host.fmu.getFMUstate())
    host.fmu.doStep(0.1, 0.1)
    after = host.get(names)
    if can_be_set:
        host.set(STRAINS, [1e-3] * N_GAUGES)
    host.fmu.doStep(0.2, 0.1)
    assert np.any(host.get(names) != after)
    host.fmu.setFMUstate(host.fmu.deSerializeFMUstate(state))
    host.fmu.doStep(0.1, 0.1)
    np.testing.assert_array_equal(host.get(names), after)
    with suppress(FMICallException):  # the Python kind can only log
        host.fmu.setFMUstate(host.fmu.deSerializeFMUstate(b'{"inputs": [1.0, 2.0]}'))
    np.testing.assert_array_equal(host.get(names), after)


def run(path: Path, stop_time: float = 0.4, **start_values: Any) -> np.ndarray:
    """Simulate the plant in steps of 0.1 ms and return all of its outputs."""
    return fmpy.simulate_fmu(str(path), stop_time=stop_time, output_interval=1e-4, start_values=start_values)


def strains(result: np.ndarray) -> np.ndarray:
    return np.column_stack([result[name] for name in STRAINS])


def test_the_plant_flies_its_trajectory(synthetic: SyntheticFiles) -> None:
    result = run(synthetic.plant, noise_std=0.0)
    model, trajectory = load_flight_model(synthetic.flight_model), load_trajectory(synthetic.trajectory)
    for row in (0, 1, 777, 2500, -1):
        condition = trajectory.condition_at(result["time"][row])
        point = evaluate(model, condition)
        np.testing.assert_allclose(strains(result)[row], point.strain, rtol=1e-9)
        assert [result[name][row] for name in COEFFICIENTS] == pytest.approx(point.coefficients, rel=1e-9)
        assert result["dynamic_pressure"][row] == pytest.approx(point.dynamic_pressure, rel=1e-12)
        names = ("mach_number", "angle_of_attack", "sideslip_angle", "altitude")
        assert [result[name][row] for name in names] == pytest.approx(condition.as_tuple(), rel=1e-9, abs=1e-15)


def test_noise_follows_its_seed_and_size(synthetic: SyntheticFiles) -> None:
    clean, noisy = strains(run(synthetic.plant, 0.2, noise_std=0.0)), strains(run(synthetic.plant, 0.2))
    np.testing.assert_array_equal(noisy, strains(run(synthetic.plant, 0.2, seed=1)))
    other = strains(run(synthetic.plant, 0.2, seed=7))
    noise = noisy - clean
    # 2001 x 6 values: the estimate of a standard deviation is good to 1/sqrt(2 n) = 0.6 %.
    assert np.std(noise) == pytest.approx(1e-6, rel=0.02)
    assert abs(np.mean(noise)) < 3e-8
    assert abs(np.corrcoef(noise.ravel(), (other - clean).ravel())[0, 1]) < 0.03
    assert abs(np.corrcoef(noise[1:].ravel(), noise[:-1].ravel())[0, 1]) < 0.03
    doubled = strains(run(synthetic.plant, 0.2, noise_std=2e-6)) - clean
    np.testing.assert_allclose(doubled, 2.0 * noise, rtol=1e-6, atol=1e-18)


def test_reading_twice_draws_no_new_noise(plant: Host) -> None:
    plant.initialize(start_time=0.05)
    np.testing.assert_array_equal(plant.get(STRAINS), plant.get(STRAINS))
    assert plant.get(["altitude"])[0] > 20e3


def test_after_its_end_the_trajectory_stays(plant: Host) -> None:
    plant.initialize()
    plant.fmu.doStep(0.0, 50.0)
    assert plant.get(["altitude"])[0] == pytest.approx(22e3)


def test_the_end_of_the_trajectory_is_logged_once(
    synthetic: SyntheticFiles, capfd: pytest.CaptureFixture[str]
) -> None:
    fmpy.simulate_fmu(str(synthetic.plant), stop_time=1.0, output_interval=0.1, debug_logging=True)
    assert "".join(capfd.readouterr()).count("the trajectory ends at 0.4 s: its last condition is held") == 1
    run(synthetic.plant)
    assert "trajectory ends" not in "".join(capfd.readouterr())


def test_parameters_of_the_plant_are_fixed_after_initialization(plant: Host) -> None:
    seed, noise_std = plant.references["seed"], plant.references["noise_std"]
    plant.fmu.setInteger([seed], [-3])
    plant.fmu.setReal([noise_std], [-1.0])
    assert plant.fmu.getInteger([seed]) == [1]
    assert plant.get(["noise_std"]) == [1e-6]
    plant.fmu.setInteger([seed], [3])
    plant.initialize()
    before = plant.get(STRAINS)
    plant.fmu.setInteger([seed], [4])
    plant.fmu.setReal([noise_std], [1e-3])
    assert plant.fmu.getInteger([seed]) == [3]
    np.testing.assert_array_equal(plant.get(STRAINS), before)


@pytest.mark.parametrize("kind", ["native", "python"])
def test_the_estimator_simulates_alone(synthetic: SyntheticFiles, fmus: dict[str, Path], kind: str) -> None:
    """Row 0 has the first strain; the last, of a gauge lost on the way, is that of the map without it."""
    rest = READ[1:].tolist()
    names = [("time", float), *((name, float) for name in STRAINS)]
    signals = np.array([(0.0, 1e-6, *rest), (1.0, np.nan, *rest)], dtype=names)
    result = fmpy.simulate_fmu(
        str(fmus[kind]),
        stop_time=1.0,
        output_interval=0.5,
        input=signals,
        output=["C_A", "health.state", "health.valid_gauges"],
    )
    inverse_map = load_inverse_map(synthetic.map_1)
    strain = np.array([1e-6, *rest])
    estimator, q = Estimator(inverse_map), inverse_map.nominal_dynamic_pressure
    assert result["C_A"][0] == pytest.approx(estimator.estimate(strain, q).coefficients[0], rel=1e-12)
    strain[0] = np.nan
    expected = estimator.estimate(strain, q)
    assert result["C_A"][-1] == pytest.approx(expected.coefficients[0], rel=1e-12)
    assert result["health.state"][-1] == expected.health
    assert result["health.valid_gauges"][-1] == N_GAUGES - 1
