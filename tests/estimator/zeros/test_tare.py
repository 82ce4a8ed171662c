"""Tare: zeros removed to their stated deviation, and refused where loads are not known."""

from dataclasses import replace

import numpy as np
import pytest
from random_map import map_of, random_model

from strainfmu.errors import InputError
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.gauge_zeros import LARGEST_ZERO
from strainfmu.estimator.tare import KnownStrain, Tare, TareLimits

pytestmark = pytest.mark.fast

N_D, N = 54, 1000
HELD = map_of(random_model(n_gauges=N_D))
NOISE = HELD.noise_std
ESTIMATOR = Estimator(HELD)


def readings(seed: int, memory: float = 0.0, common: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """(n_d,) zeros of 200 um/m and (n, n_d) readings: noise of a first-order filter, some of it in common."""
    random = np.random.default_rng(seed)
    zero = 2e-4 * random.normal(size=N_D)
    white = random.normal(size=(N + 200, N_D)) + common * random.normal(size=(N + 200, 1))
    noise = np.zeros_like(white)
    for k in range(1, len(white)):
        noise[k] = memory * noise[k - 1] + np.sqrt(1.0 - memory**2) * white[k]
    return zero, zero + NOISE * noise[200:]


def taken(strain: np.ndarray, pressure: float = 0.0, **changes: float) -> Tare:
    return ESTIMATOR.tare(strain, pressure, replace(TareLimits(), **changes))


@pytest.mark.parametrize("memory", [0.0, 0.5, 0.9])
def test_zeros_are_removed_to_their_stated_deviation(memory: float) -> None:
    apart = []
    for seed in range(20):
        zero, strain = readings(seed, memory)
        found = taken(strain)
        assert found.faults == ()
        apart.append((found.zeros.value - zero) / found.zeros.std)
    whole = np.array(apart)
    assert 0.9 < np.sqrt(np.mean(whole**2)) < 1.12
    assert np.mean(np.abs(whole) < 3.0) > 0.99


def test_an_error_in_common_is_stated() -> None:
    apart, stated = [], []
    for seed in range(40):
        zero, strain = readings(seed, common=1.0)
        found = taken(strain).zeros
        apart.append(np.mean((found.value - zero) / NOISE))
        stated.append(found.common_std / np.median(NOISE))
    assert 0.6 < np.sqrt(np.mean(np.square(apart))) / np.sqrt(np.mean(np.square(stated))) < 1.7
    assert taken(readings(1)[1]).zeros.common_std == 0.0


def test_known_loads_are_taken_off() -> None:
    zero, strain = readings(1)
    load = 1e-5 * np.random.default_rng(2).normal(size=N_D)
    known = KnownStrain(value=load, relative_std=0.05)
    found = ESTIMATOR.tare(strain + load, 0.0, known=known)
    assert np.all(np.abs(found.zeros.value - zero) < 5.0 * NOISE / np.sqrt(N))
    assert np.all(found.zeros.std >= 0.05 * np.abs(load))


def test_refused_while_air_loads_the_vehicle() -> None:
    found = taken(readings(1)[1], pressure=5e3)
    assert found.faults == ("loads are not known: dynamic pressure reaches 5000 Pa, expected at most 100 Pa",)


def test_refused_while_readings_drift_or_move() -> None:
    _, strain = readings(1)
    drifting = strain.copy()
    drifting[:, 7] += 1e-5 * np.linspace(0.0, 1.0, N)
    (fault,) = taken(drifting).faults
    assert fault.startswith("readings drift: gauge 'G7' by 10")
    assert fault.endswith("over the window, expected at most 2 um/m")
    slow = strain.copy()
    quiet = int(np.argmin(NOISE))
    slow[:, quiet] += 1e-6 * np.linspace(-0.5, 0.5, N)
    found = taken(slow)
    assert found.faults == ()
    assert found.zeros.std[quiet] == pytest.approx(1e-6 / np.sqrt(12.0), rel=0.1)
    moving = strain.copy()
    moving[:, 3] += 2e-4 * np.sin(np.linspace(0.0, 300.0, N))
    assert "readings move: gauge 'G3'" in taken(moving).faults[0]


def test_refused_where_readings_are_no_zeros() -> None:
    _, strain = readings(1)
    large = strain + np.where(np.arange(N_D) == 5, 3e-3, 0.0)
    assert "no plausible zero: gauge 'G5' reads" in " ".join(taken(large).faults)
    assert not any("no plausible" in one for one in taken(large, zero=1e-2).faults)


def test_refused_where_readings_look_like_a_flight() -> None:
    strain = 30.0 * HELD.mean_strain + readings(1)[1] - readings(1)[0]
    found = taken(strain)
    assert len(found.faults) == 1
    assert found.faults[0].startswith("readings look like load")


def test_silent_and_frozen_gauges_are_named() -> None:
    _, strain = readings(1)
    strain[:, 2] = np.nan
    strain[:, 9] = 1e-4
    found = ESTIMATOR.tare(strain)
    assert found.faults == ()
    assert found.notes == (
        "gauge 'G2': reads in less than 90 % of the window: no zero, not to be used",
        "gauge 'G9': every reading is the same: is it alive?",
        "dynamic pressure is not recorded: that air does not load the vehicle is taken on trust",
    )
    assert (found.zeros.value[2], found.zeros.std[2]) == (0.0, LARGEST_ZERO)


def test_a_few_samples_are_no_window() -> None:
    with pytest.raises(InputError, match="window: expected at least 64 samples, got 20"):
        taken(readings(1)[1][:20])


def test_arrays_of_other_gauges_are_refused() -> None:
    _, strain = readings(1)
    with pytest.raises(InputError, match=r"^strain: expected \(k, 54\) values, got \(1000, 53\)"):
        ESTIMATOR.tare(strain[:, 1:], 0.0)
    with pytest.raises(InputError, match=r"^dynamic_pressure: expected a number or 1000 numbers, got shape"):
        ESTIMATOR.tare(strain, np.zeros(2))
    with pytest.raises(InputError, match=r"^known strain: expected \(54,\) values, got \(53,\)"):
        ESTIMATOR.tare(strain, 0.0, known=KnownStrain(value=np.zeros(53)))
