"""Navigation that becomes wrong in flight: named, left out while it lasts, and back when it is good again."""

from dataclasses import replace

import numpy as np
import pytest
from flight_maps import NOISE_STD, ROWS, STATIONS, exact_response, flight_map
from scaled_maps import scaled_map

from strainfmu.estimator.filter.flight_filter import FlightFilter
from strainfmu.estimator.filter.named_navigation import NAMED_AFTER
from strainfmu.estimator.filter.settings import FilterSettings
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.manifold.estimator import ManifoldEstimator
from strainfmu.estimator.manifold.flight_estimate import FlightEstimate
from strainfmu.estimator.manifold.navigation import NAVIGATION

pytestmark = pytest.mark.fast
N_D = STATIONS * ROWS
DT = 0.01
STD = (0.05, 0.02, 0.01)
"""Deviations of M [1], p_inf and q_inf [of the value]."""

MACH, PRESSURE = 0, 1
BEFORE, WRONG, AFTER = 20, 35, 10
"""Samples before the error, with it, and after it."""

N = BEFORE + WRONG + AFTER


@pytest.fixture(scope="module", name="estimator")
def _estimator() -> ManifoldEstimator:
    held = replace(
        scaled_map(2, 1, N_D),
        noise_std=np.full(N_D, NOISE_STD),
        manifold=flight_map(discrepancy=1e-2, hardware=True),
    )
    return ManifoldEstimator(held)


def states(seed: int) -> np.ndarray:
    """A slow turn from a random flight state."""
    random = np.random.default_rng(seed)
    first = np.array([random.uniform(5.7, 6.7), *random.uniform(-0.08, 0.08, size=2), random.uniform(8.2, 9.0)])
    turn = np.linspace(0.0, 1.0, N)
    return np.asarray(first + turn[:, None] * random.uniform(-1.0, 1.0, size=4) * [0.02, 0.03, 0.03, 0.02])


def flown(
    estimator: ManifoldEstimator,
    seed: int,
    error: np.ndarray,
    known: tuple[str, ...] = NAVIGATION,
    white: float = 0.0,
    step: float = DT,
) -> tuple[list[FlightEstimate], np.ndarray, np.ndarray]:
    """Return the estimates of a flight, its loads and which quantities of navigation are named (n, 3).

    Navigation has ``error`` (n, 3) beside its own, in deviations: one of one deviation for the whole flight, but
    for the part ``white`` of the variance, drawn in every sample.
    """
    random, flight = np.random.default_rng(seed), FlightFilter(estimator, FilterSettings(time_constant=1.0))
    own, out, loads, named = random.standard_normal(3), [], [], []
    for state, further in zip(states(seed), error, strict=True):
        both = exact_response(*state[:3], np.exp(state[3]))
        drawn = np.sqrt(1.0 - white) * own + np.sqrt(white) * random.standard_normal(3)
        mach, pressure = state[0], np.exp(state[3])
        right = (mach, pressure, 0.7 * mach**2 * pressure)
        size = (STD[0], STD[1] * right[1], STD[2] * right[2])
        read = np.array(right) + size * (drawn + further)
        flow = {name: value for name, value in zip(NAVIGATION, read, strict=True) if name in known}
        strain = both[:N_D] + NOISE_STD * random.standard_normal(N_D)
        out.append(flight.recorded(step, strain, flow).estimate[0])
        loads.append(both[N_D:])
        named.append(flight.track.named.apart > 0.0)
    return out, np.array(loads), np.array(named)


def with_error(which: int, size: float) -> np.ndarray:
    error = np.zeros((N, 3))
    error[BEFORE : BEFORE + WRONG, which] = size
    return error


def inside(found: list[FlightEstimate], loads: np.ndarray) -> float:
    """The part of loads within three deviations."""
    apart = np.array([one.loads for one in found]) - loads
    return float(np.mean(np.abs(apart) <= 3.0 * np.array([one.loads_std for one in found])))


@pytest.mark.parametrize("which", [MACH, PRESSURE])
def test_five_deviations_are_named_at_once_and_return(estimator: ManifoldEstimator, which: int) -> None:
    for seed, size in enumerate((-5.0, 5.0)):
        found, loads, named = flown(estimator, seed, with_error(which, size))
        left_out = ~np.array([one.navigation_used for one in found])
        wrong, after = slice(BEFORE, BEFORE + WRONG), slice(BEFORE + WRONG + 1, None)
        assert left_out[wrong, which].all()
        assert named[BEFORE + NAMED_AFTER - 1 : BEFORE + WRONG, which].all()
        assert not np.delete(left_out, which, axis=1)[BEFORE:].any()
        assert not left_out[after].any()
        assert all(one.health is HealthState.DEGRADED for one in found[wrong])
        assert all(one.health is HealthState.OK for one in found[after])
        assert inside(found, loads) >= 0.99


@pytest.mark.parametrize("which", [MACH, PRESSURE])
def test_what_is_not_known_to_be_good_stays_out(estimator: ManifoldEstimator, which: int) -> None:
    """Without a third quantity the filter forgets what the wrong one should read: then any reading fits."""
    for seed in range(2):
        found, loads, _ = flown(estimator, seed, with_error(which, 5.0), NAVIGATION[:2], step=0.1)
        used = np.array([one.navigation_used[which] for one in found])
        assert not used[BEFORE : BEFORE + WRONG].any()
        assert inside(found, loads) >= 0.99


@pytest.mark.parametrize("white", [0.2, 1.0])
def test_correct_navigation_is_never_named(estimator: ManifoldEstimator, white: float) -> None:
    """Whether its error lasts as the filter has it, or is drawn in every sample, as it has not."""
    for seed in range(2):
        assert not flown(estimator, seed, np.zeros((N, 3)), white=white)[2].any()
