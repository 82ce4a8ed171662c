"""False alarms on a coarse vehicle: levels bring their rate to the stated one, and tenths add up to the whole."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from trial_cases import case_of

from builder.campaign.snapshots import Snapshots
from builder.inverse.build import build_inverse_map
from builder.inverse.problem import inverse_problem
from builder.manifold.build import with_manifold
from builder.structure.fourier.model import StructuralModel
from builder.trial.cases import Plan
from builder.trial.estimators import of_map
from builder.trial.levels import (
    alarm_scales,
    level_readings,
    tail_ratios,
    with_alarm_levels,
    with_flight_alarm_levels,
)
from builder.trial.readings import Readings
from builder.trial.run import scored
from builder.trial.score import Row
from builder.trial.world import World
from builder.truth.revolution.flow_table import FlowTable
from builder.truth.revolution.strain import TrueStructure
from builder.vehicle.file import Vehicle
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import InverseMap


@pytest.fixture(scope="module")
def theory(vehicle: Vehicle, snapshots: Snapshots, structure: StructuralModel) -> InverseMap:
    problem = inverse_problem(vehicle, snapshots, structure)
    linear = build_inverse_map(vehicle, snapshots, structure, problem=problem)
    return with_manifold(linear, vehicle, snapshots, structure, problem=problem)


@pytest.fixture(scope="module")
def alarm_world(theory: InverseMap, vehicle: Vehicle, true_model: TrueStructure, table: FlowTable) -> World:
    return World(vehicle=vehicle, structure=true_model, flows=table, inverse_map=theory, conditions=200, seed=4)


@pytest.fixture(scope="module")
def flights(alarm_world: World) -> Readings:
    return level_readings(alarm_world, conditions=250, vehicles=40)


@pytest.fixture(scope="module")
def calibrated(theory: InverseMap, flights: Readings) -> InverseMap:
    return with_flight_alarm_levels(with_alarm_levels(theory, flights), flights)


def counted(world: World, made: InverseMap, estimator: str, vehicles: int = 50) -> list[Row]:
    """Return the rows of the shipped trial on as many samples."""
    plan = Plan(vehicles=vehicles, estimators=[estimator])
    case = case_of(world.vehicle, "false alarms", trial="false_alarms")
    (rows,) = scored(replace(world, inverse_map=made, _flights={}, _bounds={}), case, plan).values()
    return rows


def test_steps_and_searches_find_the_same_tail(theory: InverseMap, flights: Readings) -> None:
    """A step of two iterations from the state of the flight leaves up to a quarter more than a search does."""
    from builder.trial.levels import _ratios
    from strainfmu.estimator.estimator import Estimator

    of_steps, estimator = tail_ratios(theory, flights), Estimator(theory)
    known = {name: value for name, value in flights.known.items() if name != "altitude"}
    of_searches = _ratios(estimator, estimator.estimate(flights.strain, **known))
    assert of_steps.shape == of_searches.shape == (3, 10_000)
    np.testing.assert_allclose(alarm_scales(of_steps), alarm_scales(of_searches), rtol=0.25)


@pytest.mark.parametrize("estimator", ["nonlinear", "nonlinear stepping"])
def test_a_search_finds_the_flight_that_a_step_starts_from(
    estimator: str, calibrated: InverseMap, flights: Readings
) -> None:
    health = of_map(calibrated, estimator)(flights.rows(np.arange(200))).health
    assert health is not None
    assert np.all(health == HealthState.OK)


def test_other_flights_raise_few_alarms(calibrated: InverseMap, alarm_world: World) -> None:
    """10,000 samples of other seeds: one alarm is expected, 7 or more are 1e-4 likely."""
    for estimator in ("nonlinear stepping", "linear"):
        every = counted(alarm_world, calibrated, estimator)[0]
        assert every["samples"] == 10_000
        assert every["alarm_percent"] <= 0.06
        assert "OUTSIDE" not in every["health"] or estimator == "linear"
    assert calibrated.manifold is not None
    tight = replace(calibrated, manifold=replace(calibrated.manifold, chi_square_scale=0.5))
    assert counted(alarm_world, tight, "nonlinear stepping", vehicles=10)[0]["alarm_percent"] > 10.0


def test_tenths_add_up_to_the_whole(calibrated: InverseMap, alarm_world: World) -> None:
    """Of levels that raise many alarms: the tenths by each quantity have the mean of all."""
    rows = counted(alarm_world, replace(calibrated, manifold=None, chi_square_scale=0.55), "linear", vehicles=8)
    for quantity in ("mach_number", "total_incidence", "leeward_roll_angle", "dynamic_pressure"):
        tenths = [row for row in rows if row["load"].endswith(f"by {quantity}")]
        assert [row["samples"] for row in tenths] == 10 * [160]
        assert np.mean([row["alarm_percent"] for row in tenths]) == pytest.approx(rows[0]["alarm_percent"])
