"""Estimators of several kinds: maps that know of the errors of a case, pressure fields, what each is given;
learning ones and their bands, and the Kalman filter with a random walk."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from flight_maps import flight_map
from shape_case import flown, grid_snapshots, shape_map, shape_structure, shape_vehicle
from shape_truth import beam
from state_estimates import state_gain, state_offset

from builder.campaign.snapshots import Snapshots
from builder.inverse.problem import inverse_problem
from builder.manifold.nonlinear_build import with_manifold
from builder.structure.fourier.fourier_model import StructuralModel
from builder.trial import compared
from builder.trial.cases import Built, Case, Plan
from builder.trial.compared import (
    FIELD,
    LEVEL,
    NONLINEAR,
    REGRESSIONS,
    ComparedWorld,
    after_reading,
    before_readings,
    compared_estimators,
    conformal_half_width,
    estimated_fields,
    knowing,
    maps_for,
    of_random_walk,
    of_regression,
    refuse_unknown,
    step_costs,
    training_flights,
    with_drawn_errors,
)
from builder.trial.conditions import Where, flown_conditions
from builder.trial.readings import ANGLES, Readings
from builder.trial.run import scored
from builder.trial.score import ROLLING
from builder.truth.revolution.flow_table import FlowTable
from builder.truth.revolution.strain import TrueStructure
from builder.vehicle.file import IC3X, Vehicle, load_vehicle
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.flight_tables import evaluate
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.other_loads import FIVE_LOADS
from strainfmu.estimator.reference.nonlinear import strain_covariance


def field_error(estimate: np.ndarray, true: np.ndarray) -> float:
    """Return the largest error of a field over the true one."""
    return float(np.max(np.linalg.norm(estimate - true, axis=1) / np.linalg.norm(true, axis=1)))


def test_a_linear_field_stands_on_the_ambient_pressure_and_a_nonlinear_one_is_the_snapshots(
    noise_map: InverseMap, noise_only: Vehicle, snapshots: Snapshots, structure: StructuralModel
) -> None:
    """The mean strain is that of the mean pressure, at any q_inf. To an absolute field nothing is added."""
    assert noise_map.field_is_net
    ratio, p_inf = np.array([0.5, 1.0, 2.0]), np.array([1e3, 2e3, 4e3])
    strain = ratio[:, None] * noise_map.mean_strain
    made = Estimator(noise_map).estimate(strain, ratio * noise_map.nominal_dynamic_pressure)
    expected = ratio[:, None] * noise_map.field_mean + p_inf[:, None]
    np.testing.assert_allclose(estimated_fields(made, p_inf), expected, rtol=1e-12)
    full = with_manifold(inverse_map=noise_map, vehicle=noise_only, snapshots=snapshots, structure=structure)
    conditions = snapshots.conditions()
    rows = [number for number, one in enumerate(conditions) if one.sideslip_angle > 0.0][::9]
    p_inf, q, mach = (
        np.array([getattr(conditions[row], name) for row in rows])
        for name in ("ambient_pressure", "dynamic_pressure", "mach_number")
    )
    operator = inverse_problem(noise_only, snapshots, structure).strain_operator
    strain = (snapshots.pressure[rows] - p_inf[:, None]) @ operator.T
    made = Estimator(full).estimate(strain, q, mach_number=mach, static_pressure=p_inf)
    assert not made.is_linear.any()
    field = estimated_fields(made, np.full(len(rows), np.nan))
    assert field_error(field, snapshots.pressure[rows]) < 0.01


def test_the_true_field_is_the_field_of_the_snapshots(
    vehicle: Vehicle,
    noise_map: InverseMap,
    snapshots: Snapshots,
    table: FlowTable,
    true_model: TrueStructure,
    structure: StructuralModel,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """One solver on one grid: flows between the knots differ by what the splines of the table leave."""
    chosen = [
        row
        for row, one in enumerate(snapshots.conditions())
        if 5.25 <= one.mach_number <= 6.75 and 0.03 < one.total_incidence <= table.incidence_knots[-1]
    ]
    parts = {"vehicle": vehicle, "structure": true_model, "flows": table, "inverse_map": noise_map}
    world = ComparedWorld(**parts, snapshots=snapshots, map_structure=structure, training=1200)
    flights = SimpleNamespace(conditions=tuple(snapshots.conditions()[row] for row in chosen))
    monkeypatch.setattr(world, "flights", lambda case: flights)
    field = world.fields(Case(error="any", group="alone"))
    assert field_error(field, snapshots.pressure[chosen]) < 0.03


@pytest.mark.fast
def test_maps_know_of_the_errors_that_are_drawn_and_unknown_estimators_are_refused() -> None:
    shipped = load_vehicle(IC3X)
    exact, whole = (knowing(shipped, is_exact, 2) for is_exact in (True, False))
    assert exact.noise.gauge_gain_percent == exact.noise.dynamic_pressure_percent == 0.0
    assert whole.noise == shipped.noise
    assert (exact.map.case, exact.map.estimator, exact.map.keep_field) == (2, "nonlinear", True)
    assert exact.map.discrepancy_percent == 0.8
    assert whole.map.discrepancy_percent == shipped.map.discrepancy_percent
    for name in ("neural network", "nonlinear, M only"):
        with pytest.raises(InputError, match=f"estimators: expected linear Case 1, .*; got '{name}'"):
            refuse_unknown(["nonlinear, q_inf only", name])


@pytest.fixture(scope="module")
def cone() -> ComparedWorld:
    """The elliptic cone, its structure a closed form; flow and maps are real."""
    vehicle, snapshots = knowing(shape_vehicle(), is_exact=False, case=1), grid_snapshots()
    structure = shape_structure(snapshots.surface)
    flows = flown(flown_conditions(Where(), vehicle, None, 15, np.random.default_rng(1)))
    maps = maps_for(vehicle, snapshots, structure, is_exact=False)
    parts = {"vehicle": vehicle, "structure": beam(flows.surface), "flows": flows, "inverse_map": maps[NONLINEAR]}
    how = {"conditions": 15, "training": 1200, "_made": {False: maps}}
    return ComparedWorld(**parts, **how, snapshots=snapshots, map_structure=structure)


@pytest.mark.parametrize("stated", [0.0, 1.0])
def test_estimators_are_scored_with_rolling_moment_field_and_air_data(cone: ComparedWorld, stated: float) -> None:
    names = ["linear Case 2", NONLINEAR, "nonlinear, q_inf only", "nonlinear, M and p_inf only", "Kalman filter"]
    how = {"over_time": {"steps": 5}, "air": {"drawn": True}, "tenths_by": ["mach_number"]}
    case = Case(error="any", group="alone", as_built=Built(stated=stated), **how)
    plan = Plan(vehicles=2, estimators=names)
    linear, nonlinear, without_air, without_q, filtered = (
        {row["load"]: row for row in rows}
        for rows in scored(cone, case, plan, make_estimators=compared_estimators).values()
    )
    loads = ("C_A", "C_N", "C_Y", "M_P", "M_Y", ROLLING)
    assert min(nonlinear[load]["covered_percent"] for load in loads) > 99.0
    assert nonlinear["C_A"]["rms"] < linear["C_A"]["rms"]
    assert nonlinear["all"]["samples"] == 30
    assert 0.0 < nonlinear[FIELD]["median"] <= nonlinear[FIELD]["p95"] < 0.02
    assert nonlinear["angle_of_attack"]["p95"] < np.radians(0.2)
    assert nonlinear["static_pressure"]["rms"] < without_air["static_pressure"]["rms"]
    assert nonlinear["dynamic_pressure"]["rms"] < without_q["dynamic_pressure"]["rms"]
    assert nonlinear["C_N"]["bound"] < without_q["C_N"]["bound"]
    assert nonlinear["all, tenth 1 by mach_number"]["rms_C_N"] > 0.0
    assert "angle_of_attack" not in linear
    assert {ROLLING, FIELD, "angle_of_attack"}.isdisjoint(filtered)
    assert "bound" not in filtered["C_A"]


ALTITUDES_KM = (15.0, 25.0)


@pytest.mark.fast
def test_bands_hold_the_stated_share() -> None:
    random = np.random.default_rng(1)
    half = conformal_half_width(random.standard_normal((20_000, 2)))
    np.testing.assert_allclose(half, 3.0, atol=0.15)
    assert np.mean(np.abs(random.standard_normal((50_000, 2))) <= half) == pytest.approx(LEVEL, abs=1e-3)
    # Too few residuals give no band.
    assert [bool(np.isfinite(conformal_half_width(np.ones((n, 1)))).all()) for n in (300, 400)] == [False, True]


def test_drawn_errors_have_the_covariance_of_the_estimator() -> None:
    manifold, state = flight_map(discrepancy=0.05, hardware=True), np.array([[6.0, 0.08, 0.03, np.log(5e3)]])
    strain, loads = np.split(evaluate(manifold.tables, state).value, [manifold.tables.n_gauges], axis=1)
    pressure, *many = (np.repeat(one, 20_000, axis=0) for one in (np.array([5e3]), strain, loads))
    read, drawn = with_drawn_errors(manifold, pressure, *many, random=np.random.default_rng(3))
    expected = strain_covariance(manifold, manifold.gauge_covariance, state)[0]
    size = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    assert np.abs((np.cov(read.T) - expected) / size).max() < 0.06
    of_loads = 5e3**2 * np.sum(manifold.error_load**2, axis=1)
    np.testing.assert_allclose(np.diag(np.cov(drawn.T)), of_loads, rtol=0.1, atol=1e-9)


def test_training_flights_of_a_shape_are_inside_the_ranges_of_both_angles() -> None:
    manifold = shape_map().manifold
    assert manifold is not None
    flights = training_flights(manifold, ALTITUDES_KM, 400, np.random.default_rng(1))
    angles = np.degrees(flights.truth[:, 5:])
    assert np.all(np.abs(angles) <= [4.01, 2.01])
    assert np.all(np.ptp(angles, axis=0) > [7.5, 3.7])


@pytest.fixture
def few_trees(monkeypatch: pytest.MonkeyPatch) -> None:
    """Gradient boosting of a tenth of the trees: its training takes longer than all else."""
    pytest.importorskip("sklearn")
    module, kind, arguments = REGRESSIONS["gradient boosting"]
    monkeypatch.setitem(REGRESSIONS, "gradient boosting", (module, kind, {**arguments, "max_iter": 20}))
    monkeypatch.setattr(compared, "COST_TRAINING", 200)


@pytest.mark.usefixtures("few_trees")
@pytest.mark.parametrize("name", REGRESSIONS)
def test_a_regression_learns_loads_and_angles(name: str) -> None:
    """The tree without Mach number."""
    manifold, random = flight_map(), np.random.default_rng(4)
    training, calibration, flown = (
        training_flights(manifold, ALTITUDES_KM, count, random) for count in (1500, 600, 400)
    )
    if name == "regression tree":
        training = replace(training, known={DYNAMIC_PRESSURE: training.known[DYNAMIC_PRESSURE]})
    estimates = of_regression(name, training, calibration, seed=1)(flown)
    error = estimates.value - flown.truth[:, :5]
    assert np.all(error.std(axis=0) < 0.5 * flown.truth[:, :5].std(axis=0))
    assert np.mean(np.abs(error) <= 3.0 * estimates.std) > 0.98
    assert estimates.health is None
    for column, angle in enumerate(ANGLES, start=5):
        assert (estimates.extras[angle][0] - flown.truth[:, column]).std() < np.radians(2.5)


@pytest.mark.usefixtures("few_trees")
def test_the_cost_of_a_step_of_each_is_its_own() -> None:
    costs = list(step_costs(flight_map(hardware=True)).values())
    assert len(set(costs)) == len(costs) == len(REGRESSIONS)
    assert all(0.0 < cost < 1.0 for cost in costs)


def readings_of(inverse_map: InverseMap, count: int) -> Readings:
    """Return ``count`` readings of each of three states of the map at its nominal q_inf."""
    random = np.random.default_rng(2)
    state = random.standard_normal((3, inverse_map.state_operator.shape[1]))
    strain = inverse_map.mean_strain + state @ inverse_map.state_operator.T
    q = np.full(3, inverse_map.nominal_dynamic_pressure)
    loads = (inverse_map.load_of_mean + state @ inverse_map.load_per_state.T)[:, FIVE_LOADS]
    noise = inverse_map.noise_std * random.standard_normal((count, *strain.shape))
    return Readings(
        strain=np.swapaxes(strain + noise, 0, 1),
        known={DYNAMIC_PRESSURE: q},
        truth=loads / (q[:, None] * inverse_map.references[FIVE_LOADS]),
        vehicle=np.arange(3),
        flight=np.arange(3),
    )


def test_one_reading_without_a_walk_is_case_2(noise_map: InverseMap, monkeypatch: pytest.MonkeyPatch) -> None:
    """More readings are better, and inside the band."""
    one, many = readings_of(noise_map, 1), readings_of(noise_map, 20)
    first, last = (of_random_walk(noise_map)(read) for read in (one, many))
    assert np.all(last.std < first.std)
    assert np.all(np.abs(last.value - many.truth) <= 4.0 * last.std)
    assert last.health is None
    monkeypatch.setattr(compared, "STEP_STD", 0.0)
    mean, _ = after_reading(noise_map, before_readings(noise_map, 3), one.last, np.ones(3))
    expected = one.last @ state_gain(noise_map).T + state_offset(noise_map)
    np.testing.assert_allclose(mean, expected, atol=1e-6 * np.abs(expected).max())
