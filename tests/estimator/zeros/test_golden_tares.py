"""Tares of random windows are those that numpy computed of them once, to the last digits; so is what is said."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tare_windows import HELD, TareWindow, tare_window

from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.zeros.gauge_zeros import LARGEST_ZERO
from strainfmu.estimator.zeros.tare_edge import EdgeTare
from strainfmu.estimator.zeros.tare_verdict import refusal, taken_text

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
