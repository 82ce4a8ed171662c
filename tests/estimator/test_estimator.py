"""One step of the estimator: the stated formulas, and what it says when an input is missing."""

from dataclasses import fields, replace
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_map import N_GAUGES, map_of, missing, random_map, random_model
from state_estimates import state_gain, state_offset

from builder.aero.load_operator import coefficient_scale, load_operator
from builder.vehicle.shape.geometry import chain_segments, surface_grid
from builder.vehicle.shape.shape_entries import ReferenceQuantities
from strainfmu.errors import InputError
from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import FALSE_ALARM_PROBABILITY, HealthState, outlier_threshold
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.reference.gain import load_covariance, residual_precision
from strainfmu.estimator.settings import (
    LARGEST_SETTING,
    SENSOR_RANGE,
    SMALLEST_SETTING,
    EstimatorSettings,
    default_settings,
)

pytestmark = pytest.mark.fast

Q = 1.2e5


def test_step_is_the_stated_formula() -> None:
    """f = (G C V)(T d + k) + G C p_mean; coefficients over q S and q S L; written out here, to 1e-10."""
    inverse_map = random_map()
    strain = inverse_map.mean_strain + 1e-7 * np.random.default_rng(3).normal(size=N_GAUGES)
    found = Estimator(inverse_map).estimate(strain, Q)
    state = state_gain(inverse_map) @ strain + state_offset(inverse_map)
    loads = inverse_map.load_per_state @ state + inverse_map.load_of_mean
    scale = np.array([Q * 0.2] * 3 + [Q * 0.2 * 0.5] * 2)
    std = np.sqrt(np.diag(load_covariance(inverse_map)))
    np.testing.assert_allclose(found.loads, loads, rtol=0.0, atol=1e-10 * np.abs(loads).max())
    np.testing.assert_allclose(found.coefficients, found.loads / scale, rtol=1e-14)
    np.testing.assert_allclose(found.loads_std, std, rtol=1e-14)
    np.testing.assert_allclose(found.coefficients_std, std / scale, rtol=1e-14)
    residual = strain - inverse_map.mean_strain
    assert found.chi_square == pytest.approx(residual @ residual_precision(inverse_map) @ residual, rel=1e-12)
    assert found.health is HealthState.OK


def test_strain_of_the_mean_gives_the_loads_of_the_mean() -> None:
    inverse_map = random_map()
    found = Estimator(inverse_map).estimate(inverse_map.mean_strain, Q)
    scale = np.abs(inverse_map.load_of_mean).max()
    np.testing.assert_allclose(found.loads, inverse_map.load_of_mean, rtol=0.0, atol=1e-8 * scale)
    assert found.chi_square == 0.0


def test_gauge_that_is_off_raises_the_alarm() -> None:
    """100 sigma on one gauge is beyond the level; the level itself is not."""
    inverse_map = random_map()
    estimator = Estimator(inverse_map)
    strain = inverse_map.mean_strain.copy()
    strain[2] += 100.0 * inverse_map.noise_std[2]
    off = estimator.estimate(strain, Q)
    assert off.health is HealthState.INCONSISTENT
    assert np.all(np.isfinite(off.coefficients))
    share = off.chi_square_limit / off.chi_square
    for factor, alarm in ((0.999, False), (1.001, True)):
        step = factor * np.sqrt(share) * (strain - inverse_map.mean_strain)
        found = estimator.estimate(inverse_map.mean_strain + step, Q)
        assert (found.health is HealthState.INCONSISTENT) is alarm
        assert found.health is not HealthState.OK


def test_false_alarms_are_as_rare_as_stated() -> None:
    """20,000 noisy strains at 1e-4: 2 expected, 10 or more has probability 5e-5; their mean is n_d - r."""
    inverse_map = random_map()
    estimator = Estimator(inverse_map)
    noise = np.random.default_rng(7).normal(size=(20_000, N_GAUGES)) * inverse_map.noise_std
    found = estimator.estimate(inverse_map.mean_strain + noise, Q)
    assert np.sum(found.chi_square > found.chi_square_limit) < 10
    assert found.chi_square.mean() == pytest.approx(5.0, abs=3.0 * np.sqrt(10.0 / 20_000))


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1.001 * SENSOR_RANGE, -1e308])
def test_strain_that_cannot_be_goes_without_the_gauge(bad: float) -> None:
    inverse_map = random_map()
    estimator = Estimator(inverse_map)
    strain = inverse_map.mean_strain.copy()
    strain[3] = bad
    found = estimator.estimate(strain, Q)
    assert found.health is HealthState.DEGRADED
    np.testing.assert_array_equal(found.valid, ~missing(N_GAUGES, 3))
    told = estimator.estimate(inverse_map.mean_strain, Q, valid=~missing(N_GAUGES, 3))
    assert_same(found, told)
    assert np.all(found.loads_std > 0.0)


