"""The compiled checks of gauges find what their definition in numpy finds, in every sequence of cycles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from reference_checks import ReferenceChecks

from strainfmu.can.cycle.gauges.noise import GaugeNoise, like_gauges
from strainfmu.can.cycle.gauges.plausibility import GaugeChecks
from strainfmu.can.settings import BridgeSettings
from strainfmu.can.wire.cycle_plan import DecodedCycle

pytestmark = pytest.mark.fast

N, CYCLE, QUANTUM = 6, 0.01, 0.25e-6


def cycles(seed: int, n_cycles: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return raw numbers, presence and times of cycles; gauges stick, jump, fall to zero or are missing."""
    random = np.random.default_rng(seed)
    raw = np.array([400, 400, 3, -2, 50, 400]) + np.cumsum(random.integers(-2, 3, size=(n_cycles, N)), axis=0)
    present = np.ones((n_cycles, N), dtype=bool)
    for start in range(60, n_cycles - 40, 70):
        gauge, end = int(random.integers(N)), start + int(random.integers(1, 40))
        kind = int(random.integers(6))
        if kind == 0:
            raw[start:end, gauge] = raw[start, gauge]
        elif kind == 1:
            raw[start:end, gauge] = 0
        elif kind == 2:
            raw[start, gauge] += 12_000
        elif kind == 3:
            present[start:end, : 1 + gauge] = False
        elif kind == 4:
            raw[start:end] = raw[start]
        else:
            raw[start:end] = raw[start] + random.integers(0, 2, size=(end - start, N))
    times = np.cumsum(random.choice([CYCLE, 0.2 * CYCLE, 3.0 * CYCLE], size=n_cycles, p=[0.9, 0.05, 0.05]))
    return raw, present, times


def in_two_frames(std: float | None) -> GaugeNoise:
    """Return the noise of the gauges [m/m], of which every other one is in a second frame."""
    return replace(like_gauges(N, std=std), frame=np.arange(N) % 2)


@pytest.mark.parametrize(
    ("std", "settings"),
    [
        (None, BridgeSettings()),
        (0.4e-6, BridgeSettings()),
        (0.4e-6, BridgeSettings(stuck_cycles=9, zero_cycles=4, heal_cycles=5, sensor_range=105e-6)),
        (0.4e-6, BridgeSettings(stuck_cycles=0, rate_limit=2e-6)),
    ],
)
@pytest.mark.parametrize("seed", range(2))
def test_the_compiled_checks_find_what_their_definition_finds(
    seed: int, std: float | None, settings: BridgeSettings
) -> None:
    n_cycles, random = 600, np.random.default_rng(seed)
    raw, present, times = cycles(seed, n_cycles)
    noise, decoded = in_two_frames(std), DecodedCycle(N)
    checks, reference = GaugeChecks(N, CYCLE, settings, noise), ReferenceChecks(N, CYCLE, settings, noise)
    left_out = 0
    for k in range(n_cycles):
        strain = np.where(present[k], raw[k] * QUANTUM, np.nan)
        now, refused = float(times[k]), present[k] & (random.random(N) < 0.002)
        given = {"present": present[k], "refused": refused, "now": now}
        found, expected = checks.update(strain, raw[k], **given), reference.update(strain, raw[k], **given)
        np.testing.assert_array_equal(found, expected, err_msg=f"cycle {k}")
        for mask in (present[k], ~present[k], np.arange(N) == k % N):
            decoded.present[:] = mask
            assert checks.frozen(decoded, now) == reference.frozen(mask, now)
        left_out += not expected.all()
    assert 0 < left_out < n_cycles, "neither nothing nor all is found"


@pytest.mark.parametrize("std", [None, 0.4e-6])
def test_the_noise_that_is_counted_on_is_that_of_the_definition(std: float | None) -> None:
    raw, present, times = cycles(5, 1000)
    noise, settings = in_two_frames(std), BridgeSettings()
    checks, reference = GaugeChecks(N, CYCLE, settings, noise), ReferenceChecks(N, CYCLE, settings, noise)
    nowhere, seen = np.zeros(N, dtype=bool), set()
    for numbers, here, now in zip(raw, present, times.tolist(), strict=True):
        given = {"present": here, "refused": nowhere, "now": now}
        for one in (checks, reference):
            one.update(np.where(here, numbers * QUANTUM, np.nan), numbers, **given)
        np.testing.assert_allclose(checks.noise_ratio, reference.watch.ratio, rtol=1e-9)
        seen.add(checks.noise_ratio.tobytes())
    assert len(seen) > 2, "and it changes"
