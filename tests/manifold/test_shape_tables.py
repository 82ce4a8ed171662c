"""The nonlinear estimator of a shape that is no body of revolution: tables over Mach number and both angles."""

from dataclasses import replace
from functools import cache
from math import radians
from pathlib import Path

import numpy as np
import pytest
from flight_maps import flight_map
from shape_case import (
    ALTITUDE,
    MIRRORED,
    N_D,
    SIDESLIP_DEG,
    flown,
    grid_conditions,
    grid_snapshots,
    shape_map,
    shape_structure,
    shape_vehicle,
)

from builder.campaign.snapshots import Snapshots
from builder.inverse.build import build_inverse_map, snapshot_coefficients
from builder.inverse.problem import inverse_problem
from builder.manifold.condition_tables import condition_tables, with_harmonics
from builder.manifold.discrepancy import process_on_surface, process_size
from builder.manifold.nonlinear_build import with_manifold
from builder.manifold.state_tables import state_tables
from builder.vehicle.map_options import MapEntry
from strainfmu.errors import InputError
from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.flight_tables import FlightTables, evaluate
from strainfmu.estimator.map.inverse_map import InverseMap, load_inverse_map, save_inverse_map
from strainfmu.estimator.map.nonlinear_map import ManifoldMap
from strainfmu.estimator.off_deadline import table_pressure
from strainfmu.flight_condition import FlightCondition

RANDOM = np.random.default_rng(8)


def between(count: int) -> list[FlightCondition]:
    """Random conditions inside the grid, off its knots."""
    mach, alpha, beta = (RANDOM.uniform(*ends, count) for ends in ((6.0, 7.0), (-4.0, 4.0), (-2.0, 2.0)))
    angles = np.radians(np.column_stack([alpha, beta])).tolist()
    return [FlightCondition(one, *each, ALTITUDE) for one, each in zip(mach.tolist(), angles, strict=True)]


@cache
def held_out() -> Snapshots:
    return flown(between(40))


@cache
def inverse_map() -> InverseMap:
    return shape_map()


def readings(snapshots: Snapshots) -> np.ndarray:
    net = snapshots.pressure - snapshots.internal_pressure[:, None]
    return np.asarray(net @ shape_structure(snapshots.surface).strain_operator("four_rows").T)


def chosen_of(snapshots: Snapshots, rows: list[int]) -> Snapshots:
    names = ("condition", "pressure", "internal_pressure", "solved", "flow", "momentum_error", "repairs")
    changed = {name: getattr(snapshots, name)[rows] for name in names}
    return replace(snapshots, **changed, mass_error=None)


def state_of(condition: FlightCondition) -> np.ndarray:
    incidence, roll = condition.total_incidence, condition.leeward_roll_angle
    log_pressure = np.log(condition.ambient_pressure)
    return np.array([condition.mach_number, incidence * np.cos(roll), incidence * np.sin(roll), log_pressure])


def tables_of(estimator: Estimator) -> ManifoldMap:
    assert estimator.inverse_map.manifold is not None
    return estimator.inverse_map.manifold


def test_tables_pass_through_the_snapshots_and_err_between_as_stated() -> None:
    manifold = inverse_map().manifold
    assert manifold is not None
    n = N_D
    for snapshots in (grid_snapshots(), held_out()):
        state = np.array([state_of(one) for one in snapshots.conditions()])
        off = evaluate(manifold.tables, state).value[:, :n] - readings(snapshots)
        size = np.sqrt(np.mean(readings(snapshots) ** 2, axis=0))
        assert np.all(np.abs(off) < (1e-3 if snapshots is grid_snapshots() else 5e-3) * size)
    terms = {one["name"]: one["rms_strain"] for one in inverse_map().provenance["table_error_terms"]}
    assert np.sqrt(np.mean(off**2)) < terms["interpolation"]


