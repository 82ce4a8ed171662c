"""The shipped vehicle's map on data of the independent model, as built: coverage, altitudes, false alarms.

Each for the linear and the nonlinear estimator of the map.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from trial_cases import case_of, health_of, other_world

from builder.campaign.snapshots import Snapshots, load_snapshots
from builder.inverse.build import build_inverse_map
from builder.manifold.nonlinear_build import with_manifold
from builder.pipeline.stages import solve_structure
from builder.structure.fourier.fourier_model import StructuralModel
from builder.trial.cases import Built, Case, Plan
from builder.trial.conditions import Where
from builder.trial.estimators import of_map
from builder.trial.readings import Readings, World, joined, read_own_vehicles
from builder.trial.run import readings_of, scored
from builder.trial.score import rows_of
from builder.truth.revolution.flow_table import load_flow_table
from builder.truth.revolution.strain import TrueStructure
from builder.vehicle.file import IC3X, Vehicle, load_vehicle
from strainfmu.estimator.health import FALSE_ALARM_PROBABILITY
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, InverseMap, load_inverse_map
from strainfmu.flight_condition import FlightCondition

ALTITUDES_KM = (12.0, 15.0, 20.0, 25.0, 30.0)

SLOW = pytest.mark.slow
EACH_KIND = pytest.mark.parametrize("kind", ["linear", pytest.param("nonlinear", marks=SLOW)])
"""Of estimator; an estimate of the nonlinear one takes a hundred times as long."""


@pytest.fixture(scope="module")
def world(ic3x_demo: Path, ic3x_truth: TrueStructure) -> World:
    """The shipped vehicle with the map of both estimators."""
    made = load_inverse_map(ic3x_demo / "map.h5")
    assert made.manifold is not None
    flows = load_flow_table(ic3x_demo / "independent_flows.h5")
    return World(vehicle=load_vehicle(IC3X), structure=ic3x_truth, flows=flows, inverse_map=made, seed=3)


@pytest.fixture(scope="module")
def snapshots(ic3x_demo: Path) -> Snapshots:
    return load_snapshots(ic3x_demo / "snapshots.h5")


@pytest.fixture(scope="module")
def fourier(world: World) -> StructuralModel:
    found = solve_structure(world.vehicle)
    assert isinstance(found, StructuralModel)
    return found


def case_at(altitude_km: float | None = None, stated: float = 1.0) -> Case:
    """Return a case of vehicles with errors as stated, each with its own; exactly known ones for 0."""
    where, built = Where(altitude_km=altitude_km), Built(stated=stated)
    return Case(error="as built", group="alone", where=where, as_built=built)


def read_in(world: World, case: Case, vehicles: int) -> Readings:
    return joined(list(readings_of(world, case, Plan(vehicles=vehicles))))


def assert_honest(inverse_map: InverseMap, kind: str, read: Readings) -> None:
    """99 to 100 % of every coefficient inside three sigma, next to none outside the envelope or undetected."""
    every, *loads = rows_of(COEFFICIENT_NAMES, of_map(inverse_map, kind)(read), read)
    assert min(row["covered_percent"] for row in loads) >= 99.0
    assert health_of(every).get("OUTSIDE", 0.0) <= 0.1
    assert every["undetected_percent"] <= 3.0


@EACH_KIND
@pytest.mark.parametrize("altitude_km", ALTITUDES_KM)
def test_three_sigma_cover_the_truth_at_every_altitude(altitude_km: float, kind: str, world: World) -> None:
    """A map of 20 km at 200 conditions: hardware errors drawn for 8 vehicles each, and exactly known ones."""
    for vehicles, stated in ((8, 1.0), (5, 0.0)):
        assert_honest(world.inverse_map, kind, read_in(world, case_at(altitude_km, stated), vehicles))


def map_of(vehicle: Vehicle, snapshots: Snapshots, structure: StructuralModel) -> InverseMap:
    linear = build_inverse_map(vehicle, snapshots, structure)
    return with_manifold(linear, vehicle, snapshots, structure)


@pytest.mark.slow
@EACH_KIND
def test_a_map_of_sideslip_to_one_side_holds_on_both(
    kind: str, world: World, snapshots: Snapshots, fourier: StructuralModel
) -> None:
    """Conditions with sideslip 0 and 5 deg alone, flown from -5 to 5 deg; building that map takes seconds."""
    alpha, beta = snapshots.condition[:, 1], snapshots.condition[:, 2]
    few = snapshots.chosen(np.flatnonzero((beta >= 0.0) & (beta < np.deg2rad(6.0)) & (alpha < 0.15)))
    random = np.random.default_rng(8)
    conditions = [
        FlightCondition(float(mach), float(alpha), float(beta), 20e3)
        for mach, alpha, beta in random.uniform([5.3, 0.0, -0.087], [6.7, 0.13, 0.087], size=(200, 3))
    ]
    read = joined(list(read_own_vehicles(world, case_at(), world.fly(conditions), 10, random)))
    assert_honest(map_of(world.vehicle, few, fourier), kind, read)


@SLOW
@pytest.mark.parametrize("estimator", ["linear", "nonlinear stepping"])
def test_false_alarms_are_as_stated(estimator: str, world: World) -> None:
    """1e6 samples, every one of a vehicle of its own, seeds that the levels were not set with: a factor 2."""
    many = other_world(world, conditions=10_000, seed=2)
    case = case_of(world.vehicle, "false alarms", trial="false_alarms")
    (rows,) = scored(many, case, Plan(vehicles=100, estimators=[estimator])).values()
    rate = 0.01 * rows[0]["alarm_percent"]
    assert 0.5 * FALSE_ALARM_PROBABILITY <= rate <= 2.0 * FALSE_ALARM_PROBABILITY
