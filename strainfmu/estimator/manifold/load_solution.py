"""Loads and coefficients of k samples at a flight state, with the errors that a covariance of the state leaves.

f = L(x) + K r with r = d - y(x) and K = Gamma_Ld S^-1: loads of the tables, and what the residual says of pressure
off them. With E_x the covariance of the state, cov f = (J_L - K J) E_x (J_L - K J)' + Gamma_LL - K Gamma_dL.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.atmosphere import HEAT_CAPACITY_RATIO
from strainfmu.estimator.manifold.further_estimate import StateErrors
from strainfmu.estimator.manifold.gauss_newton import Linearised
from strainfmu.estimator.numerics.triangular import forward_substituted
from strainfmu.estimator.tables.flight_tables import LOG_PRESSURE, MACH
from strainfmu.estimator.tables.manifold_map import ManifoldMap


@dataclass(frozen=True, eq=False, kw_only=True)
class LoadSolution:
    """Loads of k samples.

    Attributes
    ----------
    loads, coefficients : (k, 5) [N, N m], [1]; covariances (k, 5, 5).
    errors : what the errors of the state do, for further loads.
    """

    loads: FloatArray
    load_covariance: FloatArray
    coefficients: FloatArray
    coefficient_covariance: FloatArray
    errors: StateErrors


def load_solution(manifold: ManifoldMap, at: Linearised, used: BoolArray, covariance: FloatArray) -> LoadSolution:
    """Return the loads at the state ``at``, of a ``covariance`` (k, 4, 4); ``used`` (k, n_d) gauges count."""
    pressure = np.exp(at.state[:, LOG_PRESSURE])
    # Strain and load go together: errors of a p_inf other than that of S could leave a negative variance.
    square = ((pressure if at.factor_pressure is None else at.factor_pressure) ** 2)[:, None, None]
    cross = np.where(used[:, None, :], square * manifold.load_strain_covariance, 0.0)
    turned = np.swapaxes(forward_substituted(at.factor, np.swapaxes(cross, 1, 2)), 1, 2)
    loads = at.loads + (turned @ at.whitened[:, :, None])[:, :, 0]
    by_state = at.load_jacobian - turned @ at.whitened_jacobian
    remaining = square * manifold.load_covariance - turned @ np.swapaxes(turned, 1, 2)
    mach = at.state[:, MACH]
    dynamic = 0.5 * HEAT_CAPACITY_RATIO * mach * mach * pressure
    scale = 1.0 / (dynamic[:, None] * manifold.references)
    coefficients = scale * loads
    of_pressure = np.zeros((len(mach), 4))
    of_pressure[:, MACH], of_pressure[:, LOG_PRESSURE] = 2.0 / mach, 1.0
    # The error of ln q_inf is normal, that of q_inf is not: three of these deviations cover what the other does.
    of_log = np.sqrt(np.einsum("kx,kxy,ky->k", of_pressure, covariance, of_pressure))
    wider = (lognormal_std(of_log) / of_log)[:, None, None] ** 2
    coefficients_by_state = scale[:, :, None] * by_state - coefficients[:, :, None] * of_pressure[:, None, :]
    errors = StateErrors(
        covariance=covariance,
        square=square,
        dynamic_pressure=dynamic,
        of_pressure=of_pressure,
        wider=wider[:, 0],
    )
    return LoadSolution(
        loads=loads,
        load_covariance=_spread(by_state, covariance) + remaining,
        coefficients=coefficients,
        coefficient_covariance=wider
        * (_spread(coefficients_by_state, covariance) + scale[:, :, None] * remaining * scale[:, None, :]),
        errors=errors,
    )


def lognormal_std(of_log: FloatArray) -> FloatArray:
    """Return the relative deviation of a lognormal value three times which reach as far as three ``of_log``."""
    return np.asarray(np.expm1(3.0 * of_log) / 3.0)


def _spread(jacobian: FloatArray, covariance: FloatArray) -> FloatArray:
    return np.asarray(jacobian @ covariance @ np.swapaxes(jacobian, 1, 2))
