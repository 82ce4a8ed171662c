"""Flights while the wall warms: sigma holds with sensors and without, and loads are as good as in cold flights."""

from __future__ import annotations

import numpy as np
import pytest
from coarse_vehicle import COARSE
from trial_cases import case_of, other_world

from builder.campaign.snapshots import Snapshots
from builder.inverse.build import build_inverse_map
from builder.manifold.build import with_manifold
from builder.structure.fourier.model import structural_model
from builder.trial.cases import Plan, cases_for, load_trial, trial_path
from builder.trial.heating import AtEnd, Heating, heated, standard_temperature
from builder.trial.run import scored
from builder.trial.world import World


def test_a_heated_gauge_reads_what_its_data_sheet_says() -> None:
    """Thermal strain and apparent strain c1 T + c2 T^2 add to the strain over a softer wall, times the factor."""
    entry = standard_temperature(3.6)
    rise, at_sensors, thermal = np.array([100.0, 50.0]), np.arange(8.0), np.array([3e-5, -1e-5])
    random, again = np.random.default_rng(1), np.random.default_rng(1)
    cold, scatter = np.full((5, 2), 1e-4), np.array([[1.0, -2.0]])
    hot, measured = heated(entry, AtEnd(thermal, rise, at_sensors), cold, scatter, random)
    time = again.uniform(0.0, 1.0, (5, 1))
    warm = time * rise
    sheet = 1e-6 * (0.05 * warm - 0.002 * warm**2 + 0.01 * scatter * warm)
    expected = (1.0 - 1e-4 * warm) * (cold / (1.0 - 4.5e-4 * warm) + time * thermal + sheet)
    np.testing.assert_allclose(hot, expected)
    np.testing.assert_allclose(measured - 293.15 - time * at_sensors, again.standard_normal((5, 8)), atol=1e-9)


def test_a_side_is_warmer(world: World) -> None:
    vehicle = world.vehicle.model_copy(update={"temperature": standard_temperature(world.vehicle.body().length)})
    even = Heating(nose_K=80.0, aft_K=10.0).at_end(vehicle)
    side = Heating(nose_K=80.0, aft_K=10.0, side_percent=10.0).at_end(vehicle)
    station = world.gauges.station / vehicle.body().length
    np.testing.assert_allclose(even.rise, 80.0 - 70.0 * station, atol=1e-9)
    warmer = 0.1 * even.rise * np.cos(world.gauges.roll_angle - 0.7)
    np.testing.assert_allclose(side.rise - even.rise, warmer, atol=1e-9)


def test_a_map_without_temperature_flies_the_standard_wall(world: World) -> None:
    (cold, warm) = cases_for(world.vehicle, load_trial(trial_path("heating")))
    assert [cold.group, warm.group] == ["alone", "beyond"]
    rows = {case.size: scored(world, case, Plan(vehicles=1))["map"] for case in (cold, warm)}
    assert rows[cold.size][1]["rms"] < rows[warm.size][1]["rms"]
    assert rows[cold.size][0]["flagged_percent"] <= 2.0 < rows[warm.size][0]["flagged_percent"]


@pytest.mark.slow
def test_a_wall_that_warms_costs_little(world: World, flown_snapshots: Snapshots) -> None:
    length = world.vehicle.body().length
    vehicle = world.vehicle.model_copy(update={"temperature": standard_temperature(length)})
    structure = structural_model(vehicle, COARSE, [vehicle.gauges.layout])
    linear = build_inverse_map(vehicle, flown_snapshots, structure)
    warm = other_world(
        world,
        vehicle=vehicle,
        inverse_map=with_manifold(linear, vehicle, flown_snapshots, structure),
        conditions=100,
    )
    plan = Plan(vehicles=1, estimators=["linear", "nonlinear"])
    rows = {
        size: scored(warm, case_of(vehicle, "wall that warms", size, "heating"), plan)
        for size in ("isothermal", "temperature sensors", "no temperature sensors")
    }
    for name in plan.estimators:
        isothermal = rows["isothermal"][name]
        for size in ("temperature sensors", "no temperature sensors"):
            every, *loads = rows[size][name]
            assert loads[0]["rms"] <= 1.5 * isothermal[1]["rms"]
            assert min(row["covered_percent"] for row in loads) >= 99.0
            assert every["verdict"] != "missed"
