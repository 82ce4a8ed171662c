"""One step of the estimator: the stated formulas, and what it says when an input is missing."""

from __future__ import annotations

from dataclasses import fields
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from runtime_map import N_GAUGES, map_of, missing, random_map, random_model

from strainfmu.errors import InputError
from strainfmu.estimator import CACHED_MASKS, LARGEST_SENSOR_RANGE, SENSOR_RANGE, Estimator, LoadEstimate
from strainfmu.health import HealthState

Q = 1.2e5


def test_step_is_the_stated_formula() -> None:
    """f = (G C V)(T d + k) + G C p_mean; coefficients over q S and q S L; written out here, to 1e-10."""
    inverse_map = random_map()
    strain = inverse_map.mean_strain + 1e-7 * np.random.default_rng(3).normal(size=N_GAUGES)
    found = Estimator(inverse_map).estimate(strain, Q)
    state = inverse_map.strain_gain @ strain + inverse_map.state_offset
    loads = inverse_map.load_per_state @ state + inverse_map.load_of_mean
    scale = np.array([Q * 0.2] * 3 + [Q * 0.2 * 0.5] * 2)
    std = np.sqrt(np.diag(inverse_map.load_covariance))
    np.testing.assert_allclose(found.loads, loads, rtol=0.0, atol=1e-10 * np.abs(loads).max())
    np.testing.assert_allclose(found.coefficients, found.loads / scale, rtol=1e-14)
    np.testing.assert_allclose(found.loads_std, std, rtol=1e-14)
    np.testing.assert_allclose(found.coefficients_std, std / scale, rtol=1e-14)
    residual = inverse_map.residual_whitening @ (strain - inverse_map.mean_strain)
    assert found.chi_square == pytest.approx(float(np.sum(residual**2)), rel=1e-12)
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
    share = estimator.chi_square_limit / off.chi_square
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
    chi_square = np.sum((noise @ inverse_map.residual_whitening.T) ** 2, axis=1)
    assert np.sum(chi_square > estimator.chi_square_limit) < 10
    assert chi_square.mean() == pytest.approx(5.0, abs=3.0 * np.sqrt(10.0 / 20_000))


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
    narrow = Estimator(inverse_map, sensor_range=1e-3).estimate(strain, Q)
    np.testing.assert_array_equal(narrow.valid, ~missing(N_GAUGES, 3))
    strain[3] = 1e100
    assert Estimator(inverse_map, LARGEST_SENSOR_RANGE).estimate(strain, Q).health is HealthState.INCONSISTENT
    for wrong in (0.0, -1.0, np.nan, np.inf, 1e101):
        with pytest.raises(InputError, match=r"sensor_range: .* found, must be positive and at most 1e\+100"):
            Estimator(inverse_map, sensor_range=wrong)


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e308])
def test_without_any_strain_nothing_can_be_computed(bad: float) -> None:
    found = Estimator(random_map()).estimate(np.full(N_GAUGES, bad), Q)
    assert found.health is HealthState.INVALID
    for values in (found.loads, found.loads_std, found.coefficients, found.coefficients_std, found.chi_square):
        assert np.all(np.isnan(values))
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


def assert_same(found: LoadEstimate, wanted: LoadEstimate) -> None:
    """Every field equal, bit by bit; NaN equals NaN."""
    for entry in fields(LoadEstimate):
        np.testing.assert_array_equal(getattr(found, entry.name), getattr(wanted, entry.name))


@pytest.mark.parametrize(
    "valid", [np.ones(7, dtype=bool), np.ones(N_GAUGES), [1] * N_GAUGES, np.ones((N_GAUGES, 1), dtype=bool), True]
)
def test_mask_of_another_shape_or_type_is_refused(valid: object) -> None:
    with pytest.raises(InputError, match=r"valid: .* found, 8 values of bool wanted"):
        Estimator(random_map()).estimate(np.zeros(N_GAUGES), Q, valid=valid)  # type: ignore[arg-type]


