"""Small maps that know of the vehicle's inertia."""

from dataclasses import replace
from typing import Any

import numpy as np

from strainfmu.estimator.map.inverse_map import InverseMap, with_gauge_covariance
from strainfmu.estimator.map.sensors import CHANNELS, InertiaMap

PRIOR = np.array([20.0, 25.0, 25.0, 5.0, 5.0, *(6 * [2.0])])
ERRORS = np.array([0.1, 0.1, 0.1, 0.5, 0.5, *(6 * [0.05])])


def inertia_part(rest: np.ndarray, size: float, seed: int = 2, **changes: Any) -> InertiaMap:
    """Random modes for the gauges of the covariance ``rest`` (n_d, n_d), of strain ``size`` at their prior."""
    strain = size * np.random.default_rng(seed).normal(size=(len(rest), len(CHANNELS))) / PRIOR
    shape = np.random.default_rng(seed + 1).normal(size=(len(rest), 2))
    fields = {
        "prior_std": PRIOR,
        "sensor_std": ERRORS,
        "mode_strain": strain,
        "rest_covariance": rest,
        "vibration_strain": shape / np.abs(shape).max(axis=0),
        "vibration_std": size,
    }
    return InertiaMap(**(fields | changes))


def with_masses(inverse_map: InverseMap, size: float | None = None, **changes: Any) -> InverseMap:
    """``inverse_map`` with inertia modes, whose prior joins its gauges' covariance.

    Their strain has ``size`` [m/m], three times the noise of the gauges by default.
    """
    rest = inverse_map.thermal.isothermal_covariance
    noise = float(np.sqrt(np.median(np.diag(rest))))
    inertia = inertia_part(rest, 3.0 * noise if size is None else size, **changes)
    vibration = inertia.vibration_std * inertia.vibration_strain
    modes = np.hstack([inertia.mode_strain * inertia.prior_std, vibration])
    covariance = inverse_map.gauge_covariance + modes @ modes.T
    return replace(with_gauge_covariance(inverse_map, covariance), inertia=inertia)
