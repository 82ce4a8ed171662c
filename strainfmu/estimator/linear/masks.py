"""An inverse map without some of its gauges, exactly as if it had been built without them.

With P = W' W the precision of d - m and R the missing gauges, the model predicts r_R from the others as
-P_RR^-1 P_RK r_K. The unchanged gain, fed with that prediction, gives the estimate of a map built without R, for
any Gamma and gamma: the missing-observation formula (Rasmussen & Williams, Gaussian Processes for Machine
Learning, section 5.4.2, for one gauge; the block inverse for several). Columns W_R stand for P_RR throughout:
P_RR^-1 P_RK is a least-squares solution, and taking R out of the residual is a projection.
"""

from __future__ import annotations

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.estimator.policies import MIN_INFORMATION as MIN_INFORMATION


def information_left(whitening: FloatArray, noise_whitening: FloatArray, missing: BoolArray) -> float:
    """Return the smallest fraction, over all states, of all gauges' information that the gauges kept hold [1].

    With H = A' Gamma^-1 A + gamma I of all gauges and H_K of those kept it is the smallest eigenvalue of H^-1 H_K,
    which is that of (Gamma^-1)_RR^-1 P_RR (as X Y and Y X share eigenvalues). The variance of no state grows more
    than by its inverse. It does not depend on the units of gauges or states.

    Parameters
    ----------
    whitening : (n, n_d) W of the same gamma as the estimate [1/(m/m)].
    noise_whitening : (n_d, n_d) L^-1 [1/(m/m)].
    missing : (n_d,) true where a gauge is missing.
    """
    if not missing.any():
        return 1.0
    _, r = np.linalg.qr(noise_whitening[:, missing])
    smallest = np.linalg.svd(np.linalg.solve(r.T, whitening[:, missing].T), compute_uv=False)[-1]
    return float(smallest**2)


def masked_gain(gain: FloatArray, whitening: FloatArray, missing: BoolArray) -> FloatArray:
    """Return (m, n_d) G_K - G_R P_RR^-1 P_RK, zero in the columns of the missing gauges.

    Parameters
    ----------
    gain : (m, n_d) G, anything that is linear in d - m.
    whitening : (n, n_d) W of the same gamma as the estimate; W_R must have full rank.
    missing : (n_d,) true where a gauge is missing.
    """
    if not missing.any():
        return gain
    q, r, size = _orthonormal(whitening[:, missing])
    prediction = np.linalg.solve(r, q.T @ whitening) / size[:, None]
    masked = gain - gain[:, missing] @ prediction
    masked[:, missing] = 0.0
    return masked


def masked_whitening(whitening: FloatArray, missing: BoolArray) -> FloatArray:
    """Return (n, n_d) W without the gauges missing: W' W is the precision of d_K, zero in rows and columns of R.

    P_KK - P_KR P_RR^-1 P_RK = W_K' (I - Q Q') W_K with W_R = Q R. ``missing`` is (n_d,); W_R must have full rank.
    """
    if not missing.any():
        return whitening
    q, _, _ = _orthonormal(whitening[:, missing])
    masked = whitening - q @ (q.T @ whitening)
    masked -= q @ (q.T @ masked)  # once more: the first pass leaves the round-off of what it took out
    masked[:, missing] = 0.0
    return masked


def _orthonormal(columns: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return Q, R and column norms s of ``columns`` = Q R diag(s)."""
    size = np.linalg.norm(columns, axis=0)
    q, r = np.linalg.qr(columns / size)
    return q, r, size
