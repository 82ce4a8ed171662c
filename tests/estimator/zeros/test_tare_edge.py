"""A tare by the edges of a flag: the zeros of the whole window, and when there are none."""

import numpy as np
import pytest
from random_map import map_of, random_model

from strainfmu.errors import InputError
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.tare import EdgeTare, TareLimits, TareState, limits_record

pytestmark = pytest.mark.fast

N_D = 12
HELD = map_of(random_model(n_gauges=N_D))
NOISE = HELD.noise_std
ESTIMATOR = Estimator(HELD)


def new_tare() -> EdgeTare:
    """One by a core of its own: nothing is left of another test."""
    return EdgeTare(Estimator(HELD).core, HELD)


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
        assert not one.step(True, row, pressure)
    return one.step(False, strain[-1], pressure)


@pytest.mark.parametrize("n", [64, 65, 127, 128, 1000])
def test_zeros_are_means_and_deviations_of_the_readings(n: int) -> None:
    strain = readings(n)
    strain[:, 3] = strain[:, 4]
    outcome = ESTIMATOR.core.tare(limits_record(TareLimits(), None, N_D), strain, np.zeros(n))
    assert np.flatnonzero(outcome["reads"] == 0.0).tolist() == [7]
    read = np.delete(strain, 7, axis=1)
    mean = np.nanmean(read, axis=0)
    np.testing.assert_allclose(np.delete(outcome["zero"], 7), mean, rtol=1e-12)
    filled = np.where(np.isfinite(read), read, mean)
    np.testing.assert_allclose(np.delete(outcome["scatter"], 7), filled.std(axis=0, ddof=1), rtol=1e-6)


def test_the_falling_edge_sets_the_zeros_of_the_window() -> None:
    one, strain = new_tare(), readings(500)
    assert taken(one, strain)
    expected = ESTIMATOR.tare(strain, 0.0).zeros
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
    one = new_tare()
    assert taken(one, readings(100, seed=1))
    before = one.zeros
    assert not taken(one, strain, pressure)
    assert one.zeros is before
    assert one.state == TareState.REFUSED
    assert one.text.startswith(f"tare refused: {text}")
    assert one.text.endswith("; zeros as before")


def test_a_load_on_the_way_ends_the_window() -> None:
    one, strain = new_tare(), readings(300)
    for k, row in enumerate(strain):
        one.step(True, row, 5e3 if k == 100 else 0.0)
        assert one.state == (TareState.AVERAGING if k < 100 else TareState.REFUSED)
    assert not one.step(False, strain[0], 0.0)
    assert one.state == TareState.REFUSED
    assert taken(one, strain)  # the next edge opens a new window


def test_what_is_saved_goes_on() -> None:
    one, other, strain = new_tare(), new_tare(), readings(400)
    for row in strain[:150]:
        one.step(True, row, 0.0)
    other.restore(one.saved())
    assert other.state == TareState.AVERAGING
    for each in (one, other):
        assert taken(each, strain[150:])
    assert one.zeros is not None
    assert other.zeros is not None
    assert other.zeros.value.tobytes() == one.zeros.value.tobytes()
    assert other.zeros.std.tobytes() == one.zeros.std.tobytes()
    good = one.saved()
    for wrong in (b"", good[:-1], np.float64(7.0).tobytes() + good[8:], good[:-8] + np.float64(np.nan).tobytes()):
        with pytest.raises(InputError, match=r"^tare: (\d+ bytes found, must be \d+|holds a tare that cannot be)"):
            other.restore(wrong)
        assert other.state == TareState.DONE
        assert other.saved() == good
