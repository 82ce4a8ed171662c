"""Quantiles in the tail of a sample, and the alarm levels that follow from them, of any shape."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2, genpareto
from shape_case import grid_snapshots, shape_map, shape_vehicle
from shape_truth import beam
from trial_cases import case_of, other_world, with_entries

from builder.inverse.envelope import tail_quantile
from builder.pipeline import measured_levels
from builder.pipeline.measured_levels import alarm_levels_wanted, level_conditions, with_shape_levels
from builder.reporting import Silent
from builder.trial import readings
from builder.trial.cases import Plan
from builder.trial.estimators import of_map
from builder.trial.levels import (
    RATE,
    _ratios,
    alarm_levels,
    alarm_scales,
    level_readings,
    tail_ratios,
    with_alarm_levels,
    with_flight_alarm_levels,
)
from builder.trial.readings import Readings, World, joined
from builder.trial.run import scored
from builder.trial.score import Row
from builder.truth.shape import shape_flows
from builder.vehicle.file import VEHICLES, load_vehicle
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState, chi_square_limit
from strainfmu.estimator.map.inverse_map import InverseMap


@pytest.mark.fast
@pytest.mark.parametrize(
    "law", [chi2(49), genpareto(0.2), genpareto(-0.3)], ids=["chi-square", "heavy", "bounded"]
)
@pytest.mark.parametrize("probability", [0.1, 1e-3, 1e-4])
def test_tail_quantile_is_that_of_the_law(law: object, probability: float) -> None:
    """200,000 samples: the probability beyond the quantile found is within a factor 1.3 of the one requested."""
    values = law.rvs(size=200_000, random_state=4)  # type: ignore[attr-defined]  # a frozen law of scipy
    beyond = law.sf(tail_quantile(np.asarray(values), probability))  # type: ignore[attr-defined]
    assert probability / 1.3 < beyond < probability * 1.3


def ratios_of(random: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return chi-square of 49 degrees of freedom and the largest of 54 squared normals (n,), over their levels."""
    chi_square = random.chisquare(49, size=n) / chi_square_limit(49)
    return chi_square, np.max(random.standard_normal((n, 54)) ** 2, axis=1) / chi2(1).isf(1e-4 / 54)


