"""The short way through the checks of gauges: it finds what the checks find, in every sequence of cycles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from strainfmu.can.cycle.gauges.noise import gauge_noise, like_gauges
from strainfmu.can.cycle.gauges.plausibility import _LONGEST_QUIET, _RECENT, GaugeChecks
from strainfmu.can.cycle.parts import gauge_checks
from strainfmu.can.settings import BridgeSettings
from strainfmu.can.wire.profiles import profile_layout

pytestmark = pytest.mark.fast

N, CYCLE, QUANTUM = 6, 0.01, 0.25e-6


def cycles(seed: int, n_cycles: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return raw numbers, presence and times of cycles; gauges stick, jump, fall to zero or are missing."""
    random = np.random.default_rng(seed)
    raw = np.array([400, 400, 3, -2, 50, 400]) + np.cumsum(random.integers(-2, 3, size=(n_cycles, N)), axis=0)
    present = np.ones((n_cycles, N), dtype=bool)
    for start in range(60, n_cycles - 40, 70):
        gauge, end = int(random.integers(N)), start + int(random.integers(1, 40))
        kind = int(random.integers(5))
        if kind == 0:
            raw[start:end, gauge] = raw[start, gauge]
        elif kind == 1:
            raw[start:end, gauge] = 0
        elif kind == 2:
            raw[start, gauge] += 12_000
        elif kind == 3:
            present[start:end, : 1 + gauge] = False
        else:
            raw[start:end] = raw[start]
    times = np.cumsum(random.choice([CYCLE, 0.2 * CYCLE, 3.0 * CYCLE], size=n_cycles, p=[0.9, 0.05, 0.05]))
    return raw, present, times


@pytest.mark.parametrize("bounded", [False, True], ids=["any strain", "strains of the layout"])
@pytest.mark.parametrize("seed", range(4))
def test_the_short_way_finds_what_the_checks_find(seed: int, bounded: bool) -> None:
    n_cycles = 1200
    raw, present, times = cycles(seed, n_cycles)
    noise = like_gauges(N)
    if bounded:
        noise = replace(noise, largest=2**15 * QUANTUM, smallest=QUANTUM)
    short, full = (GaugeChecks(N, CYCLE, BridgeSettings(), noise) for _ in range(2))
    refused = np.zeros(N, dtype=bool)
    short_ways = 0
    for k in range(n_cycles):
        strain = np.where(present[k], raw[k] * QUANTUM, np.nan)
        now, whole = float(times[k]), bool(present[k].all())
        given = {"present": present[k], "refused": refused, "now": now}
        found = short.update(strain.copy(), raw[k].copy(), **given, is_clean=whole)
        expected = full.update(strain.copy(), raw[k].copy(), **given)
        np.testing.assert_array_equal(found, expected)
        assert short.frozen(present[k], now) == full.frozen(present[k], now)
        short_ways += found is short.every_gauge
    assert short_ways > n_cycles / 3, "and it is the usual way"


@pytest.mark.parametrize("profile", ["fd64", "classic-le"])
def test_a_cycle_in_which_gauges_change_asks_for_no_dates(profile: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """All gauges of these profiles come in every cycle, as their layout says: the age needs nothing else then."""
    layout = profile_layout(profile, tuple(f"G{i}" for i in range(N)), CYCLE)
    checks = gauge_checks(layout, BridgeSettings(), None)
    raw, _, _ = cycles(1, 40)
    everywhere, nowhere = np.ones(N, dtype=bool), np.zeros(N, dtype=bool)
    for k, numbers in enumerate(raw):
        checks.update(
            numbers * QUANTUM, numbers, present=everywhere, refused=nowhere, now=k * CYCLE, is_clean=True
        )
        if k == 20:
            monkeypatch.setattr(checks, "_date_changes", lambda: pytest.fail("times of change are not needed"))
        if k > 1:
            assert checks.frozen(everywhere, k * CYCLE) == (0.0, 0.0)


def test_what_the_short_way_puts_off_is_what_the_checks_keep() -> None:
    """A run longer than any that is put off: the same pace, and the same time of change of a gauge that stays."""
    random, n_cycles = np.random.default_rng(7), 3 * _LONGEST_QUIET + _RECENT // 2
    raw = 400 + np.cumsum(random.integers(-3, 4, size=(n_cycles, N)), axis=0)
    raw[-9:, 2] = raw[-10, 2]
    short, full = (GaugeChecks(N, CYCLE, BridgeSettings()) for _ in range(2))
    everywhere, nowhere = np.ones(N, dtype=bool), np.zeros(N, dtype=bool)
    for k, numbers in enumerate(raw):
        given = {"present": everywhere, "refused": nowhere, "now": (k + 0.3 * (k % 2)) * CYCLE}
        short.update(numbers * QUANTUM, numbers, **given, is_clean=True)
        full.update(numbers * QUANTUM, numbers, **given)
    short._add_changes()
    np.testing.assert_allclose(short._pace, full._pace, rtol=1e-12)
    now = n_cycles * CYCLE
    by_itself = np.arange(N)[:, None] == np.arange(N)
    found = [short.frozen(gauge, now) for gauge in by_itself]
    assert found == [full.frozen(gauge, now) for gauge in by_itself]
    np.testing.assert_array_equal(short._good_time, full._good_time)
    assert found[2][0] > 9.0 * CYCLE


def test_the_strains_that_a_layout_can_hold() -> None:
    """16 bits of 0.25 um/m: up to 8192 um/m, and none but 0 below 0.25; floats hold any."""
    known = gauge_noise(profile_layout("fd64", ["a", "b"], CYCLE), None)
    assert known.largest == pytest.approx(2**15 * QUANTUM)
    assert known.smallest == pytest.approx(QUANTUM)
    unknown = gauge_noise(profile_layout("float2", ["a", "b"], CYCLE), None)
    assert (unknown.largest, unknown.smallest) == (np.inf, 0.0)
