"""Navigation that becomes wrong in flight: named, left out while it lasts, and back when it is good again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from flight_maps import NOISE_STD, ROWS, STATIONS, exact_response, flight_map
from scaled_maps import scaled_map

from strainfmu.estimator.air_data import NAVIGATION
from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.policies import NAMED_AFTER

pytestmark = pytest.mark.fast

N_D = STATIONS * ROWS
DT = 0.01
STD = np.array([0.05, 0.02, 0.01])
"""Deviations of M [1], p_inf and q_inf [of the value]."""

MACH, PRESSURE = 0, 1
BEFORE, WRONG, AFTER = 20, 35, 10
"""Samples before the error, with it, and after it."""

N = BEFORE + WRONG + AFTER
FLIGHTS = 40


@pytest.fixture(scope="module", name="estimator")
def _estimator() -> Estimator:
    """An estimator with errors of pressure and of hardware."""
    noise, manifold = np.full(N_D, NOISE_STD), flight_map(discrepancy=1e-2, hardware=True)
    return Estimator(replace(scaled_map(2, 1, N_D), noise_std=noise, manifold=manifold))


def states(seed: int) -> np.ndarray:
    """A slow turn (n, 4) from a random flight state."""
    random = np.random.default_rng(seed)
    first = np.array([random.uniform(5.7, 6.7), *random.uniform(-0.08, 0.08, size=2), random.uniform(8.2, 9.0)])
    turn = np.linspace(0.0, 1.0, N)
    return np.asarray(first + turn[:, None] * random.uniform(-1.0, 1.0, size=4) * [0.02, 0.03, 0.03, 0.02])


def flown(
    estimator: Estimator,
    seed: int,
    error: np.ndarray,
    known: tuple[str, ...] = NAVIGATION,
    white: float = 0.0,
    step: float = DT,
) -> tuple[Estimate, np.ndarray]:
    """Return the estimates of a flight, and its loads (n, 5).

    Navigation has ``error`` (n, 3) beside its own, in deviations: one of one deviation for the whole flight, but
    for the part ``white`` of the variance, drawn in every sample.
    """
    random, at = np.random.default_rng(seed), states(seed)
    both = np.array([exact_response(*one[:3], np.exp(one[3])) for one in at])
    pressure = np.exp(at[:, 3])
    right = np.column_stack([at[:, 0], pressure, 0.7 * at[:, 0] ** 2 * pressure])
    size = STD * np.column_stack([np.ones(N), right[:, 1:]])
    own = np.sqrt(1.0 - white) * random.standard_normal(3) + np.sqrt(white) * random.standard_normal((N, 3))
    read = right + size * (own + error)
    flow = {name: value for name, value in zip(NAVIGATION, read.T, strict=True) if name in known}
    strain = both[:, :N_D] + NOISE_STD * random.standard_normal((N, N_D))
    return estimator.filter(1.0).track(strain, time=step * np.arange(N), **flow), both[:, N_D:]


def with_error(which: int, size: float) -> np.ndarray:
    """Errors (n, 3) of ``size`` deviations in one quantity, while it is wrong."""
    error = np.zeros((N, 3))
    error[BEFORE : BEFORE + WRONG, which] = size
    return error


def named(found: Estimate, known: tuple[str, ...] = NAVIGATION) -> np.ndarray:
    """(n, 3) quantities that are given, and left out with an alarm."""
    given = np.array([name in known for name in NAVIGATION])
    is_alarm = found.health != HealthState.OK
    return np.asarray(~found.air_data_used & given & is_alarm[:, None])


def inside(found: Estimate, loads: np.ndarray) -> float:
    """The part of loads within three deviations."""
    return float(np.mean(np.abs(found.loads - loads) <= 3.0 * found.loads_std))


@pytest.mark.parametrize("which", [MACH, PRESSURE])
def test_five_deviations_are_named_at_once_and_return(estimator: Estimator, which: int) -> None:
    for seed, size in enumerate((-5.0, 5.0)):
        found, loads = flown(estimator, seed, with_error(which, size))
        left_out = ~found.air_data_used
        wrong, after = slice(BEFORE, BEFORE + WRONG), slice(BEFORE + WRONG + 1, None)
        assert left_out[wrong, which].all()
        assert not np.delete(left_out, which, axis=1)[BEFORE:].any()
        assert not left_out[after].any()
        assert np.all(found.health[wrong] == HealthState.DEGRADED)
        assert np.all(found.health[after] == HealthState.OK)
        assert inside(found, loads) >= 0.99


@pytest.mark.parametrize("which", [MACH, PRESSURE])
def test_what_is_not_known_to_be_good_stays_out(estimator: Estimator, which: int) -> None:
    """Without a third quantity the filter forgets what the wrong one should read: then any reading fits."""
    for seed in range(2):
        found, loads = flown(estimator, seed, with_error(which, 5.0), NAVIGATION[:2], step=0.1)
        assert not found.air_data_used[BEFORE : BEFORE + WRONG, which].any()
        assert inside(found, loads) >= 0.99


@pytest.mark.parametrize("white", [0.2, 1.0])
def test_correct_navigation_is_never_named(estimator: Estimator, white: float) -> None:
    """Whether its error lasts as the filter has it, or is drawn in every sample, as it has not."""
    for seed in range(2):
        found, _ = flown(estimator, seed, np.zeros((N, 3)), white=white)
        alarms = named(found)
        assert not any(alarms[k : k + NAMED_AFTER].all(axis=0).any() for k in range(N - NAMED_AFTER + 1))
        assert white == 1.0 or not alarms.any()


@pytest.mark.parametrize("known", [2, 3])
@pytest.mark.parametrize("which", [MACH, PRESSURE])
def test_five_deviations_are_named_in_nearly_every_flight(estimator: Estimator, which: int, known: int) -> None:
    right, false, held = 0, 0, []
    for seed in range(FLIGHTS):
        found, loads = flown(estimator, seed, with_error(which, 5.0), NAVIGATION[:known])
        alarms = named(found, NAVIGATION[:known])
        right += bool(alarms[BEFORE + NAMED_AFTER - 1 : BEFORE + WRONG, which].all())
        false += bool(alarms[:BEFORE].any() or np.delete(alarms, which, axis=1).any())
        held.append(inside(found, loads))
    print(f"named {right} of {FLIGHTS}, falsely {false}; loads held in {100.0 * np.mean(held):.2f} %")
    assert right >= 0.95 * FLIGHTS
    assert false <= 0.01 * FLIGHTS
    assert np.mean(held) >= 0.99
