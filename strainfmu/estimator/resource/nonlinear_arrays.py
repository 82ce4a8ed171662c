"""The arrays of ``map.bin`` that follow from the tables of a nonlinear map."""

from __future__ import annotations

import sys
from collections.abc import Callable
from math import log
from typing import Any

import numpy as np

from strainfmu.arrays import FloatArray
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
from strainfmu.estimator.tables.flight_tables import MIN_INCIDENCE
from strainfmu.estimator.tables.manifold_map import ManifoldMap
from strainfmu.estimator.tables.parameter_factors import error_products
from strainfmu.estimator.tables.schema import INCREASING, POSITIVE, Stored, derived


def _tables(part: str, fixed_response: Callable[[Any], FloatArray]) -> tuple[Stored, ...]:
    """Return the arrays of tables without repetition (:mod:`strainfmu.estimator.tables.channel_tables`)."""
    # fmt: off
    return (
        derived(f"{part}.table", "coefficients of each channel, per p_inf", lambda s: s.channels[part].table,
            "n_mach+2 n_incidence+2 n_channels n_harmonics", unit="1/Pa, m2, m3"),
        derived(f"{part}.row", "that a term adds to, ascending", lambda s: s.channels[part].row, "n_terms"),
        derived(f"{part}.channel", "of each term", lambda s: s.channels[part].channel, "n_terms"),
        derived(f"{part}.cosine", "factors of cos m phi_T in a term", lambda s: s.channels[part].cosine,
            "n_terms n_harmonics"),
        derived(f"{part}.sine", "the same of sin m phi_T", lambda s: s.channels[part].sine, "n_terms n_harmonics"),
        derived(f"{part}.fixed_response", "part that does not follow p_inf", fixed_response, "n_rows",
            unit="m/m, N, N.m"),
    )
    # fmt: on


def _considered(tables: ManifoldMap) -> tuple[FloatArray, FloatArray]:
    """Return strain (n_d, k) and the five loads (5, k) of considered errors."""
    columns = tables.considered_columns
    return columns[: tables.n_gauges], columns[tables.n_gauges :][FIVE_LOADS]


