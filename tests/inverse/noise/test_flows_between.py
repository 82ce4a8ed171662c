"""Flows between the listed conditions: what they show of an axis with three values, in both estimators."""

from dataclasses import replace
from functools import cache

import numpy as np
from shape_case import ALTITUDE, flown, grid_conditions, shape_structure, shape_vehicle

from builder.campaign.snapshots import Snapshots
from builder.inverse.build import build_inverse_map
from builder.inverse.noise.flow_models import LEEWARD_PRESSURE
from builder.inverse.noise.flows_between import BETWEEN, FlowsBetween, SolvedFlows
from builder.inverse.problem import inverse_problem
from builder.manifold.condition_tables import condition_tables
from builder.manifold.nonlinear_build import with_manifold
from builder.vehicle.file import Vehicle
from strainfmu.estimator.map.flight_tables import FlightTables, evaluate
from strainfmu.estimator.reference.gain import load_covariance
from strainfmu.flight_condition import FlightCondition

WIDE_DEG = (-24.0, 0.0, 24.0)
"""Sideslip angles so far apart that the leeward side falls into shadow between them."""

SIDE_FORCE = 2
NAMES = ("total_incidence", "leeward_roll_angle")


def newtonian_vehicle(**entry: object) -> Vehicle:
    vehicle = shape_vehicle(**entry)
    newtonian = vehicle.aerodynamics.model_copy(update={"engine": "newtonian"})
    return vehicle.model_copy(update={"aerodynamics": newtonian})


@cache
def snapshots() -> Snapshots:
    return flown(grid_conditions(mach=(6.0, 7.0), alpha=(-4.0, 0.0, 4.0), beta=WIDE_DEG))


def flows_between(vehicle: Vehicle, flows: Snapshots) -> FlowsBetween | None:
    return SolvedFlows(snapshots=flows, entries=vehicle.flow_entries()).between


def known() -> FlowsBetween:
    between = flows_between(newtonian_vehicle(), snapshots())
    assert between is not None
    return between


def test_there_is_one_flow_in_every_cell() -> None:
    between = known()
    assert between.cells == 1 * 2 * 2
    angles = {(condition.angle_of_attack, condition.sideslip_angle) for condition in between.conditions}
    assert np.degrees(sorted(angles)).round(6).tolist() == [[-2, -12], [-2, 12], [2, -12], [2, 12]]
    again = flown(between.conditions)
    ambient = np.array([condition.ambient_pressure for condition in between.conditions])
    np.testing.assert_allclose(between.ratio, again.pressure / ambient[:, None], rtol=1e-9)


def test_the_odd_part_of_the_error_shows_between_the_snapshots_alone() -> None:
    """Of three sideslip angles the one left out shows no error of the side force, by symmetry."""
    problem = inverse_problem(newtonian_vehicle(), snapshots(), shape_structure(snapshots().surface))
    operator = problem.load_operator[:5]
    left_out, measured = (condition_tables(snapshots(), operator, True, one) for one in (None, known()))
    random = np.random.default_rng(4)
    angles = random.uniform(-1.0, 1.0, (30, 2)) * np.radians([4.0, 24.0])
    conditions = [FlightCondition(6.5, *one, ALTITUDE) for one in angles.tolist()]
    flow = flown(conditions)
    true = (flow.pressure / conditions[0].ambient_pressure - 1.0) @ operator.T
    tables = FlightTables(
        mach_knots=measured.mach_knots,
        incidence_knots=measured.incidence_knots,
        response=measured.coefficients,
        fixed_response=np.zeros(5),
    )
    incidence, roll = (np.array([getattr(one, name) for one in conditions]) for name in NAMES)
    state = np.column_stack([np.full(30, 6.5), incidence * np.cos(roll), incidence * np.sin(roll), np.zeros(30)])
    error = np.sqrt(np.mean((evaluate(tables, state).value - true) ** 2, axis=0))
    stated = np.sqrt(np.sum(measured.errors[BETWEEN] ** 2, axis=1))
    blind = np.sqrt(np.sum(left_out.errors["interpolation"] ** 2, axis=1))
    assert BETWEEN not in left_out.errors
    assert "interpolation" not in measured.errors
    assert blind[SIDE_FORCE] < 0.5 * error[SIDE_FORCE]
    assert 0.7 * error[SIDE_FORCE] < stated[SIDE_FORCE] < 3.0 * error[SIDE_FORCE]


