"""What a map's matrices are made into for an FMU, computed in one order on every processor.

An FMU that holds results of LAPACK would differ between machines in their last bits. Results are those of
:func:`strainfmu.masked_map.map_parts` to round-off; two exports of one map are equal wherever they are made. For
matrices of some hundred rows, once per export.
"""

from __future__ import annotations

from math import copysign, sqrt

import numpy as np
from numpy.typing import NDArray

from strainfmu.fixed_order import cholesky, load_gain_of, noise_whitening_of, product, solve_lower
from strainfmu.inverse_map import InverseMap
from strainfmu.load_errors import LoadErrorModel
from strainfmu.masked_map import MapParts

FloatArray = NDArray[np.float64]

_JACOBI_SWEEPS = 30
_ORTHOGONAL = 4e-16
"""Cosine of two columns that counts as a right angle."""


def householder(matrix: FloatArray) -> tuple[FloatArray, list[FloatArray]]:
    """Return R (m, n), upper triangular, and the reflectors v of Q = H_1 H_2 .., H = I - 2 v v' / v' v.

    Source: Golub & Van Loan, Matrix Computations, algorithms 5.1.1 and 5.2.1.
    """
    r, reflectors = matrix.copy(), []
    for k in range(min(r.shape)):
        v = np.zeros(len(r))
        v[k:] = r[k:, k]
        v[k] += copysign(sqrt(float(_square(v))), v[k])
        r = _reflected(v, r)
        r[k + 1 :, k] = 0.0
        reflectors.append(v)
    return r, reflectors


def _square(v: FloatArray) -> np.float64:
    """Return v' v, summed in order."""
    return np.float64(np.add.accumulate(v * v)[-1])


def _reflected(v: FloatArray, matrix: FloatArray) -> FloatArray:
    """Return H ``matrix``; H = I for v = 0."""
    square = _square(v)
    if square == 0.0:
        return matrix.copy()
    return np.asarray(matrix - v[:, None] * (2.0 / square * product(v[None, :], matrix)))


def whitening_of(state_operator: FloatArray, noise_whitening: FloatArray, regularisation: float) -> FloatArray:
    """Return (n_d, n_d) W with W' W = (A A' / gamma + Gamma)^-1; for gamma = 0 its limit, blind to A.

    W = diag(1 / sqrt(1 + S^2 / gamma)) U' L^-1 with L^-1 A = U S V', as
    :func:`strainfmu.innovation.innovation_whitening`: small rows keep all their digits. For gamma = 0 the rows of
    the states are zero.
    """
    n, n_states = state_operator.shape
    seen = product(noise_whitening, state_operator)
    weight = np.ones(n)
    if regularisation > 0.0:
        u, s = left_singular(seen)
        weight[: len(s)] = 1.0 / np.sqrt(1.0 + s * s / regularisation)
    else:
        # Columns of one size: the span is what counts, and no square may overflow.
        _, reflectors = householder(seen / np.max(np.abs(seen), axis=0))
        u = _orthogonal(reflectors, np.eye(n))
        weight[:n_states] = 0.0
    return np.asarray(weight[:, None] * product(u.T.copy(), noise_whitening))


def left_singular(matrix: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return U (n, n), orthogonal, and min(n, m) singular values of ``matrix`` (n, m), in no order.

    By a QR decomposition and one-sided Jacobi rotations of its R: small values keep all their digits. Source: Golub
    & Van Loan, Matrix Computations, section 8.6.3; Demmel & Veselic (1992).
    """
    n, m = matrix.shape
    if m >= n:
        r, _ = householder(matrix.T.copy())
        return _rotations(r[:n])
    r, reflectors = householder(matrix)
    rotated, s = _rotations(r[:m].T.copy())
    inner = np.eye(n)
    inner[:m, :m] = rotated
    return _orthogonal(reflectors, inner), s


def _orthogonal(reflectors: list[FloatArray], inner: FloatArray) -> FloatArray:
    """Return Q ``inner`` for Q = H_1 H_2 .."""
    for v in reversed(reflectors):
        inner = _reflected(v, inner)
    return inner


def _rotations(matrix: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return J, orthogonal, that makes the columns of ``matrix`` J orthogonal, and their norms."""
    rows, turned = matrix.T.copy(), np.eye(matrix.shape[1])
    for _ in range(_JACOBI_SWEEPS):
        still = True
        for p in range(len(rows) - 1):
            for q in range(p + 1, len(rows)):
                alpha, beta = float(_square(rows[p])), float(_square(rows[q]))
                gamma = float(np.add.accumulate(rows[p] * rows[q])[-1])
                if abs(gamma) <= _ORTHOGONAL * sqrt(alpha) * sqrt(beta):
                    continue
                still = False
                c, s = _rotation((beta - alpha) / (2.0 * gamma))
                for array in (rows, turned):
                    array[p], array[q] = c * array[p] - s * array[q], s * array[p] + c * array[q]
        if still:
            break
    return turned.T.copy(), np.sqrt([_square(row) for row in rows])


def _rotation(tau: float) -> tuple[float, float]:
    """Return cosine and sine of the smaller angle whose cotangent of the double is ``tau``."""
    t = copysign(1.0, tau) / (abs(tau) + sqrt(1.0 + tau * tau))
    c = 1.0 / sqrt(1.0 + t * t)
    return c, t * c


def eigen(matrix: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return eigenvalues (n,) and eigenvectors (n, n), by columns, of a symmetric ``matrix``, by Jacobi's method.

    Source: Golub & Van Loan, Matrix Computations, section 8.5.
    """
    a, vectors = matrix.copy(), np.eye(len(matrix))
    for _ in range(_JACOBI_SWEEPS):
        for p in range(len(a) - 1):
            for q in range(p + 1, len(a)):
                if a[p, q] == 0.0:
                    continue
                c, s = _rotation(float(a[q, q] - a[p, p]) / (2.0 * float(a[p, q])))
                a = _rotated(_rotated(a, p, q, c, s).T, p, q, c, s).T
                a[p, q] = a[q, p] = 0.0
                vectors = _rotated(vectors, p, q, c, s)
    return np.diag(a).copy(), vectors


def _rotated(matrix: FloatArray, p: int, q: int, c: float, s: float) -> FloatArray:
    """Return ``matrix`` with its columns p and q rotated."""
    out = matrix.copy()
    out[:, p], out[:, q] = c * matrix[:, p] - s * matrix[:, q], s * matrix[:, p] + c * matrix[:, q]
    return out


def map_parts_in_fixed_order(inverse_map: InverseMap) -> MapParts:
    """Return what :func:`strainfmu.masked_map.map_parts` returns, to round-off, bit for bit on every machine."""
    noise_whitening = noise_whitening_of(inverse_map.noise_covariance)
    gain = load_gain_of(inverse_map, noise_whitening)
    return MapParts(
        inverse_map,
        gain,
        _error_model(inverse_map, gain),
        noise_whitening,
        whitening_of(inverse_map.state_operator, noise_whitening, inverse_map.regularisation),
    )


def _error_model(inverse_map: InverseMap, gain: FloatArray) -> LoadErrorModel:
    """Return the model of :func:`strainfmu.load_errors.load_error_model`; the map has been checked for it."""
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
