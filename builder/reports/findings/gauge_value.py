"""Value of each gauge: the cost of its loss, the bias that stays undetected, and its effect on the loads.

With P the precision of d - m and R the gauges lost, the gain without them is G - K P_R, K = G_R P_RR^-1. With L
the root of the gauges' covariance and N, M strain and loads of what has a prior
(:mod:`strainfmu.estimator.reference.linear`), the factor E = [G L, G N - M] of the loads' error is linear in G. So
with Q = P [L, N] it becomes E - K Q_R, and the variances of all sets of one size follow from three small products.

A map with tables is used with the nonlinear estimator, which is linear about a flight state
(:mod:`strainfmu.estimator.reference.nonlinear`). Its gain is the best one, so that without the gauges R the
variance rises by diag(K P_RR K'); considered errors E = N G' - M become E - N P_R' K'. Variances, P and the
precision of each gauge alone are means over few states of the envelope.
"""

from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple, TypedDict

import numpy as np
from scipy.sparse.csgraph import connected_components
from scipy.special import ndtr

from builder.reports.findings.envelope_states import ALL, FEW, air_data_at, envelope, strain_at
from strainfmu.arrays import FloatArray, IntArray, inverse_root
from strainfmu.estimator.health import (
    AMBIGUOUS_CORRELATION,
    FALSE_ALARM_PROBABILITY,
    MISS_PROBABILITY,
    detectable_bias,
    outlier_threshold,
)
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.nonlinear_map import ManifoldMap
from strainfmu.estimator.other_loads import FIVE_LOADS
from strainfmu.estimator.policies import POLICIES
from strainfmu.estimator.reference.air import N_AIR, air_inputs
from strainfmu.estimator.reference.gain import load_covariance, noise_precision, nominal, residual_precision
from strainfmu.estimator.reference.linear import models
from strainfmu.estimator.reference.nonlinear import NonlinearReference, Sample, coefficient_slopes

NEWTON_STEPS = 100
PAIRED = 512
"""Gauges at most whose losses in pairs are looked into: those whose own loss costs most."""