def test_jacobian_is_that_of_central_differences() -> None:
    manifold = inverse_map().manifold
    assert manifold is not None
    state = np.array([state_of(one) for one in between(6)])
    found = evaluate(manifold.tables, state).jacobian
    for k, step in enumerate(1e-5 * np.eye(4)):
        ahead, behind = (evaluate(manifold.tables, state + sign * step).value for sign in (1.0, -1.0))
        size = np.abs(found[:, :, k]).max()
        np.testing.assert_allclose(found[:, :, k], (ahead - behind) / 2e-5, rtol=0.0, atol=1e-7 * size)


def test_flights_between_the_snapshots_are_found() -> None:
    random, snapshots = np.random.default_rng(2), held_out()
    conditions = snapshots.conditions()
    strain = readings(snapshots) + inverse_map().noise_std * random.standard_normal((len(conditions), N_D))
    true = snapshot_coefficients(shape_vehicle(), snapshots, _loads(snapshots))
    q = np.array([one.dynamic_pressure for one in conditions])
    mach = np.array([one.mach_number for one in conditions]) + 0.05 * random.standard_normal(len(q))
    estimator = Estimator(inverse_map())
    found = estimator.estimate(strain, q, dynamic_pressure_std=0.0, mach_number=mach, altitude=ALTITUDE)
    linear = estimator.linear.estimate(strain, q, dynamic_pressure_std=0.0)
    error = found.coefficients - true
    rms, of_linear = (np.sqrt(np.mean(one**2, axis=0)) for one in (error, linear.coefficients - true))
    assert np.all(rms < 1.5 * of_linear)  # which expects no pressure off the snapshots
    assert np.mean(np.abs(error) <= 3.0 * found.coefficients_std) >= 0.99
    angles = np.array([[one.angle_of_attack, one.sideslip_angle] for one in conditions])
    assert np.quantile(np.abs(found.air_data.value[:, :2] - angles), 0.95) < radians(0.1)
    assert np.all(found.health == HealthState.OK)


def test_the_level_of_the_pressure_is_that_of_the_tables() -> None:
    """Axial force follows from the state; what its deviation does not hold of another level is no good sample."""
    snapshots = held_out()
    conditions = snapshots.conditions()
    q, mach, ambient = (
        np.array([getattr(one, name) for one in conditions])
        for name in ("dynamic_pressure", "mach_number", "ambient_pressure")
    )
    noise = 5e-7 * np.random.default_rng(12).standard_normal((len(q), N_D))
    vehicle = shape_vehicle(discrepancy_of_overpressure_percent=10.0)
    noisy = vehicle.noise.model_copy(update={"std_um_per_m": 0.5})
    vehicle = vehicle.model_copy(update={"noise": noisy})
    structure = shape_structure(grid_snapshots().surface)
    made = build_inverse_map(vehicle, grid_snapshots(), structure)
    estimator = Estimator(with_manifold(made, vehicle, grid_snapshots(), structure))
    for level in (-0.2, -0.1, 0.0, 0.1, 0.2):
        flow = replace(
            snapshots,
            pressure=ambient[:, None] + (1.0 + level) * (snapshots.pressure - ambient[:, None]),
        )
        true = snapshot_coefficients(shape_vehicle(), flow, _loads(flow))[:, 0]
        found = estimator.estimate(readings(flow) + noise, q, mach_number=mach, altitude=ALTITUDE)
        off = np.abs(found.coefficients[:, 0] - true)
        assert np.all((off <= 3.0 * found.coefficients_std[:, 0]) | (found.health != HealthState.OK))
        if level == 0.0:
            linear = estimator.linear.estimate(readings(flow) + noise, q)
            assert np.mean(off) < np.mean(np.abs(linear.coefficients[:, 0] - true))


