"""Factors for many right hand sides, against scipy's own solution."""

import numpy as np
import pytest
from scipy.sparse import csc_array
from scipy.sparse.linalg import spsolve

from builder.structure.fourier.factors import BLOCK, factored

pytestmark = pytest.mark.fast


def stiffness(n: int) -> csc_array:
    """Return a symmetric, definite matrix (n, n) with a few entries in each row."""
    random = np.random.default_rng(1)
    row, column = random.integers(0, n, (2, 4 * n))
    spread = csc_array((random.standard_normal(4 * n), (row, column)), shape=(n, n))
    return csc_array(spread @ spread.T + csc_array((np.full(n, 5.0), (range(n), range(n)))))


@pytest.mark.parametrize("count", [1, 3, BLOCK, 2 * BLOCK + 5])
def test_solutions_are_those_of_scipy(count: int) -> None:
    matrix = stiffness(200)
    sides = np.random.default_rng(2).standard_normal((count, 200))
    expected = spsolve(matrix, sides.T).reshape(200, count).T
    np.testing.assert_allclose(factored(matrix).solve(sides), expected, rtol=1e-9, atol=1e-12)


def test_some_unknowns_among_others() -> None:
    """Right hand sides of more unknowns than the matrix has: the others stay zero."""
    matrix, dof = stiffness(150), np.sort(np.random.default_rng(3).choice(400, 150, replace=False))
    sides = np.random.default_rng(4).standard_normal((7, 400))
    found = factored(matrix).solve(sides, dof)
    np.testing.assert_allclose(found[:, dof], spsolve(matrix, sides[:, dof].T).T, rtol=1e-9, atol=1e-12)
    assert not np.delete(found, dof, axis=1).any()


def test_right_hand_sides_may_lie_in_memory_by_column() -> None:
    matrix, sides = stiffness(60), np.random.default_rng(5).standard_normal((60, 4))
    np.testing.assert_array_equal(factored(matrix).solve(sides.T), factored(matrix).solve(sides.T.copy()))
