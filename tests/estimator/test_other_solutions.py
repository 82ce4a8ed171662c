"""Lost gauges: mirror images of the flow are inside the uncertainty; few gauges give no loads of the tables."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from flight_maps import N_D, ROWS, STATIONS, flight_map
from scaled_maps import scaled_map

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.estimator.air_inputs import AIR_INPUT_NAMES
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.flight_tables import LOG_PRESSURE, MACH, U, W, evaluate
from strainfmu.estimator.reference.air import air_inputs_of
from strainfmu.estimator.reference.nonlinear import NonlinearEstimate, NonlinearReference, Sample

pytestmark = pytest.mark.fast

PRESSURE = 6e4
"""Of all flights [Pa]."""


@pytest.fixture(scope="module")
def estimator() -> Estimator:
    return Estimator(replace(scaled_map(2, 1, N_D), manifold=flight_map(discrepancy=2e-3, hardware=True)))


def plane_of(row: int, *others: int) -> BoolArray:
    """Return the gauges of a row, of the one opposite, and of ``others``."""
    return np.isin(np.tile(np.arange(ROWS), STATIONS), [row, (row + ROWS // 2) % ROWS, *others])


def flights(seed: int, count: int = 40) -> FloatArray:
    """Return states (k, 4) at any roll angle, 2 to 9 deg of incidence."""
    random = np.random.default_rng(seed)
    incidence, roll = np.radians(random.uniform(2.0, 9.0, count)), random.uniform(0.0, 2.0 * np.pi, count)
    mach, log_pressure = random.uniform(5.2, 6.8, count), np.full(count, np.log(PRESSURE))
    return np.column_stack([mach, incidence * np.cos(roll), incidence * np.sin(roll), log_pressure])


def image_of(state: FloatArray, row: int) -> FloatArray:
    """Return the mirror images of ``state`` (k, 4) in the plane of a row."""
    twice = 4.0 * np.pi * row / ROWS
    found = state.copy()
    found[:, U] = np.cos(twice) * state[:, U] + np.sin(twice) * state[:, W]
    found[:, W] = np.sin(twice) * state[:, U] - np.cos(twice) * state[:, W]
    return found


def responses(estimator: Estimator, state: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return strain (k, n_d) and loads (k, 5) of the tables."""
    manifold = estimator.inverse_map.manifold
    assert manifold is not None
    value = evaluate(manifold.tables, state).value
    return value[:, :N_D], value[:, N_D:]


def air_of(state: FloatArray) -> dict[str, Any]:
    mach, pressure = state[:, MACH], np.exp(state[:, LOG_PRESSURE])
    return {"mach_number": mach, "static_pressure": pressure, "dynamic_pressure": 0.7 * mach**2 * pressure}


def linearised(
    estimator: Estimator, strain: FloatArray, used: BoolArray, start: FloatArray, air: dict[str, Any]
) -> NonlinearEstimate:
    """Return what the linearised problem about the solution from ``start`` (4,) has."""
    manifold = estimator.inverse_map.manifold
    assert manifold is not None
    reference = NonlinearReference(estimator.inverse_map, manifold, manifold.gauge_covariance)
    given = dict.fromkeys(AIR_INPUT_NAMES, np.nan) | air | {"q_source": 1.0}
    inputs = air_inputs_of(estimator.inverse_map, given)
    return reference.solved(Sample(rows=np.where(used, strain, np.nan), used=used, air=inputs), start)


@pytest.mark.parametrize("row", [0, 1, 4])
def test_a_mirror_image_is_inside_three_sigma(estimator: Estimator, row: int) -> None:
    """Strain of two opposite rows is of both flows alike: whichever is found, its sigma includes the other one."""
    state = flights(seed=row)
    strain, loads = responses(estimator, state)
    found = estimator.estimate(np.where(plane_of(row), strain, np.nan), **air_of(state), q_source=1.0)
    for true in (loads, responses(estimator, image_of(state, row))[1]):
        assert np.all(np.abs(found.loads - true) <= 3.0 * found.loads_std)
    assert np.all(found.health == HealthState.DEGRADED)