def test_range_of_the_sensors_is_the_users() -> None:
    inverse_map = random_map()
    strain = inverse_map.mean_strain.copy()
    strain[3] = 2e-3
    assert Estimator(inverse_map).estimate(strain, Q).valid.all()
    narrow = Estimator(inverse_map, changed(inverse_map, sensor_range=1e-3)).estimate(strain, Q)
    np.testing.assert_array_equal(narrow.valid, ~missing(N_GAUGES, 3))
    strain[3] = LARGEST_SETTING
    wide = Estimator(inverse_map, changed(inverse_map, sensor_range=LARGEST_SETTING))
    assert wide.estimate(strain, Q).health is HealthState.INCONSISTENT


def changed(inverse_map: InverseMap, **settings: float) -> EstimatorSettings:
    """The settings of ``inverse_map`` but for those named."""
    return replace(default_settings(inverse_map), **settings)


@pytest.mark.parametrize("name", [entry.name for entry in fields(EstimatorSettings)])
@pytest.mark.parametrize(
    "wrong", [0.0, -1.0, np.nan, np.inf, -np.inf, 1.01 * LARGEST_SETTING, 0.99 * SMALLEST_SETTING]
)
def test_settings_that_cannot_be_are_refused(name: str, wrong: float) -> None:
    if name == "moment_station" and abs(wrong) <= 1.0:
        assert changed(random_map(), moment_station=wrong).moment_station == wrong
        return
    with pytest.raises(InputError, match=rf"{name}: .* found, must be between .* and 1e\+09"):
        changed(random_map(), **{name: wrong})


def test_alarm_scale_moves_both_alarm_levels() -> None:
    """Four times the level of chi-square, twice that of z; what is estimated stays as it was, bit by bit."""
    inverse_map = random_map()
    plain = Estimator(inverse_map)
    strain = inverse_map.mean_strain.copy()
    strain[2] += 6.0 / np.sqrt(residual_precision(inverse_map)[2, 2])  # |z| of 6, chi-square of 36
    before = plain.estimate(strain, Q)
    assert before.health is HealthState.INCONSISTENT
    assert 2 in before.suspects
    after = plain.with_settings(changed(inverse_map, alarm_scale=4.0)).estimate(strain, Q)
    assert after.health is HealthState.OK
    assert after.suspects == ()
    assert after.chi_square_limit == 4.0 * before.chi_square_limit
    for name in ("loads", "loads_std", "coefficients", "coefficients_std", "chi_square", "standardised_residual"):
        np.testing.assert_array_equal(getattr(after, name), getattr(before, name))
    for factor, alarm in ((0.999, False), (1.001, True)):
        level = factor * 2.0 * outlier_threshold(N_GAUGES, FALSE_ALARM_PROBABILITY)
        strain[2] = inverse_map.mean_strain[2] + level / np.sqrt(residual_precision(inverse_map)[2, 2])
        found = Estimator(inverse_map, changed(inverse_map, alarm_scale=4.0)).estimate(strain, Q)
        assert bool(found.suspects) is alarm


def test_reference_area_and_length_scale_the_coefficients() -> None:
    inverse_map = random_map()
    strain = inverse_map.mean_strain + 1e-6
    plain = Estimator(inverse_map).estimate(strain, Q)
    other = changed(inverse_map, reference_area=0.4, reference_length=2.0)
    found = Estimator(inverse_map, other).estimate(strain, Q)
    np.testing.assert_array_equal(found.loads, plain.loads)
    share = np.array([0.5, 0.5, 0.5, 0.125, 0.125])  # 0.2 m2 and 0.5 m before
    np.testing.assert_allclose(found.coefficients, share * plain.coefficients, rtol=1e-14)
    np.testing.assert_allclose(found.coefficients_std, share * plain.coefficients_std, rtol=1e-14)


