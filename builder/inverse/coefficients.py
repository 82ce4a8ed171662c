"""Covariance of the estimated loads and coefficients, for any gain."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from builder.aero.loads import ReferenceQuantities, coefficient_scale
from builder.inverse.noise_model import NoiseModel
from builder.inverse.state_map import StateMap

FloatArray = NDArray[np.float64]


def load_error_covariance(solved: StateMap, load_per_state: FloatArray, noise: NoiseModel) -> FloatArray:
    """Return the (5, 5) covariance of the loads' estimation error [(N, N m)^2].

    The error of f = M q + f_mean is M T N_i - M_i per noise term (strain factor N_i, load M_i) and M (T A - I) of
    the states. A truncated mode acts twice, by aliasing through the strain and by the load it carries itself, and
    the two are correlated. The sum of these terms' squares (Joseph's form) holds for any gain and cannot turn
    negative; with gamma = 1 it is the posterior covariance.

    Parameters
    ----------
    solved : the state map.
    load_per_state : (5, n_q) M [N, N m per state].
    noise : the terms that happen; need not be those that the gain was weighted with.
    """
    gain = load_per_state @ solved.strain_gain
    parts = [load_per_state @ solved.unresolved]
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
