"""Proper orthogonal decomposition of pressure snapshots."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError


@dataclass(frozen=True, eq=False, kw_only=True)
class PressureModes:
    """p = mean + V c (paper, eq. pod), V orthonormal in an inner product over the nodes: V^T W V = I.

    Attributes
    ----------
    mean : (n_p,) p_bar [Pa].
    modes : (n_p, k) V [1], all k that carry energy.
    singular_values : (k,) of the centred snapshots in the same inner product, falling [Pa].
    n_snapshots : N.
    weights : (n_p,) diagonal of W [1], or None for the Euclidean inner product, W = I.
    """

    mean: FloatArray
    modes: FloatArray
    singular_values: FloatArray
    n_snapshots: int
    weights: FloatArray | None = None

    @property
    def energy(self) -> FloatArray:
        """(k,) fraction of the energy in the first 1, 2, .. k modes."""
        square = self.singular_values**2
        return np.cumsum(square) / np.sum(square)

    def coefficient_std(self) -> FloatArray:
        """(k,) standard deviation of the modal coefficients over the snapshots [Pa]."""
        return self.singular_values / np.sqrt(self.n_snapshots - 1)

    def reordered(self, order: list[int]) -> PressureModes:
        """Return the modes in another ``order``, by index."""
        return replace(self, modes=self.modes[:, order], singular_values=self.singular_values[order])

    def coefficients(self, pressure: FloatArray) -> FloatArray:
        """Return c = V^T W (p - mean), (N, k) [Pa], of pressures (N, n_p) [Pa]."""
        return modal_coefficients(pressure, self.mean, self.modes, self.weights)


def modal_coefficients(
    pressure: FloatArray, mean: FloatArray, modes: FloatArray, weights: FloatArray | None
) -> FloatArray:
    """Return c = V^T W (p - mean), (.., r) [Pa], of pressures (.., n_p) [Pa] on modes V (n_p, r)."""
    centred = pressure - mean
    coefficients: FloatArray = (centred if weights is None else centred * weights) @ modes
    return coefficients


def mean_snapshot(snapshots: FloatArray) -> FloatArray:
    """Return the mean (n_p,) [Pa] of ``snapshots`` (N, n_p) [Pa].

    Raises
    ------
    InputError
        Fewer than two snapshots.
    """
    if len(snapshots) < 2:
        raise InputError(f"{len(snapshots)} snapshot found, at least 2 are needed")
    mean: FloatArray = snapshots.mean(axis=0)
    return mean


def area_weights(node_area: FloatArray) -> FloatArray:
    """Return the weights (n_p,) of the area-weighted inner product: area [m2] over the mean area.

    With this scaling coefficients keep the unit Pa, and equal areas give the Euclidean inner product.

    Raises
    ------
    InputError
        A node has no area.
    """
    missing = int(np.sum(~(node_area > 0.0)))
    if missing:
        raise InputError(
            f"map.inner_product: 'area' found, but {missing} of {len(node_area)} nodes have no area; "
            "use 'euclidean'"
        )
    return node_area / node_area.mean()


def proper_orthogonal_decomposition(snapshots: FloatArray, weights: FloatArray | None = None) -> PressureModes:
    """Decompose ``snapshots`` (N, n_p) [Pa], centred by their mean.

    Modes below 1e-10 of the largest singular value are round-off and are left out. The largest entry of each mode
    is positive, so that results repeat.

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
    left, singular_values, _ = np.linalg.svd(((snapshots - mean) * root).T, full_matrices=False)
    kept = singular_values > 1e-10 * singular_values[0]
    if singular_values[0] <= 1e-10 * float(np.linalg.norm(mean * root)):
        raise InputError("the snapshots are all equal: no modes")
    modes = left[:, kept] if weights is None else left[:, kept] / np.sqrt(weights)[:, None]
    largest = np.abs(modes).argmax(axis=0)
    modes = modes * np.sign(modes[largest, np.arange(modes.shape[1])])
    return PressureModes(
        mean=mean,
        modes=modes,
        singular_values=singular_values[kept],
        n_snapshots=len(snapshots),
        weights=weights,
    )
