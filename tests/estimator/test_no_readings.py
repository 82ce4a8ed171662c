"""Strain of exactly zero under load is no reading, whatever the zero offsets; quantities of 0 are not given."""

from dataclasses import replace

import numpy as np
import pytest
from flight_fmu import random_flight, whole_map
from random_map import N_GAUGES, random_map
from scaled_maps import NOMINAL, whole_scaled_map
from thermal_maps import REFERENCE, with_temperature

from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.gauge_zeros import no_zeros
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import InverseMap

pytestmark = pytest.mark.fast

Q = 1.2e5
LINEAR = {"absolute": random_map, "dynamic pressure": lambda: whole_scaled_map(1, seed=3, n=N_GAUGES, n_states=3)}


@pytest.mark.parametrize("form", LINEAR)
def test_zero_strain_in_a_flow_is_invalid(form: str) -> None:
    """The rows of a series that are exactly zero, and no others."""
    held = LINEAR[form]()
    strain = np.vstack([held.mean_strain, np.zeros(N_GAUGES), -0.0 * held.mean_strain, held.mean_strain])
    strain[3, 1:] = 0.0
    found = Estimator(held).estimate(strain, Q)
    assert [HealthState(one).name == "INVALID" for one in found.health] == [False, True, True, False]
    assert np.isnan(found.loads[1:3]).all()
    assert np.isnan(found.coefficients_std[1:3]).all()
    assert not found.valid[1:3].any()
    assert found.valid[[0, 3]].all()


@pytest.mark.parametrize("form", LINEAR)
def test_the_gauges_in_use_decide(form: str) -> None:
    """One that reads is not in use: the others are exactly zero."""
    estimator, others = Estimator(LINEAR[form]()), np.arange(N_GAUGES) != 2
    strain = np.where(others, 0.0, 1e-5)
    assert estimator.estimate(strain, Q).health is not HealthState.INVALID
    assert estimator.estimate(strain, Q, valid=others).health is HealthState.INVALID
    for broken in (np.nan, 1.0):
        assert estimator.estimate(np.where(others, 0.0, broken), Q).health is HealthState.INVALID
    assert estimator.estimate(np.zeros(N_GAUGES), Q, valid=~others).health is HealthState.INVALID


@pytest.mark.parametrize("q", [np.nan, 0.0, -3.0, 5e-324])
@pytest.mark.parametrize("form", LINEAR)
def test_without_a_flow_zero_strain_is_what_gauges_read_at_rest(form: str, q: float) -> None:
    found = Estimator(LINEAR[form]()).estimate(np.zeros(N_GAUGES), q)
    assert found.health is HealthState.NO_COEFFICIENTS
    assert found.valid.all()


@pytest.mark.parametrize("kind", ["linear", "nonlinear"])
def test_readings_count_as_they_come(kind: str) -> None:
    """Zero offsets of any size: a reading of exactly 0 is none, and one of its offset is a strain of 0."""
    held = whole_map() if kind == "nonlinear" else whole_map().without_tables()
    zeros = replace(no_zeros(held.n_gauges), value=1e-4 * np.random.default_rng(1).normal(size=held.n_gauges))
    estimator = Estimator(held, zeros=zeros)
    assert estimator.estimate(np.zeros(held.n_gauges), NOMINAL).health == HealthState.INVALID
    assert estimator.estimate(zeros.value, NOMINAL).health != HealthState.INVALID


@pytest.mark.parametrize("temperature", [None, [np.nan, np.nan], [REFERENCE + 3.0, np.nan]])
def test_with_temperatures(temperature: list[float] | None) -> None:
    """What the wall's temperature strains is not what the gauges read."""
    held = with_temperature(whole_scaled_map(1, seed=3, n=12, n_states=3), k=3, n_t=2)
    strain = np.vstack([np.zeros(12), held.mean_strain])
    found = Estimator(held).estimate(strain, NOMINAL, temperature=temperature)
    assert [one == HealthState.INVALID for one in found.health] == [True, False]


def test_temperatures_of_zero_are_not_known() -> None:
    held = with_temperature(whole_scaled_map(1, seed=3, n=12, n_states=3), k=3, n_t=2)
    estimator = Estimator(held)
    found = [
        estimator.step(held.mean_strain, NOMINAL, temperature=[REFERENCE, one]).loads_std
        for one in (np.nan, 0.0, -1.0)
    ]
    np.testing.assert_array_equal(found, [found[0]] * 3)


@pytest.fixture(scope="module")
def both() -> InverseMap:
    return whole_map()


def test_zero_strain_is_invalid_with_the_nonlinear_estimator(both: InverseMap) -> None:
    """With q_inf, without it, and at 0: no flight gives it. A step of it keeps the flight state."""
    estimator, n = Estimator(both), both.n_gauges
    samples = random_flight(both, 3, seed=5)
    for flow in ({}, {"dynamic_pressure": 0.0}, samples[0].flow):
        found = estimator.step(np.zeros(n), **flow)
        assert found.health is HealthState.INVALID
        assert np.isnan([*found.loads, *found.air_data.value]).all()
        assert not found.valid.any()
    estimator.track(samples[0].strain, **samples[0].flow)
    state = estimator.memory
    assert estimator.track(np.zeros(n), **samples[1].flow).health is HealthState.INVALID
    kept = estimator.track(samples[2].strain, **samples[2].flow)
    assert kept.health is HealthState.OK
    estimator.memory = state
    np.testing.assert_array_equal(estimator.track(samples[2].strain, **samples[2].flow).state, kept.state)


def test_the_filter_predicts_through_zero_strain_as_through_lost_gauges(both: InverseMap) -> None:
    samples = random_flight(both, 5, seed=5)
    flow = {name: np.array([one.flow[name] for one in samples]) for name in samples[0].flow}
    found = []
    for lost in (0.0, np.nan):
        strain = np.array([one.strain for one in samples])
        strain[3] = lost
        found.append(Estimator(both).filter(1.0).track(strain, time=0.01 * np.arange(5), **flow))
    for name in ("health", "loads", "loads_std"):
        np.testing.assert_array_equal(getattr(found[0], name), getattr(found[1], name))
    assert found[0].health[3] == HealthState.INVALID
    assert np.all(np.isfinite(found[0].loads[3]))


@pytest.mark.parametrize("name", ["mach_number", "static_pressure", "dynamic_pressure", "altitude"])
def test_what_is_zero_or_below_is_not_given(both: InverseMap, name: str) -> None:
    """One rule for both estimators: health and numbers are those of NaN."""
    sample = random_flight(both, 1, seed=5)[0]
    nonlinear, linear = Estimator(both), Estimator(both).linear
    flow = sample.flow | {"altitude": 13e3} | ({"static_pressure": np.nan} if name == "altitude" else {})
    of_linear = {one: value for one, value in flow.items() if one != "static_pressure"}
    for estimator, given in ((nonlinear, flow), (linear, of_linear)):
        if name in given:
            values = (np.nan, 0.0, -1e9, -np.inf)
            found = [estimator.step(sample.strain, **(given | {name: value})) for value in values]
            assert len({one.health for one in found}) == 1
            np.testing.assert_array_equal([one.loads for one in found], [found[0].loads] * 4)
            np.testing.assert_array_equal([one.coefficients_std for one in found], [found[0].coefficients_std] * 4)
