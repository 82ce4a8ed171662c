"""Gain and variance of the further loads for a fixed gain, as of maps in form "absolute".

The formulas are those of :mod:`strainfmu.estimator.map.load_errors`, of which variances alone are needed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.innovation import inverse_cholesky
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.load_errors import load_gain
from strainfmu.estimator.numerics.algebra import FIXED_ORDER, LAPACK, Algebra


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
    inverse_map: InverseMap, noise_root: FloatArray, noise_whitening: FloatArray, algebra: Algebra = FIXED_ORDER
) -> FurtherErrors:
    """Return the terms of ``inverse_map``; ``noise_root`` is L (n_d, n_d), ``noise_whitening`` its inverse."""
    further, n_d = inverse_map.further, inverse_map.n_gauges
    if further is None:
        return FurtherErrors(gain=np.zeros((0, n_d)), regression=np.zeros((0, n_d)), remainder=np.zeros(0))
    gain = load_gain(
        load_per_state=further.load_per_state,
        strain_gain=inverse_map.strain_gain,
        state_operator=inverse_map.state_operator,
        noise_whitening=noise_whitening,
        strain_load_covariance=further.strain_load_covariance,
        algebra=algebra,
    )
    x = further.strain_load_covariance
    regression = np.zeros_like(gain) if x is None else algebra.solve_lower(noise_root, x).T
    of_gain = _of_gain(inverse_map, noise_root, regression, gain)
    return FurtherErrors(gain=gain, regression=regression, remainder=np.maximum(further.variance - of_gain, 0.0))


def further_variance(
    errors: FurtherErrors, inverse_map: InverseMap, noise_root: FloatArray, gain: FloatArray
) -> FloatArray:
    """Return (m,) variance of the further loads estimated with ``gain`` (m, n_d) [(N, N m)^2]."""
    return errors.remainder + _of_gain(inverse_map, noise_root, errors.regression, gain)


def with_noise_of(held: InverseMap, noisy: InverseMap) -> InverseMap:
    """Return ``noisy``, which is ``held`` with further gauge noise, with the variance of its further loads.

    Of the load that no state holds, what strain does not tell grows as in
    :mod:`strainfmu.estimator.map.added_noise`.
    """
    if noisy.further is None:
        return noisy
    roots = [np.asarray(np.linalg.cholesky(one.noise_covariance)) for one in (held, noisy)]
    before, after = (
        further_errors(one, root, inverse_cholesky(one.noise_covariance), LAPACK)
        for one, root in zip((held, noisy), roots, strict=True)
    )
    told = np.sum(before.regression**2, axis=1) - np.sum(after.regression**2, axis=1)
    of_gain = _of_gain(noisy, roots[1], after.regression, after.gain)
    variance = np.maximum(before.remainder + told, 0.0) + of_gain
    return replace(noisy, further=replace(noisy.further, variance=variance))


def _of_gain(
    inverse_map: InverseMap, noise_root: FloatArray, regression: FloatArray, gain: FloatArray
) -> FloatArray:
    variance = np.sum((gain @ noise_root - regression) ** 2, axis=1)
    if inverse_map.case == 2 and inverse_map.further is not None:
        of_prior = inverse_map.further.load_per_state - gain @ inverse_map.state_operator
        variance = variance + np.sum(of_prior**2, axis=1)
    return np.asarray(variance)
