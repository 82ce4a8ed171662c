"""Sums in the order of their index: equal to numpy's to round-off."""

import numpy as np
import pytest

from strainfmu.estimator.numerics import householder, product, row_squares

pytestmark = pytest.mark.fast


def test_products_are_those_of_numpy() -> None:
    random = np.random.default_rng(3)
    a, b = random.normal(size=(7, 9)), random.normal(size=(9, 4))
    np.testing.assert_allclose(product(a, b), a @ b, rtol=0.0, atol=1e-13)


@pytest.mark.parametrize("shape", [(54, 59), (512, 600), (6, 0)])
def test_the_diagonal_alone_has_the_bits_of_the_product(shape: tuple[int, int]) -> None:
    a = np.random.default_rng(3).normal(size=shape)
    np.testing.assert_array_equal(row_squares(a), np.diag(product(a, a.T)))


@pytest.mark.parametrize("shape", [(7, 9), (9, 7), (5, 5)])
def test_triangles_have_the_products_of_their_matrix(shape: tuple[int, int]) -> None:
    """R' R = A' A, as Q is orthogonal; of matrices of less than full rank either."""
    whole = np.random.default_rng(3).normal(size=shape)
    lacking = whole.copy()
    lacking[:, 1] = lacking[:, 0]
    for matrix in (whole, lacking, np.zeros(shape)):
        r, _ = householder(matrix)
        np.testing.assert_array_equal(r, np.triu(r))
        np.testing.assert_allclose(r.T @ r, matrix.T @ matrix, rtol=0.0, atol=1e-13)
