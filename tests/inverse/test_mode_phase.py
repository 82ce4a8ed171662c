"""Pairs of modes of a rolled POD, turned to gauges that observe one phase of a harmonic."""

import numpy as np
import pytest

from builder.inverse.ensemble import turned_to_gauges
from strainfmu.linear.pressure_modes import PressureModes

pytestmark = pytest.mark.fast

ROLL = 2.0 * np.pi * np.arange(24) / 24


@pytest.mark.parametrize("phase", [0.0, 0.4, 1.3])
def test_one_mode_of_a_pair_has_all_the_strain(phase: float) -> None:
    """Gauges that read cos(2 phi) alone, whatever the roll angle of the pair; a mode on its own stays."""
    pair = np.stack([np.cos(2.0 * (ROLL - phase)), np.sin(2.0 * (ROLL - phase))], axis=1) / np.sqrt(12.0)
    alone = np.full((24, 1), 1.0 / np.sqrt(24.0))
    modes = PressureModes(
        mean=np.zeros(24),
        modes=np.hstack([alone, pair]),
        singular_values=np.array([5.0, 2.0, 2.0 * (1.0 - 1e-14)]),
        n_snapshots=10,
    )
    operator = np.stack([np.cos(2.0 * ROLL), -0.5 * np.cos(2.0 * ROLL) + 0.1])
    found = turned_to_gauges(modes, (operator / np.array([[1.0], [2.0]])) @ modes.modes)
    strain = operator @ found.modes
    np.testing.assert_allclose(strain[:, 2], 0.0, atol=1e-12)
    np.testing.assert_allclose(np.abs(strain[:, 1]), np.sqrt(12.0) * np.array([1.0, 0.5]), rtol=1e-12)
    np.testing.assert_allclose(found.modes.T @ found.modes, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(found.modes[:, 0], alone[:, 0], rtol=1e-12)
    assert np.all(found.modes[np.abs(found.modes).argmax(axis=0), np.arange(3)] > 0.0)