@pytest.mark.parametrize("gamma", [0.0, 1.0])
@pytest.mark.parametrize("gauges", [(), (3,)])
def test_another_moment_station_is_a_map_built_about_it(gamma: float, gauges: tuple[int, ...]) -> None:
    """Loads of every state moved to x = 2.5 m by their own forces; of the map rebuilt of those, 1e-11."""
    model = random_model(gamma=gamma, n_gauges=N_GAUGES, n_states=3)
    inverse_map = replace(map_of(model), provenance={"moment_station_m": 2.0})
    move = np.eye(5)
    move[3, 1] = move[4, 2] = 0.5
    rebuilt = map_of(
        replace(
            model,
            load_per_state=move @ model.load_per_state,
            load_of_mean=move @ model.load_of_mean,
            strain_load_covariance=model.strain_load_covariance @ move.T,
            load_noise_covariance=move @ model.load_noise_covariance @ move.T,
        )
    )
    strain, valid = model.draw(1, 4)[0][0], ~missing(N_GAUGES, *gauges)
    wanted = Estimator(rebuilt).estimate(strain, Q, valid=valid)
    found = Estimator(inverse_map, changed(inverse_map, moment_station=2.5)).estimate(strain, Q, valid=valid)
    for name in ("loads", "loads_std", "coefficients", "coefficients_std", "chi_square"):
        np.testing.assert_allclose(getattr(found, name), getattr(wanted, name), rtol=1e-9)
    scale = np.outer(wanted.loads_std, wanted.loads_std)
    np.testing.assert_allclose(found.load_covariance / scale, wanted.load_covariance / scale, rtol=0.0, atol=1e-9)


def test_moment_moves_as_a_force_does() -> None:
    """A force up through x = 1 m: nose-up about 2 m by 1 m times it, nose-down about 0.5 m by half of that.

    The loads of a map about 2 m, estimated about 0.5 m, are those of the pressure about 0.5 m.
    """
    grid = surface_grid(chain_segments([(1.0, np.radians(10.0), np.radians(10.0))]), 60, 24)
    about_2, about_half = load_operator(grid, 2.0), load_operator(grid, 0.5)
    pressure = 1e4 - 2e3 * np.cos(np.tile(grid.roll_angle, len(grid.x)) - 0.3) * np.repeat(grid.x, grid.n_roll)
    model = replace(random_model(n_gauges=N_GAUGES, n_states=3), load_of_mean=about_2 @ pressure)
    inverse_map = replace(map_of(model), provenance={"moment_station_m": 2.0})
    loads = Estimator(inverse_map, changed(inverse_map, moment_station=0.5)).estimate(model.m, Q).loads
    np.testing.assert_allclose(loads, about_half @ pressure, rtol=1e-10)
    assert np.all(loads[1:3] > 0.0)


@pytest.mark.parametrize("dynamic_pressure_std", [0.0, 1.0, 2.4e3, 1e5])
def test_uncertain_dynamic_pressure_widens_sigma(dynamic_pressure_std: float) -> None:
    """cov(C) = D cov(F) D + C C' (s/q)^2 with D of 1/(q S) and 1/(q S L), on the diagonal, to 1e-14."""
    inverse_map = random_map()
    strain = inverse_map.mean_strain + 1e-6
    plain = Estimator(inverse_map).estimate(strain, Q)
    found = Estimator(inverse_map).estimate(strain, Q, dynamic_pressure_std=dynamic_pressure_std)
    of_loads = coefficient_scale(Q, ReferenceQuantities(0.2, 0.5, 0.0)) ** 2 * np.diag(plain.load_covariance)
    wanted = np.sqrt(of_loads + (plain.coefficients * dynamic_pressure_std / Q) ** 2)
    np.testing.assert_allclose(found.coefficients_std, wanted, rtol=1e-14)
    np.testing.assert_array_equal(found.coefficients, plain.coefficients)
    np.testing.assert_array_equal(found.loads_std, plain.loads_std)


def test_sigma_of_uncertain_dynamic_pressure_covers() -> None:
    """4000 draws of q_inf alone, 2 %: their spread is C s/q within three times its own 1/sqrt(2 n)."""
    inverse_map = random_map()
    estimator = Estimator(inverse_map)
    loads = estimator.estimate(inverse_map.mean_strain, Q)
    drawn = Q * (1.0 + 0.02 * np.random.default_rng(2).normal(size=4000))
    strain = np.tile(inverse_map.mean_strain, (4000, 1))
    spread = np.std(estimator.estimate(strain, drawn).coefficients, axis=0)
    wider = estimator.estimate(inverse_map.mean_strain, Q, dynamic_pressure_std=0.02 * Q).coefficients_std
    of_pressure = np.sqrt(wider**2 - loads.coefficients_std**2)
    np.testing.assert_allclose(spread, of_pressure, rtol=3.0 / np.sqrt(8000))


