"""The proper orthogonal decomposition of the snapshots."""

import numpy as np
import pytest

from builder.aero.surface.mesh import mesh_of_grid
from builder.campaign.snapshots import Snapshots
from builder.inverse.solution import area_weights
from builder.structure.fourier.fourier_model import StructuralModel
from strainfmu.errors import InputError
from strainfmu.linear.pressure_modes import proper_orthogonal_decomposition

pytestmark = pytest.mark.fast


def test_modes_are_orthonormal(snapshots: Snapshots) -> None:
    v = proper_orthogonal_decomposition(snapshots.pressure).modes
    np.testing.assert_allclose(v.T @ v, np.eye(v.shape[1]), atol=1e-12)


def test_all_modes_reconstruct_the_snapshots(snapshots: Snapshots) -> None:
    """mean + V V^T (p - mean) = p to 1e-9 of the largest pressure, the size of the modes left out."""
    modes = proper_orthogonal_decomposition(snapshots.pressure)
    centred = snapshots.pressure - modes.mean
    np.testing.assert_allclose(
        modes.mean + centred @ modes.modes @ modes.modes.T,
        snapshots.pressure,
        atol=1e-9 * snapshots.pressure.max(),
        rtol=0.0,
    )


@pytest.mark.parametrize("r", [1, 5, 20])
def test_error_of_r_modes_is_the_energy_left_out(r: int, snapshots: Snapshots) -> None:
    """Eckart-Young: the squared error of r modes is the sum of the other squared singular values."""
    modes = proper_orthogonal_decomposition(snapshots.pressure)
    centred = snapshots.pressure - modes.mean
    kept = modes.modes[:, :r]
    left = np.linalg.norm(centred - centred @ kept @ kept.T) ** 2
    assert left == pytest.approx(np.sum(modes.singular_values[r:] ** 2), rel=1e-9)
    assert modes.energy[r - 1] == pytest.approx(1.0 - left / np.linalg.norm(centred) ** 2, rel=1e-12)


def test_five_modes_hold_99_percent(snapshots: Snapshots) -> None:
    """The published energy of five modes over the same conditions."""
    energy = proper_orthogonal_decomposition(snapshots.pressure).energy
    assert energy[4] > 0.99
    assert np.all(np.diff(energy) >= 0.0)
    assert energy[-1] == pytest.approx(1.0, abs=1e-14)


def test_coefficients_have_the_stated_spread(snapshots: Snapshots) -> None:
    modes = proper_orthogonal_decomposition(snapshots.pressure)
    coefficients = (snapshots.pressure - modes.mean) @ modes.modes
    np.testing.assert_allclose(coefficients.std(axis=0, ddof=1)[:40], modes.coefficient_std[:40], rtol=1e-8)
    covariance = np.cov(coefficients[:, :10].T)
    np.testing.assert_allclose(covariance, np.diag(np.diag(covariance)), atol=1e-9 * covariance[0, 0])


def test_input_is_left_alone_and_the_signs_repeat(snapshots: Snapshots) -> None:
    before = snapshots.pressure.copy()
    modes = proper_orthogonal_decomposition(snapshots.pressure)
    np.testing.assert_array_equal(snapshots.pressure, before)
    largest = modes.modes[np.abs(modes.modes).argmax(axis=0), np.arange(modes.modes.shape[1])]
    assert np.all(largest > 0.0)
    reordered = proper_orthogonal_decomposition(snapshots.pressure[::-1])
    np.testing.assert_allclose(reordered.modes[:, :5], modes.modes[:, :5], atol=1e-9)


def test_round_off_is_no_mode() -> None:
    """Three snapshots on a line through space: one mode."""
    line = np.outer([1.0, 2.0, 4.0], np.arange(1.0, 9.0)) + 3.0
    assert proper_orthogonal_decomposition(line).modes.shape == (8, 1)


def test_too_few_or_equal_snapshots_are_refused() -> None:
    with pytest.raises(InputError, match="1 snapshot found, at least 2"):
        proper_orthogonal_decomposition(np.ones((1, 4)))
    with pytest.raises(InputError, match="all equal"):
        proper_orthogonal_decomposition(np.full((5, 4), 5474.9))


@pytest.fixture(scope="module")
def weights(structure: StructuralModel) -> np.ndarray:
    return area_weights(mesh_of_grid(structure.surface).node_area)


def test_weighted_modes_are_orthonormal_in_area(snapshots: Snapshots, weights: np.ndarray) -> None:
    """V^T W V = I and all modes reconstruct; the energy is that of |p|^2 over the area."""
    modes = proper_orthogonal_decomposition(snapshots.pressure, weights)
    gram = modes.modes.T @ (weights[:, None] * modes.modes)
    np.testing.assert_allclose(gram, np.eye(len(gram)), atol=1e-11)
    np.testing.assert_allclose(
        modes.mean + modes.coefficients(snapshots.pressure) @ modes.modes.T,
        snapshots.pressure,
        rtol=0.0,
        atol=1e-8 * snapshots.pressure.max(),
    )
    energy = np.sum(weights * (snapshots.pressure - modes.mean) ** 2)
    assert np.sum(modes.singular_values**2) == pytest.approx(energy, rel=1e-10)
    np.testing.assert_allclose(
        modes.coefficients(snapshots.pressure).std(axis=0, ddof=1)[:20], modes.coefficient_std[:20], rtol=1e-7
    )


def test_weighted_modes_are_the_best_in_area(snapshots: Snapshots, weights: np.ndarray) -> None:
    """Five modes: each inner product is best in its own norm (Eckart-Young), and they differ here."""
    error = {}
    for name, one in (("area", weights), ("euclidean", None)):
        modes = proper_orthogonal_decomposition(snapshots.pressure, one)
        # The best coefficients in the weighted norm, whatever the modes.
        root = np.sqrt(weights)[:, None]
        centred = root * (snapshots.pressure - modes.mean).T
        fit = np.linalg.lstsq(root * modes.modes[:, :5], centred, rcond=None)[0]
        error[name] = np.linalg.norm(centred - root * modes.modes[:, :5] @ fit)
    assert error["area"] < error["euclidean"] * (1.0 - 1e-4)


def test_equal_areas_are_the_euclidean_inner_product(snapshots: Snapshots) -> None:
    plain = proper_orthogonal_decomposition(snapshots.pressure)
    equal = area_weights(np.full(snapshots.pressure.shape[1], 3e-4))
    weighted = proper_orthogonal_decomposition(snapshots.pressure, equal)
    np.testing.assert_allclose(weighted.singular_values[:20], plain.singular_values[:20], rtol=1e-10)
    np.testing.assert_allclose(weighted.modes[:, :5], plain.modes[:, :5], atol=1e-9)


def test_nodes_without_area_are_refused() -> None:
    with pytest.raises(InputError, match=r"map.inner_product: 'area' found, but 1 of 3 nodes have no area"):
        area_weights(np.array([1.0, 0.0, 2.0]))
