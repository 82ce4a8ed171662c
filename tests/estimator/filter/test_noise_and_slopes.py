"""Noise of the gauges alone must not become evidence against navigation that is correct."""

from dataclasses import replace

import numpy as np
import pytest
from flight_maps import NOISE_STD, ROWS, STATIONS, exact_response, flight_map
from scaled_maps import scaled_map

from strainfmu.estimator.filter.flight_filter import FlightFilter
from strainfmu.estimator.filter.settings import FilterSettings
from strainfmu.estimator.manifold.estimator import ManifoldEstimator
from strainfmu.estimator.map.inverse_map import InverseMap

N_D = STATIONS * ROWS
STATE = np.array([6.2, 0.09, -0.05, 8.6])
PRESSURE = 1
"""Of the quantities of navigation."""


def flown_score(steps: int, seed: int) -> float:
    """Return z of the error of p_inf after a manoeuvre, hardware errors expected and none there, p_inf known."""
    noise_std = np.full(N_D, NOISE_STD)
    inverse_map: InverseMap = replace(
        scaled_map(2, 1, N_D), noise_std=noise_std, manifold=flight_map(discrepancy=1e-3, hardware=True)
    )
    random = np.random.default_rng(seed)
    flight = FlightFilter(ManifoldEstimator(inverse_map), FilterSettings(time_constant=10.0))
    for i in range(steps):
        turn = 2.0 * np.pi * i / steps
        away = [-0.3 * i / steps, 0.05 * np.cos(3.0 * turn) - 0.05, 0.06 * np.sin(2.0 * turn), 0.2 * i / steps]
        mach, u, w, log_pressure = STATE + np.array(away)
        strain = exact_response(mach, u, w, np.exp(log_pressure))[:N_D] + NOISE_STD * random.standard_normal(N_D)
        flight.step(10.0 / steps, strain, static_pressure=np.exp(log_pressure))
    law, own = flight.track.law, 8 + PRESSURE
    assert law is not None
    return float(law.mean[own] / np.sqrt(1.0 - law.covariance[own, own]))


@pytest.mark.parametrize("seed", [0, 1])
def test_noise_of_gauges_is_no_evidence_against_correct_navigation(seed: int) -> None:
    """z after T = 10 s; with slopes at the iterates it is -14."""
    assert abs(flown_score(400, seed)) < 3.0
