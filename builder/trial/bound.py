"""The Cramer-Rao bound of the coefficients: no unbiased estimate of one reading has a smaller rms error.

At the true flight state the tables of a map are linear to first order. There strain, navigation and the ranges of
the map as prior have the information J on the state (Van Trees 1968, section 2.4):

    J = X' S^-1 X + (information of M, ln p_inf, ln q_inf and prior),  bound = sqrt(diag(T J^-1 T'))

X are the derivatives of the strain by the state, T the slopes of the coefficients. S holds gauge noise and the
errors of the installation at their stated sizes. It is the sigma of the nonlinear estimator where it reads the
strain of the tables at the true state. Errors of the flow are not in it: an estimator that knew the flow exactly
would not make them. A map holds the error of the internal pressure together with these, and flow parameters count
as known: both make the bound smaller than it could be. It bounds the rms over many vehicles with errors as stated:
one vehicle, exactly built ones, or a filter of many readings may be below it.
"""

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from builder.trial.conditions import flight_states, quantities
from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE, MACH_NUMBER, STATIC_PRESSURE, QSource
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.flight_tables import MACH, U, W, evaluate
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.nonlinear_map import ManifoldMap
from strainfmu.estimator.policies import POLICIES
from strainfmu.flight_condition import FlightCondition

KNOWN = (MACH_NUMBER, STATIC_PRESSURE, DYNAMIC_PRESSURE)
"""Navigation, by the names of the estimator's arguments; ``altitude`` stands for p_inf too."""


def cramer_rao_bound(
    inverse_map: InverseMap,
    conditions: Sequence[FlightCondition],
    known: Collection[str],
    dynamic_pressure_std: float = np.nan,
) -> FloatArray | None:
    """Return (k, 5) standard deviations of the coefficients [1]; None of a map without tables.

    They are NaN at conditions beyond the ranges of the map, where its tables say nothing.

    Parameters
    ----------
    conditions : k true flight conditions.
    known : what the estimator is given in addition to strain, as in :data:`KNOWN`.
    dynamic_pressure_std : of the stated q_inf [Pa]; NaN for the map's own.
    """
    manifold = inverse_map.manifold
    if manifold is None:
        return None
    state = flight_states(conditions)
    scale = inverse_map.sensors.scale
    strain = scale * evaluate(manifold.tables, state).value[:, : manifold.n_gauges]
    strain += inverse_map.zero_offset  # which the estimator subtracts
    air: dict[str, Any] = {DYNAMIC_PRESSURE: np.nan, "q_source": QSource.INDEPENDENT}
    air |= {name: quantities(conditions, name) for name in known}
    estimator = Estimator(replace(inverse_map, manifold=without_field_errors(manifold)))
    made = estimator.estimate(strain, **air, dynamic_pressure_std=dynamic_pressure_std, start=state)
    # Sigma is wider by what the error of q_inf is lognormal by.
    relative = made.air_data.sigma.dynamic_pressure / made.air_data.dynamic_pressure
    wider = relative / (np.log1p(3.0 * relative) / 3.0)
    inside = _inside(manifold, state)
    return np.where(inside[:, None], made.coefficients_std / np.asarray(wider)[:, None], np.nan)


def _inside(manifold: ManifoldMap, state: FloatArray) -> BoolArray:
    """Return (k,) whether the ranges of the map hold ``state`` (k, 4)."""
    middle, half = manifold.crossflow
    across = (state[:, [U, W]] - middle) / half
    off = np.abs(across).max(axis=1) if manifold.crossflow_range is not None else np.hypot(*across.T)
    low, high = manifold.mach_range
    excess = np.maximum(low - state[:, MACH], state[:, MACH] - high) / low
    return (off <= 1.0 + POLICIES.range_tolerance) & (excess <= POLICIES.range_tolerance)


def without_field_errors(manifold: ManifoldMap) -> ManifoldMap:
    """Return tables that include errors of the hardware alone, none of the pressure on the surface."""
    return replace(
        manifold,
        error_strain=np.zeros((len(manifold.error_strain), 1)),
        error_load=np.zeros((len(manifold.error_load), 1)),
        considered_strain=np.zeros(0),
        considered_load=np.zeros(0),
        considered_response=None,
        parameters=None,
        shape_field=None,
    )
