"""Proper orthogonal decomposition of pressure snapshots."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from strainfmu.errors import InputError

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class PressureModes:
    """p = mean + V c (paper, eq. pod), Euclidean inner product over the nodes.

    Attributes
    ----------
    mean : (n_p,) p_bar [Pa].
    modes : (n_p, k) V, orthonormal columns, k = all that carry energy.
    singular_values : (k,) of the centred snapshots, falling [Pa].
    n_snapshots : N.
    """

    mean: FloatArray
    modes: FloatArray
    singular_values: FloatArray
    n_snapshots: int

    @property
    def energy(self) -> FloatArray:
        """(k,) share of the energy held by the first 1, 2, .. k modes."""
        square = self.singular_values**2
        return np.cumsum(square) / np.sum(square)

    def coefficient_std(self) -> FloatArray:
        """(k,) standard deviation of the modal coefficients over the snapshots [Pa]."""
        return self.singular_values / np.sqrt(self.n_snapshots - 1)


def proper_orthogonal_decomposition(snapshots: FloatArray) -> PressureModes:
    """Decompose ``snapshots`` (N, n_p) [Pa], centred by their mean.

    Modes below 1e-10 of the largest singular value are round-off and left out. Each mode's sign is fixed by
    its largest entry being positive, so that results repeat.

    Raises
    ------
    InputError
        Fewer than two snapshots, or snapshots that are all alike.
    """
    if len(snapshots) < 2:
        raise InputError(f"{len(snapshots)} snapshot found, at least 2 are needed")
    mean = snapshots.mean(axis=0)
    left, singular_values, _ = np.linalg.svd((snapshots - mean).T, full_matrices=False)
    kept = singular_values > 1e-10 * singular_values[0]
    if singular_values[0] <= 1e-10 * float(np.linalg.norm(mean)):
        raise InputError("the snapshots are all alike: no modes")
    modes = left[:, kept]
    largest = np.abs(modes).argmax(axis=0)
    modes = modes * np.sign(modes[largest, np.arange(modes.shape[1])])
    return PressureModes(mean, modes, singular_values[kept], len(snapshots))
