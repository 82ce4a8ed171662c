"""Air data of an estimated flight state, with standard deviations."""

from __future__ import annotations

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.estimator.air_data import AIR_DATA_NAMES as AIR_DATA_NAMES
from strainfmu.estimator.air_data import AIR_DATA_UNITS as AIR_DATA_UNITS
from strainfmu.estimator.air_data import AirData, air_data_of_state
from strainfmu.estimator.manifold.load_solution import lognormal_std
from strainfmu.estimator.policies import MIN_GAIN as MIN_GAIN
from strainfmu.estimator.policies import MIN_INCIDENCE_SCORE
from strainfmu.estimator.tables.flight_tables import LOG_PRESSURE, MACH, U, W


def air_data(state: FloatArray, covariance: FloatArray, prior_std: FloatArray) -> AirData:
    """Return the air data of ``state`` (k, 4) with ``covariance`` (k, 4, 4); ``prior_std`` (4,) of the ranges."""
    value, jacobian = air_data_of_state(state)
    variance = np.einsum("kix,kxy,kiy->ki", jacobian, covariance, jacobian)
    std = np.sqrt(np.maximum(variance, 0.0))
    std[:, 5:] = value[:, 5:] * lognormal_std(std[:, 5:] / value[:, 5:])
    std[:, 3] = np.minimum(std[:, 3], np.pi / np.sqrt(3.0))  # of a roll angle that may be any
    return AirData(value=value, std=std, is_identified=_identified(state, covariance, prior_std, std))


def _identified(state: FloatArray, covariance: FloatArray, prior_std: FloatArray, std: FloatArray) -> BoolArray:
    of_state = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2)) < MIN_GAIN * prior_std
    angles = of_state[:, U] & of_state[:, W]
    roll = np.hypot(state[:, U], state[:, W]) > MIN_INCIDENCE_SCORE * std[:, 2]
    both = of_state[:, MACH] & of_state[:, LOG_PRESSURE]
    return np.column_stack(
        [angles, angles, angles, roll & angles, of_state[:, MACH], of_state[:, LOG_PRESSURE], both]
    )
