"""Estimators without weights or prior, for comparison."""

from __future__ import annotations

import numpy as np

from strainfmu.arrays import FloatArray


def unweighted_gain(state_operator: FloatArray) -> FloatArray:
    """Return the ordinary least-squares gain Z^+ (r, n_d) of Z (n_d, r): every gauge has the same weight."""
    return np.asarray(np.linalg.pinv(state_operator), dtype=np.float64)


def minimum_norm_pressure(
    strain_operator: FloatArray, strain: FloatArray, weights: FloatArray | None = None, tolerance: float = 1e-10
) -> FloatArray:
    """Return the pressure of minimum norm that causes a strain: p = W^-1 Z^T (Z W^-1 Z^T)^+ d.

    Source: the paper, section Case 2. It lies in the row space of Z_p: nothing else is known without a prior.

    Parameters
    ----------
    strain_operator : (n_d, n_p) Z_p [1/Pa].
    strain : (n_d,) or (n_d, n) [m/m].
    weights : (n_p,) diagonal of W of the norm |p|^2 = p^T W p, or None for the Euclidean norm.
    tolerance : singular values of Z W^(-1/2) below this fraction of the largest count as 0.

    Returns
    -------
    (n_p,) or (n_p, n) [Pa].
    """
    root = 1.0 if weights is None else 1.0 / np.sqrt(weights)
    u, s, vt = np.linalg.svd(strain_operator * root, full_matrices=False)
    inverse = np.where(s > tolerance * s[0], 1.0 / np.maximum(s, tolerance * s[0]), 0.0)
    pressure: FloatArray = vt.T @ (inverse[:, None] * (u.T @ strain.reshape(len(strain), -1)))
    if weights is not None:
        pressure /= np.sqrt(weights)[:, None]
    return pressure.reshape(len(pressure), *strain.shape[1:])
