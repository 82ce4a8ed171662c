"""``map.estimator`` "auto": both estimators on flights that the map was not made from."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from builder.campaign.snapshots import Snapshots
from builder.inverse.ensemble import ensemble_of
from builder.pipeline.estimator_choice import FACTS, as_chosen, compared_in_flights, left_out
from builder.pipeline.stages import map_from
from builder.reporting import Silent
from builder.reports.build_report.build_tables import estimator_choice
from builder.structure.fourier.fourier_model import StructuralModel
from builder.trial.levels import level_readings
from builder.trial.readings import Readings, World, joined
from builder.truth.flow_table import FlowTable
from builder.truth.true_structure import TrueStructure
from builder.vehicle.file import Vehicle
from builder.vehicle.map_needs import why_linear
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, InverseMap


class Notes(Silent):
    """Keeps the notes."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def note(self, text: str) -> None:
        self.lines.append(text)


def auto(vehicle: Vehicle, **entry: Any) -> Vehicle:
    return vehicle.model_copy(update={"map": vehicle.map.model_copy(update={"estimator": "auto", **entry})})


@pytest.fixture(scope="module")
def chosen(vehicle: Vehicle, snapshots: Snapshots, structure: StructuralModel) -> tuple[InverseMap, list[str]]:
    notes = Notes()
    return map_from(auto(vehicle), snapshots, structure, notes), notes.lines


def test_the_better_estimator_on_snapshots_left_out_is_used(chosen: tuple[InverseMap, list[str]]) -> None:
    found, notes = chosen
    held = found.provenance[FACTS]
    assert found.manifold is not None
    assert held["used"] == "nonlinear"
    ratio = [held["rms"]["nonlinear"][name] / held["rms"]["linear"][name] for name in COEFFICIENT_NAMES]
    assert np.median(ratio) < 0.7
    assert max(held["undetected"].values()) < 0.03
    line = next(one for one in notes if one.startswith("map.estimator 'auto'"))
    assert line == f"map.estimator 'auto': nonlinear, {held['why']}, on {held['flights']}"
    assert "M 6, total incidence 8 deg" in held["flights"]
    report: Any = SimpleNamespace(inverse_map=found)
    assert [row[0] for row in estimator_choice(report)[0].rows] == list(COEFFICIENT_NAMES)


@pytest.fixture(scope="module")
def flights(
    chosen: tuple[InverseMap, list[str]], vehicle: Vehicle, true_model: TrueStructure, table: FlowTable
) -> Readings:
    world = World(vehicle=vehicle, structure=true_model, flows=table, inverse_map=chosen[0])
    return joined(list(level_readings(world, vehicles=4, conditions=60)))


def test_tables_that_are_wrong_lose_to_the_linear_map(
    chosen: tuple[InverseMap, list[str]], flights: Readings
) -> None:
    found = chosen[0]
    assert compared_in_flights(found, flights).used == "nonlinear"
    assert found.manifold is not None
    n_d, response = found.n_gauges, found.manifold.response.copy()
    response[:, :, n_d : n_d + 5] *= 1.3
    wrong = replace(found, manifold=replace(found.manifold, response=response))
    choice = compared_in_flights(wrong, flights)
    assert choice.used == "linear"
    assert "60 flights of the independent model" in choice.line
    assert as_chosen(wrong, choice).manifold is None


def test_a_file_without_tables_has_the_linear_map(
    vehicle: Vehicle, snapshots: Snapshots, structure: StructuralModel
) -> None:
    notes = Notes()
    absolute = auto(vehicle, form="absolute", symmetry="listed")
    found = map_from(absolute, snapshots, structure, notes)
    assert found.manifold is None
    assert "map.estimator 'auto': linear, map.form is 'absolute'" in notes.lines
    assert why_linear(auto(vehicle, symmetry="listed")) == "map.symmetry is 'listed' with a profile"
    paper = vehicle.noise.without_hardware_errors().model_copy(update={"model": "paper"})
    assert why_linear(auto(vehicle.model_copy(update={"noise": paper}))) == "noise.model is 'paper'"
    assert why_linear(auto(vehicle)) is None


def test_too_few_conditions_have_the_linear_map(
    vehicle: Vehicle, snapshots: Snapshots, structure: StructuralModel
) -> None:
    mach, incidence = snapshots.condition[:, 0], snapshots.condition[:, 1:3]
    no_sideslip = np.flatnonzero(np.isin(mach, [5.0, 7.0]) & (incidence[:, 1] == 0.0))
    few = snapshots.chosen(no_sideslip[incidence[no_sideslip, 0] < np.radians(9.0)])
    found = map_from(auto(vehicle), few, structure, Silent())
    assert "no map can be made without total incidence 4 deg" in found.provenance[FACTS]["why"]
    assert found.manifold is None


def test_ends_of_the_conditions_are_never_left_out(vehicle: Vehicle, snapshots: Snapshots) -> None:
    left = left_out(snapshots, ensemble_of(vehicle, snapshots))
    assert left is not None
    kept = np.setdiff1d(np.arange(len(snapshots.condition)), left.rows)
    for values in (snapshots.condition[:, 0], snapshots.total_incidence):
        gone = np.setdiff1d(np.round(values, 9), np.round(values[kept], 9))
        assert len(gone) == 1
        assert values.min() < gone[0] < values.max()
    assert 0 < len(left.rows) < len(snapshots.condition) // 2
