"""A Kalman filter whose states walk at random, on a linear map of Case 2.

It is the estimator of load from strain that many works use: d = d_0 + s (m - d_0 + A q) + e with q + w in the
next cycle, e and w white. The states are standard normal when a flight begins. What is not white,
as the error of a gain, is the same in all cycles, and the filter takes it for noise that averages out.
"""

from __future__ import annotations

import numpy as np

from builder.trial.estimators import EstimateReadings, Estimates
from builder.trial.readings import Readings
from strainfmu.arrays import FloatArray
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.other_loads import FIVE_LOADS

STEP_STD = 0.1
"""Standard deviation of the walk in one cycle, over the prior's: at 100 Hz it reaches the prior's in 1 s."""

State = tuple[FloatArray, FloatArray]
"""Mean (k, n_q) and covariance (k, n_q, n_q) of the states of k flights."""


def of_random_walk(inverse_map: InverseMap) -> EstimateReadings:
    """Return the filter on ``inverse_map``, of Case 2 and form "dynamic_pressure", fed with all readings of a
    flight; its estimates are the ones after the last."""

    def estimate(read: Readings) -> Estimates:
        q = np.asarray(read.known[DYNAMIC_PRESSURE])
        ratio, state = q / inverse_map.nominal_dynamic_pressure, before_readings(inverse_map, len(q))
        for strain in np.swapaxes(read.strain, 0, 1):
            state = after_reading(inverse_map, state, strain, ratio)
        return _loads_of(inverse_map, state, q)

    return estimate


def before_readings(inverse_map: InverseMap, k: int) -> State:
    """Return the states before the first reading of ``k`` flights."""
    n = inverse_map.state_operator.shape[1]
    return np.zeros((k, n)), np.broadcast_to(np.eye(n), (k, n, n))


def after_reading(inverse_map: InverseMap, state: State, strain: FloatArray, ratio: FloatArray) -> State:
    """Return the states after ``strain`` (k, n_d) at ``ratio`` (k,) of q_inf to the nominal one."""
    mean, s, fixed = state[0], ratio[:, None, None], inverse_map.fixed_strain
    operator, error = s * inverse_map.state_operator, inverse_map.error_strain
    covariance = state[1] + STEP_STD**2 * np.eye(mean.shape[1])
    cross = covariance @ np.swapaxes(operator, 1, 2)
    of_strain = operator @ cross + inverse_map.gauge_covariance + s * s * (error @ error.T)
    gain = np.swapaxes(np.linalg.solve(of_strain, np.swapaxes(cross, 1, 2)), 1, 2)
    expected = fixed + ratio[:, None] * (inverse_map.mean_strain - fixed) + (operator @ mean[:, :, None])[:, :, 0]
    mean = mean + (gain @ (strain - expected)[:, :, None])[:, :, 0]
    return mean, covariance - gain @ np.swapaxes(cross, 1, 2)


def _loads_of(inverse_map: InverseMap, state: State, q: FloatArray) -> Estimates:
    """Return the coefficients of states at a dynamic pressure ``q`` (k,) [Pa]."""
    mean, covariance = state
    s = (q / inverse_map.nominal_dynamic_pressure)[:, None]
    fixed, error = inverse_map.fixed_load[FIVE_LOADS], inverse_map.error_load[FIVE_LOADS]
    of_mean, per_state = inverse_map.load_of_mean[FIVE_LOADS], inverse_map.load_per_state[FIVE_LOADS]
    loads = fixed + s * (of_mean - fixed + mean @ per_state.T)
    of_loads = (s * s)[:, :, None] * (per_state @ covariance @ per_state.T + error @ error.T)
    scale = 1.0 / (q[:, None] * inverse_map.references[FIVE_LOADS])
    value = scale * loads
    variance = (
        scale**2 * np.diagonal(of_loads, axis1=1, axis2=2) + (inverse_map.dynamic_pressure_error * value) ** 2
    )
    return Estimates(value=value, std=np.sqrt(variance))
