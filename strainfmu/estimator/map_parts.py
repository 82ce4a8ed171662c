"""What the matrices of every set of gauges are made from, in the same bits on every machine.

Estimator and FMUs share these numbers: loads are small differences of large terms, so that another order of sums
would show, and an FMU that holds the result of LAPACK would differ from machine to machine. The formulas are those
of :mod:`strainfmu.estimator.innovation` and :mod:`strainfmu.estimator.load_errors`, by the algebra of
:mod:`strainfmu.estimator.fixed_order`.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.estimator.fixed_order import apply_orthogonal, cholesky, eigen, householder, product, solve_lower
from strainfmu.estimator.inverse_map import InverseMap
from strainfmu.estimator.load_errors import LoadErrorModel


@dataclass(frozen=True)
class MapParts:
    """What the matrices of every set of gauges are made from.

    Attributes
    ----------
    inverse_map : the map.
    load_gain : (5, n_d) G of all gauges [N, N m].
    error_model : terms of the covariance of loads.
    noise_whitening : (n_d, n_d) L^-1 [1/(m/m)].
    gain_whitening : (n_d, n_d) W, upper triangular, of the gamma that the estimate is made with [1/(m/m)].
    """

    inverse_map: InverseMap
    load_gain: FloatArray
    error_model: LoadErrorModel
    noise_whitening: FloatArray
    gain_whitening: FloatArray


def map_parts(inverse_map: InverseMap) -> MapParts:
    """Return the parts of ``inverse_map``."""
    covariance = inverse_map.noise_covariance
    # Rows and columns scaled to unit variance, so that gauges of unlike noise cost no digits.
    std = np.sqrt(np.diag(covariance))
    scaled_root = cholesky(covariance / (std[:, None] * std[None, :]))
    noise_whitening = np.asarray(solve_lower(scaled_root, np.eye(len(std))) / std)
    gain = _load_gain(inverse_map, noise_whitening)
    whitening = _gain_whitening(inverse_map.state_operator, noise_whitening, inverse_map.regularisation)
    return MapParts(inverse_map, gain, _error_model(inverse_map, gain), noise_whitening, whitening)


def _load_gain(inverse_map: InverseMap, noise_whitening: FloatArray) -> FloatArray:
    """Return (5, n_d) G, as :func:`strainfmu.estimator.load_errors.load_gain`."""
    x = inverse_map.strain_load_covariance
    if x is None:
        return product(inverse_map.load_per_state, inverse_map.strain_gain)
    of_residual = product(product(noise_whitening, x).T.copy(), noise_whitening)
    of_states = inverse_map.load_per_state - product(of_residual, inverse_map.state_operator)
    return np.asarray(product(of_states, inverse_map.strain_gain) + of_residual)


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


def _error_model(inverse_map: InverseMap, gain: FloatArray) -> LoadErrorModel:
    """Return the model of :func:`~strainfmu.estimator.load_errors.load_error_model`; the map has been checked."""
    a, known_prior = inverse_map.state_operator, inverse_map.case == "2"
    root = cholesky(inverse_map.noise_covariance)
    x = inverse_map.strain_load_covariance
    regression = np.zeros((5, len(a))) if x is None else solve_lower(root, x).T.copy()
    of_noise = product(gain, root) - regression
    explained = product(of_noise, of_noise.T.copy())
    if known_prior:
        of_prior = inverse_map.load_per_state - product(gain, a)
        explained = explained + product(of_prior, of_prior.T.copy())
    size = np.sqrt(np.diag(inverse_map.load_covariance))
    rest = (inverse_map.load_covariance - explained) / (size[:, None] * size[None, :])
    values, vectors = eigen(0.5 * (rest + rest.T))
    factor = size[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    remainder = product(factor, factor.T.copy())
    return LoadErrorModel(root, regression, remainder, a, inverse_map.load_per_state, known_prior)