@pytest.mark.fast
@pytest.mark.parametrize("rise", [0.0, 0.3])
def test_levels_of_the_theory_are_found_and_follow_what_rises_with_the_incidence(rise: float) -> None:
    """Both tests are independent: each has half of the rate. Chi-square over its level rises by ``rise`` of what
    the expected one does: a half of the samples finds it.

    Of the other half the rate in each tenth is at most 3 times the mean; with constant factors half of all alarms
    are in the last tenth.
    """
    random, n, half = np.random.default_rng(5), 600_000, 0.5 * RATE
    incidence = random.uniform(size=n)
    expected = np.exp(1.5 * incidence**2 - 0.5)
    ratios = np.stack(ratios_of(random, n)) * (1.0 - rise + rise * expected)
    one, other = slice(0, n // 2), slice(n // 2, n)
    scales, slope = alarm_levels(*ratios[:, one], expected[one], incidence[one])
    assert slope == pytest.approx(rise, abs=0.06 if rise else 0.0)
    assert scales[0] == pytest.approx(chi2(49).isf(half) / chi_square_limit(49), abs=0.06)
    assert scales[1] == pytest.approx(chi2(1).isf(half / 54) / chi2(1).isf(1e-4 / 54), abs=0.12)
    followed = (ratios[:, other] > scales[:, None] * (1.0 + slope * (expected[other] - 1.0))).any(axis=0)
    assert 0.5 * RATE < followed.mean() < 2.0 * RATE
    tenth = np.floor(10.0 * incidence[other]).astype(int)
    assert max(followed[tenth == k].mean() for k in range(10)) < 3.0 * followed.mean()
    fixed = (ratios[:, other] > alarm_scales(ratios[:, one])[:, None]).any(axis=0)
    assert (np.mean(tenth[fixed] == 9) > 0.5) == (rise > 0.0)


@pytest.fixture(scope="module")
def flights(full_world: World) -> Readings:
    return joined(list(level_readings(full_world, conditions=250, vehicles=40)))


@pytest.fixture(scope="module")
def calibrated(full_map: InverseMap, flights: Readings) -> InverseMap:
    return with_flight_alarm_levels(with_alarm_levels(full_map, [flights]), flights)


def test_blocks_of_flights_set_the_levels_of_all_their_samples(
    full_world: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Blocks have a largest number of readings; draws are of each flight alone."""
    linear = full_world.inverse_map.without_tables()
    whole = joined(list(level_readings(full_world, conditions=60, vehicles=40)))
    monkeypatch.setattr(readings, "LARGEST_BATCH", 500 * linear.n_gauges)
    blocks = list(level_readings(full_world, conditions=60, vehicles=40))
    assert [len(block.strain) for block in blocks] == [480] * 5
    np.testing.assert_array_equal(joined(blocks).strain, whole.strain)
    at_once, in_turn = with_alarm_levels(linear, [whole]), with_alarm_levels(linear, iter(blocks))
    assert in_turn.provenance == at_once.provenance
    assert in_turn.chi_square_scale == at_once.chi_square_scale


def test_steps_and_searches_find_the_same_tail(
    full_map: InverseMap, calibrated: InverseMap, flights: Readings
) -> None:
    """A step of two iterations from the state of the flight leaves up to a quarter more than a search does."""
    flights = flights.rows(np.arange(0, 10_000, 2))
    of_steps, estimator = tail_ratios(full_map, flights), Estimator(full_map)
    known = {name: value for name, value in flights.known.items() if name != "altitude"}
    of_searches = _ratios(estimator, estimator.estimate(flights.strain, **known))
    assert of_steps.shape == of_searches.shape == (3, 5_000)
    np.testing.assert_allclose(alarm_scales(of_steps), alarm_scales(of_searches), rtol=0.25)
    for name in ("nonlinear", "nonlinear stepping"):
        health = of_map(calibrated, name)(flights.rows(np.arange(200))).health
        assert health is not None
        assert np.all(health == HealthState.OK)


def test_other_flights_raise_few_alarms_and_tenths_add_up_to_the_whole(
    calibrated: InverseMap, full_world: World
) -> None:
    """10,000 samples of other seeds: one alarm is expected, 7 or more are 1e-4 likely."""
    case = case_of(full_world.vehicle, "false alarms", trial="false_alarms")

    def counted(made: InverseMap, estimator: str, vehicles: int) -> list[Row]:
        plan = Plan(vehicles=vehicles, estimators=[estimator])
        (rows,) = scored(other_world(full_world, inverse_map=made), case, plan).values()
        return rows

    for estimator in ("nonlinear stepping", "linear"):
        every = counted(calibrated, estimator, 50)[0]
        assert every["samples"] == 10_000
        assert every["alarm_percent"] <= 0.06
        assert "OUTSIDE" not in every["health"] or estimator == "linear"
    assert calibrated.manifold is not None
    tight = replace(calibrated, manifold=replace(calibrated.manifold, chi_square_scale=0.5))
    assert counted(tight, "nonlinear stepping", 10)[0]["alarm_percent"] > 10.0
    rows = counted(replace(calibrated, manifold=None, chi_square_scale=0.55), "linear", 8)
    for quantity in ("mach_number", "total_incidence", "leeward_roll_angle", "dynamic_pressure"):
        tenths = [row for row in rows if row["load"].endswith(f"by {quantity}")]
        assert [row["samples"] for row in tenths] == 10 * [160]
        assert np.mean([row["alarm_percent"] for row in tenths]) == pytest.approx(rows[0]["alarm_percent"])


@pytest.mark.fast
def test_cheap_flows_of_a_shape_set_levels_and_those_by_euler_do_on_request() -> None:
    finned, cone = (load_vehicle(VEHICLES / f"{name}.toml") for name in ("finned_body", "elliptic_cone"))
    reporter, notes = Silent(), list[str]()
    reporter.note = notes.append  # type: ignore[method-assign]  # notes are kept
    for vehicle, wanted, said in (
        (finned, True, ""),
        (cone, False, "from the theory, its 200 flows by euler"),
        (with_entries(finned, "structure", checked_by=None), False, "no independent model (structure.checked"),
        (with_entries(cone, "map", alarm_levels="always"), True, ""),
        (with_entries(finned, "map", alarm_levels="nominal"), False, ""),
    ):
        assert alarm_levels_wanted(vehicle, reporter) == wanted
        assert [said in note for note in notes] == [True] * bool(said)
        notes.clear()


def test_levels_of_a_shape_follow_from_the_flights(monkeypatch: pytest.MonkeyPatch) -> None:
    """Flights as the map expects them leave the levels about where they are; errors that it does not know raise
    them."""
    monkeypatch.setattr(measured_levels, "SHAPE_CONDITIONS", 40)
    monkeypatch.setattr(measured_levels, "SHAPE_VEHICLES", 100)
    vehicle = with_entries(shape_vehicle(), "aerodynamics", engine="newtonian")
    vehicle = with_entries(vehicle, "resolution", truth=vehicle.resolution.map)
    flows = shape_flows(vehicle, level_conditions(vehicle), Silent(), "Flow")
    monkeypatch.setattr(measured_levels, "structure_of_check", lambda *_: beam(grid_snapshots().surface))
    known: Any = SimpleNamespace(check=True)
    worse = with_entries(vehicle, "noise", apparent_strain_um_per_m=0.03)
    found, raised = (with_shape_levels(one, shape_map(), known, flows, Silent()) for one in (vehicle, worse))
    assert found.manifold is not None
    assert raised.manifold is not None
    facts = found.provenance["flight_alarm_levels"]
    assert (facts["samples"], facts["used"]) == (4000, True)
    assert 0.5 < found.manifold.chi_square_scale < 1.5
    assert raised.manifold.chi_square_scale > 1.1 * found.manifold.chi_square_scale
    assert raised.chi_square_scale > found.chi_square_scale
