"""Flights of a small vehicle whose navigation is wrong for a while."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from flight_maps import NOISE_STD, ROWS, STATIONS, exact_response, flight_map
from scaled_maps import scaled_map

from strainfmu.estimator.filter.flight_filter import FlightFilter
from strainfmu.estimator.filter.settings import FilterSettings
from strainfmu.estimator.manifold.estimator import ManifoldEstimator
from strainfmu.estimator.manifold.flight_estimate import FlightEstimate
from strainfmu.estimator.manifold.navigation import NAVIGATION

N_D = STATIONS * ROWS
DT = 0.01
STD = (0.05, 0.02, 0.01)
"""Deviations of M [1], p_inf and q_inf [of the value]."""

MACH, PRESSURE = 0, 1
BEFORE, WRONG, AFTER = 20, 35, 10
"""Samples before the error, with it, and after it."""

N = BEFORE + WRONG + AFTER


def flight_estimator() -> ManifoldEstimator:
    """An estimator with errors of pressure and of hardware."""
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
    """Errors (n, 3) of ``size`` deviations in one quantity, while it is wrong."""
    error = np.zeros((N, 3))
    error[BEFORE : BEFORE + WRONG, which] = size
    return error


def inside(found: list[FlightEstimate], loads: np.ndarray) -> float:
    """The part of loads within three deviations."""
    apart = np.array([one.loads for one in found]) - loads
    return float(np.mean(np.abs(apart) <= 3.0 * np.array([one.loads_std for one in found])))
