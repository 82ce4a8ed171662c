"""Covariance of the estimated loads and coefficients, for any gain."""

from __future__ import annotations

import numpy as np

from builder.aero.loads import coefficient_scale
from builder.inverse.noise_model import NoiseModel
from builder.inverse.state_map import StateMap
from builder.vehicle.reference_quantities import ReferenceQuantities
from strainfmu.arrays import FloatArray
from strainfmu.estimator.innovation import inverse_cholesky
from strainfmu.estimator.load_errors import load_gain, residual_load_gain


def load_error_covariance(
    solved: StateMap,
    load_per_state: FloatArray,
    noise: NoiseModel,
    strain_load_covariance: FloatArray | None = None,
) -> FloatArray:
    """Return the (5, 5) covariance of the loads' estimation error [(N, N m)^2].

    The error of f = G (d - m) + f_mean is G N_i - M_i per noise term (strain factor N_i, load M_i) and (G A - M) q
    of the states. A truncated mode acts twice, through the strain and by the load it carries itself, and the two
    are correlated. The sum of these terms' squares (Joseph's form) holds for any gain and cannot turn negative;
    with gamma = 1 it is the posterior covariance.

    Parameters
    ----------
    solved : the state map.
    load_per_state : (5, n_q) M [N, N m per state].
    noise : the terms that happen; need not be those that the gain was weighted with.
    strain_load_covariance : (n_d, 5) X that the gain G goes by
        (:func:`~strainfmu.estimator.load_errors.load_gain`); None for G = M T.
    """
    of_state = load_per_state
    whitening = inverse_cholesky(solved.noise_covariance)
    gain = load_gain(
        load_per_state=load_per_state,
        strain_gain=solved.strain_gain,
        state_operator=solved.state_operator,
        noise_whitening=whitening,
        strain_load_covariance=strain_load_covariance,
    )
    if strain_load_covariance is not None:
        # G A - M = (M - X' Gamma^-1 A) (T A - I), whose last factor is known without cancellation.
        of_residual = residual_load_gain(whitening, strain_load_covariance)
        of_state = load_per_state - of_residual @ solved.state_operator
    parts = [of_state @ solved.unresolved]
    parts += [gain @ term.strain - (0.0 if term.load is None else term.load) for term in noise.terms]
    factor = np.hstack(parts)
    covariance: FloatArray = factor @ factor.T
    return covariance


def coefficient_covariance(
    loads: FloatArray,
    load_covariance: FloatArray,
    reference: ReferenceQuantities,
    dynamic_pressure: float,
    dynamic_pressure_std: float = 0.0,
) -> FloatArray:
    """Return the (5, 5) covariance [1] of C = F/(q S), M/(q S L), to first order in the error of q_inf.

    cov(C) = D cov(F) D + C C^T (sigma_q / q)^2 with D = diag(1/(q S), .., 1/(q S L)): an error of q_inf scales all
    coefficients alike.

    Parameters
    ----------
    loads : (5,) [N, N m].
    load_covariance : (5, 5) of the loads' error, independent of that of q_inf.
    reference : S and L.
    dynamic_pressure, dynamic_pressure_std : q_inf and its standard deviation [Pa].
    """
    scale = coefficient_scale(dynamic_pressure, reference)
    of_dynamic_pressure = scale * loads * (dynamic_pressure_std / dynamic_pressure)
    return np.outer(scale, scale) * load_covariance + np.outer(of_dynamic_pressure, of_dynamic_pressure)
