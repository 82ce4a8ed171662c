"""False alarms on a coarse vehicle: levels bring their rate to the stated one, and what is counted adds up."""

from __future__ import annotations

import sys
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from builder.campaign.snapshots import Snapshots
from builder.inverse.build import build_inverse_map
from builder.inverse.problem import inverse_problem
from builder.manifold.build import with_manifold
from builder.stress import false_alarms as module
from builder.stress.false_alarms import FalseAlarms, false_alarms
from builder.structure.fourier.model import StructuralModel
from builder.trial.alarm_levels import alarm_scales, ratios_and_health, with_alarm_levels, with_flight_alarm_levels
from builder.trial.readings import ReadFlights, read_flights
from builder.trial.vehicles import drawn_vehicles
from builder.truth.revolution.flow_table import FlowTable
from builder.truth.revolution.strain import TrueStructure
from builder.vehicle.file import Vehicle
from strainfmu.errors import InputError
from strainfmu.estimator.health import FALSE_ALARM_PROBABILITY, HealthState
from strainfmu.estimator.map.inverse_map import InverseMap


@pytest.fixture(scope="module")
def theory(vehicle: Vehicle, snapshots: Snapshots, structure: StructuralModel) -> InverseMap:
    problem = inverse_problem(vehicle, snapshots, structure)
    linear = build_inverse_map(vehicle, snapshots, structure, problem=problem)
    return with_manifold(linear, vehicle, snapshots, structure, problem=problem)


@pytest.fixture(scope="module")
def flights(theory: InverseMap, vehicle: Vehicle, true_model: TrueStructure, table: FlowTable) -> ReadFlights:
    fly = partial(drawn_vehicles, vehicle, true_model, table)
    return read_flights(theory, vehicle, table, fly, conditions=250, vehicles=40)


@pytest.fixture(scope="module")
def calibrated(theory: InverseMap, flights: ReadFlights) -> InverseMap:
    return with_flight_alarm_levels(with_alarm_levels(theory, flights), flights)


def test_steps_and_searches_find_the_same_tail(theory: InverseMap, flights: ReadFlights) -> None:
    """A step of two iterations from the state of the flight leaves up to a quarter more than a search does."""
    of_steps, health = ratios_and_health(theory, flights)
    of_searches, _ = ratios_and_health(theory, flights, search=True)
    assert of_steps.shape == of_searches.shape == (3, 10_000)
    np.testing.assert_allclose(alarm_scales(of_steps), alarm_scales(of_searches), rtol=0.25)
    assert np.all((of_steps.max(axis=0) <= 1.0) | (health != HealthState.OK))


@pytest.mark.parametrize("search", [False, True])
def test_a_search_finds_the_flight_that_a_step_starts_from(
    search: bool, calibrated: InverseMap, flights: ReadFlights
) -> None:
    few = replace(
        flights,
        conditions=flights.conditions[:5],
        strain=flights.strain[:200],
        known={name: value[:200] for name, value in flights.known.items()},
    )
    ratios, health = ratios_and_health(calibrated, few, search=search)
    assert np.all(health == HealthState.OK)
    assert np.all(ratios.max(axis=0) < 1.0)


def test_other_flights_raise_few_alarms(
    calibrated: InverseMap, vehicle: Vehicle, true_model: TrueStructure, table: FlowTable
) -> None:
    """10,000 samples of other seeds: one alarm is expected, 7 or more are 1e-4 likely."""
    found = false_alarms(calibrated, vehicle, true_model, table, samples=10_000, seed=4)
    assert found.samples == 10_000
    assert found.strain <= 6
    assert set(found.each) == {*module.TESTS, "DEGRADED", "OUTSIDE"}
    assert calibrated.manifold is not None
    tight = replace(calibrated, manifold=replace(calibrated.manifold, chi_square_scale=0.5))
    many = false_alarms(tight, vehicle, true_model, table, samples=2_000, seed=4)
    assert many.strain == many.each["chi-square"] > 200
    linear = false_alarms(replace(calibrated, manifold=None), vehicle, true_model, table, samples=10_000, seed=4)
    assert linear.strain <= 6
    assert set(linear.each) == {*module.TESTS[:2], "DEGRADED", "OUTSIDE"}
    assert linear.each["OUTSIDE"] <= 20


def test_tenths_add_up_to_the_whole(
    calibrated: InverseMap, vehicle: Vehicle, true_model: TrueStructure, table: FlowTable
) -> None:
    """Of levels that raise many alarms: the tenths by each quantity have the mean of all."""
    low = replace(calibrated, manifold=None, chi_square_scale=0.55)
    found = false_alarms(low, vehicle, true_model, table, samples=8_000, vehicles=8, seed=5)
    assert set(found.tenths) == {"Mach number", "total incidence", "roll angle", "dynamic pressure"}
    for alarms, outside in found.tenths.values():
        assert alarms.shape == outside.shape == (10,)
        assert alarms.mean() == pytest.approx(found.rate / FALSE_ALARM_PROBABILITY)
        assert outside.mean() == pytest.approx(found.each["OUTSIDE"] / found.samples)
    assert len(found.lines()) == 3 + len(found.each) + 1 + 4


@pytest.mark.fast
def test_the_interval_holds_the_rate() -> None:
    found = FalseAlarms(samples=1_000_000, strain=100, each={"chi-square": 60, "largest |z|": 45})
    assert found.rate == FALSE_ALARM_PROBABILITY
    low, high = found.interval()
    assert (low, high) == pytest.approx((81.4e-6, 121.6e-6), rel=1e-3)
    assert found.lines()[-1].startswith(
        "1000000 samples; stated 0.0001, found 1.00 times that (95 %: 0.81 to 1.22)"
    )
    assert FalseAlarms(samples=1000, strain=0, each={}).interval()[0] == 0.0


@pytest.mark.fast
def test_no_samples_are_refused(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(sys, "argv", ["false_alarms", "v.toml", "m.h5", str(tmp_path / "f.h5"), "--samples", "0"])
    with pytest.raises(InputError, match="--samples and --vehicles from 1 on"):
        module.main()
    monkeypatch.setattr(sys, "argv", ["false_alarms", "v.toml", "m.h5", "f.h5", "--estimator", "manifold"])
    with pytest.raises(InputError, match=r"^--estimator: .*, got 'manifold', now called 'nonlinear'$"):
        module.main()
