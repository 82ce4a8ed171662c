"""The arrays of ``map.bin`` that a nonlinear map adds: its tables, section loads, flow parameters."""

from __future__ import annotations

from math import log

import numpy as np

from strainfmu.atmosphere import HEAT_CAPACITY_RATIO
from strainfmu.estimator.air_data import NAVIGATION
from strainfmu.estimator.alarm_limits import outlier_threshold, outside_score, shape_limit
from strainfmu.estimator.health import FALSE_ALARM_PROBABILITY, chi_square_limit
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.numerics.fixed_order import product
from strainfmu.estimator.other_loads import FIVE_LOADS, OTHER_LOADS
from strainfmu.estimator.policies import (
    COLD_ITERATIONS,
    FALSE_ALARMS,
    LARGEST_STEP,
    LARGEST_USED_SCORE,
    MIN_GAIN,
    MIN_INCIDENCE_SCORE,
    NAVIGATION_ALARM,
    RANGE_TOLERANCE,
    RETURN_AFTER,
    SEARCH_EVERY,
    START_ITERATIONS,
    WARM_ITERATIONS,
)
from strainfmu.estimator.resource.container import Values
from strainfmu.estimator.setting_inputs import OF_AREA, OF_LENGTH
from strainfmu.estimator.tables.channel_tables import channel_tables
from strainfmu.estimator.tables.flight_tables import MIN_INCIDENCE, FlightTables
from strainfmu.estimator.tables.manifold_map import ManifoldMap
from strainfmu.estimator.tables.parameter_factors import error_products, factors
from strainfmu.estimator.tables.parameter_tables import ParameterTables


def nonlinear_parts(inverse_map: InverseMap) -> dict[str, Values]:
    """Return the parts of the tables of ``inverse_map`` by name; none of a linear map."""
    manifold = inverse_map.manifold
    if manifold is None:
        return {}
    parts: dict[str, Values] = {
        "flight": {
            **_tables(inverse_map, manifold),
            **_ranges(manifold),
            **_solver(manifold),
            **_errors(manifold),
        },
    }
    if manifold.considered_tables is not None:
        parts["considered"] = _considered(inverse_map, manifold.considered_tables)
    if inverse_map.has_other_loads:
        parts["flight_loads"] = _other_loads(manifold)
    if manifold.parameters is not None:
        parts["parameter_tables"] = _parameter_tables(manifold, manifold.parameters)
    return parts


def _tables(inverse_map: InverseMap, manifold: ManifoldMap) -> Values:
    """Return the tables of strain and loads on their knots."""
    return {
        OF_AREA: manifold.reference_area,
        OF_LENGTH: manifold.reference_length,
        "min_incidence": MIN_INCIDENCE,
        "mach_knots": manifold.mach_knots,
        "incidence_knots": manifold.incidence_knots,
        **vars(channel_tables(manifold.tables.response, np.arctan2(*inverse_map.gauge_position[:, 1:].T))),
        "fixed_response": manifold.tables.fixed_response,
    }


def _considered(inverse_map: InverseMap, tables: FlightTables) -> Values:
    """Return the tables of strain and all loads of the considered error of the flow."""
    return {
        **vars(channel_tables(tables.response, np.arctan2(*inverse_map.gauge_position[:, 1:].T))),
        "fixed_response": tables.fixed_response,
    }


def _ranges(manifold: ManifoldMap) -> Values:
    """Return where the tables hold, and what is known of the flight state without strain."""
    prior = manifold.state_prior
    low, high = manifold.pressure_range.tolist()
    return {
        "mach_range": manifold.mach_range,
        "pressure_range": [low, high],
        "log_pressure_range": [log(low), log(high)],
        "middle_log_pressure": np.log(manifold.pressure_range).mean(),
        "incidence_limit": manifold.incidence_limit,
        "has_crossflow_range": manifold.crossflow_range is not None,
        "crossflow_middle": manifold.crossflow.middle,
        "crossflow_half": manifold.crossflow.half,
        "outside_score": outside_score(manifold),
        "range_tolerance": RANGE_TOLERANCE,
        "navigation_error": [
            manifold.mach_number_error,
            manifold.static_pressure_error,
            manifold.dynamic_pressure_error,
        ],
        "altitude_error": manifold.altitude_error,
        "prior_mean": prior.mean,
        "prior_precision": 1.0 / prior.std**2,
        "navigation_limit": [outlier_threshold(1, rate) for rate in FALSE_ALARMS],
        "navigation_alarm": NAVIGATION_ALARM,
        "half_gamma": 0.5 * HEAT_CAPACITY_RATIO,
        "log_half_gamma": log(0.5 * HEAT_CAPACITY_RATIO),
    }


