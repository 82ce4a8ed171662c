"""Alarm levels of a map from data that it was not built on: the independent model, hardware errors drawn.

The theory's levels hold for normal errors of the map's own covariance. Real flights have the errors of one
vehicle at one strain, pressure between the snapshots, and another discretisation. So the levels are set to where
the stated rate of false alarms is met on such data, drawn over conditions, vehicles and noise.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from builder.inverse.envelope import tail_quantile
from builder.trial.cases import Air, Built, Case
from builder.trial.conditions import Where, quantities
from builder.trial.estimators import estimate_of
from builder.trial.readings import Readings, World, read_own_vehicles, with_map_errors
from builder.truth.flights import Flights
from strainfmu.arrays import BoolArray, FloatArray, IntArray
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE
from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import FALSE_ALARM_PROBABILITY, chi_square_limit
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.flight_condition import FlightCondition

CONDITIONS, VEHICLES = 4000, 10
"""Flight conditions, and vehicles that fly at each, every one with its own errors and noise.

Levels of the shipped nonlinear map by 40,000 samples give 0.45 to 0.9 times the stated rate on 200,000 other
samples; levels by 200,000 samples give 0.65 times, in four times the time.
"""

SEED = 20260

HARDWARE = Case(
    error="installation errors, air data",
    group="alone",
    where=Where(altitudes="map"),
    as_built=Built(stated=1.0),
    air=Air(drawn=True),
)
"""What levels are set from: errors of hardware and air data, drawn at their stated sizes."""

LARGEST_SCALE = 3.0
"""Factor on an alarm level from which map and independent model do not agree: then the level stays the
theory's."""

RATE = 0.6 * FALSE_ALARM_PROBABILITY
"""Rate that levels are set for: on flows that they were not set on, the rate is 1.4 to 1.5 times as large."""

PARTS, RATE_OF_PARTS = 10, 2e-3
"""Parts of the samples by incidence, and the rate of the alarms that are compared between them."""

SLOPES, AS_FEW = 21, 1.1
"""Slopes of the levels that are compared, and alarms over the fewest of these that count as as few."""

UPPER = 0.05
"""Part of the samples, by each test of the nonlinear estimator, that take steps from their own estimates: levels
are set from the upper hundredth, :data:`~builder.inverse.envelope.TAIL`."""

LEAST_RANGE = 0.2
"""Range of expected chi-square over that at the mean strain, over the parts, from which the levels follow it."""


def level_readings(
    world: World,
    fly: Callable[[list[FlightCondition]], Flights] | None = None,
    *,
    seed: int | list[int] = SEED,
    vehicles: int = VEHICLES,
    conditions: int = CONDITIONS,
) -> Iterator[Readings]:
    """Yield what ``vehicles`` read at each of ``conditions`` that map and flows cover, in blocks; ``fly`` makes
    the flights there, the flights of the world by default."""
    random = np.random.default_rng(seed)
    flown = replace(world, conditions=conditions).drawn_conditions(HARDWARE, random)
    return read_own_vehicles(world, HARDWARE, (fly or world.fly)(flown), vehicles, random)


def with_alarm_levels(inverse_map: InverseMap, flights: Iterable[Readings]) -> InverseMap:
    """Return ``inverse_map`` with the alarm levels that meet the stated rate on blocks of ``flights``.

    The rate counts any alarm; both tests get the same rate of their own. Where a level would need a factor
    above :data:`LARGEST_SCALE`, map and independent model do not describe the same vehicle: it stays, and the
    provenance holds the factor.

    Pressure that no state holds grows with the incidence, its part of the covariance does not. So chi-square rises
    with the strain by more than what errors in proportion to strain add, and the levels follow it.
    """
    chi_square, outlier, expected, incidence = linear_tests(inverse_map, flights)
    scales, slope = alarm_levels(chi_square, outlier, expected, incidence)
    of_scales = {"chi_square_scale": float(scales[0]), "outlier_scale": float(scales[1]), "slope": slope}
    facts = _facts(np.stack([chi_square, outlier]), scales) | of_scales
    noted = replace(inverse_map, provenance={**inverse_map.provenance, "alarm_levels": facts})
    if not facts["used"]:
        return noted
    return replace(
        noted,
        chi_square_scale=inverse_map.chi_square_scale * float(scales[0]),
        outlier_scale=inverse_map.outlier_scale * float(scales[1]),
        level_slope=slope,
    )


def _facts(ratios: FloatArray, scales: FloatArray) -> dict[str, Any]:
    """Return what the provenance says of ``scales`` of the levels that ``ratios`` (t, n) are over."""
    return {
        "samples": ratios.shape[1],
        "rate_before": float(np.mean(ratios.max(axis=0) > 1.0)),
        "stated_rate": FALSE_ALARM_PROBABILITY,
        "used": bool(scales.max() <= LARGEST_SCALE),
    }


def alarm_scales(ratios: FloatArray) -> FloatArray:
    """Return factors (t,) on the levels of t tests that together meet :data:`RATE`, each an equal part of it.

    ``ratios`` (t, n) are the tests of n samples, each over its present level.
    """
    rate = RATE / len(ratios)
    scales = np.array([tail_quantile(ratio, rate) for ratio in ratios])
    largest = np.max(ratios / scales[:, None], axis=0)
    return np.asarray(scales * tail_quantile(largest, RATE))


