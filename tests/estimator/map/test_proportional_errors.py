"""Errors at the current strain: at levels of the dynamic pressure, between levels, and against drawn errors."""

from dataclasses import replace

import numpy as np
import pytest
from scaled_maps import NOMINAL, scaled_map

from strainfmu.errors import InputError
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import chi_square_limit
from strainfmu.estimator.map.inverse_map import PAIRS, InverseMap

pytestmark = pytest.mark.fast

N = 18


def random_errors(size: float = 1.0) -> tuple[dict[str, np.ndarray], np.ndarray, np.ndarray]:
    """Return a map's fields of two errors of each gauge (2, 6, n_d) and two common ones (2, 6, n_d), and these."""
    random = np.random.default_rng(5)
    own, common = (size * random.standard_normal((2, 6, N)) for _ in range(2))
    of_gauge = np.array([(1.0 if a == b else 2.0) * np.sum(own[:, a] * own[:, b], axis=0) for a, b in PAIRS])
    c = np.hstack([np.ones((50, 1)), random.uniform(-0.3, 0.3, (50, 5))])
    mean = np.array([np.mean(c[:, a] * c[:, b]) for a, b in PAIRS])
    return {"gauge_error_product": of_gauge, "common_error": common, "mean_product": mean}, own, common


def map_with_errors() -> tuple[InverseMap, np.ndarray, np.ndarray]:
    """Return a map of Case 1 whose weights hold the errors at their mean, and these errors."""
    errors, own, common = random_errors(4e-6)
    return scaled_map(1, seed=2, n=N, errors=errors), own, common


@pytest.mark.parametrize("level", [0.25, 1.0, 2.0**1.5])
@pytest.mark.parametrize("spread", [0.0, 3.0])
def test_errors_drawn_at_the_current_strain_have_the_stated_covariance(level: float, spread: float) -> None:
    """20,000 flights of one state: normalised error squared 5 and chi-square at its limit's scale, within 5 %.

    At the mean state and at one far from it, where the errors are several times larger; with the covariance of the
    weights alone the second would be far off.
    """
    free, own, common = map_with_errors()
    random, n = np.random.default_rng(8), 20_000
    states = spread * random.standard_normal(free.state_operator.shape[1])
    q = level * NOMINAL
    scale = NOMINAL * free.reference_area * np.array([1.0, 1.0, 1.0, *2 * [free.reference_length]])
    c = np.concatenate([[1.0], (free.load_of_mean + free.load_per_state @ states) / scale])
    error = (random.standard_normal((n, 2, N)) * (c @ own)).sum(axis=1)
    error += random.standard_normal((n, 2)) @ (c @ common)
    others = random.standard_normal((n, N + 5))  # what does not follow the current strain
    error += others @ free.error_strain[:, : N + 5].T
    noise = random.standard_normal((n, N)) @ np.linalg.cholesky(free.gauge_covariance).T
    strain = level * (free.mean_strain + states @ free.state_operator.T + error) + noise
    truth = level * (free.load_of_mean + free.load_per_state @ states + others @ free.error_load[:, : N + 5].T)
    found = Estimator(free).estimate(strain, q, dynamic_pressure_std=0.0)
    deviation = found.loads - truth
    squared = np.einsum(
        "ki,ki->k", deviation, np.linalg.solve(found.load_covariance, deviation[:, :, None])[:, :, 0]
    )
    assert squared.mean() == pytest.approx(5.0, rel=0.05)
    assert np.mean(np.abs(deviation) < 3.0 * found.loads_std) == pytest.approx(0.9973, abs=2e-3)
    # The expected chi-square, in units of its degrees of freedom, is the scale of the limit.
    limit = free.chi_square_scale * chi_square_limit(found.degrees_of_freedom[0])
    scale_of_limit = found.chi_square_limit / limit
    ratio = found.chi_square / (found.degrees_of_freedom * scale_of_limit)
    assert ratio.mean() == pytest.approx(1.0, rel=0.05)


def test_between_levels_the_covariance_is_smooth() -> None:
    """Across a level it is continuous, and in the middle of two within 2 % of the one computed there."""
    inverse_map, _, _ = map_with_errors()
    estimator = Estimator(inverse_map)
    states = 2.0 * np.ones(inverse_map.state_operator.shape[1])

    def std_at(level: float) -> np.ndarray:
        strain = level * (inverse_map.mean_strain + states @ inverse_map.state_operator.T)
        return np.asarray(estimator.step(strain, level * NOMINAL, dynamic_pressure_std=0.0).loads_std) / level

    np.testing.assert_allclose(std_at(1.0 - 1e-9), std_at(1.0 + 1e-9), rtol=1e-6)
    middle = std_at(0.5 * (1.0 + np.sqrt(0.5)))
    assert np.all(middle < 1.02 * std_at(np.sqrt(0.5)))
    assert np.all(middle > 0.98 * std_at(1.0))


@pytest.mark.parametrize("spread", [0.0, 3.0])
def test_levels_rise_with_the_expected_chi_square_by_more(spread: float) -> None:
    """With a slope of 0.4 both levels are r (0.6 + 0.4 r) times those at the mean strain, instead of r."""
    plain, _, _ = map_with_errors()
    random, states = np.random.default_rng(3), plain.state_operator.shape[1]
    strain = plain.mean_strain + spread * random.standard_normal((20, states)) @ plain.state_operator.T
    before, after = (Estimator(one).estimate(strain, NOMINAL) for one in (plain, replace(plain, level_slope=0.4)))
    at_mean = plain.chi_square_scale * chi_square_limit(plain.residual_degrees_of_freedom)
    ratio = np.asarray(before.chi_square_limit) / at_mean
    assert ratio.max() > 1.2 if spread else ratio.max() < 1.0
    rise = 0.6 + 0.4 * ratio
    np.testing.assert_allclose(after.chi_square_limit, at_mean * ratio * rise, rtol=1e-12)
    np.testing.assert_allclose(after.residual_limit / before.residual_limit, np.sqrt(rise), rtol=1e-12)
    np.testing.assert_array_equal(after.coefficients, before.coefficients)


def test_a_slope_beyond_one_is_refused() -> None:
    with pytest.raises(InputError, match=r"level_slope is 1\.5, must be 0 to 1"):
        replace(map_with_errors()[0], level_slope=1.5)