@pytest.mark.parametrize("bad", [-1.0, -np.inf])
def test_negative_deviations_are_refused(bad: float) -> None:
    estimator, strain = Estimator(random_map()), random_map().mean_strain
    for wrong in (bad, [1e3, bad]):
        with pytest.raises(InputError, match="dynamic_pressure_std: expected numbers from 0 on, got -"):
            estimator.estimate(strain if wrong is bad else [strain] * 2, Q, dynamic_pressure_std=wrong)


def test_an_infinite_deviation_leaves_no_coefficients() -> None:
    inverse_map = random_map()
    found = Estimator(inverse_map).estimate(inverse_map.mean_strain, Q, dynamic_pressure_std=np.inf)
    assert found.health is HealthState.NO_COEFFICIENTS
    assert np.all(np.isnan(found.coefficients))
    assert np.all(np.isnan(found.coefficients_std))
    assert np.all(np.isfinite(found.loads))


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e308])
def test_without_any_strain_nothing_can_be_computed(bad: float) -> None:
    found = Estimator(random_map()).estimate(np.full(N_GAUGES, bad), Q)
    assert found.health is HealthState.INVALID
    for values in (found.loads, found.loads_std, found.coefficients, found.coefficients_std):
        assert np.all(np.isnan(values))
    assert found.chi_square == 0.0  # a sum without terms
    assert not found.valid.any()


ESTIMATORS = [Estimator(map_of(random_model(gamma=gamma, n_gauges=N_GAUGES, n_states=3))) for gamma in (0.0, 1.0)]


@settings(max_examples=200, deadline=None)
@given(
    estimator=st.sampled_from(ESTIMATORS),
    valid=st.lists(st.booleans(), min_size=N_GAUGES, max_size=N_GAUGES),
    garbage=st.lists(st.floats(width=64), min_size=N_GAUGES, max_size=N_GAUGES),
)
def test_strain_of_a_masked_gauge_never_leaks(
    estimator: Estimator, valid: list[bool], garbage: list[float]
) -> None:
    """Any bits in the gauges left out, NaN and infinity included: not one bit of any output changes."""
    mean = estimator.inverse_map.mean_strain
    clean = estimator.estimate(mean, Q, valid=np.array(valid))
    assert_same(estimator.estimate(np.where(valid, mean, garbage), Q, valid=np.array(valid)), clean)
    np.testing.assert_array_equal(clean.valid, valid)


FIELDS = ("loads", "loads_std", "load_covariance", "coefficients", "coefficients_std", "coefficient_covariance")
FIELDS += ("health", "chi_square", "chi_square_limit", "degrees_of_freedom", "envelope_score", "residual_limit")
FIELDS += ("valid", "standardised_residual", "suspects", "fits", "other_loads", "other_coefficients_std")


def assert_same(found: Estimate, wanted: Estimate) -> None:
    """Every field equal, bit by bit; NaN equals NaN."""
    for name in FIELDS:
        np.testing.assert_array_equal(getattr(found, name), getattr(wanted, name), err_msg=name)


@pytest.mark.parametrize(
    "valid", [np.ones(7, dtype=bool), np.ones(N_GAUGES), [1] * N_GAUGES, np.ones((N_GAUGES, 1), dtype=bool), True]
)
def test_mask_of_another_shape_or_type_is_refused(valid: object) -> None:
    with pytest.raises(InputError, match=r"valid: expected \(8,\) values of bool, got"):
        Estimator(random_map()).estimate(np.zeros(N_GAUGES), Q, valid=valid)  # type: ignore[arg-type]  # no mask


def test_an_estimate_does_not_depend_on_the_masks_before_it() -> None:
    """Every pair and triple of gauges lost, forwards and backwards: bit by bit as by an estimator of its own."""
    estimator, strain = Estimator(random_map()), random_map().mean_strain + 1e-7
    masks = [~missing(N_GAUGES, *lost) for n in (2, 3) for lost in combinations(range(N_GAUGES), n)]
    found = estimator.estimate(np.tile(strain, (len(masks), 1)), Q, valid=masks)
    for k in reversed(range(len(masks))):
        assert_same(estimator.estimate(strain, Q, valid=masks[k]), found[k])
    for k in (0, 40, len(masks) - 1):
        assert_same(Estimator(random_map()).estimate(strain, Q, valid=masks[k]), found[k])


