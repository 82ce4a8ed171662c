"""A linear model with normal parameters and noise, all of standard deviation 1.

    misfit = rows theta + noise,  S = 1 + rows rows',  C = (1 + rows' rows)^-1,  S^-1 = 1 - rows C rows'.

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

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular
from scipy.sparse import bsr_array, csr_array

from strainfmu.arrays import FloatArray, IntArray

ROWS = 4096
"""Rows of a product in memory at once."""

JITTER = 1e-9
"""Added to the diagonal of 1 where rounding makes a matrix indefinite."""


class Arrow:
    """The matrix by its blocks, (n_g, p, p), (n_g, p, c) and (c, c); rows of blocks that are not full are zero.

    ``gauge_of`` (k,) is the gauge of each row of the matrix, -1 of a common parameter.
    """

    def __init__(self, gauge_of: IntArray, blocks: FloatArray, border: FloatArray, common: FloatArray) -> None:
        self.gauge_of, self.blocks, self.border, self.common = gauge_of, blocks, border, common
        self.of_gauges, self.of_all = np.flatnonzero(gauge_of >= 0), np.flatnonzero(gauge_of < 0)
        self.place = gauge_of[self.of_gauges] * blocks.shape[1] + _order_in_gauge(gauge_of)[self.of_gauges]

    @classmethod
    def of_rows(cls, rows: csr_array, gauge_of: IntArray) -> Arrow:
        """Return rows' rows of ``rows`` (n, k)."""
        slot, is_own = _order_in_gauge(gauge_of), gauge_of >= 0
        size, n_c = int(slot.max(initial=0, where=is_own)) + 1, int(np.sum(~is_own))
        blocks = np.zeros((int(gauge_of.max(initial=0)) + 1, size, size))
        border, common = np.zeros((len(blocks), size, n_c)), np.zeros((n_c, n_c))
        product = (rows.T @ rows).tocoo()
        (row, column), value = product.coords, product.data
        in_gauge, in_border, in_common = (
            is_own[row] & is_own[column],
            is_own[row] & ~is_own[column],
            ~(is_own[row] | is_own[column]),
        )
        blocks[gauge_of[row[in_gauge]], slot[row[in_gauge]], slot[column[in_gauge]]] = value[in_gauge]
        border[gauge_of[row[in_border]], slot[row[in_border]], slot[column[in_border]]] = value[in_border]
        common[slot[row[in_common]], slot[column[in_common]]] = value[in_common]
        return cls(gauge_of, blocks, border, common)

    @property
    def diagonal(self) -> FloatArray:
        """Diagonal of the matrix (k,)."""
        values = np.zeros(len(self.gauge_of))
        values[self.of_gauges] = np.diagonal(self.blocks, axis1=1, axis2=2).ravel()[self.place]
        values[self.of_all] = np.diag(self.common)
        return values

    def changed(self, factor: float, added: FloatArray) -> Arrow:
        """Return ``factor`` times the matrix with ``added`` (k,) on its diagonal."""
        blocks, common = factor * self.blocks, factor * self.common
        diagonal = np.zeros(self.blocks[..., 0].size)
        diagonal[self.place] = added[self.of_gauges]
        np.einsum("gii->gi", blocks)[:] += diagonal.reshape(len(blocks), -1)
        np.einsum("ii->i", common)[:] += added[self.of_all]
        return Arrow(self.gauge_of, blocks, factor * self.border, common)

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
        schur = of_all[:, None] * self.common * of_all - np.tensordot(border, border, ((0, 1), (0, 1)))
        try:
            return cho_factor(schur, lower=True)
        except np.linalg.LinAlgError:  # parameters that no reading separates, at readings that no vehicle has
            return cho_factor(schur + JITTER * np.eye(len(schur)), lower=True)

    @cached_property
    def log_determinant(self) -> float:
        """Logarithm of the determinant."""
        scale, of_all, root, _ = self._factors
        diagonal = np.diagonal(root, axis1=1, axis2=2)
        sizes = [np.diag(self._schur[0]), 1.0 / of_all, 1.0 / diagonal, 1.0 / scale]
        return 2.0 * float(sum(np.sum(np.log(size)) for size in sizes))

    def solve(self, right: FloatArray) -> FloatArray:
        """Return A^-1 of ``right`` (k,)."""
        scale, of_all, root, border = self._factors
        single = np.zeros(scale.size)
        single[self.place] = right[self.of_gauges]
        inner = np.einsum("gij,gj->gi", root, scale * single.reshape(scale.shape))
        outer = of_all * right[self.of_all] - np.einsum("gic,gi->c", border, inner)
        solution, common = np.zeros(len(right)), cho_solve(self._schur, outer)
        inner -= border @ common
        solution[self.of_gauges] = (scale * np.einsum("gji,gj->gi", root, inner)).ravel()[self.place]
        solution[self.of_all] = of_all * common
        return solution

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
        diagonal = np.zeros(len(self.gauge_of))
        diagonal[self.of_gauges] = np.diagonal(blocks, axis1=1, axis2=2).ravel()[self.place]
        diagonal[self.of_gauges] += np.sum((slope @ common) * slope, axis=1)
        diagonal[self.of_all] = np.diag(common)
        return diagonal

    @property
    def inverse(self) -> FloatArray:
        """(k, k) A^-1."""
        _, slope, common = self._inverse
        inverse, of_gauges, of_all = np.zeros((len(self.gauge_of),) * 2), self.of_gauges, self.of_all
        off_diagonal = slope @ common
        inverse[np.ix_(of_all, of_all)] = common
        inverse[np.ix_(of_gauges, of_all)] = -off_diagonal
        inverse[np.ix_(of_all, of_gauges)] = -off_diagonal.T
        inverse[np.ix_(of_gauges, of_gauges)] = off_diagonal @ slope.T
        entries = self._by_blocks(self._inverse[0]).tocoo()
        inverse[of_gauges[entries.coords[0]], of_gauges[entries.coords[1]]] += entries.data
        return inverse

    def _by_blocks(self, blocks: FloatArray) -> csr_array:
        """Return (n_own, n_own) of ``blocks`` (n_g, p, p)."""
        n_g = len(self.blocks)
        every = bsr_array((blocks, np.arange(n_g), np.arange(n_g + 1)), shape=(n_g * blocks.shape[1],) * 2)
        return every.tocsr()[self.place][:, self.place]

    def halves(self, rows: csr_array) -> tuple[csr_array, FloatArray]:
        """Return G (m, n_own) and H (m, c) of rows R (m, k): R A^-1 R' = G G' + H H'."""
        scale, of_all, root, _ = self._factors
        single = rows[:, self.of_gauges]
        outer = rows[:, self.of_all].toarray()
        for first in range(0, len(outer), ROWS):
            outer[first : first + ROWS] -= single[first : first + ROWS] @ self._inverse[1]
        outer *= of_all
        of_common = solve_triangular(self._schur[0], outer.T, lower=True, overwrite_b=True).T
        return (single @ self._by_blocks(scale[:, :, None] * root.transpose(0, 2, 1))).tocsr(), of_common