def alarm_levels(
    chi_square: FloatArray, outlier: FloatArray, expected: FloatArray, incidence: FloatArray
) -> tuple[FloatArray, float]:
    """Return factors (2,) on the levels of chi-square and of the squared largest |z| (n,), each over its present
    level, and the slope a of the levels.

    Present levels are in proportion to ``expected`` (n,), r, the expected chi-square over that at the mean strain;
    the new ones are in proportion to r (1 - a + a r). ``incidence`` (n,) is the incidence of the flights [rad].
    """
    ratios = np.stack([chi_square, outlier])
    slope = level_slope(ratios, expected, incidence)
    return alarm_scales(ratios / (1.0 + slope * (expected - 1.0))), slope


def level_slope(ratios: FloatArray, expected: FloatArray, incidence: FloatArray) -> float:
    """Return a, 0 to 1, with which levels in proportion to 1 - a + a r spread alarms over the incidence.

    ``ratios`` (t, n) are tests, ``expected`` (n,) is r. Samples are parted by ``incidence`` (n,); the part with
    the most alarms has as few as possible, but for :data:`AS_FEW`: of such a the smallest one counts.
    It is 0 where r hardly changes.
    """
    parts = np.array_split(np.argsort(incidence, kind="stable"), PARTS)
    if np.ptp([expected[part].mean() for part in parts]) < LEAST_RANGE:
        return 0.0
    slopes = np.linspace(0.0, 1.0, SLOPES)
    most = np.array([_most_alarms(ratios / (1.0 + slope * (expected - 1.0)), parts) for slope in slopes.tolist()])
    return float(slopes[np.argmax(most <= AS_FEW * most.min())])


def _most_alarms(ratios: FloatArray, parts: list[IntArray]) -> int:
    """Return the largest number of alarms in one of ``parts``, at levels that :data:`RATE_OF_PARTS` exceed."""
    level = np.quantile(ratios, 1.0 - RATE_OF_PARTS / len(ratios), axis=1)
    above: BoolArray = np.any(ratios > level[:, None], axis=0)
    return max(int(above[part].sum()) for part in parts)


def linear_tests(inverse_map: InverseMap, flights: Iterable[Readings]) -> FloatArray:
    """Return (4, n) of the linear map: its two tests, each over its level, the factor by which the levels of a
    sample follow its strain, and its incidence [rad]."""
    estimator = Estimator(inverse_map.without_tables())
    nominal = inverse_map.chi_square_scale * chi_square_limit(inverse_map.residual_degrees_of_freedom)
    tests = list[FloatArray]()
    for block in flights:
        made = estimator.estimate(block.strain, block.known[DYNAMIC_PRESSURE], with_residuals=True)
        incidence = quantities(block.conditions, "total_incidence")[block.flight]
        tests.append(np.stack([*_ratios(estimator, made), made.chi_square_limit / nominal, incidence]))
    return np.concatenate(tests, axis=1)


def with_flight_alarm_levels(inverse_map: InverseMap, flights: Readings) -> InverseMap:
    """Return ``inverse_map`` with the levels of its nonlinear estimator that meet the stated rate on ``flights``.

    Errors of pressure and numerics that the tables include are drawn on top: they are stated, and raise no alarm.

    They are the levels of chi-square, of the largest leave-one-out residual, and of the shapes of pressure off the
    tables together. Levels that would need a factor above :data:`LARGEST_SCALE` stay the theory's.
    """
    manifold = inverse_map.manifold
    assert manifold is not None
    ratios = tail_ratios(inverse_map, with_map_errors(inverse_map, flights, np.random.default_rng(SEED)))
    scales = alarm_scales(ratios)
    facts = _facts(ratios, scales) | {"scales": scales.tolist()}
    if facts["used"]:
        manifold = replace(
            manifold,
            chi_square_scale=float(scales[0]),
            outlier_scale=float(scales[1]),
            shape_scale=float(scales[2]) if len(scales) > 2 else 1.0,
        )
    provenance = {**inverse_map.provenance, "flight_alarm_levels": facts}
    return replace(inverse_map, manifold=manifold, provenance=provenance)


def tail_ratios(inverse_map: InverseMap, flights: Readings) -> FloatArray:
    """Return the tests (2 or 3, n) that levels are set from, over their levels.

    Estimates start as steps along a flight do, from the states that vehicles estimate there: errors of a vehicle
    last, and its estimates are wrong by as much in every step. Such steps are taken by the samples with a test in
    the upper :data:`UPPER` of it from the true state; the tests of the others are of the true state.
    """
    estimator = Estimator(inverse_map)
    made = estimate_of(estimator, flights, flights.states)
    ratios = _ratios(estimator, made)
    upper = np.flatnonzero(np.any(ratios > np.quantile(ratios, 1.0 - UPPER, axis=1, keepdims=True), axis=0))
    ratios[:, upper] = _ratios(
        estimator, estimate_of(estimator, flights.rows(upper), np.asarray(made.state)[upper])
    )
    return ratios


def _ratios(estimator: Estimator, made: Estimate) -> FloatArray:
    """Return the tests of strain (2 or 3, n) of estimates, each over its level: chi-square, the squared largest
    |z|, and chi-square of the shapes of pressure off the tables, where there are any."""
    manifold = estimator.inverse_map.manifold
    tests = [
        made.chi_square / np.asarray(made.chi_square_limit),
        (np.max(np.abs(made.standardised_residual), axis=1) / made.residual_limit) ** 2,
    ]
    if manifold is not None and manifold.discrepancy_shapes.shape[1]:
        tests.append(made.discrepancy_chi_square / (estimator.settings.alarm_scale * manifold.shape_limit))
    return np.stack(tests)
