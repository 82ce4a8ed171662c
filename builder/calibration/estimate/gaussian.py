"""A linear model with normal parameters and noise, all of standard deviation 1.

    left = rows theta + noise,  S = 1 + rows rows',  C = (1 + rows' rows)^-1,  S^-1 = 1 - rows C rows'.

All follows from the precision of the parameters: its size is the number of parameters and not of readings. It is
scaled to a diagonal of 1, as zeros of a recorder are known a thousand times less exactly than gains.

Source: Rasmussen & Williams, Gaussian Processes for Machine Learning, sections 2.1 and 5.4.2.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from strainfmu.arrays import FloatArray, IntArray

JITTER = 1e-9
"""Added to the diagonal of 1 where rounding makes the precision indefinite."""


@dataclass(frozen=True, eq=False)
class GaussianModel:
    """The model.

    Attributes
    ----------
    rows : (n, k) readings per parameter.
    left : (n,) readings less what they are at theta = 0.
    group : (n,) rows of one group depend on few of the parameters, as all readings of a gauge do; by default all
        rows are of one.
    """

    rows: FloatArray
    left: FloatArray
    group: IntArray | None = field(default=None)

    @cached_property
    def information(self) -> FloatArray:
        """(k, k) rows' rows."""
        if self.group is None:
            return np.asarray(self.rows.T @ self.rows)
        total = np.zeros((self.rows.shape[1],) * 2)
        for number in np.unique(self.group):
            part = self.rows[self.group == number]
            at = np.flatnonzero(part.any(axis=0))
            total[np.ix_(at, at)] += part[:, at].T @ part[:, at]
        return total

    def solved(self, noise: float = 1.0) -> tuple[FloatArray, FloatArray, float]:
        """Return mean (k,) and covariance (k, k) of the parameters where noise has the standard deviation
        ``noise``, and the logarithm of the density of ``left`` but for a constant."""
        n, k = self.rows.shape
        precision = np.eye(k) + self.information / noise**2
        scale = 1.0 / np.sqrt(np.diag(precision))
        scaled = scale[:, None] * precision * scale
        try:
            factor = cho_factor(scaled, lower=True)
        except np.linalg.LinAlgError:  # parameters that no reading separates, at readings that no vehicle has
            factor = cho_factor(scaled + JITTER * np.eye(k), lower=True)
        covariance = scale[:, None] * cho_solve(factor, np.diag(scale))
        mean = covariance @ (self.rows.T @ self.left) / noise**2
        rest = self.left - self.rows @ mean
        size = float(np.sum(np.log(np.diag(factor[0])) - np.log(scale))) + n * np.log(noise)
        return mean, covariance, -size - 0.5 * float(rest @ rest / noise**2 + mean @ mean)

    @cached_property
    def _solved(self) -> tuple[FloatArray, FloatArray, float]:
        return self.solved()

    @property
    def mean(self) -> FloatArray:
        """(k,) of the parameters."""
        return self._solved[0]

    @property
    def covariance(self) -> FloatArray:
        """(k, k) of the parameters."""
        return self._solved[1]

    @property
    def density(self) -> float:
        """Logarithm of the density of ``left`` but for a constant."""
        return self._solved[2]

    @cached_property
    def weighted(self) -> FloatArray:
        """(n,) S^-1 left."""
        return np.asarray(self.left - self.rows @ self.mean)

    def precision_of(self, at: IntArray) -> FloatArray:
        """Return the part of S^-1 of the rows ``at``."""
        part = self.rows[at]
        some = np.flatnonzero(part.any(axis=0))
        return np.asarray(np.eye(len(at)) - part[:, some] @ self.covariance[np.ix_(some, some)] @ part[:, some].T)

    def without(self, at: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return what the rows ``at`` differ by from the prediction by all others, and the covariance of that."""
        covariance = np.asarray(np.linalg.inv(self.precision_of(at)), dtype=np.float64)
        return covariance @ self.weighted[at], covariance

    def terms(self, columns: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return C' S^-1 left (m,) and C' S^-1 C (m, m) of further columns C (n, m)."""
        at = np.flatnonzero(columns.any(axis=1))
        part = columns[at]
        cross = self.rows[at].T @ part
        return part.T @ self.weighted[at], np.asarray(part.T @ part - cross.T @ (self.covariance @ cross))
