"""Tares of random windows are those that numpy computed of them once, to the last digits; so is what is said."""

from pathlib import Path

import numpy as np
import pytest
from tare_windows import HELD, TareWindow, tare_window

from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.gauge_zeros import LARGEST_ZERO
from strainfmu.estimator.tare import EdgeTare, refusal, taken_text

pytestmark = pytest.mark.fast

ESTIMATOR = Estimator(HELD)
GOLDEN = Path(__file__).with_name("golden_tares.npz")


def said_of_steps(window: TareWindow) -> str:
    """What a tare by steps says of the same readings."""
    one = EdgeTare(ESTIMATOR.core, HELD, window.known)
    for row, pressure in zip(window.strain, window.pressure, strict=True):
        assert not one.step(True, row, pressure)
    one.step(False, window.strain[-1], 0.0)
    return one.text


def test_tares_are_the_stored_ones() -> None:
    with np.load(GOLDEN) as golden:
        for seed, said in enumerate(golden["said"].tolist()):
            window = tare_window(seed)
            found = ESTIMATOR.tare(window.strain, window.pressure, window.limits, window.known)
            zeros = found.zeros
            near = 1e-12 * np.median(HELD.noise_std)
            np.testing.assert_allclose(zeros.value, golden["value"][seed], rtol=1e-12, atol=near)
            np.testing.assert_allclose(zeros.std, golden["std"][seed], rtol=1e-10)
            np.testing.assert_allclose(zeros.common_std, golden["common_std"][seed], rtol=1e-9)
            assert found.memory == pytest.approx(golden["memory"][seed], rel=1e-10)
            any_reads = bool((zeros.std < LARGEST_ZERO).any())
            outcome = refusal(found) or (taken_text(found, "cycles") if any_reads else "")
            assert "\n".join([outcome, *found.faults, *found.notes, said_of_steps(window)]) == said


def test_any_readings_give_finite_zeros_in_range() -> None:
    random = np.random.default_rng(0)
    pool = np.array([0.0, np.nan, np.inf, 1e300, -1e308, 5e-324, 1e-170, 1e-160, 1e100, 1e101, 1e-4, 0.05, 0.06])
    for _ in range(60):
        n = int(random.integers(64, 130))
        strain = random.choice(random.choice(pool, size=3), size=(n, len(HELD.mean_strain)))
        found = ESTIMATOR.tare(strain, random.choice(pool, size=n))
        assert np.isfinite(
            [found.memory, found.rms, found.largest_std, *found.zeros.std, *found.zeros.value]
        ).all()
