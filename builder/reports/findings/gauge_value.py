"""Value of each gauge: the cost of its loss, the bias that stays undetected, and its effect on the loads.

With P the precision of d - m and R the gauges lost, the gain without them is G - K P_R, K = G_R P_RR^-1
(:mod:`strainfmu.estimator.linear.masks`). The factor E = [G L - X' L'^-1, G A - M] of the loads' error is linear
in G. So with Q = P [L, A] it becomes E - K Q_R, and the variances of all sets of one size follow from three small
products.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from strainfmu.arrays import FloatArray, IntArray
from strainfmu.estimator.alarm_limits import (
    ambiguous_groups,
    correlations,
    detectable_noncentrality,
    minimal_detectable_bias,
    minimal_isolable_bias,
    outlier_threshold,
)
from strainfmu.estimator.health import FALSE_ALARM_PROBABILITY
from strainfmu.estimator.linear.map_parts import map_parts
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.policies import MIN_INFORMATION

MISS_PROBABILITY = 0.01
"""Probability that a bias of the stated detectable or isolable size is missed."""


@dataclass(frozen=True, eq=False, kw_only=True)
class GaugeValue:
    """Design figures per gauge; n_d gauges, loads in the order of the map.

    Attributes
    ----------
    leverage : (n_d,) 1 - P_ii / (Gamma^-1)_ii [1]: the fraction of its information that no other gauge has; 1
        where no other gauge checks it. With independent noise it is the diagonal of A T.
    growth : (n_d, 5) sigma of each load without the gauge over sigma with all [1]; infinite where the others do
        not identify the state.
    detectable_bias : (n_d,) minimum bias that its z-score detects in 99 % of the cases [m/m].
    isolable_bias : (n_d,) minimum bias that is attributed to this gauge in 99 % of the cases [m/m].
    undetected_effect : (n_d, 5) error of each load from a bias of ``detectable_bias``, in its sigmas [1].
    groups : gauges, by index, whose faults cannot be distinguished.
    pairs : (n, 2) all pairs of gauges.
    pair_growth : (n, 5) as ``growth``, with both lost.
    """

    leverage: FloatArray
    growth: FloatArray
    detectable_bias: FloatArray
    isolable_bias: FloatArray
    undetected_effect: FloatArray
    groups: tuple[tuple[int, ...], ...]
    pairs: IntArray
    pair_growth: FloatArray


def gauge_value(inverse_map: InverseMap) -> GaugeValue:
    """Return the value of each gauge of ``inverse_map``, at the estimator's probability of false alarms."""
    parts, n = map_parts(inverse_map), inverse_map.n_gauges
    whitening = inverse_map.residual_whitening
    precision = whitening.T @ whitening
    information = np.sum(parts.noise_whitening**2, axis=0)
    minimum = MIN_INFORMATION * information
    # The precision of a gauge that no other checks is round-off.
    precision_checked = np.where(np.eye(n, dtype=bool) & (precision <= minimum), 0.0, precision)
    correlation = correlations(precision, minimum)
    per_gauge = detectable_noncentrality(1, FALSE_ALARM_PROBABILITY / n, MISS_PROBABILITY)
    detectable = minimal_detectable_bias(precision_checked, per_gauge)
    threshold = outlier_threshold(n, FALSE_ALARM_PROBABILITY)
    std = np.sqrt(np.diag(inverse_map.load_covariance))
    pairs = np.array(list(combinations(range(n), 2)), dtype=np.int64).reshape(-1, 2)
    of_gain = np.sum(parts.gain_whitening**2, axis=0)
    return GaugeValue(
        leverage=np.clip(1.0 - of_gain / information, 0.0, 1.0),
        growth=loss_growth(inverse_map, np.arange(n)[:, None]),
        detectable_bias=detectable,
        isolable_bias=minimal_isolable_bias(precision_checked, correlation, threshold, MISS_PROBABILITY),
        undetected_effect=np.abs(parts.load_gain.T) * detectable[:, None] / std,
        groups=ambiguous_groups(correlation),
        pairs=pairs,
        pair_growth=loss_growth(inverse_map, pairs),
    )


def loss_growth(inverse_map: InverseMap, lost: IntArray) -> FloatArray:
    """Return (n, 5) sigma of each load without gauges over sigma with all [1], for n sets ``lost`` (n, k).

    Infinite where the gauges left do not identify the state (Case 1) or none is left.
    """
    parts = map_parts(inverse_map)
    model, gain, variance = parts.error_model, parts.load_gain, np.diag(inverse_map.load_covariance)
    precision = parts.gain_whitening.T @ parts.gain_whitening
    weight = parts.noise_whitening.T @ parts.noise_whitening
    error, change = gain @ model.noise_root - model.regression, precision @ model.noise_root
    if model.known_prior:
        of_states = gain @ model.state_operator - model.load_per_state
        error = np.hstack([error, of_states])
        change = np.hstack([change, precision @ model.state_operator])
    cross, square = error @ change.T, change @ change.T
    block = lost[:, :, None], lost[:, None, :]
    fraction = np.linalg.eigvals(np.linalg.solve(weight[block], precision[block])).real.min(axis=1)
    identified = (fraction >= MIN_INFORMATION) | model.known_prior
    identified &= lost.shape[1] < inverse_map.n_gauges
    growth = np.full((len(lost), 5), np.inf)
    sets = lost[identified]
    block = sets[:, :, None], sets[:, None, :]
    # K (n, 5, k) = G_R P_RR^-1
    k = np.linalg.solve(precision[block], gain.T[sets]).transpose(0, 2, 1)
    of_sets = np.sum(k * (k @ square[block]), axis=2) - 2.0 * np.sum(k * cross[:, sets].transpose(1, 0, 2), axis=2)
    growth[identified] = np.sqrt(np.maximum(variance + of_sets, 0.0) / variance)
    return growth
