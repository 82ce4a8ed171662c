"""Alarm levels of the nonlinear estimator from flights of the independent model.

As for the linear map, see :mod:`builder.trial.alarm_levels`: the levels of chi-square, of the largest
leave-one-out residual, and of the shapes of pressure off the tables together.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from builder.trial.alarm_levels import LARGEST_SCALE, alarm_scales
from builder.trial.conditions import flight_states
from builder.trial.readings import ReadFlights
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.estimator.alarm_limits import shape_limit
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import FALSE_ALARM_PROBABILITY
from strainfmu.estimator.map.inverse_map import InverseMap


def with_flight_alarm_levels(inverse_map: InverseMap, flights: ReadFlights) -> InverseMap:
    """Return ``inverse_map`` with the levels of its nonlinear estimator that meet the stated rate on ``flights``.

    Levels that would need a factor above :data:`~builder.trial.alarm_levels.LARGEST_SCALE` stay the
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

    Estimates start from the states of the flights or, with ``search``, from a search of the tables.
    """
    manifold, estimator = inverse_map.manifold, Estimator(inverse_map)
    assert manifold is not None
    scale = estimator.settings.alarm_scale
    found = estimator.estimate(
        flights.strain,
        flights.dynamic_pressure,
        mach_number=flights.mach_number,
        static_pressure=flights.static_pressure,
        start=None if search else np.repeat(flight_states(flights.conditions), flights.rows(0).stop, axis=0),
    )
    tests = [
        found.chi_square / np.asarray(found.chi_square_limit),
        (np.max(np.abs(found.standardised_residual), axis=1) / found.residual_limit) ** 2,
    ]
    if manifold.shapes.shape[1]:
        tests.append(found.discrepancy_chi_square / shape_limit(manifold, scale))
    return np.stack(tests), np.asarray(found.health)
