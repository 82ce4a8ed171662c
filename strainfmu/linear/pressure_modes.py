"""What snapshots say of the pressure: their mean, the prior of Case 2 and the modes of Case 1.

With N snapshots p_j of mean p_mean, F = (p_j - p_mean) / sqrt(N - 1), a column each, is a factor of the prior
covariance, Gamma_pr = F F^T (Pham et al., eq. prior_cov), which is never formed. Its singular value decomposition
in the inner product V^T W V = I is the proper orthogonal decomposition, p = p_mean + V c (eq. pod).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

ROUND_OFF = 1e-10
"""Singular values of snapshots below this fraction of the largest are round-off."""


@dataclass(frozen=True, eq=False, kw_only=True)
class PressureModes:
    """p = mean + V c (paper, eq. pod), V orthonormal in an inner product over the nodes: V^T W V = I.

    Attributes
    ----------
    mean : (n_p,) p_bar [Pa].
    modes : (n_p, k) V [1], all k that carry energy, or the first ones.
    singular_values : (k,) of the centred snapshots in the same inner product, falling [Pa].
    n_snapshots : N.
    weights : (n_p,) diagonal of W [1], or None for the Euclidean inner product, W = I.
    total_energy : sum of the squares of all singular values [Pa^2]; None where all are there.
    """

    mean: FloatArray
    modes: FloatArray
    singular_values: FloatArray
    n_snapshots: int
    weights: FloatArray | None = None
    total_energy: float | None = None

    @property
    def energy(self) -> FloatArray:
        """(k,) fraction of the energy in the first 1, 2, .. k modes."""
        square = self.singular_values**2
        return np.cumsum(square) / (np.sum(square) if self.total_energy is None else self.total_energy)

    @property
    def coefficient_std(self) -> FloatArray:
        """(k,) standard deviation of the modal coefficients over the snapshots [Pa]."""
        return self.singular_values / np.sqrt(self.n_snapshots - 1)

    def reordered(self, order: list[int]) -> PressureModes:
        """Return the modes in another ``order``, by index."""
        return replace(self, modes=self.modes[:, order], singular_values=self.singular_values[order])

    def coefficients(self, pressure: FloatArray) -> FloatArray:
        """Return c = V^T W (p - mean), (N, k) [Pa], of pressures (N, n_p) [Pa]."""
        centred = pressure - self.mean
        return (centred if self.weights is None else centred * self.weights) @ self.modes


def mean_snapshot(snapshots: FloatArray) -> FloatArray:
    """Return the mean (n_p,) [Pa] of ``snapshots`` (N, n_p) [Pa]."""
    if len(snapshots) < 2:
        raise InputError(f"{len(snapshots)} snapshot found, at least 2 are needed")
    mean: FloatArray = snapshots.mean(axis=0)
    return mean


@dataclass(frozen=True, eq=False)
class LowRankPrior:
    """p = mean + F q with q standard normal (paper, eq. prior_cov: Gamma_pr = F F^T).

    Attributes
    ----------
    mean : (n_p,) p_bar [Pa].
    factor : (n_p, n_q) F [Pa].
    """

    mean: FloatArray
    factor: FloatArray

    @property
    def n_states(self) -> int:
        return self.factor.shape[1]


def prior_of_snapshots(snapshots: FloatArray) -> LowRankPrior:
    """Return the prior of ``snapshots`` (N, n_p) [Pa], N states."""
    mean = mean_snapshot(snapshots)
    factor = snapshots - mean
    factor /= np.sqrt(len(snapshots) - 1)
    if np.linalg.norm(factor) <= ROUND_OFF * np.linalg.norm(mean):
        raise InputError("the snapshots are all equal: no prior")
    return LowRankPrior(mean, factor.T)


def proper_orthogonal_decomposition(snapshots: FloatArray, weights: FloatArray | None = None) -> PressureModes:
    """Decompose ``snapshots`` (N, n_p) [Pa], centred by their mean.

    Modes below :data:`ROUND_OFF` of the largest singular value are left out.

    Parameters
    ----------
    snapshots : (N, n_p) [Pa].
    weights : (n_p,) positive weights of the inner product, or None for the Euclidean one.

    Raises
    ------
    InputError
        Fewer than two snapshots, or snapshots that are all equal.
    """
    mean = mean_snapshot(snapshots)
    root = 1.0 if weights is None else np.sqrt(weights)
    left_vectors, singular_values, _ = np.linalg.svd(((snapshots - mean) * root).T, full_matrices=False)
    is_mode = singular_values > ROUND_OFF * singular_values[0]
    if singular_values[0] <= ROUND_OFF * float(np.linalg.norm(mean * root)):
        raise InputError("the snapshots are all equal: no modes")
    modes = left_vectors[:, is_mode] if weights is None else left_vectors[:, is_mode] / np.sqrt(weights)[:, None]
    return PressureModes(
        mean=mean,
        modes=modes * signs(modes),
        singular_values=singular_values[is_mode],
        n_snapshots=len(snapshots),
        weights=weights,
    )


def leading_modes(
    prior: LowRankPrior, r: int, weights: FloatArray | None, rows: Sequence[FloatArray]
) -> tuple[PressureModes, FloatArray, FloatArray]:
    """Return the first ``r`` modes of the snapshots of ``prior``, coefficients V^T W F (r, N) of F [Pa], and B F.

    ``rows`` are the parts of B (m, n_p). It takes a fraction of the work that all modes take: three products with
    F, the last of which is B F too.

    The method of snapshots (Sirovich 1987): eigenvectors of F^T W F (N, N). Squaring costs weak modes digits, so
    modes and singular values are solved again within the leading ones (Rayleigh and Ritz).
    """
    fields, n_snapshots = prior.factor, prior.n_states
    if isinstance(r, bool) or int(r) != r or not 1 <= r < n_snapshots:
        raise InputError(f"modes: expected 1 to {n_snapshots - 1} with {n_snapshots} snapshots, got {r}")
    root = 1.0 if weights is None else np.sqrt(weights)[:, None]
    scaled = fields if weights is None else root * fields
    values, vectors = np.linalg.eigh(scaled.T @ scaled)
    basis, _ = np.linalg.qr((vectors[:, ::-1][:, : min(r + 4, n_snapshots)].T @ scaled.T).T)
    product = np.vstack([*rows, (root * basis).T]) @ fields
    of_rows, of_basis = product[: -basis.shape[1]], product[-basis.shape[1] :]
    left_vectors, std, right = np.linalg.svd(of_basis, full_matrices=False)
    if not std[r - 1] > ROUND_OFF * std[0]:
        count = int(np.sum(std > ROUND_OFF * std[0]))
        raise InputError(f"modes: expected at most {count}, the modes that the snapshots have, got {r}")
    scale, modes = np.sqrt(n_snapshots - 1), (basis @ left_vectors[:, :r]) / root
    sign = signs(modes)
    pod = PressureModes(
        mean=prior.mean,
        modes=modes * sign,
        singular_values=scale * std[:r],
        n_snapshots=n_snapshots,
        weights=weights,
        total_energy=float(scale**2 * values.sum()),
    )
    return pod, (sign * std[:r])[:, None] * right[:r], of_rows


def signs(modes: FloatArray) -> FloatArray:
    """Return (k,) signs with which the largest entry of each mode is positive, so that results repeat."""
    return np.sign(modes[np.abs(modes).argmax(axis=0), np.arange(modes.shape[1])])
