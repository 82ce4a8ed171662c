"""Flights while the wall's temperature changes, by small maps with tables and temperature modes."""

from dataclasses import replace

import numpy as np
from flight_fmu import FlightSample, random_flight, whole_map

from strainfmu.estimator.map.inverse_map import InverseMap


def warm_flight(inverse_map: InverseMap, steps: int, seed: int, time_step: float) -> list[FlightSample]:
    """Samples of ``inverse_map``, of which the modes' amplitudes decay in a second; sensor errors are constant.

    ``time_step`` [s] lies between two of them.
    """
    thermal, random = inverse_map.thermal, np.random.default_rng(seed)
    start = thermal.prior_std * random.standard_normal(len(thermal.prior_std))
    amplitude = np.exp(-time_step * np.arange(steps))[:, None] * start
    error = thermal.sensor_std * random.standard_normal(thermal.n_sensors)
    temperature = thermal.reference_temperature + amplitude @ thermal.sensor_operator.T + error
    cold = random_flight(whole_map(), steps, seed)
    rise = amplitude @ thermal.gauge_operator.T
    apparent = sum(row * rise ** (k + 1) for k, row in enumerate(thermal.apparent_strain))
    by_load = np.array([sample.strain for sample in cold]) / (1.0 + thermal.modulus_slope * rise)
    strain = (1.0 + thermal.gauge_factor_slope * rise) * (by_load + amplitude @ thermal.mode_strain.T + apparent)
    return [
        replace(sample, strain=warm, temperature=sensors)
        for sample, warm, sensors in zip(cold, strain, temperature, strict=True)
    ]
