"""Flights while the wall's temperature changes, by small maps with tables and temperature modes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from flight_fmu import FlightSample, random_flight, whole_map

from strainfmu.estimator.map.inverse_map import InverseMap


def warm_flight(held: InverseMap, steps: int, seed: int, time_step: float) -> list[FlightSample]:
    """Samples of ``held``, of which the modes' amplitudes decay within a second; sensors have constant errors.

    ``time_step`` [s] lies between two of them.
    """
    thermal, random = held.thermal, np.random.default_rng(seed)
    start = thermal.prior_std * random.standard_normal(len(thermal.prior_std))
    amplitude = np.exp(-time_step * np.arange(steps))[:, None] * start
    error = thermal.sensor_std * random.standard_normal(thermal.n_sensors)
    temperature = thermal.reference_temperature + amplitude @ thermal.sensor_operator.T + error
    cold = random_flight(whole_map(), steps, seed)
    rise = amplitude @ thermal.gauge_operator.T
    apparent = sum(one * rise ** (k + 1) for k, one in enumerate(thermal.apparent_strain))
    by_load = np.array([one.strain for one in cold]) / (1.0 + thermal.modulus_slope * rise)
    strain = (1.0 + thermal.gauge_factor_slope * rise) * (by_load + amplitude @ thermal.mode_strain.T + apparent)
    return [
        replace(one, strain=warm, temperature=sensors)
        for one, warm, sensors in zip(cold, strain, temperature, strict=True)
    ]
