"""Gain and variance of the further loads of a map, as those of the five loads.

The formulas are those of :mod:`strainfmu.estimator.map.load_errors`, of which variances alone are needed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.load_errors import load_error_model, load_gain
from strainfmu.estimator.numerics.algebra import FIXED_ORDER, Algebra


@dataclass(frozen=True, kw_only=True, eq=False)
class FurtherErrors:
    """The terms of the variance of m further loads.

    Attributes
    ----------
    gain : (m, n_d) with all gauges [N, N m].
    regression : (m, n_d) X' L'^-1 [N, N m].
    remainder : (m,) what no gain changes [(N, N m)^2].
    """

    gain: FloatArray
    regression: FloatArray
    remainder: FloatArray


def further_errors(
    inverse_map: InverseMap,
    strain_gain: FloatArray,
    noise_whitening: FloatArray,
    algebra: Algebra = FIXED_ORDER,
) -> FurtherErrors:
    """Return the terms of ``inverse_map``; ``strain_gain`` is T, ``noise_whitening`` L^-1 (n_d, n_d)."""
    further, n_d = inverse_map.further, inverse_map.n_gauges
    if further is None:
        return FurtherErrors(gain=np.zeros((0, n_d)), regression=np.zeros((0, n_d)), remainder=np.zeros(0))
    gain = load_gain(
        load_per_state=further.load_per_state,
        strain_gain=strain_gain,
        state_operator=inverse_map.state_operator,
        noise_whitening=noise_whitening,
        strain_load_covariance=algebra.product(inverse_map.error_strain, further.error_load.T),
        algebra=algebra,
    )
    model = load_error_model(
        gauge_covariance=inverse_map.gauge_covariance,
        error_strain=inverse_map.error_strain,
        error_load=further.error_load,
        state_operator=inverse_map.state_operator,
        load_per_state=further.load_per_state,
        known_prior=inverse_map.case == 2,
        algebra=algebra,
    )
    return FurtherErrors(gain=gain, regression=model.regression, remainder=np.diag(model.remainder).copy())


def further_variance(
    errors: FurtherErrors, inverse_map: InverseMap, noise_root: FloatArray, gain: FloatArray
) -> FloatArray:
    """Return (m,) variance of the further loads estimated with ``gain`` (m, n_d) [(N, N m)^2]."""
    variance = errors.remainder + np.sum((gain @ noise_root - errors.regression) ** 2, axis=1)
    if inverse_map.case == 2 and inverse_map.further is not None:
        of_prior = inverse_map.further.load_per_state - gain @ inverse_map.state_operator
        variance = variance + np.sum(of_prior**2, axis=1)
    return np.asarray(variance)