# fmt: off
DERIVED: tuple[Stored, ...] = (
    derived("flight.min_incidence", "rounds the cone of total angle of attack off at its tip",
        lambda s: MIN_INCIDENCE, unit="rad", rule=POSITIVE),
    *_tables("flight", lambda s: s.nonlinear.tables.fixed_response),
    derived("flight.log_pressure_range", "ln(p_inf / Pa)",
        lambda s: [log(p) for p in s.nonlinear.pressure_range.tolist()], "2", rule=INCREASING, kind="values"),
    derived("flight.middle_log_pressure", "the same", lambda s: np.log(s.nonlinear.pressure_range).mean()),
    derived("flight.has_crossflow_range", "1, or 0: incidence_limit at every aerodynamic roll angle",
        lambda s: s.nonlinear.crossflow_range is not None, whole=(0, 1)),
    derived("flight.crossflow_middle", "of the ranges of u and w", lambda s: s.nonlinear.crossflow.middle, "2",
        unit="rad", kind="values"),
    derived("flight.crossflow_half", "half widths of these", lambda s: s.nonlinear.crossflow.half, "2", unit="rad",
        rule=POSITIVE, kind="values"),
    derived("flight.outside_score", "of the flight state from which it is outside",
        lambda s: outside_score(s.nonlinear)),
    derived("flight.range_tolerance", "part of a range by which it may be left", lambda s: RANGE_TOLERANCE),
    derived("flight.navigation_error",
        "of navigation without a standard deviation: of M, relative of p_inf and q_inf",
        lambda s: [getattr(s.nonlinear, f"{name}_error") for name in NAVIGATION],
        "3", kind="values"),
    derived("flight.prior_mean", "of the flight state where nothing is known",
        lambda s: s.nonlinear.state_prior.mean, "4", unit="", kind="values"),
    derived("flight.prior_precision", "its inverse variance", lambda s: 1.0 / s.nonlinear.state_prior.std**2, "4",
        unit="", rule=POSITIVE, kind="values"),
    derived("flight.navigation_limit", "standardised residuals above which navigation is inconsistent",
        lambda s: [outlier_threshold(1, rate) for rate in FALSE_ALARMS], "3", kind="values"),
    derived("flight.navigation_alarm", "from which an input that is dropped is an alarm",
        lambda s: NAVIGATION_ALARM),
    derived("flight.half_gamma", "q = half_gamma M^2 p", lambda s: 0.5 * HEAT_CAPACITY_RATIO),
    derived("flight.log_half_gamma", "its logarithm", lambda s: log(0.5 * HEAT_CAPACITY_RATIO)),
    derived("flight.largest_step", "of an iteration", lambda s: LARGEST_STEP, "4", unit="", rule=POSITIVE,
        kind="values"),
    derived("flight.min_gain", "of an iteration that goes on", lambda s: MIN_GAIN),
    derived("flight.min_incidence_score", "from which the wind has a roll angle", lambda s: MIN_INCIDENCE_SCORE),
    derived("flight.search_every", "steps", lambda s: SEARCH_EVERY, whole=(0, 1000000)),
    derived("flight.return_after", "steps", lambda s: RETURN_AFTER, whole=(0, 1000000)),
    derived("flight.start_iterations", "an even number", lambda s: START_ITERATIONS, whole=(2, 1000)),
    derived("flight.cold_iterations", "after a search", lambda s: COLD_ITERATIONS, whole=(0, 1000)),
    derived("flight.warm_iterations", "of a step that goes on", lambda s: WARM_ITERATIONS, whole=(0, 1000)),
    derived("flight.shape_limit", "sum of squares of discrepancy modes from which strain does not fit",
        lambda s: shape_limit(s.nonlinear, 1.0)),
    derived("flight.outlier_threshold", "of the largest leave-one-out residual",
        lambda s: outlier_threshold(s.nonlinear.n_gauges, FALSE_ALARM_PROBABILITY)),
    derived("flight.chi_square_limit", "by degrees of freedom from 0 on",
        lambda s: [chi_square_limit(max(k, 1)) for k in range(s.nonlinear.n_gauges + len(NAVIGATION) + 1)],
        "n_gauges+4"),
    derived("flight.gain_std", "error of each gain, relative", lambda s: s.nonlinear.gain_std, "n_gauges"),
    derived("flight.common_gain", "error that gains have in common, in each of them",
        lambda s: s.nonlinear.common_gain, "n_gauges"),
    derived("flight.scaled_covariance", "of errors that the gain may correct, per p_inf^2",
        lambda s: product(s.nonlinear.error_strain, s.nonlinear.error_strain.T), "n_gauges n_gauges",
        unit="1/Pa^2"),
    derived("flight.load_strain_covariance", "the same of loads with strain",
        lambda s: product(s.nonlinear.error_load[FIVE_LOADS], s.nonlinear.error_strain.T), "5 n_gauges", unit=""),
    derived("flight.load_covariance", "the same of loads",
        lambda s: product(s.nonlinear.error_load[FIVE_LOADS], s.nonlinear.error_load[FIVE_LOADS].T), "5 5",
        unit=""),
    derived("flight.considered_covariance", "of considered errors",
        lambda s: product(_considered(s.nonlinear)[0], _considered(s.nonlinear)[0].T), "n_gauges n_gauges",
        unit="1/Pa^2"),
    derived("flight.considered_load_strain_covariance", "the same of loads with strain",
        lambda s: product(_considered(s.nonlinear)[1], _considered(s.nonlinear)[0].T), "5 n_gauges", unit=""),
    derived("flight.considered_load_covariance", "the same of loads",
        lambda s: product(_considered(s.nonlinear)[1], _considered(s.nonlinear)[1].T), "5 5", unit=""),
    derived("flight.considered_common", "considered ones of common_error",
        lambda s: _or_none(s.nonlinear.considered_common, s.nonlinear.n_gauges),
        "n_considered_common 6 n_gauges", unit="1/Pa"),
    derived("flight.shapes", "discrepancy modes", lambda s: s.nonlinear.shapes.T, "n_shapes n_gauges"),
    *_tables("considered", lambda s: s.considered_tables.fixed_response),
    *_tables("flight_loads", lambda s: s.nonlinear.fixed_response[s.nonlinear.n_gauges + FIVE_LOADS.stop :]),
    derived("flight_loads.strain_covariance", "with strain, of errors that the gain may correct, per p_inf^2",
        lambda s: product(s.nonlinear.error_load[OTHER_LOADS], s.nonlinear.error_strain.T), "n_loads n_gauges",
        unit=""),
    derived("flight_loads.variance", "the same of each load",
        lambda s: _sums_of_squares(s.nonlinear.error_load[OTHER_LOADS]), "n_loads", unit=""),
    derived("flight_loads.considered_strain_covariance", "with strain, of considered errors",
        lambda s: product(_considered_others(s.nonlinear), _considered(s.nonlinear)[0].T), "n_loads n_gauges",
        unit=""),
    derived("flight_loads.considered_variance", "the same of each load",
        lambda s: _sums_of_squares(_considered_others(s.nonlinear)), "n_loads", unit=""),
    derived("parameter_tables.largest_score", "of a parameter's range by which it may leave it and still be used",
        lambda s: LARGEST_USED_SCORE, bounds=(0.0, sys.float_info.max)),
    derived("parameter_tables.basis", "tables, orthonormal, whose sums by", lambda s: s.factors[0],
        "n_basis n_incidence+2 n_harmonics 2"),
    derived("parameter_tables.row_weight", "are of a unit of a power, per p_inf", lambda s: s.factors[1],
        "n_mach+2 n_powers n_rows n_basis", unit="1/Pa, m2, m3"),
    derived("parameter_tables.product",
        "of errors, per p_inf^2: of those that no parameter makes; of pairs of powers; of each spread",
        lambda s: error_products(s.parameter_tables, s.nonlinear.n_gauges, s.nonlinear.n_loads),
        "n_products product_size", unit=""),
)
# fmt: on
"""Values that follow from the tables."""

PARTS: dict[str, Callable[[InverseMap], bool]] = {
    "flight": lambda one: one.manifold is not None,
    "considered": lambda one: one.manifold is not None and one.manifold.considered_tables is not None,
    "flight_loads": lambda one: one.manifold is not None and one.has_other_loads,
    "parameter_tables": lambda one: one.manifold is not None and one.manifold.parameters is not None,
}
"""Whether a map has a part."""


def _considered_others(tables: ManifoldMap) -> FloatArray:
    return tables.considered_columns[tables.n_gauges + FIVE_LOADS.stop :]


def _or_none(common: FloatArray | None, n_gauges: int) -> FloatArray:
    return np.zeros((0, 6, n_gauges)) if common is None else common


def _sums_of_squares(load: FloatArray) -> FloatArray:
    return np.asarray(np.sum(load * load, axis=1))
