"""The nonlinear estimator as it is used: inputs, health, fall back to the linear map, air data, one by one."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from flight_maps import AREA, LENGTH, ROWS, STATIONS, exact_response, flight_map
from scaled_maps import scaled_map

import strainfmu
from builder.manifold.discrepancy import TESTED
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import AIR_DATA_NAMES, QSource
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState, chi_square_limit
from strainfmu.estimator.map.inverse_map import InverseMap, load_inverse_map, save_inverse_map
from strainfmu.estimator.policies import POLICIES
from strainfmu.flight_condition import FlightCondition

pytestmark = pytest.mark.fast
N_D = STATIONS * ROWS
CONDITION = FlightCondition(6.2, np.radians(5.0), np.radians(-3.0), 20e3)


def whole_map() -> InverseMap:
    return replace(scaled_map(2, 1, N_D), manifold=flight_map(discrepancy=1e-3))


def strain_at(condition: FlightCondition, seed: int = 1) -> np.ndarray:
    incidence, phi = condition.total_incidence, condition.leeward_roll_angle
    u, w = incidence * np.cos(phi), incidence * np.sin(phi)
    exact = exact_response(condition.mach_number, u, w, condition.ambient_pressure)
    return exact[:N_D] + 2e-7 * np.random.default_rng(seed).standard_normal(N_D)


def navigation(condition: FlightCondition) -> dict[str, float]:
    return {
        "dynamic_pressure": condition.dynamic_pressure,
        "mach_number": condition.mach_number,
        "static_pressure": condition.ambient_pressure,
        "q_source": float(QSource.INDEPENDENT),
    }


def test_a_jump_of_the_pressure_keeps_the_deviations() -> None:
    """The weights of a step belong to the pressure of the step before."""
    off_tables = replace(whole_map(), manifold=flight_map(discrepancy=3e-2))
    estimator = Estimator(off_tables)
    before = estimator.track(strain_at(CONDITION), **navigation(CONDITION))
    lower = replace(CONDITION, altitude=CONDITION.altitude - 1000.0)
    after = estimator.track(strain_at(lower), **navigation(lower))
    assert after.loads_std == pytest.approx(before.loads_std, rel=0.06)


def test_the_air_of_a_day_differs_from_the_standard_atmosphere() -> None:
    """By 7 % where the map says no other, as over latitudes and seasons; a stated deviation counts for both."""
    estimator, strain = Estimator(whole_map()), strain_at(CONDITION)
    mach, altitude = CONDITION.mach_number, CONDITION.altitude
    pressure = CONDITION.ambient_pressure
    by_altitude = estimator.estimate(strain, mach_number=mach, altitude=altitude)
    for flow in (
        {"static_pressure": pressure, "static_pressure_std": 0.07 * pressure},
        {"static_pressure": pressure, "static_pressure_std": 0.07 * pressure, "altitude": altitude - 1000.0},
    ):
        same = estimator.estimate(strain, mach_number=mach, **flow)
        np.testing.assert_array_equal(same.loads_std, by_altitude.loads_std)
    measured = estimator.estimate(strain, mach_number=mach, static_pressure=pressure)
    assert np.all(measured.coefficients_std[1:3] < 0.6 * by_altitude.coefficients_std[1:3])
    for part in (-1.5, 1.5):
        day = replace(CONDITION, altitude=altitude + part * 450.0)  # at which the pressure is 10 % another
        found = estimator.estimate(strain_at(day), mach_number=mach, altitude=altitude)
        error = np.abs(found.coefficients - estimator.estimate(strain_at(day), **navigation(day)).coefficients)
        assert np.all(error < 3.0 * found.coefficients_std)
    stated = estimator.estimate(strain, mach_number=mach, altitude=altitude, static_pressure_std=0.02 * pressure)
    np.testing.assert_array_equal(stated.loads_std, measured.loads_std)


def test_an_exact_dynamic_pressure_alone_is_believed() -> None:
    """Where strain hardly tells Mach number from pressure, the iterations end near the minimum, not at it."""
    random = np.random.default_rng(1)
    flights = [
        FlightCondition(mach_number=mach, angle_of_attack=a, sideslip_angle=b, altitude=height)
        for mach, a, b, height in random.uniform(
            (5.2, -0.08, -0.08, 18e3), (7.8, 0.08, 0.08, 26e3), (150, 4)
        ).tolist()
    ]
    found = Estimator(whole_map()).estimate(
        np.array([strain_at(one, seed) for seed, one in enumerate(flights)]),
        [one.dynamic_pressure for one in flights],
        dynamic_pressure_std=0.0,
    )
    residual = found.air_data_residual[:, 2]
    assert np.max(np.abs(residual)) < 4.5
    assert np.sqrt(np.mean(residual**2)) < 1.1
    assert found.air_data_used[:, 2].all()


def test_air_data_are_those_of_the_condition() -> None:
    found = Estimator(whole_map()).estimate(strain_at(CONDITION), **navigation(CONDITION))
    true = dict(
        zip(
            AIR_DATA_NAMES,
            (
                CONDITION.angle_of_attack,
                CONDITION.sideslip_angle,
                CONDITION.total_incidence,
                CONDITION.leeward_roll_angle,
                CONDITION.mach_number,
                CONDITION.ambient_pressure,
                CONDITION.dynamic_pressure,
            ),
            strict=True,
        )
    )
    air = found.air_data
    for i, name in enumerate(AIR_DATA_NAMES):
        assert abs(air.value[i] - true[name]) < 3.5 * air.std[i], name
    assert found.health is HealthState.OK
    assert np.all(air.is_identified)


def test_without_incidence_its_error_is_all_of_the_crossflow_and_the_roll_angle_any() -> None:
    """The state is symmetric: the wind has no direction along which to take the error."""
    strain = exact_response(6.2, 0.0, 0.0, 5e3)[:N_D]
    found = Estimator(whole_map()).estimate(strain, mach_number=6.2, static_pressure=5e3)
    std = dict(zip(found.air_data.names, found.air_data.std, strict=True))
    assert found.air_data.value[2] < 1e-4
    assert std["total_incidence"] == pytest.approx(np.hypot(*found.air_data.std[:2]), rel=1e-3)
    assert std["wind_roll_angle"] == pytest.approx(np.pi / np.sqrt(3.0))
    assert not found.air_data.is_identified[3]


def test_one_sample_is_a_row_of_several() -> None:
    """One estimate for strain of one axis, as of the linear estimator; steps on their own are the same."""
    estimator, flow = Estimator(whole_map()), navigation(CONDITION)
    strain = np.array([strain_at(CONDITION, seed) for seed in range(3)])
    several = estimator.estimate(strain, **flow)
    assert len(several) == 3
    for row in range(3):
        one, step = estimator.estimate(strain[row], **flow), estimator.step(strain[row], **flow)
        assert one.health is several[row].health
        np.testing.assert_allclose(one.loads, several[row].loads, rtol=1e-9)
        np.testing.assert_allclose(one.air_data.value, several.air_data.value[row], rtol=1e-9)
        assert np.array_equal(one.loads, step.loads)
    assert estimator.estimate(strain[:1], **flow).is_series


def test_loading_a_map_with_tables_gives_the_nonlinear_estimator(tmp_path: Path) -> None:
    save_inverse_map(whole_map(), tmp_path / "map.h5")
    loaded = load_inverse_map(tmp_path / "map.h5")
    assert loaded.manifold is not None
    assert np.array_equal(loaded.manifold.response, flight_map().response)
    estimator = strainfmu.load(tmp_path / "map.h5")
    assert estimator.is_nonlinear
    save_inverse_map(replace(whole_map(), manifold=None), tmp_path / "linear.h5")
    assert not strainfmu.load(tmp_path / "linear.h5").is_nonlinear


def test_strain_off_the_tables_gets_the_loads_of_the_linear_map() -> None:
    estimator = Estimator(whole_map())
    strain = strain_at(CONDITION) + 2e-5 * np.cos(np.arange(N_D))
    found = estimator.estimate(strain, **navigation(CONDITION))
    linear = estimator.linear.estimate(strain, CONDITION.dynamic_pressure)
    assert found.is_linear
    assert found.health in (HealthState.INCONSISTENT, HealthState.OUTSIDE)
    assert np.array_equal(found.loads, linear.loads)
    blind = estimator.estimate(strain)
    assert not blind.is_linear  # the linear map knows nothing without q_inf
    assert blind.health in (HealthState.INCONSISTENT, HealthState.OUTSIDE)


def test_without_gauges_nothing_is_known() -> None:
    found = Estimator(whole_map()).estimate(np.full(N_D, np.nan), **navigation(CONDITION))
    assert found.health is HealthState.INVALID
    assert np.all(np.isnan(found.loads))
    assert np.all(np.isnan(found.air_data.value))


def test_a_flight_beyond_the_tables_is_outside() -> None:
    beyond = replace(CONDITION, angle_of_attack=np.radians(12.5))
    found = Estimator(whole_map()).estimate(strain_at(beyond), **navigation(beyond))
    assert found.health is HealthState.OUTSIDE
    fast = replace(CONDITION, mach_number=8.4)
    found = Estimator(whole_map()).estimate(strain_at(fast), **navigation(fast))
    assert found.health is HealthState.OUTSIDE


def test_a_lost_gauge_degrades_and_a_wrong_one_is_suspect() -> None:
    estimator, strain = Estimator(whole_map()), strain_at(CONDITION)
    valid = np.ones(N_D, dtype=bool)
    valid[4] = False
    assert estimator.estimate(strain, valid=valid, **navigation(CONDITION)).health is HealthState.DEGRADED
    wrong = strain.copy()
    wrong[7] += 2.2e-6
    found = estimator.estimate(wrong, **navigation(CONDITION))
    assert found.suspects == (7,)
    assert found.health in (HealthState.SUSPECT, HealthState.INCONSISTENT)


def test_a_result_is_shown_in_a_few_lines() -> None:
    estimator, strain = Estimator(whole_map()), strain_at(CONDITION)
    one = estimator.estimate(strain, **navigation(CONDITION))
    assert repr(one).startswith("Estimate: health OK, chi-square")
    assert len(repr(one).splitlines()) <= 8
    assert f"C_A {one.C_A:.5g} +- {one.sigma.C_A:.2g}" in repr(one)
    many = repr(estimator.estimate(np.tile(strain, (3, 1)), **navigation(CONDITION)))
    assert many.startswith("Estimate of 3 samples: health 3 OK")
    assert len(many.splitlines()) <= 8


def test_bad_arguments_are_named() -> None:
    estimator = Estimator(whole_map())
    with pytest.raises(InputError, match=rf"strain: expected {N_D} values, got \(3,\)"):
        estimator.estimate(np.zeros(3))
    with pytest.raises(InputError, match=rf"strain: expected \(k, {N_D}\) values, got \(2, 3\)"):
        estimator.estimate(np.zeros((2, 3)))
    with pytest.raises(InputError, match="dynamic_pressure: expected a number, got None"):
        estimator.estimate(np.zeros(N_D), None)
    with pytest.raises(InputError, match="strain: expected real numbers, got complex128"):
        estimator.estimate(np.zeros(N_D) + 1e-6j)
    with pytest.raises(InputError, match="strain: expected real numbers, got complex128"):
        estimator.track(np.zeros(N_D) + 1e-6j)
    with pytest.raises(InputError, match="mach_number: expected a number, got shape"):
        estimator.estimate(np.zeros(N_D), mach_number=[1.0, 2.0])


def test_steps_follow_the_search_and_keep_lock() -> None:
    estimator, k = Estimator(whole_map()), 40
    flown = [replace(CONDITION, angle_of_attack=np.radians(5.0 * np.sin(0.1 * step))) for step in range(k)]
    strain = np.array([strain_at(one, step) for step, one in enumerate(flown)])
    flow = {name: np.array([navigation(one)[name] for one in flown]) for name in navigation(CONDITION)}
    found, alone = estimator.track(strain, **flow), estimator.estimate(strain, **flow)
    assert np.all(np.abs(found.loads - alone.loads) < 0.2 * alone.loads_std)


def test_after_strain_off_the_tables_the_loads_come_back_late() -> None:
    k = POLICIES.return_after + 3
    strain = np.array([strain_at(CONDITION, seed) for seed in (1, 1, *range(k))])
    strain[1] += 2e-5 * np.cos(np.arange(N_D))
    found = Estimator(whole_map()).track(strain, **navigation(CONDITION))
    late = slice(1, 1 + POLICIES.return_after)
    assert np.all(found.is_linear[late])
    assert np.all(found.health[late] != HealthState.OK)
    assert not found.is_linear[-1]
    assert found.health[-1] == HealthState.OK


def test_navigation_that_may_be_correct_is_dropped_without_an_alarm() -> None:
    estimator, strain = Estimator(whole_map()), strain_at(CONDITION)
    flow, states = navigation(CONDITION), {}
    of_all = estimator.estimate(strain, **flow)
    for sigmas in (0.0, 4.5, 12.0):
        found = estimator.estimate(strain, **flow | {"mach_number": CONDITION.mach_number + 0.05 * sigmas})
        states[sigmas] = (bool(found.air_data_used[0]), found.health)
        assert np.all(np.abs(found.coefficients - of_all.coefficients) < found.coefficients_std)
    assert states == {
        0.0: (True, HealthState.OK),
        4.5: (False, HealthState.OK),
        12.0: (False, HealthState.DEGRADED),
    }


def test_samples_with_wrong_navigation_leave_the_others_as_they_are() -> None:
    estimator = Estimator(whole_map())
    strain = np.array([strain_at(CONDITION, seed) for seed in range(5)])
    mach = CONDITION.mach_number + 0.05 * np.array([0.0, 12.0, 0.0, 4.5, 0.0])
    flow = navigation(CONDITION)
    together = estimator.estimate(strain, **flow | {"mach_number": mach})
    assert together.air_data_used[:, 0].tolist() == [True, False, True, False, True]
    for row in range(5):
        alone = estimator.estimate(strain[row], **flow | {"mach_number": mach[row]})
        np.testing.assert_allclose(together.coefficients[row], alone.coefficients, rtol=1e-9)
        np.testing.assert_allclose(together.coefficients_std[row], alone.coefficients_std, rtol=1e-9)
        assert together.health[row] == alone.health


def test_a_shape_of_pressure_off_the_tables_is_seen_where_chi_square_is_not() -> None:
    whole = replace(whole_map(), manifold=flight_map(discrepancy=3e-2))
    assert whole.manifold is not None
    shapes = whole.manifold.discrepancy_shapes
    assert 1 <= shapes.shape[1] <= TESTED
    estimator, strain = Estimator(whole), strain_at(CONDITION)
    largest = 0.0
    for size in np.linspace(0.0, 40.0, 41):
        found = estimator.estimate(strain + size * shapes[:, -1], **navigation(CONDITION))
        if not found.fits:
            break
        largest = found.discrepancy_chi_square
    limit = chi_square_limit(shapes.shape[1])
    assert largest < limit < found.discrepancy_chi_square
    assert found.chi_square < found.chi_square_limit
    assert found.health is HealthState.INCONSISTENT
    assert found.is_linear


def test_the_shape_of_one_gauge_is_its_leave_one_out_residual() -> None:
    whole = whole_map()
    assert whole.manifold is not None
    unit = replace(whole.manifold, discrepancy_shapes=1e-6 * np.eye(N_D)[:, [3]])
    estimator, strain = Estimator(replace(whole, manifold=unit)), strain_at(CONDITION)
    found = estimator.estimate(strain, **navigation(CONDITION))
    assert found.discrepancy_chi_square == pytest.approx(found.standardised_residual[3] ** 2, rel=1e-9)
    found = estimator.estimate(strain, valid=np.arange(N_D) != 3, **navigation(CONDITION))
    assert found.discrepancy_chi_square == 0.0


def test_shapes_are_tested_together_in_whatever_order_and_a_repeated_one_counts_once() -> None:
    whole = whole_map()
    assert whole.manifold is not None
    strain, shapes = strain_at(CONDITION), 1e-6 * np.random.default_rng(5).standard_normal((N_D, 3))
    strain = strain + 3.0 * shapes[:, 0]

    def square(columns: list[int]) -> float:
        chosen = replace(whole, manifold=replace(whole.manifold, discrepancy_shapes=shapes[:, columns]))
        return float(Estimator(chosen).estimate(strain, **navigation(CONDITION)).discrepancy_chi_square)

    assert square([2, 0, 1]) == pytest.approx(square([0, 1, 2]), rel=1e-9)
    assert square([0, 1, 1, 2, 0]) == pytest.approx(square([0, 1, 2]), rel=1e-9)
    assert square([0, 1]) < square([0, 1, 2])


@pytest.mark.parametrize("name", ["mach_number_std", "static_pressure_std", "dynamic_pressure_std"])
def test_a_negative_deviation_of_navigation_is_refused(name: str) -> None:
    estimator = Estimator(whole_map())
    with pytest.raises(InputError, match=rf"{name}: expected numbers from 0 on, got -0.1"):
        estimator.estimate(strain_at(CONDITION), **navigation(CONDITION) | {name: -0.1})


@pytest.mark.parametrize("name", ["static_pressure", "dynamic_pressure"])
def test_a_pressure_beyond_numbers_is_no_error_of_the_others(name: str) -> None:
    """One such sample of navigation, at any gauges lost, stops no series; the others are as without it."""
    estimator, random = Estimator(whole_map()), np.random.default_rng(0)
    strain = np.array([strain_at(CONDITION, seed) for seed in range(12)])
    valid = random.random(strain.shape) < 0.7
    given = {"static_pressure": CONDITION.ambient_pressure, **navigation(CONDITION)}
    flow = {key: np.full(12, value) for key, value in given.items()}
    expected = estimator.estimate(strain, valid=valid, **flow)
    flow[name][::2] = 1e308
    found = estimator.estimate(strain, valid=valid, **flow)
    np.testing.assert_allclose(found.coefficients[1::2], expected.coefficients[1::2], rtol=1e-9)
    assert not np.any(found.health[::2] == HealthState.OK)


def test_doubt_about_navigation_covers_an_error_of_the_quantity_that_is_kept() -> None:
    """q_inf wrong by ten deviations looks like a wrong Mach number: three sigma hold the coefficients."""
    estimator = Estimator(whole_map())
    flow = navigation(CONDITION)
    flow["dynamic_pressure"] *= 1.1
    scale = CONDITION.dynamic_pressure * AREA * np.array([1.0, 1.0, 1.0, LENGTH, LENGTH])
    u, w = (CONDITION.total_incidence * f(CONDITION.leeward_roll_angle) for f in (np.cos, np.sin))
    true = exact_response(CONDITION.mach_number, u, w, CONDITION.ambient_pressure)[N_D:] / scale
    found = estimator.estimate(np.array([strain_at(CONDITION, seed) for seed in range(20)]), **flow)
    wrong = np.any(np.abs(found.coefficients - true) > 3.0 * found.coefficients_std, axis=1)
    assert not np.any(found.air_data_used.all(axis=1))
    assert np.sum(wrong & (found.health == HealthState.OK)) <= 1


@pytest.mark.parametrize("factor", [0.8, 1.25])
def test_a_wrong_dynamic_pressure_leaves_the_coefficients_within_three_sigma(factor: float) -> None:
    """Far beyond the alarm level, too: M, p_inf and q_inf have one relation, which does not tell the wrong one."""
    estimator = Estimator(whole_map())
    flow = navigation(CONDITION)
    flow["dynamic_pressure"] *= factor
    strain = np.array([strain_at(CONDITION, seed) for seed in range(20)])
    found = estimator.estimate(strain, **flow)
    u, w = (CONDITION.total_incidence * f(CONDITION.leeward_roll_angle) for f in (np.cos, np.sin))
    loads = exact_response(CONDITION.mach_number, u, w, CONDITION.ambient_pressure)[N_D:]
    true = loads / (CONDITION.dynamic_pressure * AREA * np.array([1.0, 1.0, 1.0, LENGTH, LENGTH]))
    assert np.all(~found.air_data_used.all(axis=1))
    assert np.all(np.abs(found.coefficients - true) < 3.0 * found.coefficients_std)
