"""Strains of load cases that contradict each other: which faults of one case are refused, on which conditions."""

from collections.abc import Iterator

import numpy as np
import pytest
from coarse_vehicle import COARSE
from inverse_case import snapshots_at

from builder.aero.engines.euler import EulerEngine
from builder.aero.engines.newtonian import NewtonianEngine
from builder.aero.euler.planes import marching_grid_of
from builder.aero.surface.mesh import mesh_of_grid
from builder.structure.external.load_export import load_cases
from builder.structure.external.strain_per_snapshot import check_cases
from builder.structure.fourier.fourier_model import StructuralModel
from builder.vehicle.file import Vehicle
from builder.vehicle.flight_conditions import condition_grid
from strainfmu.errors import InputError
from strainfmu.flight_condition import FlightCondition

SOME = slice(1, None, 6)
"""None at no incidence, where strain is as small as what 2 % of the pressure do elsewhere."""
FACTORS = {"sign": -1.0, "times 2": 2.0, "times 1000": 1000.0, "zero": 0.0}
POWER = {"36": (100,) * 5, "45": (100,) * 5, "60": (100, 100, 100, 100, 97), "90": (100,) * 5}
"""Wrong cases that are refused [%], by conditions: of each of FACTORS, then of two exchanged rows."""


def refused(pressure: np.ndarray, strain: np.ndarray) -> int | None:
    """Return the case that is refused, None where all pass; the last case is the uniform one."""
    try:
        check_cases(pressure, strain, tuple(map(str, range(len(strain)))), len(strain) - 1)
    except InputError as error:
        return int(str(error).split(":")[0])
    return None


def exchanges(strain: np.ndarray, some: slice = slice(None)) -> Iterator[tuple[int, np.ndarray]]:
    """Yield some of the cases but the last two, and the strains with its row and the next one exchanged."""
    for case in range(len(strain) - 2)[some]:
        wrong = strain.copy()
        wrong[[case, case + 1]] = wrong[[case + 1, case]]
        yield case, wrong


def scaled(strain: np.ndarray, factor: float, some: slice = slice(None)) -> Iterator[tuple[int, np.ndarray]]:
    """Yield some of the cases but the uniform one, and the strains with its row times ``factor``."""
    for case in range(len(strain) - 1)[some]:
        wrong = strain.copy()
        wrong[case] *= factor
        yield case, wrong


@pytest.fixture(scope="module")
def uneven(vehicle: Vehicle, structure: StructuralModel) -> tuple[np.ndarray, np.ndarray]:
    """Pressures and strains of 36 conditions; 2 % of each pressure is no combination of the others'."""
    conditions = condition_grid([5.0, 6.0, 7.0], (0, 3, 6, 9), (0, 4, 8), 20e3)
    snapshots = snapshots_at(NewtonianEngine(mesh_of_grid(structure.surface)), vehicle, conditions)
    pressure = load_cases(vehicle, snapshots).pressure
    pressure[:-1] *= 1.0 + 0.02 * np.random.default_rng(3).standard_normal(pressure[:-1].shape)
    return pressure, pressure @ structure.strain_operator(vehicle.gauges.layout).T


@pytest.mark.parametrize("fault", FACTORS)
def test_every_wrong_case_is_named(uneven: tuple[np.ndarray, np.ndarray], fault: str) -> None:
    """A wrong case must not hide behind the bad predictions that it makes of its neighbours."""
    pressure, strain = uneven
    for case, wrong in scaled(strain, FACTORS[fault], SOME):
        assert refused(pressure, wrong) == case


def test_exchanged_cases_are_refused(uneven: tuple[np.ndarray, np.ndarray]) -> None:
    pressure, strain = uneven
    for case, wrong in exchanges(strain, SOME):
        assert refused(pressure, wrong) in (case, case + 1)


@pytest.mark.parametrize("noise", [0.0, 1e-4, 1e-2])
def test_right_strains_pass_with_noise(uneven: tuple[np.ndarray, np.ndarray], noise: float) -> None:
    pressure, strain = uneven
    factor = 1.0 + noise * np.random.default_rng(4).standard_normal(strain.shape)
    assert refused(pressure, strain * factor) is None


def test_uniform_case_without_strain_is_refused(uneven: tuple[np.ndarray, np.ndarray]) -> None:
    pressure, strain = uneven
    empty = strain.copy()
    empty[-1] = 0.0
    assert refused(pressure, empty) == len(strain) - 1


def test_few_cases_are_not_judged(uneven: tuple[np.ndarray, np.ndarray]) -> None:
    pressure, strain = (array[:8] for array in uneven)
    assert refused(pressure, strain * np.array([1, -1, 1, 1, 1, 1, 1, 1])[:, None]) is None


def flown(name: str, vehicle: Vehicle) -> list[FlightCondition]:
    """Return the conditions of a key of POWER, by their number."""
    if name == "36":
        return condition_grid([5.0, 6.0, 7.0], (0, 3, 6, 9), (0, 4, 8), 20e3)
    if name == "45":
        return condition_grid([5.0, 6.0, 7.0], (-8, -4, 0, 4, 8), (-4, 0, 4), 20e3)
    if name == "90":
        return list(vehicle.flight_conditions())
    mach, attack, sideslip, height = np.random.default_rng(1).random((60, 4)).T
    angles = np.deg2rad([10.0 * attack, 10.0 * sideslip - 5.0])
    rows = np.column_stack([5.0 + 2.0 * mach, *angles, 18e3 + 6e3 * height])
    return [FlightCondition(*map(float, row)) for row in rows]


@pytest.mark.slow
@pytest.mark.parametrize("grid", POWER)
def test_power_of_the_comparison_of_cases(
    vehicle: Vehicle, structure: StructuralModel, compiled_solver: None, grid: str
) -> None:
    """Every case of every grid, with flows of the Euler solver."""
    engine = EulerEngine(vehicle.body(), marching_grid_of(COARSE), structure.surface)
    pressure = load_cases(vehicle, snapshots_at(engine, vehicle, flown(grid, vehicle))).pressure
    strain = pressure @ structure.strain_operator(vehicle.gauges.layout).T
    assert len(strain) == 1 + int(grid)
    for noise in (0.0, 1e-3, 1e-2):
        factor = 1.0 + noise * np.random.default_rng(5).standard_normal(strain.shape)
        assert refused(pressure, strain * factor) is None
    found = [np.mean([refused(pressure, wrong) == k for k, wrong in scaled(strain, f)]) for f in FACTORS.values()]
    answers = [(case, refused(pressure, wrong)) for case, wrong in exchanges(strain)]
    found.append(np.mean([answer is not None for _, answer in answers]))
    assert tuple(round(100.0 * float(one)) for one in found) == POWER[grid]
    assert np.mean([answer in (case, case + 1) for case, answer in answers]) > 0.75
