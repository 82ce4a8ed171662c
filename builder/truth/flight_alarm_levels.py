"""Alarm levels of the nonlinear estimator from flights of the independent model.

Errors of hardware and navigation are drawn. As for the linear map, see :mod:`builder.truth.alarm_levels`: the
levels of chi-square, of the largest leave-one-out residual, and of the largest shape of pressure off the tables.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from builder.truth.alarm_levels import LARGEST_SCALE, SEED, THREADS, alarm_scales, gauge_noise
from builder.truth.flow_table import FlowTable
from builder.truth.flown_vehicles import Fly
from builder.truth.held_out import held_out_conditions
from builder.vehicle.file import Vehicle
from strainfmu.arrays import FloatArray
from strainfmu.estimator.health import FALSE_ALARM_PROBABILITY
from strainfmu.estimator.inverse_map import InverseMap
from strainfmu.estimator.manifold.estimator import BLOCK, EstimatorInputs, ManifoldEstimator
from strainfmu.estimator.manifold.flight_health import gauge_threshold, shape_threshold
from strainfmu.estimator.manifold.solve import solve_warm
from strainfmu.flight_condition import FlightCondition

CONDITIONS, VEHICLES = 1000, 24
"""Flight conditions, and vehicles as built that fly at each."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ReadFlights:
    """What n flights read.

    Attributes
    ----------
    inputs : strain and navigation, with the errors of both.
    state : (n, 4) true flight states, from which each starts as a step does from the state of the last one.
    """

    inputs: EstimatorInputs
    state: FloatArray


def with_flight_alarm_levels(inverse_map: InverseMap, vehicle: Vehicle, table: FlowTable, fly: Fly) -> InverseMap:
    """Return ``inverse_map`` with the levels of its nonlinear estimator that meet the stated rate.

    ``fly`` is as for :func:`~builder.truth.alarm_levels.with_alarm_levels`. Levels that would need a factor above
    :data:`~builder.truth.alarm_levels.LARGEST_SCALE` stay the theory's.
    """
    manifold = inverse_map.manifold
    assert manifold is not None
    estimator = ManifoldEstimator(inverse_map)
    ratios = flight_alarm_ratios(estimator, read_flights(estimator, vehicle, table, fly))
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
            shape_limit=shape_threshold(manifold, 1.0) * float(np.sqrt(scales[2])) if tested else None,
        )
    provenance = {**inverse_map.provenance, "flight_alarm_levels": facts}
    return replace(inverse_map, manifold=manifold, provenance=provenance)


def read_flights(
    estimator: ManifoldEstimator,
    vehicle: Vehicle,
    table: FlowTable,
    fly: Fly,
    *,
    vehicles: int = VEHICLES,
    seed: int = SEED,
) -> ReadFlights:
    """Return what ``vehicles`` read at each of :data:`CONDITIONS` held-out flights, each with its own errors."""
    random, inverse_map, noise = np.random.default_rng(seed), estimator.inverse_map, vehicle.noise
    flown = fly(held_out_conditions(vehicle, table, CONDITIONS, random))
    found = [flown.read(number, vehicles, random) for number in range(len(flown.conditions))]
    read, stated = (np.concatenate(part) for part in zip(*found, strict=True))
    state = np.repeat([_state(one) for one in flown.conditions], vehicles, axis=0)
    error = random.standard_normal((2, len(state)))
    of_pressure = 0.01 * noise.navigation_static_pressure_percent * error[1]
    flow = {
        "mach_number": state[:, 0] + noise.navigation_mach_number * error[0],
        "static_pressure": np.exp(state[:, 3]) * (1.0 + of_pressure),
        "dynamic_pressure": np.repeat(flown.dynamic_pressure, vehicles) * stated,
        "altitude": np.nan,
        **{f"{name}_std": np.nan for name in ("mach_number", "static_pressure", "dynamic_pressure")},
    }
    read = read + gauge_noise(inverse_map, random, read.shape)
    return ReadFlights(inputs=estimator.checked_inputs(read, None, flow), state=state)


def _state(condition: FlightCondition) -> list[float]:
    incidence, roll = condition.total_incidence, condition.leeward_roll_angle
    return [
        condition.mach_number,
        incidence * float(np.cos(roll)),
        incidence * float(np.sin(roll)),
        float(np.log(condition.ambient_pressure)),
    ]


def flight_alarm_ratios(estimator: ManifoldEstimator, flights: ReadFlights) -> FloatArray:
    """Return chi-square and the squares of the largest residuals (2 or 3, n), each over its level."""
    manifold, scale = estimator.manifold, estimator.settings.alarm_scale
    of_gauges, of_shapes = gauge_threshold(manifold, scale), shape_threshold(manifold, scale)

    def of_block(first: int) -> FloatArray:
        rows = slice(first, first + BLOCK)
        state = flights.state[rows]
        found = estimator.estimated(
            flights.inputs.rows(rows), lambda samples: solve_warm(manifold, state, samples)
        )
        tests = [
            found.chi_square / np.asarray(found.chi_square_limit),
            (np.max(np.abs(found.standardised_residual), axis=1) / of_gauges) ** 2,
        ]
        if found.shape_residual.shape[1]:
            tests.append((np.max(np.abs(found.shape_residual), axis=1) / of_shapes) ** 2)
        return np.stack(tests)

    with ThreadPoolExecutor(THREADS) as pool:
        return np.concatenate(list(pool.map(of_block, range(0, len(flights.state), BLOCK))), axis=1)
