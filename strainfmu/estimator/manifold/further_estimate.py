"""Loads of sections along a body of revolution at an estimated flight state, corrected by strain.

As the five loads: with F(x) those of the tables, r the residual of strain and K = Gamma_Fd S^-1, f = F(x) + K r,
and its variances are the diagonal of (J_F - K J) E_x (J_F - K J)' + Gamma_FF - K Gamma_dF.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.estimator.manifold.gauss_newton import Linearised
from strainfmu.estimator.numerics.triangular import forward_substituted
from strainfmu.estimator.tables.flight_tables import evaluate
from strainfmu.estimator.tables.manifold_map import ManifoldMap


class FurtherEstimate(NamedTuple):
    """Further loads [N, N m] and coefficients [1] of k samples, and their variances, each (k, m)."""

    loads: FloatArray
    variance: FloatArray
    coefficients: FloatArray
    coefficient_variance: FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class StateErrors:
    """What the errors of the state of k samples do.

    Attributes
    ----------
    covariance : (k, 4, 4) of the state.
    square : (k, 1, 1) p_inf^2 that the factor of S belongs to [Pa^2].
    dynamic_pressure : (k,) q_inf [Pa].
    of_pressure : (k, 4) derivative of ln q_inf by the state.
    wider : (k, 1) variance that covers the error of q_inf, over that of ln q_inf.
    """

    covariance: FloatArray
    square: FloatArray
    dynamic_pressure: FloatArray
    of_pressure: FloatArray
    wider: FloatArray


def further_estimate(
    manifold: ManifoldMap, at: Linearised, used: BoolArray, errors: StateErrors
) -> FurtherEstimate:
    """Return the further loads at the solved state ``at``, m = 0 for none."""
    further = manifold.further
    if further is None:
        return FurtherEstimate(*(np.zeros((len(used), 0)) for _ in range(4)))
    response = evaluate(further.tables(manifold.tables), at.state)
    cross = np.where(used[:, None, :], errors.square * further.strain_covariance, 0.0)
    turned = np.swapaxes(forward_substituted(at.factor, np.swapaxes(cross, 1, 2)), 1, 2)
    loads = response.value + (turned @ at.whitened[:, :, None])[:, :, 0]
    by_state = response.jacobian - turned @ at.whitened_jacobian
    remaining = errors.square[:, :, 0] * further.variance - np.sum(turned * turned, axis=2)
    remaining = np.maximum(remaining, 0.0)  # of a load that strain tells wholly, rounding leaves less
    references = further.references(manifold.reference_area, manifold.reference_length)
    scale = 1.0 / (errors.dynamic_pressure[:, None] * references)
    coefficients = scale * loads
    coefficients_by_state = (
        scale[:, :, None] * by_state - coefficients[:, :, None] * errors.of_pressure[:, None, :]
    )
    return FurtherEstimate(
        loads=loads,
        variance=_variance(by_state, errors.covariance) + remaining,
        coefficients=coefficients,
        coefficient_variance=errors.wider
        * (_variance(coefficients_by_state, errors.covariance) + scale**2 * remaining),
    )


def _variance(jacobian: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return (k, m) diagonals of J E J'."""
    return np.asarray(np.einsum("kmx,kxy,kmy->km", jacobian, covariance, jacobian, optimize=True))
