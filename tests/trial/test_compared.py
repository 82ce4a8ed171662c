"""Estimators of several kinds: maps that know of the errors of a case, pressure fields, what each is given;
learning ones and their bands, and the Kalman filter with a random walk."""

from dataclasses import replace

import numpy as np
import pytest
from flight_maps import flight_map
from shape_case import flown, grid_snapshots, shape_map, shape_structure, shape_vehicle
from shape_truth import beam
from state_estimates import state_gain, state_offset
from sweeps import sweep

from builder.trial import compared
from builder.trial.cases import Built, Case, Plan
from builder.trial.compared import (
    FIELD,
    LEVEL,
    NONLINEAR,
    REGRESSIONS,
    ComparedWorld,
    after_reading,
    compared_estimators,
    conformal_half_width,
    knowing,
    maps_for,
    of_random_walk,
    of_regression,
    refuse_unknown,
    step_costs,
    training_flights,
)
from builder.trial.conditions import Where, flown_conditions
from builder.trial.readings import ANGLES, Readings
from builder.trial.run import scored
from builder.trial.score import ROLLING
from builder.vehicle.file import IC3X, load_vehicle
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE
from strainfmu.estimator.other_loads import FIVE_LOADS


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


@pytest.mark.parametrize("stated", sweep([0.0, 1.0], [1.0]))
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
    assert linear[FIELD]["p95"] < 0.05
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
    monkeypatch.setattr(compared, "COST_STEPS", 3)


@pytest.mark.usefixtures("few_trees")
@pytest.mark.parametrize("name", sweep(REGRESSIONS, ["regression tree", "gradient boosting"]))
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


def test_one_reading_without_a_walk_is_case_2(cone: ComparedWorld, monkeypatch: pytest.MonkeyPatch) -> None:
    """More readings, here of three states at the nominal q_inf, are better, and inside the band."""
    made = cone.maps(Case(error="any", group="alone", as_built=Built(stated=1.0)))["linear Case 2"]
    random, q = np.random.default_rng(2), np.full(3, made.nominal_dynamic_pressure)
    state = random.standard_normal((3, made.state_operator.shape[1]))
    loads = (made.load_of_mean + state @ made.load_per_state.T)[:, FIVE_LOADS]
    strain = (made.mean_strain + state @ made.state_operator.T)[:, None]
    one, many = (
        Readings(
            strain=strain + made.noise_std * random.standard_normal((3, count, strain.shape[-1])),
            known={DYNAMIC_PRESSURE: q},
            truth=loads / (q[:, None] * made.references[FIVE_LOADS]),
            vehicle=np.arange(3),
            flight=np.arange(3),
        )
        for count in (1, 20)
    )
    first, last = (of_random_walk(made)(read) for read in (one, many))
    assert np.all(last.std < first.std)
    assert np.all(np.abs(last.value - many.truth) <= 4.0 * last.std)
    assert last.health is None
    monkeypatch.setattr(compared, "STEP_STD", 0.0)
    before = np.zeros_like(state), np.eye(state.shape[1])
    mean, _ = after_reading(made, before, one.last, np.ones(3))
    expected = one.last @ state_gain(made).T + state_offset(made)
    np.testing.assert_allclose(mean, expected, atol=1e-6 * np.abs(expected).max())
