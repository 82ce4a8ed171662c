"""The envelope at run time: half-spaces of the coefficients, ranges of navigation, and what is not known."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from random_map import nothing_of
from scaled_maps import NOMINAL, scaled_map

from strainfmu.atmosphere import dynamic_pressure
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import InverseMap

pytestmark = pytest.mark.fast

RANGES = {
    "dynamic_pressure_range": np.array([50e3, 200e3]),
    "mach_number_range": np.array([5.0, 7.0]),
    "altitude_range": np.array([15e3, 30e3]),
}
NORMAL_FORCE = np.eye(5)[[1]]


def enclosed(**changes: Any) -> InverseMap:
    """Return a map whose envelope is a C_N of at most 0.3, far from its mean."""
    fields: dict[str, Any] = {
        "envelope_direction": NORMAL_FORCE,
        "envelope_limit": np.array([0.3]),
        **RANGES,
    }
    return scaled_map(1, seed=3, **(fields | changes))


WIDE = Estimator(enclosed(envelope_limit=np.array([1e6])))
"""An estimator whose ranges of navigation alone are left."""


def outside(q: float, std: float = 0.0, mach: float = np.nan, altitude: float = np.nan) -> bool:
    strain = q / NOMINAL * WIDE.inverse_map.mean_strain
    found = WIDE.step(
        strain, q, dynamic_pressure_std=std, mach_number=mach, altitude=altitude, q_source="independent"
    )
    assert found.health in (HealthState.OK, HealthState.OUTSIDE)
    return found.health is HealthState.OUTSIDE


def test_the_score_is_the_largest_distance_in_its_own_sigma() -> None:
    """By the book over 40 half-spaces, for 200 coefficients with covariances of their own; 0 inside."""
    random = np.random.default_rng(1)
    plain, q = enclosed(), random.uniform(0.5, 1.5, 200) * NOMINAL
    states = random.standard_normal((200, plain.state_operator.shape[1])) * random.uniform(0.1, 1.5, (200, 1))
    strain = (q / NOMINAL)[:, None] * (plain.mean_strain + states @ plain.state_operator.T)
    direction = random.standard_normal((40, 5))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    limit = np.quantile(Estimator(plain).estimate(strain, q).coefficients @ direction.T, 0.95, axis=0)
    estimator = Estimator(enclosed(envelope_direction=direction, envelope_limit=limit))
    found = estimator.estimate(strain, q, dynamic_pressure_std=random.uniform(0.0, 0.02, 200) * q)
    for k in range(200):
        sigma = np.sqrt(np.einsum("mi,ij,mj->m", direction, found.coefficient_covariance[k], direction))
        expected = max(0.0, float(np.max((direction @ found.coefficients[k] - limit) / sigma)))
        assert found.envelope_score[k] == pytest.approx(expected, rel=1e-9)
    assert 0 < np.count_nonzero(found.envelope_score) < 200


def test_a_mach_number_may_be_beyond_its_range_by_its_tolerance() -> None:
    mach = np.array([0.975 * 5.0, 1.025 * 7.0]) + 1e-9 * np.array([[1.0, -1.0], [-1.0, 1.0]])
    estimator, q = Estimator(WIDE.inverse_map), np.full(4, 100e3)
    strain = q[:, None] / NOMINAL * WIDE.inverse_map.mean_strain
    found = estimator.estimate(strain, q, mach_number=mach.ravel())
    assert found.health.tolist() == [HealthState.OK] * 2 + [HealthState.OUTSIDE] * 2


@pytest.mark.parametrize("mach", [np.nan, 6.0])
def test_ranges_hold_and_what_is_not_known_is_not_outside(mach: float) -> None:
    assert not outside(100e3, mach=mach)
    assert outside(49e3, mach=mach)
    assert outside(201e3, mach=mach)
    assert not outside(100e3, mach=mach, altitude=np.nan)
    assert not outside(100e3, altitude=20e3)
    assert outside(100e3, altitude=14.9e3)
    assert outside(100e3, altitude=30.1e3)
    assert not outside(100e3)


def test_a_stated_deviation_widens_the_range_of_the_mach_number() -> None:
    """By three of it."""
    estimator, q, std = Estimator(WIDE.inverse_map), np.full(5, 100e3), np.array([0.1, 0.1, 0.1, 0.1, np.inf])
    beyond = np.array([0.29, 0.31, -0.29, -0.31, 5.0])
    mach = np.where(beyond > 0.0, 1.025 * 7.0, 0.975 * 5.0) + beyond
    strain = q[:, None] / NOMINAL * WIDE.inverse_map.mean_strain
    found = estimator.estimate(strain, q, mach_number=mach, mach_number_std=std)
    is_outside = found.health == HealthState.OUTSIDE
    assert is_outside.tolist() == [False, True, False, True, False]


def test_few_measured_mach_numbers_of_a_flight_at_the_end_are_outside() -> None:
    """Of the default deviation 0.05: 0.6 % at the lower end, where the relative tolerance is the smallest."""
    random, ends = np.random.default_rng(3), np.repeat([5.0, 7.0], 20_000)
    mach = ends + 0.05 * random.standard_normal(len(ends))
    strain = 100e3 / NOMINAL * WIDE.inverse_map.mean_strain
    found = Estimator(WIDE.inverse_map).estimate(np.tile(strain, (len(ends), 1)), 100e3, mach_number=mach)
    is_outside = (found.health == HealthState.OUTSIDE).reshape(2, -1).mean(axis=1)
    assert is_outside[0] < 0.01
    assert is_outside[1] < 0.001


def test_dynamic_pressure_must_agree_with_mach_number_and_altitude() -> None:
    """q = 0.7 M^2 p(h): 5 % and three of its standard deviations are allowed."""
    mach, altitude = 6.0, 20.1e3
    q = dynamic_pressure(mach, altitude)
    for factor, std, expected in (
        (1.0, 0.0, False),
        (1.045, 0.0, False),
        (1.055, 0.0, True),
        (0.945, 0.0, True),
        (1.075, 0.01 * q, False),
        (1.085, 0.01 * q, True),
    ):
        assert outside(factor * q, std, mach, altitude) == expected, factor
    # One of the two alone does not contradict.
    assert not outside(1.2 * q, mach=mach)
    assert not outside(1.2 * q, altitude=altitude)


def test_the_pressure_at_an_altitude_is_that_of_the_closed_form() -> None:
    """q of 0.95 and 1.05 times 0.7 M^2 p(h), 1e-12 to both sides, at 200 altitudes."""
    ranges = {"dynamic_pressure_range": np.array([1.0, 1e7]), "altitude_range": np.array([0.0, 80e3])}
    estimator = Estimator(enclosed(envelope_limit=np.array([1e6]), **ranges))
    altitude = np.random.default_rng(2).uniform(0.0, 70e3, 200)
    q = np.array([dynamic_pressure(6.0, one) for one in altitude])
    least = 1e-12
    for factor, expected in (
        (1.05 - least, False),
        (1.05 + least, True),
        (0.95 + least, False),
        (0.95 - least, True),
    ):
        strain = (factor * q / NOMINAL)[:, None] * estimator.inverse_map.mean_strain
        found = estimator.estimate(
            strain,
            factor * q,
            dynamic_pressure_std=0.0,
            mach_number=6.0,
            altitude=altitude,
            q_source="independent",
        )
        assert np.all((found.health == HealthState.OUTSIDE) == expected)


def strain_of_normal_force(inverse_map: InverseMap, coefficient: float, q: float) -> np.ndarray:
    """Return the strain (n_d,) of the least states that give C_N = ``coefficient`` at ``q``, without noise."""
    ratio = q / inverse_map.nominal_dynamic_pressure
    force = coefficient * q * inverse_map.reference_area / ratio - inverse_map.load_of_mean[1]
    row = inverse_map.load_per_state[1]
    states = force * row / (row @ row)
    return np.asarray(ratio * (inverse_map.mean_strain + inverse_map.state_operator @ states))


def test_the_estimator_says_outside() -> None:
    """By coefficients, by q_inf, by Mach number, by altitude, by a contradiction; health alone changes."""
    inverse_map = enclosed()
    estimator, q = Estimator(inverse_map), dynamic_pressure(6.0, 20.4e3)
    inside, beyond = (strain_of_normal_force(inverse_map, value, q) for value in (0.1, 3.0))
    good = estimator.step(inside, q)
    assert pytest.approx(0.1, rel=1e-6) == good.C_N
    assert (good.health, good.envelope_score) == (HealthState.OK, 0.0)
    bad = estimator.step(beyond, q)
    assert bad.health == HealthState.OUTSIDE
    assert bad.envelope_score == pytest.approx((bad.C_N - 0.3) / bad.sigma.C_N, rel=1e-6)
    known = estimator.step(inside, q, mach_number=6.0, altitude=20.4e3)
    assert known.health == HealthState.OK
    for mach, altitude in ((4.0, np.nan), (np.nan, 40e3), (6.5, 20.4e3)):
        found = estimator.step(inside, q, mach_number=mach, altitude=altitude, q_source="independent")
        assert found.health == HealthState.OUTSIDE
        np.testing.assert_array_equal(found.loads, good.loads)
    low = 0.9 * RANGES["dynamic_pressure_range"][0]
    assert estimator.step(strain_of_normal_force(inverse_map, 0.1, low), low).health == HealthState.OUTSIDE
    assert estimator.step(inside, np.nan).health == HealthState.NO_COEFFICIENTS
    assert estimator.step(inside, np.nan).envelope_score == 0.0


def test_the_limit_of_the_score_is_that_of_the_map() -> None:
    inverse_map = enclosed()
    q = dynamic_pressure(6.0, 20.4e3)
    strain = strain_of_normal_force(inverse_map, 0.3, q)
    sigma = Estimator(inverse_map).step(strain, q).sigma.C_N
    limit = inverse_map.envelope_score_limit
    for factor, expected in ((0.8, HealthState.OK), (1.2, HealthState.OUTSIDE)):
        strain = strain_of_normal_force(inverse_map, 0.3 + factor * limit * float(sigma), q)
        assert Estimator(inverse_map).step(strain, q).health == expected


def test_a_map_without_an_envelope_is_nowhere_outside() -> None:
    ranges = ("dynamic_pressure_range", "mach_number_range", "altitude_range")
    inverse_map = replace(enclosed(), **nothing_of("envelope_direction", "envelope_limit", *ranges))
    strain = strain_of_normal_force(inverse_map, 3.0, 1e6)
    assert Estimator(inverse_map).step(strain, 1e6, mach_number=20.0).health == HealthState.OK