def test_the_linear_map_holds_what_is_no_combination_of_its_snapshots() -> None:
    vehicle, structure = newtonian_vehicle(), shape_structure(snapshots().surface)
    problem = inverse_problem(vehicle, snapshots(), structure)
    fields, ensemble = problem.off_the_snapshots, problem.ensemble
    assert fields is not None
    own = ensemble.pressure - ensemble.mean()
    assert np.abs(fields @ own.T).max() < 1e-3 * np.linalg.norm(own, axis=1).max() * np.linalg.norm(fields)
    made = build_inverse_map(vehicle, snapshots(), structure)
    terms = {one["name"]: one["rms_strain"] for one in made.provenance["noise_terms"]}
    assert terms[BETWEEN] > 0.0
    without = replace(problem, noise=tuple(one for one in problem.noise if one.name != BETWEEN))
    less = build_inverse_map(vehicle, snapshots(), structure, problem=without)
    ratio = np.sqrt(np.diag(load_covariance(made)) / np.diag(load_covariance(less)))
    assert np.all(ratio > 1.0 - 1e-9)
    assert ratio[SIDE_FORCE] > 1.001
    term = next(one for one in problem.noise if one.name == BETWEEN)
    assert term.load is not None
    np.testing.assert_allclose(term.load, problem.load_operator @ fields.T)


def test_both_estimators_name_the_term() -> None:
    vehicle, structure = newtonian_vehicle(keep_field=True), shape_structure(snapshots().surface)
    made = with_manifold(build_inverse_map(vehicle, snapshots(), structure), vehicle, snapshots(), structure)
    assert BETWEEN in {one["name"] for one in made.provenance["table_error_terms"]}
    assert BETWEEN in {one["name"] for one in made.provenance["noise_terms"]}


def test_nothing_is_taken_from_another_engine_or_other_options() -> None:
    """Snapshots of the same engine by other options, and a vehicle whose flows are dear."""
    assert flows_between(shape_vehicle(), snapshots()) is None
    others = newtonian_vehicle()
    classical = others.aerodynamics.model_copy(update={"stagnation": "classical"})
    assert flows_between(others.model_copy(update={"aerodynamics": classical}), snapshots()) is None


def test_many_cells_are_drawn_from() -> None:
    one_mach = flown(grid_conditions(mach=(6.0,), alpha=np.linspace(-4.0, 4.0, 31), beta=np.linspace(-2, 2, 31)))
    found = flows_between(newtonian_vehicle(), one_mach)
    assert found is not None
    assert found.cells == len(found.conditions) == 800
    assert {one.mach_number for one in found.conditions} == {6.0}


def test_the_leeward_side_is_in_doubt() -> None:
    """A quarter of the difference to a Prandtl-Meyer expansion, leeward alone, in strain and loads of both."""
    vehicle, structure = (
        newtonian_vehicle(discrepancy_of_leeward_percent=25.0),
        shape_structure(snapshots().surface),
    )
    problem = inverse_problem(vehicle, snapshots(), structure)
    assert problem.leeward is not None
    first, level = snapshots().conditions()[0], problem.ensemble.mean_ambient_pressure
    wind = np.array([1.0, -np.sin(first.sideslip_angle), np.sin(first.angle_of_attack)])
    wind[[0, 2]] *= np.cos(first.sideslip_angle)
    wind[0] *= np.cos(first.angle_of_attack)
    windward = snapshots().surface.node_normal @ wind < -1e-9
    share = problem.leeward[0] / level * np.sqrt(len(problem.leeward)) / 0.25
    assert np.abs(share[windward]).max() < 1e-12
    assert -1.0 < share.min() < -0.3
    made = with_manifold(build_inverse_map(vehicle, snapshots(), structure), vehicle, snapshots(), structure)
    for terms in ("noise_terms", "table_error_terms"):
        assert LEEWARD_PRESSURE in {one["name"] for one in made.provenance[terms]}
    none = inverse_problem(newtonian_vehicle(discrepancy_of_leeward_percent=0.0), snapshots(), structure)
    assert none.leeward is None
    assert inverse_problem(shape_vehicle(), snapshots(), structure).leeward is None
