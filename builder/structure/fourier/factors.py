"""Factors of a banded stiffness, solved for many right hand sides at once.

A harmonic's mesh is long and thin, so that its stiffness is a narrow band, which LAPACK factors in a third of the
time of a general sparse solver. LAPACK would solve for one right hand side after another; here each entry of the
factor is read once for a block of them, and the zeros within the band are left out.

Source: Golub and Van Loan, Matrix Computations (4th ed.), section 4.3.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg import cholesky_banded
from scipy.sparse import csc_array
from scipy.sparse.csgraph import reverse_cuthill_mckee

from builder.compiled import compiled, inlined
from strainfmu.arrays import FloatArray, IntArray

BLOCK = 64
"""Right hand sides that are solved for together: more no longer fit into the processor's cache."""

WIDE = 100
"""Width of a band from which the unknowns are renumbered; a wall of one shell is narrower."""


class Lines(NamedTuple):
    """Rows or columns of a triangular matrix (n, n), without its diagonal and without zeros.

    Attributes
    ----------
    start : (n + 1,) where each line begins.
    place, entry : (n_nonzero,) of each entry its column in a row, or its row in a column, and its value.
    """

    start: IntArray
    place: IntArray
    entry: FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class Factors:
    """Cholesky factor L of a symmetric, definite matrix (n, n) whose unknowns are in the order ``order`` (n,).

    Attributes
    ----------
    rows, columns : of L.
    inverse : (n,) one over the diagonal of L.
    order : (n,) the unknown of the matrix that each of the factor's is.
    """

    rows: Lines
    columns: Lines
    inverse: FloatArray
    order: IntArray

    def solve(self, sides: FloatArray, dof: IntArray | None = None) -> FloatArray:
        """Return the solutions (k, n_dof) of right hand sides (k, n_dof).

        ``dof`` (n,) are the unknowns among them, all by default; the others are zero.
        """
        place = self.order if dof is None else dof[self.order]
        answer, sides = np.zeros(sides.shape), np.ascontiguousarray(sides)
        for first in range(0, len(sides), BLOCK):
            block = slice(first, first + BLOCK)
            by_unknown = np.empty((len(place), len(sides[block])))
            _gather(sides[block], place, by_unknown)
            _substitute(self.rows, self.columns, self.inverse, by_unknown)
            _scatter(by_unknown, place, answer[block])
        return answer


def factored(matrix: csc_array) -> Factors:
    """Factor a symmetric, definite ``matrix`` (n, n).

    Raises
    ------
    numpy.linalg.LinAlgError
        It is not definite.
    """
    order = np.arange(matrix.shape[0])
    width = _width(matrix, order)
    if width > WIDE:
        order = reverse_cuthill_mckee(matrix.tocsr(), symmetric_mode=True).astype(np.int64)
        width = _width(matrix, order)
    band = np.zeros((len(order), width + 1))
    _fill(matrix.indptr, matrix.indices, matrix.data, np.argsort(order), band)
    band = cholesky_banded(band.T, overwrite_ab=True, lower=True, check_finite=False).T
    rows, columns = (_empty_lines(len(band), int(np.count_nonzero(band)) - len(band)) for _ in range(2))
    _set_rows(band, rows)
    _set_columns(band, columns)
    return Factors(rows=rows, columns=columns, inverse=1.0 / band[:, 0], order=order)


def _width(matrix: csc_array, order: IntArray) -> int:
    """Return how far an entry is from the diagonal, at most, with the unknowns in ``order``."""
    place = np.argsort(order)
    column = np.repeat(place, np.diff(matrix.indptr))
    return int(np.abs(place[matrix.indices] - column).max(initial=0))


@compiled
def _fill(start: IntArray, row: IntArray, entry: FloatArray, place: IntArray, band: FloatArray) -> None:
    """Set ``band`` (n, w + 1) to the columns of a matrix from the diagonal down, unknowns at ``place`` (n,)."""
    for column in range(len(place)):
        for at in range(start[column], start[column + 1]):
            below = place[row[at]] - place[column]
            if below >= 0:
                band[place[column], below] = entry[at]


def _empty_lines(n: int, n_nonzero: int) -> Lines:
    return Lines(
        start=np.zeros(n + 1, dtype=np.int64),
        place=np.empty(n_nonzero, dtype=np.int64),
        entry=np.empty(n_nonzero),
    )


@compiled
def _set_columns(band: FloatArray, lines: Lines) -> None:
    """Set ``lines`` to the columns of a factor, which ``band`` (n, w + 1) holds from the diagonal down."""
    entry = 0
    for column in range(band.shape[0]):
        for below in range(1, band.shape[1]):
            if band[column, below] != 0.0:
                lines.place[entry], lines.entry[entry] = column + below, band[column, below]
                entry += 1
        lines.start[column + 1] = entry


@compiled
def _set_rows(band: FloatArray, lines: Lines) -> None:
    """Set ``lines`` to the rows of a factor, whose columns ``band`` (n, w + 1) holds from the diagonal down."""
    entry = 0
    for row in range(band.shape[0]):
        for column in range(max(row - band.shape[1] + 1, 0), row):
            if band[column, row - column] != 0.0:
                lines.place[entry], lines.entry[entry] = column, band[column, row - column]
                entry += 1
        lines.start[row + 1] = entry


@compiled
def _gather(sides: FloatArray, place: IntArray, gathered: FloatArray) -> None:
    """Set ``gathered`` (n, k) to the entries ``place`` (n,) of ``sides`` (k, n_dof)."""
    n, k = gathered.shape
    for i in range(n):
        for c in range(k):
            gathered[i, c] = sides[c, place[i]]


@compiled
def _scatter(solution: FloatArray, place: IntArray, scattered: FloatArray) -> None:
    """Set the entries ``place`` (n,) of ``scattered`` (k, n_dof) to ``solution`` (n, k)."""
    n, k = solution.shape
    for i in range(n):
        for c in range(k):
            scattered[c, place[i]] = solution[i, c]


@compiled
def _substitute(rows: Lines, columns: Lines, inverse: FloatArray, side: FloatArray) -> None:
    """Replace ``side`` (n, k) by the solutions: forward by the rows of L, then backward by its columns."""
    n, k = side.shape
    for i in range(n):
        _subtract(rows, i, side)
        for c in range(k):
            side[i, c] *= inverse[i]
    for i in range(n - 1, -1, -1):
        _subtract(columns, i, side)
        for c in range(k):
            side[i, c] *= inverse[i]


@inlined
def _subtract(lines: Lines, i: int, side: FloatArray) -> None:
    """Subtract from row ``i`` of ``side`` (n, k) what line ``i`` makes of other rows."""
    place, entry, index, end = lines.place, lines.entry, lines.start[i], lines.start[i + 1]
    while index + 4 <= end:  # four at once: the row is read and written a fourth as often
        first, second, third, fourth = place[index], place[index + 1], place[index + 2], place[index + 3]
        a_1, a_2, a_3, a_4 = entry[index], entry[index + 1], entry[index + 2], entry[index + 3]
        for c in range(side.shape[1]):
            part = a_1 * side[first, c] + a_2 * side[second, c] + a_3 * side[third, c] + a_4 * side[fourth, c]
            side[i, c] -= part
        index += 4
    while index < end:
        for c in range(side.shape[1]):
            side[i, c] -= entry[index] * side[place[index], c]
        index += 1