@pytest.mark.parametrize(("mach", "size"), [((2.0, 3.0, 4.0), 8e-4 * 0.7 * 29.0 / 3.0), ((6.0, 7.0, 8.0), 0.02)])
def test_the_process_goes_with_the_dynamic_pressure(mach: tuple[float, ...], size: float) -> None:
    flow = flown(grid_conditions(mach=mach, alpha=(0.0,), beta=(-1.0, 1.0)))
    vehicle = shape_vehicle(discrepancy_percent=None)
    problem = inverse_problem(vehicle, flow, shape_structure(flow.surface))
    assert process_size(problem) == pytest.approx(size, rel=1e-12)
    stated = shape_vehicle(discrepancy_percent=3.0)
    assert process_size(replace(problem, entry=stated.map)) == pytest.approx(0.03)


def _loads(snapshots: Snapshots) -> np.ndarray:
    vehicle = shape_vehicle()
    return inverse_problem(vehicle, snapshots, shape_structure(snapshots.surface)).load_operator[:5]


def test_mirrored_strain_has_the_mirrored_answer() -> None:
    estimator, conditions = Estimator(inverse_map()), between(8)
    state = np.array([state_of(one) for one in conditions])
    strain = evaluate(tables_of(estimator).tables, state).value[:, :N_D]
    strain = strain + 5e-8 * np.random.default_rng(3).standard_normal(strain.shape)
    q = np.array([one.dynamic_pressure for one in conditions])
    one, other = (
        estimator.estimate(each, q, mach_number=6.5, q_source="independent")
        for each in (strain, strain[:, MIRRORED])
    )
    sign = np.array([1.0, 1.0, -1.0, 1.0, -1.0])
    off = np.abs(other.coefficients - sign * one.coefficients)
    # Triangles, and so normals, loads and pressures, are no mirror images.
    assert np.all(off.max(axis=0) < 0.015 * np.abs(one.coefficients).max(axis=0))
    np.testing.assert_allclose(other.coefficients_std, one.coefficients_std, rtol=0.015)
    of_air = np.array([1.0, -1.0, 1.0, -1.0, 1.0, 1.0, 1.0])
    off = (other.air_data.value - of_air * one.air_data.value) / one.air_data.std
    assert np.abs(off).max() < 0.5


