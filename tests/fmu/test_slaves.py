"""The slaves inside their FMUs, driven by fmpy as any host does."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy.fmi2 import FMU2Slave
from synthetic_vehicle import N_GAUGES, SyntheticFiles

from strainfmu.cosim.flight_model import evaluate, load_flight_model
from strainfmu.cosim.trajectory import load_trajectory
from strainfmu.estimator import Estimator
from strainfmu.health import HealthState
from strainfmu.inverse_map import load_inverse_map

STRAINS = [f"strain[{i + 1}]" for i in range(N_GAUGES)]
COEFFICIENTS = ["C_A", "C_N", "C_Y", "M_P", "M_Y"]
LOADS = ["force.axial", "force.normal", "force.side", "moment.pitch", "moment.yaw"]


class Host:
    """An FMU with names instead of value references."""

    def __init__(self, fmu: FMU2Slave, references: dict[str, int]) -> None:
        self.fmu, self.references = fmu, references

    def get(self, names: Sequence[str]) -> np.ndarray:
        return np.array(self.fmu.getReal([self.references[name] for name in names]))

    def set(self, names: Sequence[str], values: Sequence[float]) -> None:
        self.fmu.setReal([self.references[name] for name in names], values)

    def health(self) -> int:
        return self.fmu.getInteger([self.references["health.state"]])[0]

    def initialize(self, start_time: float = 0.0) -> None:
        self.fmu.setupExperiment(startTime=start_time)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()


@contextmanager
def loaded(path: Path, folder: Path) -> Iterator[Host]:
    """Instantiate the FMU at ``path``, unzipped to ``folder``."""
    description = fmpy.read_model_description(str(path))
    fmpy.extract(str(path), str(folder))
    fmu = FMU2Slave(
        guid=description.guid,
        modelIdentifier=description.coSimulation.modelIdentifier,
        unzipDirectory=str(folder),
        instanceName="x",
    )
    fmu.instantiate()
    yield Host(fmu, {v.name: v.valueReference for v in description.modelVariables})
    fmu.terminate()
    fmu.freeInstance()


@pytest.fixture
def estimator(synthetic: SyntheticFiles, tmp_path: Path) -> Iterator[Host]:
    with loaded(synthetic.estimator_1, tmp_path / "unzipped") as host:
        yield host


@pytest.fixture
def plant(synthetic: SyntheticFiles, tmp_path: Path) -> Iterator[Host]:
    with loaded(synthetic.plant, tmp_path / "unzipped") as host:
        yield host


def test_the_estimator_fmu_is_the_estimator(synthetic: SyntheticFiles, estimator: Host) -> None:
    reference = Estimator(load_inverse_map(synthetic.map_1))
    random = np.random.default_rng(1)
    estimator.initialize()
    for step in range(5):
        strain, pressure = random.normal(size=N_GAUGES) * 1e-6, random.uniform(5e4, 2e5)
        estimator.set([*STRAINS, "dynamic_pressure"], [*strain, pressure])
        estimator.fmu.doStep(step * 0.1, 0.1)
        expected = reference.estimate(strain, pressure)
        for names, values in (
            (COEFFICIENTS, expected.coefficients),
            ([f"sigma.{name}" for name in COEFFICIENTS], expected.coefficients_std),
            (LOADS, expected.loads),
            ([f"sigma.{name}" for name in LOADS], expected.loads_std),
            (["health.chi_square"], [expected.chi_square]),
            (["health.chi_square_limit"], [reference.chi_square_limit]),
        ):
            np.testing.assert_allclose(estimator.get(names), values, rtol=1e-12)
        assert estimator.health() == expected.health


def test_outputs_are_right_at_the_start_and_after_any_set(synthetic: SyntheticFiles, estimator: Host) -> None:
    inverse_map = load_inverse_map(synthetic.map_1)
    reference = Estimator(inverse_map)
    estimator.initialize()
    at_rest = reference.estimate(np.zeros(N_GAUGES), inverse_map.nominal_dynamic_pressure)
    np.testing.assert_allclose(estimator.get(COEFFICIENTS), at_rest.coefficients, rtol=1e-12)
    strain = np.zeros(N_GAUGES)
    strain[2] = 1e-6
    estimator.set(["strain[3]"], [1e-6])
    expected = reference.estimate(strain, inverse_map.nominal_dynamic_pressure)
    np.testing.assert_allclose(estimator.get(COEFFICIENTS), expected.coefficients, rtol=1e-12)
    np.testing.assert_array_equal(estimator.get(STRAINS), strain)


def test_a_state_that_the_interface_lacks_is_reported_as_one_it_has(
    synthetic: SyntheticFiles, estimator: Host
) -> None:
    """z^2 = 20 of a level of 18.6, chi-square 20 of 21.1: SUSPECT to the estimator, OK to the FMU."""
    inverse_map = load_inverse_map(synthetic.map_1)
    strain = inverse_map.mean_strain.copy()
    strain[0] += np.sqrt(20.0) / np.linalg.norm(inverse_map.residual_whitening[:, 0])
    reference = Estimator(inverse_map).estimate(strain, 1e5)
    assert reference.health is HealthState.SUSPECT
    estimator.initialize()
    estimator.set([*STRAINS, "dynamic_pressure"], [*strain, 1e5])
    assert estimator.health() == HealthState.OK
    np.testing.assert_allclose(estimator.get(COEFFICIENTS), reference.coefficients, rtol=1e-12)


def test_inputs_that_are_not_finite_are_a_state_of_health(estimator: Host) -> None:
    estimator.initialize()
    for bad in (np.nan, np.inf):
        estimator.set(["strain[2]"], [bad])
        estimator.fmu.doStep(0.0, 0.1)
        assert estimator.health() == HealthState.INVALID
        assert np.all(np.isnan(estimator.get([*COEFFICIENTS, *LOADS])))
    estimator.set(["strain[2]"], [0.0])
    for bad in (0.0, -1.0, np.nan):
        estimator.set(["dynamic_pressure"], [bad])
        assert estimator.health() == HealthState.NO_COEFFICIENTS
        assert np.all(np.isnan(estimator.get(COEFFICIENTS)))
        assert np.all(np.isfinite(estimator.get(LOADS)))
    estimator.set(["dynamic_pressure"], [1e5])
    assert estimator.health() < HealthState.NO_COEFFICIENTS
    estimator.set(["strain[1]"], [1.0])
    assert estimator.health() == HealthState.INCONSISTENT


@pytest.mark.parametrize("kind", ["estimator", "plant"])
def test_misuse_does_not_end_the_fmu(kind: str, request: pytest.FixtureRequest) -> None:
    host: Host = request.getfixturevalue(kind)
    before_initialization = host.get(COEFFICIENTS)
    assert np.all(np.isfinite(before_initialization))
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


@pytest.mark.parametrize("kind", ["estimator", "plant"])
def test_a_state_can_be_kept_and_put_back(kind: str, request: pytest.FixtureRequest) -> None:
    host: Host = request.getfixturevalue(kind)
    names = [*COEFFICIENTS, *STRAINS]
    host.initialize()
    host.fmu.doStep(0.0, 0.1)
    state = host.fmu.serializeFMUstate(host.fmu.getFMUstate())
    host.fmu.doStep(0.1, 0.1)
    after = host.get(names)
    if kind == "estimator":
        host.set(STRAINS, [1.0] * N_GAUGES)
    host.fmu.doStep(0.2, 0.1)
    assert np.any(host.get(names) != after)
    host.fmu.setFMUstate(host.fmu.deSerializeFMUstate(state))
    host.fmu.doStep(0.1, 0.1)
    np.testing.assert_array_equal(host.get(names), after)
    host.fmu.setFMUstate(host.fmu.deSerializeFMUstate(b'{"inputs": [1.0, 2.0]}'))
    assert np.all(np.isfinite(host.get(names)))


def run(path: Path, **start_values: Any) -> np.ndarray:
    """Simulate the plant for 0.4 s in steps of 0.1 ms and return all of its outputs."""
    return fmpy.simulate_fmu(str(path), stop_time=0.4, output_interval=1e-4, start_values=start_values)


def strains(result: np.ndarray) -> np.ndarray:
    return np.column_stack([result[name] for name in STRAINS])


def test_the_plant_flies_its_trajectory(synthetic: SyntheticFiles) -> None:
    result = run(synthetic.plant, noise_std=0.0)
    model, trajectory = load_flight_model(synthetic.flight_model), load_trajectory(synthetic.trajectory)
    for row in (0, 1, 777, 2500, -1):
        condition = trajectory.at(result["time"][row])
        point = evaluate(model, condition)
        np.testing.assert_allclose(strains(result)[row], point.strain, rtol=1e-9)
        assert [result[name][row] for name in COEFFICIENTS] == pytest.approx(point.coefficients, rel=1e-9)
        assert result["dynamic_pressure"][row] == pytest.approx(point.dynamic_pressure, rel=1e-12)
        names = ("mach_number", "angle_of_attack", "sideslip_angle", "altitude")
        assert [result[name][row] for name in names] == pytest.approx(condition.as_tuple(), rel=1e-9, abs=1e-15)


def test_noise_follows_its_seed_and_size(synthetic: SyntheticFiles) -> None:
    clean, noisy = strains(run(synthetic.plant, noise_std=0.0)), strains(run(synthetic.plant))
    np.testing.assert_array_equal(noisy, strains(run(synthetic.plant, seed=1)))
    other = strains(run(synthetic.plant, seed=-7))
    noise = noisy - clean
    # 4001 x 6 values: the estimate of a standard deviation is good to 1/sqrt(2 n) = 0.5 %.
    assert np.std(noise) == pytest.approx(1e-6, rel=0.02)
    assert abs(np.mean(noise)) < 3e-8
    assert abs(np.corrcoef(noise.ravel(), (other - clean).ravel())[0, 1]) < 0.03
    assert abs(np.corrcoef(noise[1:].ravel(), noise[:-1].ravel())[0, 1]) < 0.03
    doubled = strains(run(synthetic.plant, noise_std=2e-6)) - clean
    np.testing.assert_allclose(doubled, 2.0 * noise, rtol=1e-6, atol=1e-18)


def test_reading_twice_draws_no_new_noise(plant: Host) -> None:
    plant.initialize(start_time=0.05)
    np.testing.assert_array_equal(plant.get(STRAINS), plant.get(STRAINS))
    assert plant.get(["altitude"])[0] > 20e3


def test_after_its_end_the_trajectory_stays(plant: Host) -> None:
    plant.initialize()
    plant.fmu.doStep(0.0, 50.0)
    assert plant.get(["altitude"])[0] == pytest.approx(22e3)


def test_the_estimator_simulates_alone(synthetic: SyntheticFiles) -> None:
    signals = np.array([(0.0, 1e-6), (1.0, np.nan)], dtype=[("time", float), ("strain[1]", float)])
    result = fmpy.simulate_fmu(
        str(synthetic.estimator_1),
        stop_time=1.0,
        output_interval=0.5,
        input=signals,
        output=["C_A", "health.state"],
    )
    inverse_map = load_inverse_map(synthetic.map_1)
    strain = np.eye(N_GAUGES)[0] * 1e-6
    expected = Estimator(inverse_map).estimate(strain, inverse_map.nominal_dynamic_pressure)
    assert result["C_A"][0] == pytest.approx(expected.coefficients[0], rel=1e-12)
    assert result["health.state"][-1] == HealthState.INVALID
