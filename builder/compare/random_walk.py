"""A Kalman filter whose states walk at random, on a linear map of Case 2.

It is the estimator of load from strain that many works use: d = d_0 + s (m - d_0 + A q) + e with q + w in the
next cycle, e and w white. The states are standard normal when a flight begins. What is not white,
as the error of a gain, is the same in all cycles, and the filter takes it for noise that averages out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from builder.compare.candidate import Answer, median_microseconds
from builder.compare.flights import Readings, one_condition
from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.other_loads import FIVE_LOADS

STEP_STD = 0.1
"""Standard deviation of the walk in one cycle, over the prior's: at 100 Hz it reaches the prior's in 1 s."""


@dataclass(frozen=True, eq=False, kw_only=True)
class WalkState:
    """States of k flights: mean (k, n_q) and covariance (k, n_q, n_q)."""

    mean: FloatArray
    covariance: FloatArray


class RandomWalkCandidate:
    """The filter, fed with all readings of a flight; it answers to the last one."""

    name = "Kalman filter, random walk"
    has_field, takes_one_reading = False, False

    def __init__(self, inverse_map: InverseMap) -> None:
        """Prepare ``inverse_map``, of Case 2 and form "dynamic_pressure"."""
        self.inverse_map = inverse_map
        self._gauges = inverse_map.gauge_covariance
        self._error_strain, self._error_load = inverse_map.error_strain, inverse_map.error_load[FIVE_LOADS]
        self._fixed_strain, self._fixed_load = inverse_map.fixed_strain, inverse_map.fixed_load[FIVE_LOADS]
        self._scaled = self._error_strain @ self._error_strain.T
        self._answered: tuple[Readings, Answer] | None = None

    def start(self, k: int) -> WalkState:
        """Return the states before the first reading of ``k`` flights."""
        n = self.inverse_map.state_operator.shape[1]
        return WalkState(mean=np.zeros((k, n)), covariance=np.broadcast_to(np.eye(n), (k, n, n)))

    def after(self, state: WalkState, strain: FloatArray, ratio: FloatArray) -> WalkState:
        """Return the states after ``strain`` (k, n_d) at ``ratio`` (k,) of q_inf to the nominal one."""
        s = ratio[:, None, None]
        operator = s * self.inverse_map.state_operator
        covariance = state.covariance + STEP_STD**2 * np.eye(state.mean.shape[1])
        cross = covariance @ np.swapaxes(operator, 1, 2)
        of_strain = operator @ cross + self._gauges + s * s * self._scaled
        gain = np.swapaxes(np.linalg.solve(of_strain, np.swapaxes(cross, 1, 2)), 1, 2)
        of_mean = self._fixed_strain + ratio[:, None] * (self.inverse_map.mean_strain - self._fixed_strain)
        innovation = strain - of_mean - (operator @ state.mean[:, :, None])[:, :, 0]
        return WalkState(
            mean=state.mean + (gain @ innovation[:, :, None])[:, :, 0],
            covariance=covariance - gain @ np.swapaxes(cross, 1, 2),
        )

    def answer(self, read: Readings, navigation: str) -> Answer:
        """Return the estimates after the last reading, the same with any navigation."""
        if self._answered is None or self._answered[0] is not read:
            self._answered = read, self._filtered(read)
        return self._answered[1]

    def _filtered(self, read: Readings) -> Answer:
        found, q = self.inverse_map, read.dynamic_pressure
        ratio = q / found.nominal_dynamic_pressure
        state = self.start(len(q))
        for strain in read.strain:
            state = self.after(state, strain, ratio)
        s = ratio[:, None]
        of_mean, per_state = found.load_of_mean[FIVE_LOADS], found.load_per_state[FIVE_LOADS]
        loads = self._fixed_load + s * (of_mean - self._fixed_load + state.mean @ per_state.T)
        of_state = per_state @ state.covariance @ per_state.T
        covariance = (s * s)[:, :, None] * (of_state + self._error_load @ self._error_load.T)
        scale = 1.0 / (q[:, None] * found.references[FIVE_LOADS])
        coefficients = scale * loads
        relative = found.dynamic_pressure_error
        if not np.isnan(read.dynamic_pressure_std):
            relative = float(np.mean(read.dynamic_pressure_std / q))
        variance = scale**2 * np.diagonal(covariance, axis1=1, axis2=2) + (relative * coefficients) ** 2
        return Answer(coefficients=coefficients, std=np.sqrt(variance))

    def step_microseconds(self, read: Readings, navigation: str) -> float:
        """Return the median time of a cycle of one flight."""
        one = one_condition(read)
        ratio = one.dynamic_pressure / self.inverse_map.nominal_dynamic_pressure
        state = self.start(1)
        return median_microseconds(lambda: self.after(state, one.last, ratio))
