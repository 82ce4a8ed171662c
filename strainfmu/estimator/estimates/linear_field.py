"""The pressure field of a linear map with its standard deviation, off the deadline.

At the pressure ratio s = q_inf / q_nominal the states follow from (d - d_0) / s + d_0 - m = A q + e with cov e =
Gamma_g / s^2 + N N' and what errors in proportion to strain add at the current strain. The pressure is s (p_mean +
V q), and the field that no state holds adds its standard deviation.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.estimator.estimates.pressure_field import PressureField, no_field, unknown_field
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.other_loads import FIVE_LOADS
from strainfmu.estimator.reference.linear import excess_covariance

MIN_OF_EXCESS = 0.25
"""Least variance of a node relative to that at the mean strain: the linear model of the errors could give less."""


@dataclass(frozen=True, eq=False, kw_only=True)
class _States:
    """The problem of one sample: data A q + e of the gauges in use, and the gain T."""

    data: FloatArray
    operator: FloatArray
    covariance: FloatArray
    gain: FloatArray


def linear_pressure(
    inverse_map: InverseMap,
    strain: FloatArray,
    valid: BoolArray,
    dynamic_pressure: float,
    dynamic_pressure_std: float,
    with_std: bool = True,
) -> PressureField:
    """Return the pressure of one sample of ``strain`` (n_d,) [m/m] by the linear map from the ``valid`` gauges.

    q_inf and its standard deviation [Pa] are NaN where not known. ``with_std`` false leaves the standard deviation
    of the pressure NaN.

    Raises
    ------
    InputError
        The map holds no pressure field.
    """
    if not inverse_map.has_field:
        raise no_field()
    scaled, is_net = inverse_map.follows_pressure, inverse_map.field_is_net
    ratio = dynamic_pressure / inverse_map.nominal_dynamic_pressure if scaled else 1.0
    few = inverse_map.case == 1 and np.count_nonzero(valid) < inverse_map.n_states
    if not ratio > 0.0 or few or not valid.any():
        return unknown_field(len(inverse_map.field_mean), is_net)
    states = _states(inverse_map, strain, ratio, valid)
    state = states.gain @ states.data
    mean, modes = inverse_map.field_mean.astype(float), inverse_map.field_modes.astype(float)
    pressure = ratio * (mean + modes @ state)
    if not with_std:
        return replace(unknown_field(len(mean), is_net), pressure=pressure)
    covariance = _state_covariance(inverse_map, states)
    variance = np.einsum("pq,qr,pr->p", modes, covariance, modes, optimize=True)
    excess = states.gain @ _excess(inverse_map, state, valid) @ states.gain.T
    variance = np.maximum(
        variance + np.einsum("pq,qr,pr->p", modes, excess, modes, optimize=True), MIN_OF_EXCESS * variance
    )
    std = ratio * _with_unresolved(inverse_map, np.sqrt(variance))
    if scaled:
        by_ratio = mean + modes @ (states.gain @ (inverse_map.fixed_strain - inverse_map.mean_strain)[valid])
        std = np.hypot(std, by_ratio * dynamic_pressure_std / inverse_map.nominal_dynamic_pressure)
    return PressureField(pressure=pressure, std=std, is_net=is_net)


def _states(inverse_map: InverseMap, strain: FloatArray, ratio: float, valid: BoolArray) -> _States:
    if inverse_map.follows_pressure:
        error, fixed = inverse_map.error_strain, inverse_map.fixed_strain
        data = (strain - fixed) / ratio + fixed - inverse_map.mean_strain
        of_all = inverse_map.gauge_covariance / ratio**2 + error @ error.T
    else:
        data, of_all = strain - inverse_map.mean_strain, inverse_map.noise_covariance
    covariance, operator = of_all[np.ix_(valid, valid)], inverse_map.state_operator[valid]
    weighted = np.linalg.solve(covariance, operator).T
    precision = weighted @ operator + inverse_map.regularisation * np.eye(operator.shape[1])
    return _States(
        data=data[valid], operator=operator, covariance=covariance, gain=np.linalg.solve(precision, weighted)
    )


def _state_covariance(inverse_map: InverseMap, states: _States) -> FloatArray:
    """Return (n_q, n_q) T Gamma T', and in Case 2 (I - T A) (I - T A)' of the prior."""
    covariance = states.gain @ states.covariance @ states.gain.T
    if inverse_map.case == 1:
        return np.asarray(covariance)
    unresolved = np.eye(len(states.gain)) - states.gain @ states.operator
    return np.asarray(covariance + unresolved @ unresolved.T)


def _excess(inverse_map: InverseMap, state: FloatArray, valid: BoolArray) -> FloatArray:
    """Return what errors in proportion to strain add to the covariance of the ``valid`` gauges at ``state``."""
    mean = inverse_map.load_of_mean - inverse_map.fixed_load
    loads = mean[FIVE_LOADS] + inverse_map.load_per_state[FIVE_LOADS] @ state
    coefficients = loads / (inverse_map.nominal_dynamic_pressure * inverse_map.references[FIVE_LOADS])
    return excess_covariance(inverse_map, coefficients[None])[0][np.ix_(valid, valid)]


def _with_unresolved(inverse_map: InverseMap, std: FloatArray) -> FloatArray:
    """Return ``std`` (n_p,) with the standard deviation of the field that no state holds.

    In Case 1 its strain is part of the states' error, so that the two depend on each other: the sum bounds both.
    """
    rest = inverse_map.field_std.astype(float)
    return std + rest if inverse_map.case == 1 else np.hypot(std, rest)
