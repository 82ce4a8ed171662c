"""Factors for many right hand sides, against scipy's own solution."""

import numpy as np
import pytest
from scipy.sparse import csc_array, diags_array, eye_array
from scipy.sparse.linalg import spsolve

from builder.structure.fourier.factors import BLOCK, factored

pytestmark = pytest.mark.fast


def stiffness(n: int) -> csc_array:
    """Return a symmetric, definite matrix (n, n) with a few entries in each row."""
    random = np.random.default_rng(1)
    row, column = random.integers(0, n, (2, 4 * n))
    spread = csc_array((random.standard_normal(4 * n), (row, column)), shape=(n, n))
    return csc_array(spread @ spread.T + csc_array((np.full(n, 5.0), (range(n), range(n)))))


def band(n: int, width: int) -> csc_array:
    """Return a symmetric, definite matrix (n, n) that is a band, with gaps in it."""
    random, offsets = np.random.default_rng(6), [k for k in {1, 2, width} if k < n]
    parts = [random.uniform(-1.0, 1.0, n - k) for k in offsets]
    found = 8.0 * eye_array(n)
    for k, part in zip(offsets, parts, strict=True):
        found = found + diags_array(part, offsets=k, shape=(n, n)) + diags_array(part, offsets=-k, shape=(n, n))
    return csc_array(found)


@pytest.mark.parametrize("count", [1, 3, BLOCK, 2 * BLOCK + 5])
@pytest.mark.parametrize("matrix", [stiffness(200), band(200, 17), band(1, 1), band(260, 250)])
def test_solutions_are_those_of_scipy(matrix: csc_array, count: int) -> None:
    n = matrix.shape[0]
    sides = np.random.default_rng(2).standard_normal((count, n))
    expected = spsolve(matrix, sides.T).reshape(n, count).T
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


def test_a_matrix_that_is_not_definite_is_refused() -> None:
    with pytest.raises(np.linalg.LinAlgError):
        factored(csc_array(band(50, 3) - 20.0 * eye_array(50)))
