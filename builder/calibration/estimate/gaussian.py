"""A linear model with normal parameters and noise, all of standard deviation 1.

    left = rows theta + noise,  S = 1 + rows rows',  C = (1 + rows' rows)^-1,  S^-1 = 1 - rows C rows'.

All follows from the precision 1 + rows' rows of the parameters, an arrow where readings of a gauge depend on few
of them: :mod:`builder.calibration.estimate.arrow_matrix`.

Source: Rasmussen & Williams, Gaussian Processes for Machine Learning, sections 2.1 and 5.4.2.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array

from builder.calibration.estimate.arrow_matrix import Arrow
from strainfmu.arrays import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class GaussianModel:
    """The model.

    Attributes
    ----------
    rows : (n, k) readings per parameter.
    left : (n,) readings less what they are at theta = 0.
    own : (k,) the gauge whose readings alone depend on a parameter, -1 of others.
    """

    rows: csr_array
    left: FloatArray
    own: IntArray

    @cached_property
    def information(self) -> Arrow:
        """(k, k) rows' rows."""
        return Arrow.of_rows(self.rows, self.own)

    def precision_at(self, noise: float = 1.0, damping: float = 0.0) -> Arrow:
        """Return 1 + rows' rows (k, k) where noise has the standard deviation ``noise``, its diagonal larger by
        the part ``damping``."""
        diagonal = 1.0 + self.information.diagonal / noise**2
        return self.information.changed(noise**-2, 1.0 + damping * diagonal)

    @cached_property
    def precision(self) -> Arrow:
        """(k, k) 1 + rows' rows."""
        return self.precision_at()

    @cached_property
    def mean(self) -> FloatArray:
        """(k,) of the parameters."""
        return self.precision.solve(self.rows.T @ self.left)

    @cached_property
    def covariance(self) -> FloatArray:
        """(k, k) of the parameters."""
        return self.precision.inverse

    @cached_property
    def std(self) -> FloatArray:
        """(k,) of the parameters."""
        return np.sqrt(self.precision.inverse_diagonal)

    def density(self, noise: float = 1.0) -> float:
        """Return the logarithm of the density of ``left`` but for a constant, where noise has the standard
        deviation ``noise``."""
        precision = self.precision if noise == 1.0 else self.precision_at(noise)
        mean = precision.solve(self.rows.T @ self.left) / noise**2
        rest, size = self.left - self.rows @ mean, 0.5 * precision.log_determinant + len(self.left) * np.log(noise)
        return float(-size - 0.5 * (rest @ rest / noise**2 + mean @ mean))

    @cached_property
    def weighted(self) -> FloatArray:
        """(n,) S^-1 left."""
        return np.asarray(self.left - self.rows @ self.mean)

    @cached_property
    def _halves(self) -> tuple[csr_array, FloatArray]:
        """G (n, n_own) and H (n, c): S^-1 = 1 - G G' - H H'."""
        return self.precision.halves(self.rows)

    def precision_of(self, at: IntArray) -> FloatArray:
        """Return the part of S^-1 of the rows ``at``."""
        own, common = self._halves[0][at], self._halves[1][at]
        return np.eye(len(at)) - (own @ own.T).toarray() - common @ common.T

    def without(self, at: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return what the rows ``at`` differ by from the prediction by all others, and the covariance of that."""
        covariance = np.asarray(np.linalg.inv(self.precision_of(at)), dtype=np.float64)
        return covariance @ self.weighted[at], covariance

    def terms(self, columns: csr_array) -> tuple[FloatArray, FloatArray]:
        """Return C' S^-1 left (m,) and C' S^-1 C (m, m) of further columns C (n, m)."""
        across = columns.T.tocsr()
        own, common = across @ self._halves[0], across @ self._halves[1]
        square = (across @ columns - own @ own.T).toarray() - common @ common.T
        return across @ self.weighted, np.asarray(square)
