"""The pressure field of a linear map with its standard deviation, off the deadline.

At the pressure ratio s = q_inf / q_nominal the states follow from (d - d_0) / s + d_0 - m = A q + e with cov e =
Gamma_g / s^2 + N N' and what errors in proportion to strain add at the current strain. The pressure is s (p_mean +
V q), and the field that no state holds adds its standard deviation.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.estimates.pressure_field import FieldInputs, PressureField, unknown_field
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


def no_field() -> InputError:
    """Return the error of a map without a pressure field."""
    return InputError("inverse map: holds no pressure field, expected one built with keep_field = true in [map]")


def linear_pressure(inputs: FieldInputs | None, valid: BoolArray, with_std: bool = True) -> PressureField:
    """Return the pressure of one sample by the linear map from the ``valid`` (n_d,) gauges.

    ``with_std`` false leaves the standard deviation NaN.

    Raises
    ------
    InputError
        The map holds no pressure field.
    """
    held = None if inputs is None else inputs.inverse_map
    if inputs is None or held is None or not held.has_field:
        raise no_field()
    scaled = held.follows_pressure
    ratio = float(inputs.dynamic_pressure) / held.nominal_dynamic_pressure if scaled else 1.0
    few = held.case == 1 and np.count_nonzero(valid) < held.state_operator.shape[1]
    is_net = held.field_is_net
    if not ratio > 0.0 or few or not valid.any():
        return unknown_field(len(held.field_mean), is_net)
    of = _states(held, inputs.strain, ratio, valid)
    state = of.gain @ of.data
    mean, modes = held.field_mean.astype(float), held.field_modes.astype(float)
    pressure = ratio * (mean + modes @ state)
    if not with_std:
        return replace(unknown_field(len(mean), is_net), pressure=pressure)
    covariance = _state_covariance(held, of)
    variance = np.einsum("pq,qr,pr->p", modes, covariance, modes, optimize=True)
    excess = of.gain @ _excess(held, state, valid) @ of.gain.T
    variance = np.maximum(
        variance + np.einsum("pq,qr,pr->p", modes, excess, modes, optimize=True), MIN_OF_EXCESS * variance
    )
    std = ratio * _with_unresolved(held, np.sqrt(variance))
    if scaled:
        by_ratio = mean + modes @ (of.gain @ (held.fixed_strain - held.mean_strain)[valid])
        error = float(inputs.dynamic_pressure_std) / held.nominal_dynamic_pressure
        std = np.hypot(std, by_ratio * error)
    return PressureField(pressure=pressure, std=std, is_net=is_net)


def _states(held: InverseMap, strain: FloatArray, ratio: float, valid: BoolArray) -> _States:
    if held.follows_pressure:
        own, error = held.gauge_covariance, held.error_strain
        fixed = held.fixed_strain
        data = (strain - fixed) / ratio + fixed - held.mean_strain
        whole = own / ratio**2 + error @ error.T
    else:
        data, whole = strain - held.mean_strain, held.noise_covariance
    covariance, operator = whole[np.ix_(valid, valid)], held.state_operator[valid]
    weighted = np.linalg.solve(covariance, operator).T
    precision = weighted @ operator + held.regularisation * np.eye(operator.shape[1])
    return _States(
        data=data[valid], operator=operator, covariance=covariance, gain=np.linalg.solve(precision, weighted)
    )


def _state_covariance(held: InverseMap, of: _States) -> FloatArray:
    """Return (n_q, n_q) T Gamma T', and in Case 2 (I - T A) (I - T A)' of the prior."""
    covariance = of.gain @ of.covariance @ of.gain.T
    if held.case == 1:
        return np.asarray(covariance)
    left = np.eye(len(of.gain)) - of.gain @ of.operator
    return np.asarray(covariance + left @ left.T)


def _excess(held: InverseMap, state: FloatArray, valid: BoolArray) -> FloatArray:
    """Return what errors in proportion to strain add to the covariance of the ``valid`` gauges at ``state``."""
    mean = held.load_of_mean - held.fixed_load
    loads = mean[FIVE_LOADS] + held.load_per_state[FIVE_LOADS] @ state
    coefficients = loads / (held.nominal_dynamic_pressure * held.references[FIVE_LOADS])
    return excess_covariance(held, coefficients[None])[0][np.ix_(valid, valid)]


def _with_unresolved(held: InverseMap, std: FloatArray) -> FloatArray:
    """Return ``std`` (n_p,) with the standard deviation of the field that no state holds.

    In Case 1 its strain is part of the states' error, so that the two depend on each other: the sum bounds both.
    """
    rest = held.field_std.astype(float)
    return std + rest if held.case == 1 else np.hypot(std, rest)
