"""Channels that stand still are found, those that only look so are not; noise follows the windows."""

import numpy as np
import pytest

from builder.calibration.ground_test.channel_faults import channel_faults
from builder.calibration.ground_test.ground_test_readings import window_variances
from strainfmu.arrays import FloatArray

pytestmark = pytest.mark.fast

CASES, SAMPLES, GAUGES = 12, 50, 6


def recording(noise: float = 0.3, seed: int = 1) -> FloatArray:
    """Return (CASES, SAMPLES, GAUGES) samples of loads that differ [um/m]."""
    random = np.random.default_rng(seed)
    load = 100.0 * random.standard_normal((CASES, 1, GAUGES))
    return np.asarray(load + noise * random.standard_normal((CASES, SAMPLES, GAUGES)))


def found(strain: FloatArray) -> dict[int, tuple[str, float, tuple[int, ...]]]:
    """Return kind, fraction and windows of each gauge at fault."""
    return {
        one.gauge: (one.kind, round(one.fraction, 4), one.windows)
        for one in channel_faults(strain.reshape(-1, GAUGES), list(strain))
    }


@pytest.mark.parametrize("step", [1e-4, 0.01, 0.1, 1.0, 5.0])
@pytest.mark.parametrize("noise", [0.05, 0.3, 1.0])
def test_sound_channels_of_any_resolution_are_not_blamed(step: float, noise: float) -> None:
    """Resolutions far below the noise, and far above, where most windows hold one value."""
    for seed in range(20):
        assert found(np.round(recording(noise, seed) / step) * step) == {}


def test_numbers_of_four_digits_are_not_blamed() -> None:
    """Their resolution is 1 um/m at 1000 and 0.0001 um/m at 0.1."""
    strain = np.vectorize(lambda value: float(f"{value:.4g}"))(40.0 * recording(noise=0.01))
    assert found(strain) == {}


def test_a_channel_that_is_slower_than_the_recording_is_not_blamed() -> None:
    strain = recording()
    strain[..., 2] = np.repeat(strain[:, ::10, 2], 10, axis=1)
    assert found(strain) == {}


def test_a_channel_at_its_end_is_railed_in_the_windows_where_it_is() -> None:
    """Wholly in one window, in one half of another; the windows between are used."""
    strain = recording()
    order = np.argsort(strain[:, 0, 3])
    top, next_one = int(order[-1]), int(order[-2])
    end = float(np.median(strain[next_one, :, 3]))
    clipped = int(np.sum(strain[..., 3] >= end))
    strain[..., 3] = np.minimum(strain[..., 3], end)
    assert found(strain) == {3: ("railed", round(clipped / (CASES * SAMPLES), 4), tuple(sorted((top, next_one))))}
    strain[..., 3] = np.where(np.arange(SAMPLES) % 2, 5e3, -5e3)  # an amplifier that swings from end to end
    assert found(strain) == {3: ("railed", 1.0, tuple(range(CASES)))}


def test_a_channel_without_any_change_is_frozen() -> None:
    strain = recording()
    strain[4:7, :, 1] = np.median(strain[..., 1])
    strain[..., 5] = 0.0
    assert found(strain) == {
        1: ("frozen", 0.25, (4, 5, 6)),
        5: ("railed or frozen", 1.0, tuple(range(CASES))),
    }


def test_where_no_channel_has_noise_nothing_is_found() -> None:
    assert found(recording(noise=0.0)) == {}


def test_noise_is_of_the_window_where_windows_differ() -> None:
    """One window in which a machine ran, ten times the noise; of the others the gauge's."""
    random = np.random.default_rng(5)
    true = np.where(np.arange(16) == 3, 10.0, 1.0)[:, None] * np.linspace(0.5, 2.0, 40)
    freedom = np.full(true.shape, 24.0)
    seen = true**2 * random.chisquare(24.0, true.shape) / 24.0
    ratio = window_variances(seen, freedom) / true**2
    assert np.median(ratio[3]) == pytest.approx(1.0, abs=0.15)
    assert np.median(ratio[[k for k in range(16) if k != 3]]) == pytest.approx(1.05, abs=0.1)
    pooled = seen.mean(axis=0) / true[3] ** 2
    assert np.median(pooled) < 0.1


def test_chi_square_of_means_keeps_its_expectation() -> None:
    """Also with five samples in a window, whether windows differ or not: means over their own sigma."""
    random = np.random.default_rng(6)
    for spread in (0.0, 0.7):
        true = np.exp(spread * random.standard_normal((300, 40)))
        seen = true**2 * random.chisquare(4.0, true.shape) / 4.0
        found = window_variances(seen, np.full(true.shape, 4.0))
        chi_square = np.mean(true**2 * random.standard_normal(true.shape) ** 2 / found)
        assert chi_square == pytest.approx(1.0, abs=0.06)


def test_windows_that_are_alike_have_the_pooled_noise() -> None:
    seen, freedom = np.full((4, 3), 2.0), np.full((4, 3), 9.0)
    np.testing.assert_allclose(window_variances(seen, freedom), 2.0)
    seen[1, 1], freedom[1, 1] = 0.0, 0.0
    np.testing.assert_allclose(window_variances(seen, freedom), 2.0)
    assert not window_variances(np.zeros((2, 1)), np.zeros((2, 1))).any()
