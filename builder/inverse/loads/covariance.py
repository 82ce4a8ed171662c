"""Covariance of estimated loads, for any gain, summed over the noise terms."""

from __future__ import annotations

import numpy as np

from builder.inverse.noise.model import NoiseModel
from strainfmu.arrays import FloatArray
from strainfmu.estimator.reference.gain import nominal, state_model
from strainfmu.estimator.reference.update import model_of
from strainfmu.linear.state_map import StateMap


def load_covariance_by_terms(
    solved: StateMap,
    load_per_state: FloatArray,
    noise: NoiseModel,
    strain_load_covariance: FloatArray | None = None,
) -> FloatArray:
    """Return the (n_f, n_f) covariance of the loads' estimation error [(N, N m)^2].

    The sum of the squares of :func:`load_error_factors` (Joseph's form) holds for any gain and cannot be negative.
    With gamma = 1 it is the posterior covariance.
    :func:`strainfmu.estimator.reference.gain.load_covariance` gives the same from a finished map, which no longer
    holds the terms.

    Parameters
    ----------
    solved : the state map.
    load_per_state : (n_f, n_q) M [N, N m per state].
    noise : the terms that occur; they may differ from those that the gain was weighted with.
    strain_load_covariance : (n_d, n_f) X of the gain G (:func:`~strainfmu.estimator.reference.gain.state_model`);
        None for G = M T.
    """
    operator, noise_covariance = solved.state_operator, solved.noise_covariance
    model = state_model(operator, noise_covariance, solved.regularisation, load_per_state, strain_load_covariance)
    gain = nominal(model).gain
    of_states, of_noise = load_error_factors(solved, load_per_state, gain, noise, strain_load_covariance)
    factor = np.hstack([of_states, *of_noise])
    covariance: FloatArray = factor @ factor.T
    return covariance


def load_error_factors(
    solved: StateMap,
    load_per_state: FloatArray,
    gain: FloatArray,
    noise: NoiseModel,
    strain_load_covariance: FloatArray | None,
) -> tuple[FloatArray, list[FloatArray]]:
    """Return the factors of the error of f = G (d - m) + f_mean, one standard deviation per column [N, N m].

    They are (n_f, j) of the states, and (n_f, k) of each noise term.

    They are G N_i - M_i of each noise term (strain factor N_i, load M_i) and (G A - M) q of the states. A
    truncated mode acts twice, through the strain and by its own load, and the two are correlated.

    Parameters
    ----------
    solved, load_per_state, noise, strain_load_covariance : as of :func:`load_covariance_by_terms`.
    gain : (n_f, n_d) G [N, N m].
    """
    of_states = load_per_state
    if strain_load_covariance is not None:
        # G A - M = (M - X' Gamma^-1 A) (T A - I), whose last factor is known without cancellation.
        gauges, loads = strain_load_covariance.shape
        without_states = model_of(gauges, loads, noise=solved.noise_covariance, cross=strain_load_covariance)
        of_residual = nominal(without_states).gain
        of_states = load_per_state - of_residual @ solved.state_operator
    of_noise = [term.by_gain(gain) - (0.0 if term.load is None else term.load) for term in noise.terms]
    return of_states @ solved.unresolved, of_noise
