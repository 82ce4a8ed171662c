"""The filter of a linear map; in form "absolute" the ratio of q_inf to nominal is 1.

States are the pressure states q, errors that grow with q_inf in the directions that gauges see, errors that gauges
have in common, and errors of the amplitudes of temperature modes. q decays with the time constant T to the prior
of the map; in Case 1, which has none, to the amplitude at which each state alone reaches the largest strains of
the snapshots, or a gauge's noise where this is more. Other errors are considered, and so are those of zeros,
which stay as they are. Memory changes the estimate of the sample by the loads of the law less those of a law of
the sample alone.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.policies import SLOW
from strainfmu.estimator.reference import kalman
from strainfmu.estimator.reference.kalman import Law, Rows, measured, predicted
from strainfmu.estimator.reference.linear import LOADS
from strainfmu.estimator.reference.readings import Zeros, zero_columns

ROUND_OFF = 1e-9
"""Variance of an error over that of the noise below which it is round-off."""


class Change(NamedTuple):
    """What memory changes: ``loads`` (5,), ``covariance`` (5, 5), and the ``chi_square`` of the innovation."""

    loads: FloatArray
    covariance: FloatArray
    chi_square: float


class LinearFilterReference:
    """A linear map fed with one sample after another; it never begins again."""

    def __init__(self, inverse_map: InverseMap, time_constant: float, zeros: Zeros | None = None) -> None:
        """Begin with the prior of the map; ``time_constant`` T [s], ``zeros`` that are taken off the rows."""
        errors, load_of_errors = inverse_map.error_strain, inverse_map.error_load[:LOADS]
        self.map, self.time_constant = inverse_map, time_constant
        self.law: Law | None = None
        self.noise, common, lasting = kalman.gauge_errors(inverse_map, inverse_map.gauge_covariance)
        of_modes = inverse_map.thermal.prior_std
        cross, variance = errors @ load_of_errors.T, load_of_errors @ load_of_errors.T
        self.seen = kalman.seen_errors(errors, cross, variance, 1.0, np.sqrt(self.noise + np.diag(lasting)))
        states, n_d = inverse_map.state_operator, inverse_map.n_gauges
        self.scaled_strain = np.hstack([states, self.seen.strain, np.zeros(common.shape)])
        self.scaled_load = np.hstack(
            [inverse_map.load_per_state[:LOADS], self.seen.load, np.zeros((LOADS, common.shape[1]))]
        )
        n, n_scaled = self.scaled_strain.shape[1], self.scaled_strain.shape[1] - common.shape[1]
        self.common = np.hstack([np.zeros((n_d, n_scaled)), common])
        std = np.ones(n)
        if inverse_map.case == 1:
            reached = np.maximum(inverse_map.strain_range, inverse_map.noise_std)
            largest = np.max(np.abs(states) / reached[:, None], axis=0)
            std[: states.shape[1]] = 1.0 / largest
        lasts = (np.arange(n) >= n_scaled) & (np.arange(n) < n - len(of_modes))
        self.time_constants = np.where(lasts, SLOW, 1.0) * time_constant
        self.lasting, self.rest = (_root(one, self.noise) for one in (lasting, self.seen.rest_strain))
        self.of_zeros = zero_columns(inverse_map, zeros)
        n_decaying, n_zeros = self.lasting.shape[1] + self.rest.shape[1], self.of_zeros.shape[1]
        self.constant = np.arange(n_decaying + n_zeros) >= n_decaying
        std[n - len(of_modes) :] = of_modes
        self.prior = Law(np.zeros(n), np.diag(std**2), np.zeros((n, len(self.constant))))
        self.fixed = inverse_map.fixed_strain

    def step(self, time_step: float, rows: FloatArray, used: BoolArray, dynamic_pressure: float) -> Change | None:
        """Return what memory changes of a sample ``time_step`` [s] after the last; None where nothing is measured.

        Nothing is without a gauge in use or a dynamic pressure; the first sample has no memory, and no change.
        """
        if self.law is not None:
            self.law = self.predicted(self.law, time_step, self.prior)
        if not used.any() or not dynamic_pressure > 0.0:
            return None
        ratio = dynamic_pressure / self.map.nominal_dynamic_pressure if self.map.follows_pressure else 1.0
        alone, found = measured(self.prior, self.rows(self.prior, rows, used, ratio))
        after = alone
        if self.law is not None:
            after, found = measured(self.law, self.rows(self.law, rows, used, ratio))
        self.law = after
        of_memory, of_alone = (self.loads(one, rows, used, ratio) for one in (after, alone))
        return Change(of_memory[0] - of_alone[0], of_memory[1] - of_alone[1], float(found.chi_square[0]))

    def transition(self, time_step: float) -> FloatArray:
        """Return F (n, n) over ``time_step`` [s]: all states decay."""
        return np.diag(np.exp(-time_step / self.time_constants))

    def predicted(self, law: Law, time_step: float, stationary: Law) -> Law:
        """Return ``law`` after ``time_step`` [s]; ``stationary`` is that of no sample."""
        kept = np.where(self.constant, 1.0, np.exp(-time_step / self.time_constant))
        return predicted(law, self.transition(time_step), stationary, kept)

    def rows(self, law: Law, rows: FloatArray, used: BoolArray, ratio: float) -> Rows:
        """Return the rows in use of ``rows`` (n_d,) at ``ratio`` of q_inf to nominal, about ``law``."""
        by_state = ratio * self.scaled_strain + self.common
        expected = self.fixed + ratio * (self.map.mean_strain - self.fixed) + by_state @ law.mean
        considered = np.hstack([self.lasting, ratio * self.rest, self.of_zeros])
        return Rows((rows - expected)[used], by_state[used], considered[used], np.diag(self.noise[used]))

    def loads(self, law: Law, rows: FloatArray, used: BoolArray, ratio: float) -> tuple[FloatArray, FloatArray]:
        """Return loads and covariance by ``law``, but for what is the same of every law."""
        read = self.rows(law, rows, used, ratio)
        cross = ratio**2 * self.seen.rest_cross[used]
        of_residual = np.linalg.solve(read.considered @ read.considered.T + read.noise, cross).T
        by_state = ratio * self.scaled_load
        of_states = by_state - of_residual @ read.by_state
        return by_state @ law.mean + of_residual @ read.innovation, of_states @ law.covariance @ of_states.T


def _root(covariance: FloatArray, noise: FloatArray) -> FloatArray:
    """Return columns (n_d, k) whose squares add up to ``covariance``, without those of round-off."""
    std = np.sqrt(noise)
    value, vector = np.linalg.eigh(covariance / np.outer(std, std))
    counts = value > ROUND_OFF
    return np.asarray(std[:, None] * vector[:, counts] * np.sqrt(value[counts]))
