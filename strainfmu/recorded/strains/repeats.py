"""Readings that repeat the row before them: how often in a row, over blocks of samples."""

from __future__ import annotations

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray, IntArray


def repeated(strain: FloatArray, last: FloatArray) -> BoolArray:
    """Return (n, n_d) which of ``strain`` (n, n_d) repeat the row before, ``last`` (n_d,) before the first.

    They are equal to the last bit, or no values both.
    """
    same = np.empty(strain.shape, dtype=bool)
    np.equal(strain[1:], strain[:-1], out=same[1:])
    np.equal(strain[0], last, out=same[0])
    without = np.isnan(strain)
    if without.any():
        same[1:] |= without[1:] & without[:-1]
        same[0] |= without[0] & np.isnan(last)
    return same


class RunLengths:
    """Lengths of runs of repetitions in ``n`` columns, block by block."""

    def __init__(self, n: int) -> None:
        self._carried = np.zeros(n, dtype=np.int64)

    def skip(self, same: BoolArray) -> None:
        """Go on behind a block of which no lengths are asked; ``same`` (k, n) as of :meth:`take`."""
        since = np.argmin(same[::-1], axis=0)
        self._carried = np.where(same.all(axis=0), self._carried + len(same), since)

    def take(self, same: BoolArray, following: BoolArray) -> IntArray:
        """Return (k, n) how many repetitions there are in the run to which each row of a block belongs.

        Parameters
        ----------
        same : (k, n) whether the rows of the block repeat the row before.
        following : (m, n) the same of rows of the next block, as far as runs are followed into it.
        """
        both, k = np.vstack([same, following]), len(same)
        row = np.arange(len(both))[:, None]
        begin = np.maximum.accumulate(np.where(both, -1, row), axis=0)
        so_far = np.where(begin >= 0, row - begin, self._carried + row + 1)
        is_end = np.vstack([~both[1:], np.ones_like(both[:1])])
        end = np.minimum.accumulate(np.where(is_end, row, len(both))[::-1], axis=0)[::-1]
        self._carried = so_far[k - 1]
        return np.asarray(np.take_along_axis(so_far, end, axis=0)[:k])
