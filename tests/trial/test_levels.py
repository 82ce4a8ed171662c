"""Quantiles in the tail of a sample, and the alarm levels that follow from them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2, genpareto
from trial_cases import case_of, other_world

from builder.inverse.envelope.score_limit import tail_quantile
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
def test_levels_of_the_theory_are_found_on_data_of_the_theory() -> None:
    """Both tests are independent: each has half of the rate."""
    random, n, half = np.random.default_rng(3), 300_000, 0.5 * RATE
    chi_square, outlier = ratios_of(random, n)
    scales, slope = alarm_levels(chi_square, outlier, np.ones(n), random.uniform(size=n))
    assert slope == 0.0
    assert scales[0] == pytest.approx(chi2(49).isf(half) / chi_square_limit(49), abs=0.06)
    assert scales[1] == pytest.approx(chi2(1).isf(half / 54) / chi2(1).isf(1e-4 / 54), abs=0.12)
    assert 0.5 * RATE < np.mean((chi_square > scales[0]) | (outlier > scales[1])) < 2.0 * RATE


@pytest.mark.fast
def test_levels_follow_what_rises_with_the_incidence() -> None:
    """Chi-square over its level rises by 0.3 of what the expected one does: a half of the samples finds it.

    Of the other half the rate in each tenth is at most 3 times the mean; with constant factors half of all alarms
    are in the last tenth.
    """
    random, n = np.random.default_rng(5), 600_000
    incidence = random.uniform(size=n)
    expected = np.exp(1.5 * incidence**2 - 0.5)
    ratios = np.stack(ratios_of(random, n)) * (0.7 + 0.3 * expected)
    one, other = slice(0, n // 2), slice(n // 2, n)
    scales, slope = alarm_levels(*ratios[:, one], expected[one], incidence[one])
    assert slope == pytest.approx(0.3, abs=0.06)
    followed = (ratios[:, other] > scales[:, None] * (1.0 + slope * (expected[other] - 1.0))).any(axis=0)
    assert 0.5 * RATE < followed.mean() < 2.0 * RATE
    tenth = np.floor(10.0 * incidence[other]).astype(int)
    assert max(followed[tenth == k].mean() for k in range(10)) < 3.0 * followed.mean()
    fixed = (ratios[:, other] > alarm_scales(ratios[:, one])[:, None]).any(axis=0)
    assert np.mean(tenth[fixed] == 9) > 0.5


@pytest.fixture(scope="module")
def flights(full_world: World) -> Readings:
    return joined(list(level_readings(full_world, conditions=250, vehicles=40)))


@pytest.fixture(scope="module")
def calibrated(full_map: InverseMap, flights: Readings) -> InverseMap:
    return with_flight_alarm_levels(with_alarm_levels(full_map, [flights]), flights)


def test_blocks_of_flights_set_the_levels_of_all_their_samples(
    full_world: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Blocks have a largest number of readings, so that memory does not grow with the gauges; draws are of each
    flight alone."""
    linear = full_world.inverse_map.without_tables()
    whole = joined(list(level_readings(full_world, conditions=60, vehicles=40)))
    monkeypatch.setattr(readings, "LARGEST_BATCH", 500 * linear.n_gauges)
    blocks = list(level_readings(full_world, conditions=60, vehicles=40))
    assert [len(block.strain) for block in blocks] == [480] * 5
    np.testing.assert_array_equal(joined(blocks).strain, whole.strain)
    at_once, in_turn = with_alarm_levels(linear, [whole]), with_alarm_levels(linear, iter(blocks))
    assert in_turn.provenance == at_once.provenance
    assert in_turn.chi_square_scale == at_once.chi_square_scale


def counted(world: World, made: InverseMap, estimator: str, vehicles: int = 50) -> list[Row]:
    """Return the rows of the shipped trial on as many samples."""
    plan = Plan(vehicles=vehicles, estimators=[estimator])
    case = case_of(world.vehicle, "false alarms", trial="false_alarms")
    (rows,) = scored(other_world(world, inverse_map=made), case, plan).values()
    return rows


def test_steps_and_searches_find_the_same_tail(
    full_map: InverseMap, calibrated: InverseMap, flights: Readings
) -> None:
    """A step of two iterations from the state of the flight leaves up to a quarter more than a search does."""
    of_steps, estimator = tail_ratios(full_map, flights), Estimator(full_map)
    known = {name: value for name, value in flights.known.items() if name != "altitude"}
    of_searches = _ratios(estimator, estimator.estimate(flights.strain, **known))
    assert of_steps.shape == of_searches.shape == (3, 10_000)
    np.testing.assert_allclose(alarm_scales(of_steps), alarm_scales(of_searches), rtol=0.25)
    for name in ("nonlinear", "nonlinear stepping"):
        health = of_map(calibrated, name)(flights.rows(np.arange(200))).health
        assert health is not None
        assert np.all(health == HealthState.OK)


def test_other_flights_raise_few_alarms(calibrated: InverseMap, full_world: World) -> None:
    """10,000 samples of other seeds: one alarm is expected, 7 or more are 1e-4 likely."""
    for estimator in ("nonlinear stepping", "linear"):
        every = counted(full_world, calibrated, estimator)[0]
        assert every["samples"] == 10_000
        assert every["alarm_percent"] <= 0.06
        assert "OUTSIDE" not in every["health"] or estimator == "linear"
    assert calibrated.manifold is not None
    tight = replace(calibrated, manifold=replace(calibrated.manifold, chi_square_scale=0.5))
    assert counted(full_world, tight, "nonlinear stepping", vehicles=10)[0]["alarm_percent"] > 10.0


def test_tenths_add_up_to_the_whole(calibrated: InverseMap, full_world: World) -> None:
    """Of levels that raise many alarms: the tenths by each quantity have the mean of all."""
    rows = counted(full_world, replace(calibrated, manifold=None, chi_square_scale=0.55), "linear", vehicles=8)
    for quantity in ("mach_number", "total_incidence", "leeward_roll_angle", "dynamic_pressure"):
        tenths = [row for row in rows if row["load"].endswith(f"by {quantity}")]
        assert [row["samples"] for row in tenths] == 10 * [160]
        assert np.mean([row["alarm_percent"] for row in tenths]) == pytest.approx(rows[0]["alarm_percent"])
