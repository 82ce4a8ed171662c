"""Gauges lost on the shipped layout, at a coarse resolution: loads inside three sigma in 99 % of the samples."""

from __future__ import annotations

import numpy as np
import pytest

from builder.campaign.snapshots import Snapshots
from builder.inverse.build import build_inverse_map
from builder.inverse.problem import inverse_problem
from builder.manifold.build import with_manifold
from builder.stress.masks import TARGET, Mask, MaskScore, gauge_rows, masks_of, scores
from builder.stress.masks import table as table_lines
from builder.structure.fourier.model import StructuralModel
from builder.trial.levels import level_readings
from builder.trial.readings import Readings
from builder.trial.world import World
from builder.truth.revolution.flow_table import FlowTable
from builder.truth.revolution.strain import TrueStructure
from builder.vehicle.file import Vehicle
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import InverseMap

SAMPLES = 2000


@pytest.fixture(scope="module")
def mapped(vehicle: Vehicle, snapshots: Snapshots, structure: StructuralModel) -> InverseMap:
    problem = inverse_problem(vehicle, snapshots, structure)
    linear = build_inverse_map(vehicle, snapshots, structure, problem=problem)
    return with_manifold(linear, vehicle, snapshots, structure, problem=problem)


@pytest.fixture(scope="module")
def flown(mapped: InverseMap, vehicle: Vehicle, true_model: TrueStructure, table: FlowTable) -> Readings:
    world = World(vehicle=vehicle, structure=true_model, flows=table, inverse_map=mapped)
    return level_readings(world, conditions=SAMPLES // 2, vehicles=2, seed=3)


def by_rows(masks: list[Mask]) -> list[Mask]:
    return [one for one in masks if not one.drawn]


def missed(found: list[MaskScore]) -> list[str]:
    return [f"{one.mask.group} {one.mask.name}: {one.coverage}" for one in found if one.coverage.min() < TARGET]


def test_the_masks_of_the_shipped_layout(mapped: InverseMap) -> None:
    """Four rows, of which 14 sets may be lost, two directions, and what is drawn."""
    masks = list(masks_of(mapped, np.random.default_rng(0), halves=5))
    roll, axial = gauge_rows(mapped)
    assert sorted({float(one) for one in roll}) == [0.0, 90.0, 180.0, 270.0]
    assert axial.sum() == 36
    groups = [one.group for one in masks]
    assert [groups.count(f"{count} of 4 rows lost") for count in (1, 2, 3)] == [4, 6, 4]
    assert groups.count("one direction lost") == 2
    assert groups.count("random half left") == 5
    assert min(int(one.used.sum()) for one in masks) == 3
    assert len({one.used.tobytes() for one in masks if not one.drawn}) >= 25


def test_rows_and_directions_lost(mapped: InverseMap, flown: Readings) -> None:
    """Without mirror images 66 % of the samples of opposite rows lost, and of all axial gauges, are inside."""
    masks = by_rows(list(masks_of(mapped, np.random.default_rng(0), halves=0)))
    found = scores(Estimator(mapped), flown, masks, samples=600)
    assert missed(found) == []
    assert sum(one.unidentified for one in found) == 0
    lines = table_lines(found)
    assert lines[-1].startswith("0 of")
    assert len(lines) == 2 + len({one.group for one in masks})


def test_the_linear_map_says_what_rows_do_not_identify(mapped: InverseMap, flown: Readings) -> None:
    masks = by_rows(list(masks_of(mapped, np.random.default_rng(0), halves=0)))
    found = scores(Estimator(mapped.without_tables()), flown, masks, samples=600)
    assert missed(found) == []
    single = [one for one in found if one.mask.group == "3 of 4 rows lost"]
    assert all(one.unidentified == one.samples for one in single)


@pytest.mark.slow
@pytest.mark.parametrize("is_nonlinear", [True, False])
def test_every_mask_of_the_list(is_nonlinear: bool, mapped: InverseMap, flown: Readings) -> None:
    """Each by itself, and the classes of drawn masks together."""
    masks = list(masks_of(mapped, np.random.default_rng(1)))
    found = scores(Estimator(mapped if is_nonlinear else mapped.without_tables()), flown, masks)
    assert missed(found) == []
    for group in {one.mask.group for one in found if one.mask.drawn}:
        members = [one for one in found if one.mask.group == group]
        given = sum(one.samples - one.unidentified for one in members)
        assert np.all(sum(one.inside for one in members) >= 0.01 * TARGET * given), group
