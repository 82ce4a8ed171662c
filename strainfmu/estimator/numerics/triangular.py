"""Forward substitution of many small triangular systems at once."""

from __future__ import annotations

import numpy as np

from strainfmu.arrays import FloatArray

MANY = 24
"""Systems from which substitution over all of them at once is faster than a solver for each."""


def forward_substituted(factor: FloatArray, right: FloatArray) -> FloatArray:
    """Return L^-1 B (k, n, m) of lower triangular ``factor`` (k, n, n), or one for all, and ``right`` (k, n, m).

    numpy has no triangular solver: its general one decomposes L again, at four times the cost of this one.
    """
    if len(factor) == 1 < len(right):
        k, n, m = right.shape
        columns = np.linalg.solve(factor[0], np.ascontiguousarray(right.transpose(1, 0, 2)).reshape(n, k * m))
        return np.asarray(columns.reshape(n, k, m).transpose(1, 0, 2))
    if len(factor) < MANY:
        return np.asarray(np.linalg.solve(factor, right))
    rows, found = np.ascontiguousarray(factor.transpose(1, 2, 0)), np.ascontiguousarray(right.transpose(1, 2, 0))
    for i in range(len(rows)):
        if i:
            found[i] -= np.einsum("jk,jmk->mk", rows[i, :i], found[:i])
        found[i] /= rows[i, i]
    return np.asarray(found.transpose(2, 0, 1))