@dataclass(frozen=True, eq=False, kw_only=True)
class GaugeValue:
    """Design figures per gauge; n_d gauges; loads in the order of the map, or coefficients (nonlinear estimator).

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
    pairs : (n, 2) pairs of gauges: all, or of many gauges the pairs of the :data:`PAIRED` whose loss costs most.
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


class _Gains(NamedTuple):
    """What the loads of a map follow from, at its nominal dynamic pressure.

    Attributes
    ----------
    gain : (5, n_d) G.
    precision : (n_d, n_d) P of the gamma that the estimate is made with.
    weight : (n_d, n_d) Gamma^-1.
    cross, square : (5, n_d) E Q' and (n_d, n_d) Q Q'.
    variance : (5,) of the loads.
    """

    gain: FloatArray
    precision: FloatArray
    weight: FloatArray
    cross: FloatArray
    square: FloatArray
    variance: FloatArray


def _gains(inverse_map: InverseMap) -> _Gains:
    for_gain, truth = models(inverse_map, at_nominal=True)
    (gain, precision), weight = nominal(for_gain), noise_precision(inverse_map)
    variance, gain = np.diag(load_covariance(inverse_map, gain))[FIVE_LOADS], gain[FIVE_LOADS]
    if for_gain is truth:  # the error of the best gain is independent of every residual: E Q' = 0, Q Q' = P
        return _Gains(gain, precision, weight, np.zeros(gain.shape), precision, variance)
    root = np.linalg.cholesky(truth.noise)
    error = np.hstack([gain @ root, gain @ truth.columns - truth.output_columns[FIVE_LOADS]])
    change = precision @ np.hstack([root, truth.columns])
    return _Gains(gain, precision, weight, error @ change.T, change @ change.T, variance)


def gauge_value(inverse_map: InverseMap) -> GaugeValue:
    """Return the value of each gauge to the estimator of ``inverse_map``, at its probability of false alarms."""
    if inverse_map.manifold is not None:
        return _of_nonlinear(inverse_map, inverse_map.manifold)
    gains, n = _gains(inverse_map), inverse_map.n_gauges
    information = np.diag(gains.weight)
    is_true = gains.square is gains.precision  # what the gain is made for
    precision = gains.precision if is_true else residual_precision(inverse_map)
    detection = _detection(precision, information)
    growth = _growth(inverse_map, gains, np.arange(n)[:, None])
    pairs = _pairs(growth)
    return GaugeValue(
        leverage=np.clip(1.0 - np.diag(gains.precision) / information, 0.0, 1.0),
        growth=growth,
        undetected_effect=np.abs(gains.gain.T) * detection["detectable_bias"][:, None] / np.sqrt(gains.variance),
        pairs=pairs,
        pair_growth=_growth(inverse_map, gains, pairs),
        **detection,
    )


def _pairs(growth: FloatArray) -> IntArray:
    """Return (n, 2) the pairs of gauges whose loss is looked into; ``growth`` (n_d, 5) is of each alone."""
    costly = np.argsort(-growth.max(axis=1), kind="stable")[:PAIRED]
    return np.array(list(combinations(sorted(costly.tolist()), 2)), dtype=np.int64).reshape(-1, 2)


class _Detection(TypedDict):
    detectable_bias: FloatArray
    isolable_bias: FloatArray
    groups: tuple[tuple[int, ...], ...]


def _detection(precision: FloatArray, information: FloatArray) -> _Detection:
    """Return which biases show in residuals of ``precision`` P (n, n), from ``information`` (n,) of each gauge."""
    n, minimum = len(precision), POLICIES.min_information * information
    # The precision of a gauge that no other checks is round-off.
    checked = np.where(np.diag(precision) <= minimum, 0.0, np.diag(precision))
    correlation, threshold = correlations(precision, minimum), outlier_threshold(n, FALSE_ALARM_PROBABILITY)
    return {
        "detectable_bias": detectable_bias(checked, threshold),
        "isolable_bias": isolable_bias(checked, correlation, threshold, MISS_PROBABILITY),
        "groups": ambiguous_groups(correlation),
    }


def correlations(precision: FloatArray, min_precision: FloatArray | float = 0.0) -> FloatArray:
    """Return (n, n) correlations P_ij / sqrt(P_ii P_jj) of z; 0 with gauges of at most ``min_precision``, which no
    other checks."""
    of_gauge = np.diag(precision)
    scale = np.where(of_gauge > min_precision, np.maximum(of_gauge, 1e-300) ** -0.5, 0.0)
    correlation = precision * scale
    correlation *= scale[:, None]  # in place: of many gauges a large array
    return correlation


def ambiguous_groups(correlation: FloatArray, limit: float = AMBIGUOUS_CORRELATION) -> tuple[tuple[int, ...], ...]:
    """Return the groups of two gauges or more, by index, that are linked by |correlation| >= ``limit``.

    A bias in one of a group shifts the z of all of it nearly alike (Foerstner 1983; Teunissen 2018 on
    identification): an alarm points to the group.
    """
    count, group = connected_components((correlation >= limit) | (correlation <= -limit), directed=False)
    groups = [tuple(np.flatnonzero(group == number).tolist()) for number in range(count)]
    return tuple(members for members in groups if len(members) > 1)


def isolable_bias(
    precision: FloatArray, correlation: FloatArray, threshold: float, miss_probability: float
) -> FloatArray:
    """Return (n,) bias [m/m] of gauge i that is attributed to gauge i with probability 1 - ``miss_probability``.

    Attributed means: |z_i| > ``threshold`` and |z_i| > |z_j| for all j. With delta = b sqrt(P_ii) and rho the
    correlation of z_i and z_j, z_i -+ z_j is normal of mean delta (1 -+ rho) and variance 2 (1 -+ rho); so a miss
    has at most the probability

        Phi(k - delta) + sum_j Phi(-delta sqrt((1 - rho_ij) / 2)) + Phi(-delta sqrt((1 + rho_ij) / 2)),

    Bonferroni's bound on the events of Teunissen, Distributional theory for the DIA method (2018). Infinite where
    |rho| = 1 or nothing checks the gauge. ``precision`` (n,) holds P_ii.
    """

    bias, last = np.full(len(precision), np.inf), threshold + 1.0
    for gauge, rho in enumerate(correlation):
        of_pairs = np.delete(rho, gauge)
        row = np.sqrt(np.maximum(1.0 - np.concatenate([of_pairs, -of_pairs]), 0.0) / 2.0)
        # Two gauges closer than this differ by round-off alone.
        if row.min(initial=1.0) >= 1e-7:
            bias[gauge] = last = _isolated(row, threshold, miss_probability, last)
    with np.errstate(divide="ignore"):
        return np.asarray(bias / np.sqrt(precision))


def _isolated(row: FloatArray, threshold: float, miss_probability: float, start: float) -> float:
    """Return delta with Phi(k - delta) + sum_j Phi(-delta ``row``_j) = ``miss_probability``, by Newton's method.

    The sum is convex from k on, where it is one half at least: behind the first step delta grows to the root.
    """
    delta, rates = start, np.append(row, 1.0)
    for _ in range(NEWTON_STEPS):
        terms = np.append(delta * row, delta - threshold)
        slope = float(rates @ np.exp(-0.5 * terms**2)) / np.sqrt(2.0 * np.pi)
        excess = float(ndtr(-terms).sum()) - miss_probability
        # So far beyond the root that the slope is round-off: begin again.
        step = excess / slope if slope > 1e-100 else threshold - delta
        delta = max(delta + step, threshold)
        if abs(step) <= 1e-12 * delta:
            break
    return delta


class _About(NamedTuple):
    """The nonlinear estimator about a flight state, of strain that fits the tables.

    Attributes
    ----------
    gain : (5, n_d) coefficients per strain of the full model.
    precision : (n_d, n_d) P.
    variance : (5,) of the coefficients.
    information : (n_d,) precision of each gauge alone, given the errors of the others.
    """

    gain: FloatArray
    precision: FloatArray
    variance: FloatArray
    information: FloatArray


def _about(reference: NonlinearReference, sample: Sample, state: FloatArray) -> _About:
    n_d, covariance = reference.n_d, reference.strain_covariance(state, considered=True)
    posterior = reference.posterior(state, sample, covariance, considered=True)
    slopes = coefficient_slopes(
        state, reference.at(state)[0][n_d:], posterior.covariance[0], reference.references
    )[0]
    slopes = slopes[FIVE_LOADS]
    return _About(
        gain=slopes @ posterior.gain[0, :, :n_d],
        precision=posterior.precision[0, :n_d, :n_d],
        variance=np.einsum("if,fg,ig->i", slopes, posterior.covariance[0], slopes),
        information=np.sum(inverse_root(covariance) ** 2, axis=0),
    )


def _variance_without(about: _About, lost: IntArray) -> FloatArray:
    """Return (n, 5) variance of the coefficients without the gauges of n sets ``lost`` (n, k)."""
    block, gain = about.precision[lost[:, :, None], lost[:, None, :]], about.gain.T[lost]
    return np.asarray(about.variance + np.sum(gain * np.linalg.solve(block, gain), axis=1))


def _of_nonlinear(inverse_map: InverseMap, manifold: ManifoldMap) -> GaugeValue:
    """Return the value of each gauge to the nonlinear estimator with all air data."""
    reference, n = NonlinearReference(inverse_map, manifold, manifold.gauge_covariance), inverse_map.n_gauges
    flown, used, unknown = envelope(manifold, *FEW).flown, np.ones(n, dtype=bool), np.full(N_AIR, np.nan)
    samples = [
        Sample(rows=rows, used=used, air=air_inputs(inverse_map, value, unknown))
        for rows, value in zip(strain_at(manifold, flown), air_data_at(flown, ALL), strict=True)
    ]
    states = [_about(reference, *at_state) for at_state in zip(samples, flown, strict=True)]

    def variance(lost: IntArray) -> FloatArray:
        return np.asarray(np.mean([_variance_without(state, lost) for state in states], axis=0))

    with_all = variance(np.zeros((1, 0), dtype=np.int64))
    information = np.mean([state.information for state in states], axis=0)
    precision = np.mean([state.precision for state in states], axis=0)
    detection, growth = _detection(precision, information), np.sqrt(variance(np.arange(n)[:, None]) / with_all)
    pairs = _pairs(growth)
    moved = np.sqrt(np.mean([state.gain**2 for state in states], axis=0)).T * detection["detectable_bias"][:, None]
    return GaugeValue(
        leverage=np.clip(1.0 - np.diag(precision) / information, 0.0, 1.0),
        growth=growth,
        undetected_effect=moved / np.sqrt(with_all),
        pairs=pairs,
        pair_growth=np.sqrt(variance(pairs) / with_all),
        **detection,
    )


def _growth(inverse_map: InverseMap, gains: _Gains, lost: IntArray) -> FloatArray:
    gain, precision, weight, cross, square, variance = gains
    block = lost[:, :, None], lost[:, None, :]
    fraction = np.linalg.eigvals(np.linalg.solve(weight[block], precision[block])).real.min(axis=1)
    identified = (fraction >= POLICIES.min_information) | (inverse_map.case == 2)
    identified &= lost.shape[1] < inverse_map.n_gauges
    growth = np.full((len(lost), 5), np.inf)
    sets = lost[identified]
    block = sets[:, :, None], sets[:, None, :]
    # K (n, 5, k) = G_R P_RR^-1
    k = np.linalg.solve(precision[block], gain.T[sets]).transpose(0, 2, 1)
    of_sets = np.sum(k * (k @ square[block]), axis=2) - 2.0 * np.sum(k * cross[:, sets].transpose(1, 0, 2), axis=2)
    growth[identified] = np.sqrt(np.maximum(variance + of_sets, 0.0) / variance)
    return growth
