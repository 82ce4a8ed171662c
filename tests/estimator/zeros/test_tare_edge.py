"""A tare by the edges of a flag: the zeros of the whole window, and when there are none."""

from __future__ import annotations

import json

import numpy as np
import pytest
from random_map import map_of, random_model

from strainfmu.estimator.zeros.reading_window import ReadingWindow, window_statistics
from strainfmu.estimator.zeros.tare import tare
from strainfmu.estimator.zeros.tare_edge import EdgeTare, TareState

pytestmark = pytest.mark.fast

N_D = 12
HELD = map_of(random_model(n_gauges=N_D))
NOISE = HELD.noise_std


def readings(n: int, seed: int = 0) -> np.ndarray:
    """(n, n_d) of random zeros; some are missing, one gauge begins late, one drifts, all share some noise."""
    random = np.random.default_rng(seed)
    strain = 1e-4 * random.normal(size=N_D) + NOISE * (random.normal(size=(n, N_D)) + random.normal(size=(n, 1)))
    strain[:, 3] += 1e-6 * np.linspace(0.0, 1.0, n)
    strain[random.random(strain.shape) < 0.01] = np.nan
    strain[: n // 30, 5] = np.nan
    strain[:, 7] = np.nan
    return strain


def taken(one: EdgeTare, strain: np.ndarray, pressure: float = 0.0) -> bool:
    for row in strain:
        assert not one.follow(True)
        one.take(row, pressure)
    return one.follow(False)


@pytest.mark.parametrize("n", [64, 65, 127, 128, 1000])
def test_readings_one_by_one_are_those_of_the_window(n: int) -> None:
    strain, window = readings(n), ReadingWindow(n_gauges=N_D)
    for row in strain:
        window.add(row)
    ours, whole = window.statistics(), window_statistics(strain)
    assert (ours.samples, ours.length, ours.reads.tolist()) == (n, whole.length, whole.reads.tolist())
    assert 16 <= len(whole.stretch) < 32
    assert len(whole.stretch) % 2 == 0
    for name in ("mean", "scatter", "stretch"):
        a, b = getattr(ours, name), getattr(whole, name)
        np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-12 * np.abs(b).max())
    read = np.delete(strain, 7, axis=1)
    np.testing.assert_allclose(np.delete(whole.mean, 7), np.nanmean(read, axis=0), rtol=1e-12)
    filled = np.where(np.isfinite(read), read, np.nanmean(read, axis=0))
    np.testing.assert_allclose(np.delete(whole.scatter, 7), filled.std(axis=0, ddof=1), rtol=1e-6)


def test_the_falling_edge_sets_the_zeros_of_the_window() -> None:
    one, strain = EdgeTare(HELD), readings(500)
    assert taken(one, strain)
    expected = tare(HELD, strain, np.zeros(500)).zeros
    assert one.zeros is not None
    assert expected.common_std > 0.0
    for name in ("value", "std", "common_std"):
        np.testing.assert_allclose(getattr(one.zeros, name), getattr(expected, name), rtol=1e-12, atol=1e-20)
    assert one.state == TareState.DONE
    assert one.text.startswith("tare taken: 11 zeros from 500 steps, rms ")
    one.drop()
    assert one.zeros is None
    assert one.state == TareState.IDLE


@pytest.mark.parametrize(
    ("strain", "pressure", "text"),
    [
        (readings(500), np.nan, "loads are not known: no dynamic pressure"),
        (readings(500), -101.0, "loads are not known: dynamic pressure is -101 Pa, expected at most 100 Pa"),
        (readings(63), 100.0, "window: expected at least 64 steps, got 63"),
        (readings(500) + 3e-3, 0.0, "no plausible zero"),
        (np.where(np.arange(N_D) < 7, np.nan, readings(500)), 0.0, "4 of 12 gauges read"),
    ],
)
def test_refused_zeros_are_as_before(strain: np.ndarray, pressure: float, text: str) -> None:
    one = EdgeTare(HELD)
    assert taken(one, readings(100, seed=1))
    before = one.zeros
    assert not taken(one, strain, pressure)
    assert one.zeros is before
    assert one.state == TareState.REFUSED
    assert one.text.startswith(f"tare refused: {text}")
    assert one.text.endswith("; zeros as before")


def test_a_load_on_the_way_ends_the_window() -> None:
    one, strain = EdgeTare(HELD), readings(300)
    for k, row in enumerate(strain):
        one.follow(True)
        one.take(row, 5e3 if k == 100 else 0.0)
        assert one.state == (TareState.AVERAGING if k < 100 else TareState.REFUSED)
    assert not one.follow(False)
    assert one.state == TareState.REFUSED
    assert taken(one, strain)  # the next edge opens a new window


def test_what_is_saved_goes_on() -> None:
    one, other, strain = EdgeTare(HELD), EdgeTare(HELD), readings(400)
    for row in strain[:150]:
        one.follow(True)
        one.take(row, 0.0)
    other.restore(json.loads(json.dumps(one.saved())))
    for each in (one, other):
        assert taken(each, strain[150:])
    assert one.zeros is not None
    assert other.zeros is not None
    assert other.zeros.value.tobytes() == one.zeros.value.tobytes()
    assert other.zeros.std.tobytes() == one.zeros.std.tobytes()
    for wrong in ({"flag": [7, 0]}, {"zeros": [[0.0], [0.0], 0.0]}, {"window": {"counts": [1, 2, 3, 4]}}):
        with pytest.raises((KeyError, ValueError)):
            other.restore({**one.saved(), **wrong})
        assert other.state == TareState.DONE