def test_a_lost_gauge_is_that_of_tables_without_it() -> None:
    kept = np.delete(np.arange(N_D), [3, 17])
    without = Estimator(shape_map(kept.tolist()))
    snapshots = held_out()
    strain = readings(snapshots)[:6]
    q = np.array([one.dynamic_pressure for one in snapshots.conditions()])[:6]
    valid = np.isin(np.arange(N_D), kept)
    masked = Estimator(inverse_map()).estimate(strain, q, valid=valid, mach_number=6.5)
    rebuilt = without.estimate(strain[:, kept], q, mach_number=6.5)
    np.testing.assert_allclose(masked.coefficients, rebuilt.coefficients, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(masked.coefficients_std, rebuilt.coefficients_std, rtol=1e-6)


def test_strain_linear_in_the_angles_has_linear_tables() -> None:
    """Splines of a straight line are that line, on the rings of the tables and beyond the snapshots too."""
    snapshots = grid_snapshots()
    state = np.array([state_of(one) for one in snapshots.conditions()])
    ambient = np.exp(state[:, 3])
    alpha = np.array([one.angle_of_attack for one in snapshots.conditions()])
    linear = replace(
        snapshots, pressure=ambient[:, None] * (1.0 + alpha[:, None] * np.ones(snapshots.pressure.shape))
    )
    found = condition_tables(linear, np.eye(1, linear.pressure.shape[1]), True)
    assert np.abs(found.errors["interpolation"]).max() < 1e-12
    tables = FlightTables(
        mach_knots=found.mach_knots,
        incidence_knots=found.incidence_knots,
        response=found.coefficients,
        fixed_response=np.zeros(1),
    )
    value = evaluate(tables, np.column_stack([state[:, :3], np.zeros(len(state))])).value[:, 0]
    np.testing.assert_allclose(value, alpha, atol=1e-6)


def test_the_pressure_between_the_snapshots_is_found(tmp_path: Path) -> None:
    """On a file's map, with and without one gauge; the deviation of a node holds its error."""
    save_inverse_map(shape_map(keep_field=True), tmp_path / "map.h5")
    estimator, snapshots = Estimator(load_inverse_map(tmp_path / "map.h5")), held_out()
    random, off, size = np.random.default_rng(4), [], []
    for row, condition in enumerate(snapshots.conditions()[:10]):
        strain = readings(snapshots)[row] + inverse_map().noise_std * random.standard_normal(N_D)
        flow = {"mach_number": condition.mach_number, "altitude": ALTITUDE}
        found = estimator.estimate(strain, condition.dynamic_pressure, valid=np.arange(N_D) != row, **flow)
        field = found.pressure()
        np.testing.assert_allclose(found.pressure(with_std=False).pressure, field.pressure, rtol=1e-9)
        off.append(np.abs(field.pressure - snapshots.pressure[row]) / field.std)
        true = snapshots.pressure[row]
        size.append(np.linalg.norm(field.pressure - true) / np.linalg.norm(true))
    assert np.mean(np.array(off) <= 3.0) > 0.99
    assert np.median(size) < 0.02


def test_the_derivative_of_the_pressure_by_the_state() -> None:
    manifold = shape_map(keep_field=True).manifold
    assert manifold is not None
    assert manifold.shape_field is not None
    state, step = state_of(between(1)[0]), 1e-6
    found = table_pressure(manifold, manifold.shape_field, state)
    for k in range(4):
        moved = [state + sign * step * np.eye(4)[k] for sign in (1.0, -1.0)]
        high, low = (table_pressure(manifold, manifold.shape_field, one).value for one in moved)
        expected = (high - low) / (2.0 * step)
        np.testing.assert_allclose(found.jacobian[:, k], expected, rtol=1e-4, atol=1e-5 * np.abs(expected).max())


def test_a_sideslip_beyond_the_snapshots_is_outside() -> None:
    """The total incidence is less than that in a corner of the snapshots."""
    beyond = FlightCondition(6.5, radians(0.5), radians(3.5), ALTITUDE)
    manifold = inverse_map().manifold
    assert manifold is not None
    assert beyond.total_incidence < manifold.incidence_limit
    strain = evaluate(manifold.tables, state_of(beyond)[None]).value[0, :N_D]
    found = Estimator(inverse_map()).estimate(strain, beyond.dynamic_pressure, mach_number=6.5)
    assert found.health == HealthState.OUTSIDE


def test_the_map_file_holds_the_ranges(tmp_path: Path) -> None:
    save_inverse_map(inverse_map(), tmp_path / "map.h5")
    held = load_inverse_map(tmp_path / "map.h5").manifold
    assert held is not None
    np.testing.assert_allclose(np.degrees(held.crossflow_range), [[-4.0, 4.0], [-2.0, 2.0]], atol=1e-12)


@pytest.mark.parametrize(
    ("conditions", "message"),
    [
        (
            grid_conditions(mach=[6.0]),
            "needs 2 Mach numbers, 3 angles of attack and 3 sideslip angles at least, got 1",
        ),
        (grid_conditions(beta=[-1.0, 2.0]), "got 3 Mach numbers, 5 angles of attack and 2 sideslip angles"),
        (grid_conditions()[:-1], r"got none of Mach number 7, angle of attack 4 deg, sideslip 2 deg"),
    ],
)
def test_snapshots_that_do_not_suffice_are_named(conditions: list[FlightCondition], message: str) -> None:
    snapshots = chosen_of(grid_snapshots(), [grid_conditions().index(one) for one in conditions])
    vehicle, structure = shape_vehicle(), shape_structure(snapshots.surface)
    problem = inverse_problem(vehicle, snapshots, structure)
    with pytest.raises(InputError, match=message):
        state_tables(problem, structure.surface, problem.strain_operator)


def test_snapshots_of_one_side_have_mirror_images() -> None:
    """Tables of one side are those of both, but for the triangles, which are no mirror images."""
    one_side = [row for row, one in enumerate(grid_conditions()) if one.sideslip_angle >= 0.0]
    snapshots = chosen_of(grid_snapshots(), one_side)
    vehicle, structure = shape_vehicle(), shape_structure(snapshots.surface)
    made = with_manifold(build_inverse_map(vehicle, snapshots, structure), vehicle, snapshots, structure).manifold
    both = inverse_map().manifold
    assert made is not None
    assert both is not None
    np.testing.assert_allclose(made.crossflow_range, both.crossflow_range)
    state = np.array([state_of(one) for one in held_out().conditions()])
    found, expected = (evaluate(one.tables, state).value for one in (made, both))
    size = np.abs(expected).max(axis=0)
    assert np.all(np.abs(found - expected) < 0.02 * size)


def test_two_mach_numbers_follow_the_dynamic_pressure() -> None:
    """Newtonian overpressure is in proportion to M^2."""
    few = flown(grid_conditions(mach=(6.0, 7.0), beta=SIDESLIP_DEG[::2]))
    operator = np.eye(3, few.pressure.shape[1], 40)
    found = condition_tables(few, operator, True)
    tables = FlightTables(
        mach_knots=found.mach_knots,
        incidence_knots=found.incidence_knots,
        response=found.coefficients,
        fixed_response=np.zeros(3),
    )
    check = flown([FlightCondition(6.5, radians(2.0), 0.0, ALTITUDE)])
    true = operator @ (check.pressure[0] / check.conditions()[0].ambient_pressure - 1.0)
    state = state_of(check.conditions()[0])
    state[3] = 0.0
    np.testing.assert_allclose(evaluate(tables, state[None]).value[0], true, rtol=2e-3)


def test_tables_take_the_number_of_harmonics_of_others() -> None:
    """Two flow models leave out negligible harmonics of the roll angle each for itself."""
    table = np.random.default_rng(1).standard_normal((3, 4, 2, 5, 2))
    longer = with_harmonics(table, 7)
    assert longer.shape == (3, 4, 2, 7, 2)
    assert not longer[:, :, :, 5:].any()
    np.testing.assert_array_equal(with_harmonics(longer, 5), table)
    np.testing.assert_array_equal(with_harmonics(table, 2), table[:, :, :, :2])


def test_the_process_has_unit_variance_and_tells_the_sides_of_a_fin_apart() -> None:
    surface = grid_snapshots().surface
    shapes = process_on_surface(surface, MapEntry(discrepancy_length=0.2, discrepancy_roll_deg=40.0))
    covariance = shapes @ shapes.T
    assert np.all(np.abs(np.diag(covariance) - 1.0) < 0.03)
    far = np.abs(surface.point[:, 0] - surface.point[:1, 0]) > 0.8
    assert np.all(np.abs(covariance[0, far]) < 0.1)
    top, bottom = np.argmax(surface.node_normal[:, 2]), np.argmin(surface.node_normal[:, 2])
    assert abs(covariance[top, bottom]) < 0.1


def test_two_deviations_beyond_a_range_are_outside() -> None:
    """Ranges of both angles are few deviations wide; with others it takes three."""
    estimator, tables = Estimator(inverse_map()), inverse_map().manifold
    assert tables is not None
    assert tables.outside_score < flight_map().outside_score

    def at(sideslip: float) -> Estimate:
        one = FlightCondition(6.5, 0.0, sideslip, ALTITUDE)
        strain = evaluate(tables_of(estimator).tables, state_of(one)[None]).value[:, :N_D]
        return estimator.estimate(strain, one.dynamic_pressure, mach_number=6.5, altitude=ALTITUDE)

    end, health = 1.01 * radians(2.0), []
    std = float(at(end).air_data.std[0, 1])
    for off in (-1.0, 1.5, 2.5):
        health.append(int(at(end + off * std).health[0]))
    assert health == [HealthState.OK, HealthState.OK, HealthState.OUTSIDE]
