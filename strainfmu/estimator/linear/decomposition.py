"""One decomposition of a map that serves every dynamic pressure.

Strain at the pressure ratio s = q_inf / q_nominal is d = d_0 + s (m + A x + N y) + e_g. The states x are free
(Case 1) or standard normal (Case 2). The columns of N hold every error that grows with the pressure, y is
standard normal. The covariance Gamma_g = L L' of e_g does not depend on s. Loads are f = f_0 + s (f_mean + M x +
M_N y).

Free states are eliminated by Householder reflections of L^-1 A. What remains is B = U S W' (B = L^-1 [A, N] in
Case 2). With w = V (d - d_0 - s m), V = U' L^-1, lambda = S^2 and u = 1 / (1 + s^2 lambda):

    f = f_0 + s f_mean + H w_free + G (s^2 S u w),   cov(f) = H H' + s^2 (R + G diag(u) G'),
    chi-square = sum u w^2,                          precision of d: V' diag(u) V,

with u = 0 for the free directions; G holds the loads of the columns of W, and R the load that no strain shows. So
a change of dynamic pressure costs n divisions. One-sided Jacobi rotations of the rows of B give U to full
precision, where eigenvalues of B B' would lose half of the digits (Golub & Van Loan, Matrix Computations, section
8.6.3).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from strainfmu.arrays import FloatArray, IntArray
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.numerics.fixed_order import householder, inverse_cholesky, product, solve_lower

_SWEEPS = 40
_ORTHOGONAL = 4e-16
"""|cosine| of two rows that counts as 0."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Decomposition:
    """The matrices of all gauges from which the estimate at any dynamic pressure follows.

    Attributes
    ----------
    whitening : (n_d, n_d) V [1/(m/m)]; its first ``n_free`` rows are those of the free states.
    singular_values : (n_d,) S [1], falling; 0 for the free rows, which have no prior.
    n_free : number of free states: n_q in Case 1, 0 in Case 2.
    load_per_direction : (n_l, n_d) H for the free rows and G for the others [N, N m]: of the five loads, then of
        the further ones.
    unseen : (n_l, n_l) R [(N, N m)^2].
    """

    whitening: FloatArray
    singular_values: FloatArray
    n_free: int
    load_per_direction: FloatArray
    unseen: FloatArray


def decompose(inverse_map: InverseMap) -> Decomposition:
    """Return the decomposition of ``inverse_map``, in the same bits on every machine."""
    own, errors, load_of_errors = inverse_map.gauge_covariance, inverse_map.error_strain, inverse_map.error_load
    whitening, states, load_of_states = (
        inverse_cholesky(own),
        inverse_map.state_operator,
        inverse_map.load_per_state,
    )
    further = inverse_map.further
    if further is not None:
        load_of_states = np.vstack([load_of_states, further.load_per_state])
        load_of_errors = np.vstack([load_of_errors, further.error_load])
    n_free = states.shape[1] if inverse_map.case == 1 else 0
    if n_free == 0:
        errors = np.hstack([states, errors])
        load_of_errors = np.hstack([load_of_states, load_of_errors])
        of_free, rest = np.empty((len(load_of_states), 0)), np.hstack([product(whitening, errors), whitening])
    else:
        # Columns of one size: only their span counts, and no square may overflow.
        size = np.max(np.abs(product(whitening, states)), axis=0)
        whole = np.hstack([product(whitening, states) / size, product(whitening, errors), whitening])
        triangle, _ = householder(whole, n_free)
        of_free = solve_lower(triangle[:n_free, :n_free].T.copy(), (load_of_states / size).T.copy()).T.copy()
        rest = triangle[:, n_free:]
        load_of_errors = load_of_errors - product(of_free, rest[:n_free, : errors.shape[1]])
    k = errors.shape[1]
    rotated = _orthogonal_rows(rest[n_free:].copy(), k)
    square = _row_products(rotated[:, :k], rotated[:, :k])
    order = np.argsort(-square, kind="stable")
    rotated, root = rotated[order], np.sqrt(square[order])
    direction = rotated[:, :k] / np.where(root > 0.0, root, 1.0)[:, None]
    along = product(load_of_errors, direction.T)
    across = load_of_errors - product(along, direction)
    vectors = np.vstack([rest[:n_free, k:], rotated[:, k:]])
    return Decomposition(
        whitening=vectors,
        singular_values=np.concatenate([np.zeros(n_free), root]),
        n_free=n_free,
        load_per_direction=np.hstack([of_free, along]),
        unseen=product(across, across.T.copy()),
    )


def _orthogonal_rows(rows: FloatArray, k: int) -> FloatArray:
    """Return ``rows`` (n, m) turned until their first ``k`` columns are orthogonal, row to row (Hestenes 1958)."""
    for _ in range(_SWEEPS):
        largest = 0.0
        for first, second in _rounds(len(rows)):
            a, b = rows[first], rows[second]
            alpha, beta = _row_products(a[:, :k], a[:, :k]), _row_products(b[:, :k], b[:, :k])
            gamma = _row_products(a[:, :k], b[:, :k])
            scale = np.sqrt(alpha) * np.sqrt(beta)
            turned = np.abs(gamma) > _ORTHOGONAL * scale
            if not turned.any():
                continue
            cosine = np.abs(gamma[turned]) / np.where(scale[turned] > 0.0, scale[turned], 1.0)
            largest = max(largest, float(np.max(cosine)))
            tau = np.where(turned, (beta - alpha) / np.where(turned, 2.0 * gamma, 1.0), 0.0)
            with np.errstate(over="ignore"):  # where tau squared is infinite, t is 0
                t = np.where(turned, np.copysign(1.0, tau) / (np.abs(tau) + np.sqrt(1.0 + tau * tau)), 0.0)
            c = (1.0 / np.sqrt(1.0 + t * t))[:, None]
            s = t[:, None] * c
            rows[first], rows[second] = c * a - s * b, s * a + c * b
        if largest <= 8.0 * _ORTHOGONAL:
            break
    return rows


def _rounds(n: int) -> list[tuple[IntArray, IntArray]]:
    """Return the pairs of n rows in rounds without a row twice: a round-robin tournament."""
    players = list(range(n)) + ([-1] if n % 2 else [])
    half, rounds = len(players) // 2, []
    for _ in range(max(len(players) - 1, 0)):
        pairs = zip(players[:half], reversed(players[half:]), strict=True)
        chosen = np.array([(min(p), max(p)) for p in pairs if -1 not in p], dtype=np.int64).reshape(-1, 2)
        rounds.append((chosen[:, 0], chosen[:, 1]))
        players = [players[0], players[-1], *players[1:-1]]
    return rounds


def _row_products(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the scalar product of each row of ``a`` and ``b`` (n, k), summed in the order of k."""
    if a.shape[1] == 0:
        return np.zeros(len(a))
    return np.add.accumulate(a * b, axis=1)[:, -1]
