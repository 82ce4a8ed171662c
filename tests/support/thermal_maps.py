"""Small maps that know of the wall's temperature."""

from dataclasses import replace
from typing import Any

import numpy as np

from strainfmu.estimator.map.inverse_map import InverseMap, with_gauge_covariance
from strainfmu.estimator.map.sensors import ThermalMap

REFERENCE = 293.15


def thermal_part(isothermal: np.ndarray, k: int = 6, n_t: int = 4, seed: int = 1, **changes: Any) -> ThermalMap:
    """Random modes for the gauges of the covariance ``isothermal`` (n_d, n_d)."""
    random, n_d = np.random.default_rng(seed), len(isothermal)
    fields: dict[str, Any] = {
        "reference_temperature": REFERENCE,
        "prior_std": random.uniform(5.0, 40.0, k),
        "mode_strain": 4e-7 * random.normal(size=(n_d, k)),
        "gauge_operator": random.uniform(0.0, 1.0, size=(n_d, k)),
        "sensor_names": tuple(f"T{i}" for i in range(n_t)),
        "sensor_operator": random.uniform(0.0, 1.0, size=(n_t, k)),
        "sensor_std": random.uniform(0.5, 2.0, n_t),
        "apparent_strain": np.array([2e-7, -1e-9]),
        "gauge_factor_slope": -1e-4,
        "modulus_slope": -4.5e-4,
        "isothermal_covariance": isothermal,
    }
    return ThermalMap(**(fields | changes))


def with_temperature(inverse_map: InverseMap, **changes: Any) -> InverseMap:
    """``inverse_map`` with modes, whose prior joins its gauges' covariance."""
    thermal = thermal_part(inverse_map.gauge_covariance, **changes)
    modes = thermal.linear_strain * thermal.prior_std
    covariance = thermal.isothermal_covariance + modes @ modes.T
    return replace(with_gauge_covariance(inverse_map, covariance), thermal=thermal)