def test_a_lost_gauge_costs_once() -> None:
    """The matrices of a mask are kept, the least recently used dropped, and no estimator sees another's."""
    one, other = Estimator(random_map()), Estimator(random_map())
    valid = ~missing(N_GAUGES, 2)
    kept = one.masked_map(valid)
    assert one.masked_map(valid) is kept
    assert other.masked_map(valid) is not kept
    masks = [~missing(N_GAUGES, *pair) for pair in combinations(range(N_GAUGES), 2)]
    masks += [~missing(N_GAUGES, *triple) for triple in combinations(range(N_GAUGES), 3)]
    assert len(masks) > 2 * CACHED_MASKS
    for k, mask in enumerate(masks):
        one.masked_map(mask)
        if k < CACHED_MASKS:
            assert one.masked_map(valid) is kept
    again = one.masked_map(valid)
    assert again is not kept
    assert again is not None
    assert kept is not None
    np.testing.assert_array_equal(again.load_gain, kept.load_gain)


def test_mask_handed_in_may_change_afterwards() -> None:
    estimator = Estimator(random_map())
    valid = ~missing(N_GAUGES, 2)
    first = estimator.estimate(np.zeros(N_GAUGES), Q, valid=valid)
    valid[:] = True
    np.testing.assert_array_equal(first.valid, ~missing(N_GAUGES, 2))
    other = ~missing(N_GAUGES, 3)
    kept = estimator.masked_map(other)
    other[:] = True
    assert kept is not None
    np.testing.assert_array_equal(kept.valid, ~missing(N_GAUGES, 3))


def test_masked_gauges_and_other_faults_are_told_apart() -> None:
    """A wrong dynamic pressure and a bad residual are worse than a missing gauge; ``valid`` tells of that."""
    inverse_map = random_map()
    estimator, valid = Estimator(inverse_map), ~missing(N_GAUGES, 2)
    strain = inverse_map.mean_strain.copy()
    assert estimator.estimate(strain, 0.0, valid).health is HealthState.NO_COEFFICIENTS
    assert np.all(np.isfinite(estimator.estimate(strain, 0.0, valid).loads))
    strain[5] += 1e-3
    assert estimator.estimate(strain, Q, valid).health is HealthState.INCONSISTENT


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
    with pytest.raises(InputError, match="8 values wanted"):
        Estimator(random_map()).estimate(np.zeros(shape), Q)


def test_lists_and_single_precision_are_taken() -> None:
    inverse_map = random_map()
    estimator = Estimator(inverse_map)
    exact = estimator.estimate(inverse_map.mean_strain, Q)
    as_list = estimator.estimate(inverse_map.mean_strain.tolist(), Q)
    assert isinstance(as_list, LoadEstimate)
    np.testing.assert_array_equal(as_list.loads, exact.loads)


def test_repeat_is_bit_identical_and_leaves_the_strain_alone() -> None:
    inverse_map = random_map()
    estimator = Estimator(inverse_map)
    strain = inverse_map.mean_strain + 1e-6
    before = strain.copy()
    first, second = estimator.estimate(strain, Q), estimator.estimate(strain, Q)
    np.testing.assert_array_equal(first.coefficients, second.coefficients)
    np.testing.assert_array_equal(strain, before)


def test_what_is_handed_out_with_every_estimate_cannot_be_changed() -> None:
    """And the map's own arrays stay as they were."""
    estimator = Estimator(random_map())
    estimate = estimator.estimate(np.zeros(estimator.inverse_map.n_gauges), 9e4)
    for array in (estimate.loads_std, estimate.load_covariance, estimate.valid):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0.0
    assert estimator.inverse_map.load_covariance.flags.writeable


@pytest.mark.parametrize(
    ("strain", "pressure", "health"),
    [(1e308, 9e4, HealthState.INVALID), (0.0, 5e-324, HealthState.NO_COEFFICIENTS)],
)
def test_overflow_is_never_a_silent_number(strain: float, pressure: float, health: HealthState) -> None:
    estimator = Estimator(random_map())
    estimate = estimator.estimate(np.full(estimator.inverse_map.n_gauges, strain), pressure)
    assert estimate.health is health
    assert np.all(np.isnan(estimate.coefficients))
