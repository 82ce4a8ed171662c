"""Wind and stability axes against rotations written out, and deviations against draws."""

import numpy as np
import pytest
from scaled_maps import NOMINAL, whole_scaled_map

from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.estimator import Estimator

pytestmark = pytest.mark.fast

A, B = np.array([0.1, -0.05, 0.17]), np.array([0.03, 0.12, -0.08])


@pytest.fixture(scope="module")
def estimates() -> Estimate:
    inverse_map = whole_scaled_map(2, 3)
    strain = np.array([1.0, 1.2, 0.9])[:, None] * inverse_map.mean_strain
    return Estimator(inverse_map).estimate(strain, NOMINAL, dynamic_pressure_std=0.02 * NOMINAL)


def test_lift_and_drag_by_the_book(estimates: Estimate) -> None:
    wind, stability = estimates.in_wind_axes(A, B), estimates.in_stability_axes(A)
    ca, cn, cy = estimates.C_A, estimates.C_N, estimates.C_Y
    np.testing.assert_allclose(stability.C_L, cn * np.cos(A) - ca * np.sin(A), rtol=1e-13)
    np.testing.assert_allclose(stability.C_D, ca * np.cos(A) + cn * np.sin(A), rtol=1e-13)
    np.testing.assert_allclose(stability.C_S, cy, rtol=1e-13)
    np.testing.assert_allclose(wind.C_L, stability.C_L, rtol=1e-13)
    # Wind axes are stability axes turned by the sideslip angle; the wind comes from starboard at b > 0.
    np.testing.assert_allclose(wind.C_D, stability.C_D * np.cos(B) - cy * np.sin(B), rtol=1e-12)
    np.testing.assert_allclose(wind.C_S, stability.C_D * np.sin(B) + cy * np.cos(B), rtol=1e-12)


def test_without_angles_body_axes_are_kept(estimates: Estimate) -> None:
    found = estimates.in_wind_axes(0.0, 0.0)
    np.testing.assert_allclose(found.values, estimates.coefficients[:, [0, 2, 1]], rtol=1e-14)
    np.testing.assert_allclose(found.std, estimates.coefficients_std[:, [0, 2, 1]], rtol=1e-12)
    one = estimates[1]
    np.testing.assert_allclose(one.in_wind_axes(0.0, 0.0).std, found.std[1], rtol=1e-13)


def test_deviations_are_those_of_draws(estimates: Estimate) -> None:
    """40,000 draws of coefficients and angles: to 2 %."""
    rng, one, std = np.random.default_rng(1), estimates[0], 0.004
    found = one.in_wind_axes(A[0], B[0], std)
    root = np.linalg.cholesky(one.coefficient_covariance)
    n = 40_000
    c = one.coefficients + rng.standard_normal((n, 5)) @ root.T
    a, b = A[0] + std * rng.standard_normal(n), B[0] + std * rng.standard_normal(n)
    drag = c[:, 0] * np.cos(a) * np.cos(b) - c[:, 2] * np.sin(b) + c[:, 1] * np.sin(a) * np.cos(b)
    lift = c[:, 1] * np.cos(a) - c[:, 0] * np.sin(a)
    np.testing.assert_allclose([found.std[0], found.std[2]], [drag.std(), lift.std()], rtol=0.02)
