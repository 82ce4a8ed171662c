"""Gauges lost on the shipped layout, at a coarse resolution: loads inside three sigma in 99 % of the samples."""

from __future__ import annotations

import numpy as np
import pytest
from trial_cases import case_of, other_world

from builder.campaign.snapshots import Snapshots
from builder.inverse.build import build_inverse_map
from builder.manifold.build import with_manifold
from builder.structure.fourier.model import StructuralModel
from builder.trial.cases import Case, Plan, cases_for, load_trial, trial_path
from builder.trial.faults import Lost, NoSuchGaugesError, gauge_rows
from builder.trial.run import Task as RunTask
from builder.trial.run import run_task, scored
from builder.trial.score import Row
from builder.trial.world import World
from builder.truth.revolution.flow_table import FlowTable
from builder.truth.revolution.strain import TrueStructure
from builder.vehicle.file import Vehicle

TARGET = 99.0


@pytest.fixture(scope="module")
def mapped(
    vehicle: Vehicle,
    snapshots: Snapshots,
    structure: StructuralModel,
    true_model: TrueStructure,
    table: FlowTable,
) -> World:
    """A map of all conditions: it identifies nothing of one row."""
    linear = build_inverse_map(vehicle, snapshots, structure)
    made = with_manifold(linear, vehicle, snapshots, structure)
    return World(vehicle=vehicle, structure=true_model, flows=table, inverse_map=made, conditions=150, seed=3)


def sets_of(world: World, **lost: object) -> list[np.ndarray]:
    return list(Lost.model_validate(lost).in_use(world.inverse_map, np.random.default_rng(0)).values())


def test_the_sets_of_the_shipped_layout(world: World) -> None:
    """Four rows, of which 14 sets may be lost, two directions, and what is drawn."""
    roll, axial = gauge_rows(world.inverse_map)
    assert sorted({float(angle) for angle in roll}) == [0.0, 90.0, 180.0, 270.0]
    assert axial.sum() == 36
    assert [len(sets_of(world, gauges="rows", count=count)) for count in (1, 2, 3)] == [4, 6, 4]
    np.testing.assert_array_equal(sets_of(world, gauges="direction"), [axial, ~axial])
    for gauges in ("direction of a row", "direction and row"):
        assert all(0 < used.sum() < len(axial) for used in sets_of(world, gauges=gauges))
    assert [int(used.sum()) for used in sets_of(world, gauges="all but", count=3, sets=4)] == [3, 3, 3, 3]
    assert [int(used.sum()) for used in sets_of(world, gauges="all but", count=0, sets=1)] == [len(axial) // 2]


def test_a_layout_without_such_gauges_is_left_out(world: World) -> None:
    lost = {"gauges": "rows", "count": 4}
    with pytest.raises(NoSuchGaugesError, match="no such gauges to lose among 54 in 4 rows"):
        sets_of(world, **lost)
    case = Case.model_validate({"error": "lost gauges", "size": "all", "class": "beyond", "lost": lost})
    _, text = run_task(lambda: world, scored, RunTask(key="", case=case, plan=Plan(vehicles=1), world=()))
    assert text == "lost gauges, all: left out: no such gauges to lose among 54 in 4 rows"


def rows_of_case(world: World, size: str, estimator: str, plan: Plan) -> list[Row]:
    case = case_of(world.vehicle, "lost gauges", size, "lost_gauges")
    return scored(world, case, plan.model_copy(update={"estimators": [estimator]}))[estimator]


@pytest.mark.parametrize("size", ["two rows", "three rows", "one direction", "a direction and a row"])
def test_rows_and_directions_lost(mapped: World, size: str) -> None:
    """Without mirror images 66 % of the samples of opposite rows lost, and of all axial gauges, are inside."""
    plan = Plan(vehicles=2)
    every, *loads = rows_of_case(mapped, size, "nonlinear", plan)
    assert every["samples"] == 300 * every["sets"]
    assert every["no_estimate_percent"] == 0.0
    assert min(row["covered_percent"] for row in loads) >= TARGET
    assert min(row["worst_set_percent"] for row in loads) >= TARGET - 2.0
    linear, *_ = rows_of_case(mapped, size, "linear", plan)
    assert linear["undetected_percent"] <= 1.0
    if size == "three rows":
        assert linear["no_estimate_percent"] == 100.0


def test_sets_that_are_drawn_have_the_next_samples(mapped: World) -> None:
    case = case_of(mapped.vehicle, "lost gauges", "all but 10, drawn", "lost_gauges")
    assert case.lost is not None
    few = case.model_copy(update={"lost": case.lost.model_copy(update={"sets": 4, "samples": 100})})
    plan = Plan(vehicles=2, estimators=["linear"])
    every = scored(mapped, few, plan)["linear"][0]
    assert (every["samples"], every["sets"], every["vehicles"]) == (400, 4, 300)


@pytest.mark.slow
def test_every_set_of_the_shipped_trial(mapped: World) -> None:
    """The sets of each case together."""
    file, world = load_trial(trial_path("lost_gauges")), other_world(mapped, conditions=1000)
    for case in cases_for(world.vehicle, file):
        for rows in scored(world, case, file.trial).values():
            covered = [row["covered_percent"] for row in rows[1:]]
            assert np.nanmin([100.0, *covered]) >= TARGET, case.size
