"""A linear model with normal parameters and noise, all of standard deviation 1.

    left = rows theta + noise,  S = 1 + rows rows',  C = (1 + rows' rows)^-1,  S^-1 = 1 - rows C rows'.

All follows from the precision 1 + rows' rows of the parameters, an arrow where readings of a gauge depend on few
of them.


Source: Rasmussen & Williams, Gaussian Processes for Machine Learning, sections 2.1 and 5.4.2.

A symmetric positive definite matrix of an arrow's shape, by its blocks.

    A = [[D, E], [E', F]],  S = F - E' D^-1 E,  T = D^-1 E,
    A^-1 = [[D^-1 + T S^-1 T', -T S^-1], [-S^-1 T', S^-1]],

D of one block for each gauge, by the parameters that its readings alone depend on; F by the common parameters.
Work and memory grow in proportion to the number of gauges.

Source: Golub & Van Loan, Matrix Computations, 4th edition, section 4.3.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular
from scipy.sparse import bsr_array, csr_array

from strainfmu.arrays import FloatArray, IntArray

JITTER = 1e-9
"""Added to the diagonal of 1 where rounding makes a matrix indefinite."""


class Arrow:
    """The matrix by its blocks, (n_g, p, p), (n_g, p, c) and (c, c); rows of blocks that are not full are zero.

    ``own`` (k,) is the gauge of each row of the matrix, -1 of a common parameter.
    """

    def __init__(self, own: IntArray, blocks: FloatArray, border: FloatArray, common: FloatArray) -> None:
        self.own, self.blocks, self.border, self.common = own, blocks, border, common
        self.of_gauges, self.of_all = np.flatnonzero(own >= 0), np.flatnonzero(own < 0)
        self.place = own[self.of_gauges] * blocks.shape[1] + _order_in_gauge(own)[self.of_gauges]

    @classmethod
    def of_rows(cls, rows: csr_array, own: IntArray) -> Arrow:
        """Return rows' rows of ``rows`` (n, k)."""
        slot, is_own = _order_in_gauge(own), own >= 0
        size, n_c = int(slot.max(initial=0, where=is_own)) + 1, int(np.sum(~is_own))
        blocks = np.zeros((int(own.max(initial=0)) + 1, size, size))
        border, common = np.zeros((len(blocks), size, n_c)), np.zeros((n_c, n_c))
        product = (rows.T @ rows).tocoo()
        (row, column), value = product.coords, product.data
        in_gauge, in_border, in_common = (
            is_own[row] & is_own[column],
            is_own[row] & ~is_own[column],
            ~(is_own[row] | is_own[column]),
        )
        blocks[own[row[in_gauge]], slot[row[in_gauge]], slot[column[in_gauge]]] = value[in_gauge]
        border[own[row[in_border]], slot[row[in_border]], slot[column[in_border]]] = value[in_border]
        common[slot[row[in_common]], slot[column[in_common]]] = value[in_common]
        return cls(own, blocks, border, common)

    @property
    def diagonal(self) -> FloatArray:
        """Diagonal of the matrix (k,)."""
        values = np.zeros(len(self.own))
        values[self.of_gauges] = np.diagonal(self.blocks, axis1=1, axis2=2).ravel()[self.place]
        values[self.of_all] = np.diag(self.common)
        return values

    def changed(self, factor: float, added: FloatArray) -> Arrow:
        """Return ``factor`` times the matrix with ``added`` (k,) on its diagonal."""
        blocks, common = factor * self.blocks, factor * self.common
        own = np.zeros(self.blocks[..., 0].size)
        own[self.place] = added[self.of_gauges]
        np.einsum("gii->gi", blocks)[:] += own.reshape(len(blocks), -1)
        np.einsum("ii->i", common)[:] += added[self.of_all]
        return Arrow(self.own, blocks, factor * self.border, common)

    @cached_property
    def _factors(self) -> tuple[FloatArray, ...]:
        """Scale (n_g, p) and (c,) to a diagonal of 1, inverses of the factors of D (n_g, p, p), and E by them."""
        diagonal = np.diagonal(self.blocks, axis1=1, axis2=2)
        scale = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
        of_all = 1.0 / np.sqrt(np.diag(self.common))
        blocks = scale[:, :, None] * self.blocks * scale[:, None, :]
        np.einsum("gii->gi", blocks)[:] = 1.0
        root = np.asarray(np.linalg.inv(_cholesky(blocks)), dtype=np.float64)
        return scale, of_all, root, root @ (scale[:, :, None] * self.border * of_all)

    @cached_property
    def _schur(self) -> tuple[FloatArray, bool]:
        """Factor of S, scaled."""
        _, of_all, _, border = self._factors
        left = of_all[:, None] * self.common * of_all - np.tensordot(border, border, ((0, 1), (0, 1)))
        try:
            return cho_factor(left, lower=True)
        except np.linalg.LinAlgError:  # parameters that no reading separates, at readings that no vehicle has
            return cho_factor(left + JITTER * np.eye(len(left)), lower=True)

    @cached_property
    def log_determinant(self) -> float:
        """Logarithm of the determinant."""
        scale, of_all, root, _ = self._factors
        diagonal = np.diagonal(root, axis1=1, axis2=2)
        sizes = [np.diag(self._schur[0]), 1.0 / of_all, 1.0 / diagonal, 1.0 / scale]
        return 2.0 * float(sum(np.sum(np.log(one)) for one in sizes))

    def solve(self, right: FloatArray) -> FloatArray:
        """Return A^-1 of ``right`` (k,)."""
        scale, of_all, root, border = self._factors
        own = np.zeros(scale.size)
        own[self.place] = right[self.of_gauges]
        inner = np.einsum("gij,gj->gi", root, scale * own.reshape(scale.shape))
        outer = of_all * right[self.of_all] - np.einsum("gic,gi->c", border, inner)
        found, common = np.zeros(len(right)), cho_solve(self._schur, outer)
        inner -= border @ common
        found[self.of_gauges] = (scale * np.einsum("gji,gj->gi", root, inner)).ravel()[self.place]
        found[self.of_all] = of_all * common
        return found

    @cached_property
    def _inverse(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """D^-1 (n_g, p, p), T (n_own, c) and S^-1 (c, c)."""
        scale, of_all, root, border = self._factors
        turned = scale[:, :, None] * root.transpose(0, 2, 1)
        slope = (turned @ border / of_all).reshape(scale.size, len(of_all))[self.place]
        common = of_all[:, None] * cho_solve(self._schur, np.diag(of_all))
        return turned @ turned.transpose(0, 2, 1), slope, common

    @property
    def inverse_diagonal(self) -> FloatArray:
        """(k,) of A^-1."""
        blocks, slope, common = self._inverse
        found = np.zeros(len(self.own))
        found[self.of_gauges] = np.diagonal(blocks, axis1=1, axis2=2).ravel()[self.place]
        found[self.of_gauges] += np.sum((slope @ common) * slope, axis=1)
        found[self.of_all] = np.diag(common)
        return found

    @property
    def inverse(self) -> FloatArray:
        """(k, k) A^-1."""
        _, slope, common = self._inverse
        found, of_gauges, of_all = np.zeros((len(self.own),) * 2), self.of_gauges, self.of_all
        beside = slope @ common
        found[np.ix_(of_all, of_all)] = common
        found[np.ix_(of_gauges, of_all)] = -beside
        found[np.ix_(of_all, of_gauges)] = -beside.T
        found[np.ix_(of_gauges, of_gauges)] = beside @ slope.T
        own = self._by_blocks(self._inverse[0]).tocoo()
        found[of_gauges[own.coords[0]], of_gauges[own.coords[1]]] += own.data
        return found

    def _by_blocks(self, blocks: FloatArray) -> csr_array:
        """Return (n_own, n_own) of ``blocks`` (n_g, p, p)."""
        n_g = len(self.blocks)
        every = bsr_array((blocks, np.arange(n_g), np.arange(n_g + 1)), shape=(n_g * blocks.shape[1],) * 2)
        return every.tocsr()[self.place][:, self.place]

    def halves(self, rows: csr_array) -> tuple[csr_array, FloatArray]:
        """Return G (m, n_own) and H (m, c) of rows R (m, k): R A^-1 R' = G G' + H H'."""
        scale, of_all, root, _ = self._factors
        own = rows[:, self.of_gauges]
        outer = rows[:, self.of_all].toarray()
        outer -= own @ self._inverse[1]
        outer *= of_all
        of_common = solve_triangular(self._schur[0], outer.T, lower=True, overwrite_b=True).T
        return (own @ self._by_blocks(scale[:, :, None] * root.transpose(0, 2, 1))).tocsr(), of_common


def _order_in_gauge(own: IntArray) -> IntArray:
    """Return (k,) the number of each row among the rows of its gauge."""
    order, found = np.argsort(own, kind="stable"), np.zeros(len(own), dtype=np.int64)
    in_order = own[order]
    found[order] = np.arange(len(own)) - np.searchsorted(in_order, in_order)
    return found


def _cholesky(blocks: FloatArray) -> FloatArray:
    try:
        return np.asarray(np.linalg.cholesky(blocks), dtype=np.float64)
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.cholesky(blocks + JITTER * np.eye(blocks.shape[1])), dtype=np.float64)


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
