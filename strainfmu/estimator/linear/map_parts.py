"""Parts that the matrices of every set of gauges are made from, in the same bits on every machine.

Estimator and FMUs share these numbers: loads are small differences of large terms, so that another order of sums
would show, and an FMU that holds the result of LAPACK would differ from machine to machine. The formulas are those
of :mod:`strainfmu.estimator.map.innovation` and :mod:`strainfmu.estimator.map.load_errors`, by the algebra of
:mod:`strainfmu.estimator.numerics.fixed_order`.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.further_errors import FurtherErrors, further_errors
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.load_errors import (
    LoadErrorModel,
    load_error_covariance,
    load_error_model,
    load_gain,
)
from strainfmu.estimator.numerics.algebra import FIXED_ORDER
from strainfmu.estimator.numerics.fixed_order import (
    apply_orthogonal,
    householder,
    inverse_cholesky,
    product,
    solve_lower,
)


@dataclass(frozen=True, kw_only=True, eq=False)
class MapParts:
    """What the matrices of every set of gauges are made from.

    Attributes
    ----------
    inverse_map : the map.
    load_gain : (5, n_d) G of all gauges [N, N m].
    load_covariance : (5, 5) of the loads with all gauges [(N, N m)^2].
    error_model : terms of the covariance of loads.
    further : gain of all gauges for the further loads, and the terms of their variance.
    noise_whitening : (n_d, n_d) L^-1 [1/(m/m)].
    gain_whitening : (n_d, n_d) W, upper triangular, of the gamma that the estimate is made with [1/(m/m)].
    residual_whitening : (n_d, n_d) W of gamma = 1 in Case 2, 0 in Case 1: that of the residual.
    """

    inverse_map: InverseMap
    load_gain: FloatArray
    load_covariance: FloatArray
    error_model: LoadErrorModel
    further: FurtherErrors
    noise_whitening: FloatArray
    gain_whitening: FloatArray
    residual_whitening: FloatArray


def map_parts(inverse_map: InverseMap) -> MapParts:
    """Return the parts of ``inverse_map``."""
    whitening = inverse_cholesky(inverse_map.noise_covariance)
    states, of_loads = inverse_map.state_operator, inverse_map.load_per_state
    strain_gain = _strain_gain(states, whitening, inverse_map.regularisation)
    gain = load_gain(
        load_per_state=of_loads,
        strain_gain=strain_gain,
        state_operator=states,
        noise_whitening=whitening,
        strain_load_covariance=inverse_map.strain_load_covariance,
        algebra=FIXED_ORDER,
    )
    error_model = load_error_model(
        gauge_covariance=inverse_map.gauge_covariance,
        error_strain=inverse_map.error_strain,
        error_load=inverse_map.error_load,
        state_operator=states,
        load_per_state=of_loads,
        known_prior=inverse_map.case == 2,
        algebra=FIXED_ORDER,
    )
    return MapParts(
        inverse_map=inverse_map,
        load_gain=gain,
        load_covariance=load_error_covariance(error_model, gain, FIXED_ORDER),
        error_model=error_model,
        further=further_errors(inverse_map, strain_gain, whitening),
        noise_whitening=whitening,
        gain_whitening=_gain_whitening(states, whitening, inverse_map.regularisation),
        residual_whitening=_gain_whitening(states, whitening, float(inverse_map.case == 2)),
    )


def _strain_gain(state_operator: FloatArray, noise_whitening: FloatArray, regularisation: float) -> FloatArray:
    """Return (n_q, n_d) T as :func:`~strainfmu.estimator.map.innovation.estimate_gain` does."""
    n, n_states = state_operator.shape
    whitened = product(noise_whitening, state_operator)
    stacked = np.vstack([whitened, sqrt(regularisation) * np.eye(n_states)])
    size = np.max(np.abs(stacked), axis=0)
    size = np.where(size > 0.0, size, 1.0)
    right = np.vstack([noise_whitening, np.zeros((n_states, n))])
    triangle, _ = householder(np.hstack([stacked / size, right]), n_states)
    # R x = Q' L^-1, the upper triangle turned into a lower one.
    upper, of_strain = triangle[:n_states, :n_states], triangle[:n_states, n_states:]
    turned = solve_lower(upper[::-1, ::-1].copy(), of_strain[::-1].copy())
    return np.asarray(turned[::-1] / size[:, None])


def _gain_whitening(state_operator: FloatArray, noise_whitening: FloatArray, regularisation: float) -> FloatArray:
    """Return (n_d, n_d) W, W' W = (A A' / gamma + Gamma)^-1; its limit for gamma = 0. Upper triangular.

    With the complete Q of the stacked [sqrt(gamma) I; L^-1 A], Q_2 of its first n_q columns and Q_perp of the
    others in the lower rows, I - Q_2 Q_2' = Q_perp Q_perp' is (I + L^-1 A A' L'^-1 / gamma)^-1. So
    W = Q_perp' L^-1, and any orthogonal matrix times it: here the R of its QR decomposition, which the native FMU
    holds too.
    """
    n, n_states = state_operator.shape
    stacked = np.vstack([sqrt(regularisation) * np.eye(n_states), product(noise_whitening, state_operator)])
    # Columns of one size: the span is what counts, and no square may overflow.
    size = np.max(np.abs(stacked), axis=0)
    _, reflectors = householder(stacked / np.where(size > 0.0, size, 1.0))
    complement = apply_orthogonal(reflectors, np.vstack([np.zeros((n_states, n)), np.eye(n)]))
    return householder(product(complement[n_states:].T.copy(), noise_whitening))[0]
