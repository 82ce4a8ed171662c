"""Alarm levels of the nonlinear estimator from flights of the independent model.

As for the linear map, see :mod:`builder.truth.levels.alarm_levels`: the levels of chi-square, of the largest
leave-one-out residual, and of the shapes of pressure off the tables together. Levels follow from the largest of
many samples, and an estimate takes a fifth of a millisecond. So all are predicted first, by one linear step from
the state of the flight, for which its vehicles have all matrices in common; only the largest are estimated.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from builder.truth.levels.alarm_levels import LARGEST_SCALE, alarm_scales
from builder.truth.levels.read_flights import THREADS, ReadFlights
from builder.truth.levels.tail_quantile import TAIL
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.estimator.health import FALSE_ALARM_PROBABILITY
from strainfmu.estimator.manifold.estimator import BLOCK, EstimatorInputs, ManifoldEstimator
from strainfmu.estimator.manifold.flight_health import gauge_threshold, shape_limit, whole_chi_square_limit
from strainfmu.estimator.manifold.gauss_newton import strain_factor
from strainfmu.estimator.manifold.navigation import NAVIGATION, predicted, state_measurement
from strainfmu.estimator.manifold.solve import solve_warm
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.tables.flight_tables import evaluate
from strainfmu.flight_condition import FlightCondition

ESTIMATED = (2.0 * TAIL, 2.0 * TAIL, 5.0 * TAIL)
"""Fractions of the samples, by chi-square, residual and shapes, that are estimated: what the tail is
fitted to, and more, as the prediction is not exact. That of the shapes is the worst."""


def with_flight_alarm_levels(inverse_map: InverseMap, flights: ReadFlights) -> InverseMap:
    """Return ``inverse_map`` with the levels of its nonlinear estimator that meet the stated rate on ``flights``.

    Levels that would need a factor above :data:`~builder.truth.levels.alarm_levels.LARGEST_SCALE` stay the
    theory's.
    """
    manifold = inverse_map.manifold
    assert manifold is not None
    ratios = flight_alarm_ratios(ManifoldEstimator(inverse_map), flights)
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


def flight_alarm_ratios(estimator: ManifoldEstimator, flights: ReadFlights) -> FloatArray:
    """Return chi-square, the square of the largest residual and chi-square of the shapes (2 or 3, n), over their
    levels.

    The largest of each are those of the estimator, see :data:`ESTIMATED`; the others are predicted.
    """
    inputs, state = _inputs(estimator, flights), _states(flights)
    ratios = _predicted_ratios(estimator, flights, inputs, state)
    level = [np.quantile(of_test, 1.0 - part) for of_test, part in zip(ratios, ESTIMATED, strict=False)]
    rows = np.flatnonzero(np.any(ratios >= np.array(level)[:, None], axis=0))
    vehicles = len(flights.strain) // len(state)
    ratios[:, rows] = _estimated(estimator, inputs.rows(rows), state[rows // vehicles])[0]
    return ratios


def ratios_and_health(
    estimator: ManifoldEstimator, flights: ReadFlights, *, search: bool
) -> tuple[FloatArray, IntArray]:
    """Return the tests of :func:`flight_alarm_ratios` and health (n,) of estimates of all samples.

    They start from the states of the flights or, with ``search``, from a search of the tables.
    """
    state = None if search else np.repeat(_states(flights), flights.rows(0).stop, axis=0)
    return _estimated(estimator, _inputs(estimator, flights), state)


def _inputs(estimator: ManifoldEstimator, flights: ReadFlights) -> EstimatorInputs:
    flow = {name: getattr(flights, name) for name in NAVIGATION}
    unknown = dict.fromkeys(("altitude", *(f"{name}_std" for name in NAVIGATION)), np.nan)
    return estimator.checked_inputs(flights.strain, None, {**flow, **unknown})


def _states(flights: ReadFlights) -> FloatArray:
    """Return (f, 4) the true states of ``flights``."""
    return np.array([_state(one) for one in flights.conditions])


def _state(condition: FlightCondition) -> list[float]:
    incidence, roll = condition.total_incidence, condition.leeward_roll_angle
    return [
        condition.mach_number,
        incidence * float(np.cos(roll)),
        incidence * float(np.sin(roll)),
        float(np.log(condition.ambient_pressure)),
    ]


def _estimated(
    estimator: ManifoldEstimator, inputs: EstimatorInputs, state: FloatArray | None
) -> tuple[FloatArray, IntArray]:
    """Return the tests (2 or 3, n) over their levels, and health (n,), of steps from ``state`` (n, 4), None for a
    search."""
    manifold, scale = estimator.manifold, estimator.settings.alarm_scale
    of_gauges, of_shapes = gauge_threshold(manifold, scale), shape_limit(manifold, scale)

    def of_block(first: int) -> tuple[FloatArray, IntArray]:
        block = slice(first, first + BLOCK)
        start = None if state is None else state[block]
        found = estimator.estimated(
            inputs.rows(block),
            lambda samples, rows: (
                estimator.search(samples, rows) if start is None else solve_warm(manifold, start[rows], samples)
            ),
        )
        tests = [
            found.chi_square / np.asarray(found.chi_square_limit),
            (np.max(np.abs(found.standardised_residual), axis=1) / of_gauges) ** 2,
        ]
        if found.shape_residual.shape[1]:
            tests.append(np.sum(found.shape_residual**2, axis=1) / of_shapes)
        return np.stack(tests), np.asarray(found.health)

    with ThreadPoolExecutor(THREADS) as pool:
        found = list(pool.map(of_block, range(0, len(inputs.strain), BLOCK)))
    return np.concatenate([one for one, _ in found], axis=1), np.concatenate([one for _, one in found])


def _predicted_ratios(
    estimator: ManifoldEstimator, flights: ReadFlights, inputs: EstimatorInputs, state: FloatArray
) -> FloatArray:
    """Return the tests (2 or 3, n) over their levels by one linear step from the ``state`` (f, 4) of each flight.

    The formulas are those of :mod:`strainfmu.estimator.manifold.solve`; navigation that is inconsistent counts.
    """
    manifold, scale = estimator.manifold, estimator.settings.alarm_scale
    n_d, shapes = manifold.tables.n_gauges, manifold.shapes
    levels = np.array(
        [
            whole_chi_square_limit(manifold, scale),
            gauge_threshold(manifold, scale) ** 2,
            shape_limit(manifold, scale),
        ]
    )

    def of_flight(number: int) -> FloatArray:
        start, rows = state[number : number + 1], flights.rows(number)
        response, measured = (
            evaluate(manifold.tables, start),
            state_measurement(manifold, inputs.navigation.rows(rows)),
        )
        inverse = np.linalg.inv(strain_factor(manifold, start, np.ones((1, n_d), dtype=bool))[0])
        whitened = (inputs.strain[rows] - response.value[0, :n_d]) @ inverse.T
        jacobian = inverse @ response.jacobian[0, :n_d]
        (value,), (of_state,) = predicted(start)
        # Deviations are relative or fixed: the same for all samples.
        innovation, weight = measured.value - value, measured.precision[0]
        covariance = np.linalg.inv(jacobian.T @ jacobian + (of_state.T * weight) @ of_state)
        step = (whitened @ jacobian + (innovation * weight) @ of_state) @ covariance
        left, of_navigation = whitened - step @ jacobian.T, innovation - step @ of_state.T
        tests = [np.sum(left**2, axis=1) + of_navigation**2 @ weight]
        by_state = inverse.T @ jacobian
        variance = np.sum(inverse**2, axis=0) - np.einsum("gx,xy,gy->g", by_state, covariance, by_state)
        tests.append(np.max((left @ inverse) ** 2 / variance, axis=1))
        if shapes.shape[1]:
            turned = inverse @ shapes
            by_state = turned.T @ jacobian
            product = left @ turned
            of_shapes = np.linalg.inv(turned.T @ turned - by_state @ covariance @ by_state.T)
            tests.append(np.einsum("ks,st,kt->k", product, of_shapes, product))
        return np.stack(tests)

    with ThreadPoolExecutor(THREADS) as pool:
        ratios = np.concatenate(list(pool.map(of_flight, range(len(state)))), axis=1)
    return np.asarray(ratios / levels[: len(ratios), None])
