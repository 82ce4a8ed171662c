"""Alarm levels of the nonlinear estimator from flights of the independent model.

As for the linear map, see :mod:`builder.truth.levels.alarm_levels`: the levels of chi-square, of the largest
leave-one-out residual, and of the shapes of pressure off the tables together.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from builder.truth.levels.alarm_levels import LARGEST_SCALE, alarm_scales
from builder.truth.levels.read_flights import THREADS, ReadFlights
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import FALSE_ALARM_PROBABILITY
from strainfmu.estimator.manifold.flight_health import gauge_threshold, shape_limit
from strainfmu.estimator.map.inverse_map import InverseMap


def with_flight_alarm_levels(inverse_map: InverseMap, flights: ReadFlights) -> InverseMap:
    """Return ``inverse_map`` with the levels of its nonlinear estimator that meet the stated rate on ``flights``.

    Levels that would need a factor above :data:`~builder.truth.levels.alarm_levels.LARGEST_SCALE` stay the
    theory's.
    """
    manifold = inverse_map.manifold
    assert manifold is not None
    ratios, _ = ratios_and_health(inverse_map, flights)
    scales = alarm_scales(ratios)
    agrees = bool(scales.max() <= LARGEST_SCALE)
    facts = {
        "samples": ratios.shape[1],
        "stated_rate": FALSE_ALARM_PROBABILITY,
        "rate_before": float(np.mean(ratios.max(axis=0) > 1.0)),
        "scales": scales.tolist(),
        "used": agrees,
    }
    if agrees:
        tested = len(scales) > 2
        manifold = replace(
            manifold,
            chi_square_scale=float(scales[0]),
            outlier_scale=float(scales[1]),
            shape_scale=float(scales[2]) if tested else 1.0,
        )
    provenance = {**inverse_map.provenance, "flight_alarm_levels": facts}
    return replace(inverse_map, manifold=manifold, provenance=provenance)


def ratios_and_health(
    inverse_map: InverseMap, flights: ReadFlights, *, search: bool = False
) -> tuple[FloatArray, IntArray]:
    """Return chi-square, the square of the largest residual and chi-square of the shapes (2 or 3, n) over their
    levels, and health (n,), of the nonlinear estimator.

    The vehicles of a flight follow one another: each starts from the flight state of the one before. With
    ``search`` each is found by a search of the tables.
    """
    manifold = inverse_map.manifold
    assert manifold is not None
    estimators = [Estimator(inverse_map) for _ in range(THREADS)]
    scale = estimators[0].settings.alarm_scale
    of_gauges, of_shapes = gauge_threshold(manifold, scale), shape_limit(manifold, scale)
    n_shapes = manifold.shapes.shape[1]

    def of_thread(first: int) -> list[tuple[FloatArray, IntArray]]:
        return [of_flight(estimators[first], one) for one in range(first, len(flights.conditions), THREADS)]

    def of_flight(estimator: Estimator, number: int) -> tuple[FloatArray, IntArray]:
        found = _estimates(estimator, flights, flights.rows(number), search)
        tests = [
            found.chi_square / np.asarray(found.chi_square_limit),
            (np.max(np.abs(found.standardised_residual), axis=1) / of_gauges) ** 2,
        ]
        if n_shapes:
            tests.append(found.discrepancy_chi_square / of_shapes)
        return np.stack(tests), np.asarray(found.health)

    with ThreadPoolExecutor(THREADS) as pool:
        by_thread = list(pool.map(of_thread, range(THREADS)))
    parts = [by_thread[number % THREADS][number // THREADS] for number in range(len(flights.conditions))]
    return np.concatenate([one for one, _ in parts], axis=1), np.concatenate([one for _, one in parts])


def _estimates(estimator: Estimator, flights: ReadFlights, rows: slice, search: bool) -> Estimate:
    """Return the estimates of the samples ``rows``, which are of one flight."""
    estimator.restart()
    return (estimator.estimate if search else estimator.track)(
        flights.strain[rows],
        flights.dynamic_pressure[rows],
        mach_number=flights.mach_number[rows],
        static_pressure=flights.static_pressure[rows],
    )