def _order_in_gauge(gauge_of: IntArray) -> IntArray:
    """Return (k,) the number of each row among the rows of its gauge."""
    order, place = np.argsort(gauge_of, kind="stable"), np.zeros(len(gauge_of), dtype=np.int64)
    in_order = gauge_of[order]
    place[order] = np.arange(len(gauge_of)) - np.searchsorted(in_order, in_order)
    return place


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
    misfit : (n,) readings less what they are at theta = 0.
    gauge_of : (k,) the gauge whose readings alone depend on a parameter, -1 of others.
    """

    rows: csr_array
    misfit: FloatArray
    gauge_of: IntArray

    @cached_property
    def information(self) -> Arrow:
        """(k, k) rows' rows."""
        return Arrow.of_rows(self.rows, self.gauge_of)

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
        return self.precision.solve(self.rows.T @ self.misfit)

    @cached_property
    def covariance(self) -> FloatArray:
        """(k, k) of the parameters."""
        return self.precision.inverse

    @cached_property
    def std(self) -> FloatArray:
        """(k,) of the parameters."""
        return np.sqrt(self.precision.inverse_diagonal)

    def density(self, noise: float = 1.0) -> float:
        """Return the logarithm of the density of ``misfit`` but for a constant, where noise has the standard
        deviation ``noise``."""
        precision = self.precision if noise == 1.0 else self.precision_at(noise)
        mean = precision.solve(self.rows.T @ self.misfit) / noise**2
        rest = self.misfit - self.rows @ mean
        size = 0.5 * precision.log_determinant + len(rest) * np.log(noise)
        return float(-size - 0.5 * (rest @ rest / noise**2 + mean @ mean))

    @cached_property
    def weighted(self) -> FloatArray:
        """(n,) S^-1 misfit."""
        return np.asarray(self.misfit - self.rows @ self.mean)

    @cached_property
    def _halves(self) -> tuple[csr_array, FloatArray]:
        """G (n, n_own) and H (n, c): S^-1 = 1 - G G' - H H'."""
        return self.precision.halves(self.rows)

    def precision_of(self, numbers: IntArray) -> FloatArray:
        """Return the part of S^-1 of the rows ``at``."""
        single, common = self._halves[0][numbers], self._halves[1][numbers]
        return np.eye(len(numbers)) - (single @ single.T).toarray() - common @ common.T

    def without(self, numbers: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return what the rows ``at`` differ by from the prediction by all others, and the covariance of that."""
        covariance = np.asarray(np.linalg.inv(self.precision_of(numbers)), dtype=np.float64)
        return covariance @ self.weighted[numbers], covariance

    def terms(self, columns: csr_array, parts: Sequence[slice]) -> list[tuple[FloatArray, FloatArray]]:
        """Return C' S^-1 misfit (m,) and C' S^-1 C (m, m) of further columns C (n, m), for each of ``parts`` of
        ``columns``."""
        across = columns.T.tocsr()
        single, common, linear = across @ self._halves[0], across @ self._halves[1], across @ self.weighted
        terms = []
        for part in parts:
            row, by_single = across[part], single[part]
            square = (row @ row.T - by_single @ by_single.T).toarray() - common[part] @ common[part].T
            terms.append((linear[part], np.asarray(square)))
        return terms