def _solver(manifold: ManifoldMap) -> Values:
    """Return what the iterations and the health of their solution need."""
    n = manifold.tables.n_gauges
    return {
        "largest_step": LARGEST_STEP,
        "min_gain": MIN_GAIN,
        "min_incidence_score": MIN_INCIDENCE_SCORE,
        "search_every": SEARCH_EVERY,
        "return_after": RETURN_AFTER,
        "start_iterations": START_ITERATIONS,
        "cold_iterations": COLD_ITERATIONS,
        "warm_iterations": WARM_ITERATIONS,
        "chi_square_scale": manifold.chi_square_scale,
        "outlier_scale": manifold.outlier_scale,
        "shape_limit": shape_limit(manifold, 1.0),
        "outlier_threshold": outlier_threshold(n, FALSE_ALARM_PROBABILITY),
        "chi_square_limit": [chi_square_limit(max(freedom, 1)) for freedom in range(n + len(NAVIGATION) + 1)],
    }


def _errors(manifold: ManifoldMap) -> Values:
    """Return the errors of strain and loads, per p_inf^2 where they scale; considered ones apart."""
    strain, load = manifold.error_strain, manifold.error_load[FIVE_LOADS]
    columns, common = manifold.considered_columns, manifold.considered_common
    considered, considered_load = columns[: manifold.n_gauges], columns[manifold.n_gauges :][FIVE_LOADS]
    return {
        "gain_std": manifold.gain_std,
        "common_gain": manifold.common_gain,
        "gauge_covariance": manifold.gauge_covariance,
        "scaled_covariance": product(strain, strain.T),
        "load_strain_covariance": product(load, strain.T),
        "load_covariance": product(load, load.T),
        "gauge_error_product": manifold.gauge_error_product,
        "common_error": manifold.common_error,
        "considered_covariance": product(considered, considered.T),
        "considered_load_strain_covariance": product(considered_load, considered.T),
        "considered_load_covariance": product(considered_load, considered_load.T),
        "considered_common": np.zeros((0, *manifold.common_error.shape[1:])) if common is None else common,
        "shapes": manifold.shapes.T,
    }


def _other_loads(manifold: ManifoldMap) -> Values:
    """Return tables of the loads behind the five over the flight state, and errors per p_inf^2."""
    first, load = manifold.n_gauges + FIVE_LOADS.stop, manifold.error_load[OTHER_LOADS]
    considered = manifold.considered_columns
    strain, considered_load = considered[: manifold.n_gauges], considered[first:]
    return {
        **vars(channel_tables(manifold.response[:, :, first:], np.zeros(0))),
        "fixed_response": manifold.fixed_response[first:],
        "strain_covariance": product(load, manifold.error_strain.T),
        "variance": np.sum(load * load, axis=1),
        "considered_strain_covariance": product(considered_load, strain.T),
        "considered_variance": np.sum(considered_load * considered_load, axis=1),
    }


def _parameter_tables(manifold: ManifoldMap, tables: ParameterTables) -> Values:
    """Return what flow parameters change of strain and loads of ``manifold``, and errors."""
    powers = tables.powers
    basis, weight = factors(tables.slope)
    return {
        "largest_score": LARGEST_USED_SCORE,
        "mean": powers.mean,
        "spread": powers.spread,
        "parameter": np.asarray(powers.parameter, dtype=float),
        "power": np.asarray(powers.power, dtype=float),
        "offset": powers.offset,
        "basis": basis,
        "row_weight": weight,
        "product": error_products(tables, manifold.n_gauges, manifold.n_loads),
    }
