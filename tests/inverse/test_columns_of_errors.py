"""Columns of errors in common: as few as their rank, whatever the number of gauges."""

import numpy as np
import pytest

from builder.inverse.build import fewest_columns

pytestmark = pytest.mark.fast


@pytest.mark.parametrize("n_gauges", [20, 200])
def test_columns_are_as_few_as_their_rank(n_gauges: int) -> None:
    """Forty columns of rank 7, one of a load without strain: 8 of the same covariance, to 1e-12 of the noise."""
    random = np.random.default_rng(1)
    variance = 1e-14 * random.uniform(0.5, 2.0, n_gauges)
    columns = random.normal(size=(n_gauges + 5, 7)) @ random.normal(size=(7, 40))
    columns[:n_gauges] *= 1e-6
    alone = np.zeros((n_gauges + 5, 1))
    alone[-1] = 3.0
    columns = np.hstack([columns, alone])
    found = fewest_columns([columns[:, :30], columns[:, 30:]], variance)
    assert found.shape == (n_gauges + 5, 8)
    size = np.linalg.norm(columns, axis=1)
    np.testing.assert_allclose(
        found @ found.T / np.outer(size, size), columns @ columns.T / np.outer(size, size), atol=1e-12
    )


def test_what_is_below_the_noise_by_far_has_no_column() -> None:
    """A column of 1e-8 of the noise in all is left out, one of 1e-6 stays."""
    variance, unit = np.full(4, 1e-14), np.full(4, 0.5)
    columns = np.zeros((9, 2))
    columns[:4, 0], columns[:4, 1] = 1e-15 * unit, 1e-13 * np.array([0.5, -0.5, 0.5, -0.5])
    assert fewest_columns([columns], variance).shape == (9, 1)