def test_mask_handed_in_may_change_afterwards() -> None:
    estimator, strain = Estimator(random_map()), random_map().mean_strain
    valid = ~missing(N_GAUGES, 2)
    one, several = (estimator.estimate(given, Q, valid=valid) for given in (strain, np.tile(strain, (3, 1))))
    valid[:] = True
    np.testing.assert_array_equal(one.valid, ~missing(N_GAUGES, 2))
    np.testing.assert_array_equal(several.valid, np.tile(one.valid, (3, 1)))


def test_masked_gauges_and_other_faults_are_told_apart() -> None:
    """A wrong dynamic pressure and a bad residual are worse than a missing gauge; ``valid`` tells of that."""
    inverse_map = random_map()
    estimator, valid = Estimator(inverse_map), ~missing(N_GAUGES, 2)
    strain = inverse_map.mean_strain.copy()
    assert estimator.estimate(strain, 0.0, valid=valid).health is HealthState.NO_COEFFICIENTS
    assert np.all(np.isfinite(estimator.estimate(strain, 0.0, valid=valid).loads))
    strain[5] += 1e-3
    assert estimator.estimate(strain, Q, valid=valid).health is HealthState.INCONSISTENT


@pytest.mark.parametrize("dynamic_pressure", [0.0, -1.0, np.nan, np.inf])
def test_loads_do_not_need_dynamic_pressure(dynamic_pressure: float) -> None:
    inverse_map = random_map()
    estimator = Estimator(inverse_map)
    found = estimator.estimate(inverse_map.mean_strain, dynamic_pressure)
    assert found.health is HealthState.NO_COEFFICIENTS
    np.testing.assert_array_equal(found.loads, estimator.estimate(inverse_map.mean_strain, Q).loads)
    assert np.all(np.isfinite(found.loads_std))
    assert np.all(np.isnan(found.coefficients))
    assert np.all(np.isnan(found.coefficients_std))
    assert np.isfinite(found.chi_square)


@pytest.mark.parametrize("shape", [(7,), (9,), (8, 1), ()])
def test_strain_of_the_wrong_shape_is_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(InputError, match=r"strain: expected (8|\(k, 8\)) values, got"):
        Estimator(random_map()).estimate(np.zeros(shape), Q)


def test_lists_and_single_precision_are_taken() -> None:
    inverse_map = random_map()
    estimator = Estimator(inverse_map)
    exact = estimator.estimate(inverse_map.mean_strain, Q)
    as_list = estimator.estimate(inverse_map.mean_strain.tolist(), Q)
    np.testing.assert_array_equal(as_list.loads, exact.loads)


def test_repeat_is_bit_identical_and_leaves_the_strain_alone() -> None:
    inverse_map = random_map()
    estimator = Estimator(inverse_map)
    strain = inverse_map.mean_strain + 1e-6
    before = strain.copy()
    first, second = estimator.estimate(strain, Q), estimator.estimate(strain, Q)
    np.testing.assert_array_equal(first.coefficients, second.coefficients)
    np.testing.assert_array_equal(strain, before)


def test_what_is_handed_out_is_the_caller_s() -> None:
    """Whatever is done to one estimate, the next and the map stay as they were."""
    estimator = Estimator(random_map())
    strain, kept = np.full(estimator.inverse_map.n_gauges, 1e-6), load_covariance(estimator.inverse_map).copy()
    first = estimator.estimate(strain, 9e4)
    before = first.loads_std.copy(), first.load_covariance.copy()
    for array in (first.loads_std, first.load_covariance, first.valid):
        array[...] = 0
    second = estimator.estimate(strain, 9e4)
    np.testing.assert_array_equal(second.loads_std, before[0])
    np.testing.assert_array_equal(second.load_covariance, before[1])
    assert second.valid.all()
    np.testing.assert_array_equal(load_covariance(estimator.inverse_map), kept)


@pytest.mark.parametrize(
    ("strain", "pressure", "health"),
    [(1e308, 9e4, HealthState.INVALID), (0.0, 5e-324, HealthState.NO_COEFFICIENTS)],
)
def test_overflow_is_never_a_silent_number(strain: float, pressure: float, health: HealthState) -> None:
    estimator = Estimator(random_map())
    estimate = estimator.estimate(np.full(estimator.inverse_map.n_gauges, strain), pressure)
    assert estimate.health is health
    assert np.all(np.isnan(estimate.coefficients))