def test_the_difference_of_two_solutions_adds_a_quarter_of_its_square(estimator: Estimator) -> None:
    """To the covariance of the linearised problem about the one that is found, of loads and of the state."""
    row, used, state = 1, plane_of(1), flights(seed=7, count=6)
    strain, _ = responses(estimator, state)
    air = air_of(state)
    found = estimator.estimate(np.where(used, strain, np.nan), **air, q_source=1.0)
    for k in range(len(state)):
        known = {name: float(value[k]) for name, value in air.items()}
        own = linearised(estimator, strain[k], used, found.state[k], known)
        image = linearised(estimator, strain[k], used, image_of(found.state[k : k + 1], row)[0], known)
        added = found.load_covariance[k] - own.covariance
        apart = image.loads - own.loads
        np.testing.assert_allclose(added, 0.25 * np.outer(apart, apart), atol=2.5e-3 * float(apart @ apart))
        added, apart = found.state_covariance[k] - own.state_covariance, image.state - own.state
        np.testing.assert_allclose(added, 0.25 * np.outer(apart, apart), atol=2.5e-3 * float(apart @ apart))


def test_a_row_off_the_plane_leaves_the_linearised_problem(estimator: Estimator) -> None:
    used, state = plane_of(0, 3), flights(seed=8, count=10)
    strain, _ = responses(estimator, state)
    air = air_of(state)
    found = estimator.estimate(np.where(used, strain, np.nan), **air, q_source=1.0)
    for k in range(len(state)):
        known = {name: float(value[k]) for name, value in air.items()}
        own = linearised(estimator, strain[k], used, state[k], known)
        np.testing.assert_allclose(found.load_covariance[k], own.covariance, rtol=1e-3, atol=1e-6)


def test_a_step_goes_over_to_the_image_that_measured_angles_are_of(estimator: Estimator) -> None:
    """A track in the wrong image, whose strain fits, follows the angles in the step that gives them."""
    used, state = plane_of(0), np.array([[6.0, 0.08, 0.08, np.log(PRESSURE)]])
    strain, loads = responses(estimator, state)
    air: dict[str, Any] = {name: float(value[0]) for name, value in air_of(state).items()} | {"q_source": 1.0}
    flight, read = estimator.filter(0.0), np.where(used, strain, np.nan)[0]
    wrong = image_of(state, 0)
    mirrored = responses(estimator, wrong)[0][0]
    flight.track(mirrored, **air)  # all gauges, in the other flow
    lost = flight.track(read, **air)
    assert lost.state[W] == pytest.approx(wrong[0, W], abs=1e-2)
    sideslip = -float(np.arcsin(np.sin(np.hypot(0.08, 0.08)) * np.sqrt(0.5)))
    attack = float(np.arctan2(np.sin(np.hypot(0.08, 0.08)) * np.sqrt(0.5), np.cos(np.hypot(0.08, 0.08))))
    given: dict[str, Any] = {"measured_angle_of_attack": attack, "measured_sideslip_angle": sideslip}
    after = flight.track(read, **air, **given)
    assert after.state[W] == pytest.approx(state[0, W], abs=1e-2)
    np.testing.assert_array_less(np.abs(after.loads - loads[0]), 3.0 * after.loads_std)


def test_fewer_gauges_than_flight_state_quantities_give_no_loads_of_the_tables(estimator: Estimator) -> None:
    """Four give some; three do not, and without q_inf the linear map gives none either."""
    state = flights(seed=9, count=1)
    strain, _ = responses(estimator, state)
    air: dict[str, Any] = {name: float(value[0]) for name, value in air_of(state).items()} | {"q_source": 1.0}
    for count, given, expected in (
        (4, air, False),
        (3, {name: value for name, value in air.items() if name != "dynamic_pressure"}, True),
    ):
        read = np.where(np.arange(N_D) < count, strain[0], np.nan)
        found = estimator.estimate(read, **given)
        assert (found.health == HealthState.UNIDENTIFIED) == expected
        assert np.isnan(found.loads).all() == expected
        assert np.isnan(found.coefficients_std).all() == expected
        assert found.usable != expected
