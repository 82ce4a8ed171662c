"""Matrices of an arrow's shape are what dense ones of the same rows are; work goes with the number of gauges."""

import numpy as np
import pytest
from scipy.sparse import csr_array

from builder.calibration.estimate.gaussian import Arrow, GaussianModel

N_G, N_C = 5, 9

pytestmark = pytest.mark.fast


@pytest.fixture
def model() -> GaussianModel:
    """Gauges of three parameters, some of two, and four of all readings; a zero is hardly known."""
    random = np.random.default_rng(0)
    own = np.array([0, 1, -1, 2, 3, 4, -1, 4, 3, 2, 1, 0, -1, 0, 1, 2, 3, -1])
    gauge = np.tile(np.arange(N_G), N_C)
    rows = random.standard_normal((len(gauge), len(own))) * ((own < 0) | (own == gauge[:, None]))
    rows[:, 0] = 4e4 * (gauge == 0)
    return GaussianModel(csr_array(rows), random.standard_normal(len(gauge)), own)


def test_an_arrow_is_the_dense_matrix(model: GaussianModel) -> None:
    rows = model.rows.toarray()
    dense = np.eye(rows.shape[1]) + rows.T @ rows
    arrow = model.precision
    np.testing.assert_allclose(arrow.diagonal, np.diag(dense), rtol=1e-14)
    inverse = np.linalg.inv(dense)
    np.testing.assert_allclose(arrow.inverse, inverse, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(arrow.inverse_diagonal, np.diag(inverse), rtol=1e-9)
    assert arrow.log_determinant == pytest.approx(np.linalg.slogdet(dense)[1], rel=1e-12)
    own, common = arrow.halves(model.rows)
    np.testing.assert_allclose(
        (own @ own.T).toarray() + common @ common.T, rows @ inverse @ rows.T, rtol=1e-9, atol=1e-12
    )
    damped = model.precision_at(noise=2.0, damping=0.5)
    right, of_noise = rows.T @ model.misfit, np.eye(rows.shape[1]) + rows.T @ rows / 4.0
    expected = np.linalg.solve(of_noise + 0.5 * np.diag(np.diag(of_noise)), right)
    np.testing.assert_allclose(damped.solve(right), expected, rtol=1e-9, atol=1e-13)


def test_a_gaussian_model_is_least_squares_with_a_prior(model: GaussianModel) -> None:
    """By orthogonal factors of readings and prior together, which square no condition number."""
    k = model.rows.shape[1]
    stacked, left = np.vstack([model.rows.toarray(), np.eye(k)]), np.append(model.misfit, np.zeros(k))
    mean = np.linalg.lstsq(stacked, left)[0]
    np.testing.assert_allclose(model.mean, mean, rtol=1e-9, atol=1e-13)
    factor, rest = np.linalg.qr(stacked)[1], left - stacked @ mean
    density = -0.5 * float(rest @ rest) - float(np.sum(np.log(np.abs(np.diag(factor)))))
    assert model.density() == pytest.approx(density, rel=1e-9)


@pytest.mark.parametrize("own", [np.full(3, -1), np.array([0, 1, 1])])
def test_an_arrow_may_lack_its_shaft_or_its_head(own: np.ndarray) -> None:
    rows = np.array([[1.0, 0.0, 0.0], [0.0, 2.0, 1.0], [0.0, 0.0, 3.0]])
    arrow = Arrow.of_rows(csr_array(rows), own)
    np.testing.assert_allclose(arrow.inverse, np.linalg.inv(rows.T @ rows), atol=1e-14)
    np.testing.assert_allclose(arrow.solve(np.ones(3)), np.linalg.solve(rows.T @ rows, np.ones(3)), atol=1e-14)
