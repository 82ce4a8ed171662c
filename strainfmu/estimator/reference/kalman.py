"""The update over time: states with memory, and errors that last but are never estimated (Schmidt).

A law has states s of mean and covariance P, and the cross covariance C of their errors with considered errors
g ~ N(0, I). A sample reads z = H s + G g + e. It is a model of the update without free states: with
L L' = P - C C'

    s = mean + C g + L v,   so that rows have the columns [H C + G, H L] of [g, v], and outputs s have [C, L].

Its posterior is the law after the sample. Of g nothing is learnt: C follows by the gain, C+ = (I - K H) C - K G.
Source: Jazwinski, Stochastic Processes and Filtering Theory, section 8.4.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.reference.update import Posterior, condition, model_of, prepare

LARGEST_SEEN, SMALLEST_SEEN = 18, 0.2
"""Number of directions of pressure errors that are estimated, and the size [standard deviations of the other
errors] from which one is."""

COMMON_SIZE, COMMON_FRACTION = 1.0, 0.3
"""Variance over that of the noise, and part of the sum of all, from which an error is one in common."""


class Law(NamedTuple):
    """Law of n states: ``mean`` (n,), ``covariance`` P (n, n), ``cross`` C (n, k) with the considered errors."""

    mean: FloatArray
    covariance: FloatArray
    cross: FloatArray


class Rows(NamedTuple):
    """Rows of a sample: ``innovation`` (m,) z - H mean, H (m, n), G (m, k), and ``noise`` (m, m) cov e."""

    innovation: FloatArray
    by_state: FloatArray
    considered: FloatArray
    noise: FloatArray


def predicted(law: Law, matrix: FloatArray, stationary: Law, kept: FloatArray) -> Law:
    """Return ``law`` after a step of a stationary process of transition ``matrix`` F.

    P- = F P F' + P_inf - F P_inf F' about the mean of the ``stationary`` law; considered errors keep the
    correlations ``kept`` (k,) with themselves.
    """
    forgotten = stationary.covariance - matrix @ stationary.covariance @ matrix.T
    mean = stationary.mean + matrix @ (law.mean - stationary.mean)
    return Law(mean, matrix @ law.covariance @ matrix.T + forgotten, matrix @ law.cross * kept)


def measured(law: Law, rows: Rows) -> tuple[Law, Posterior]:
    """Return ``law`` after the sample ``rows``, and the posterior, whose gain is K."""
    n, m = len(law.mean), len(rows.innovation)
    size = np.sqrt(np.diag(law.covariance))
    value, vector = np.linalg.eigh((law.covariance - law.cross @ law.cross.T) / np.outer(size, size))
    root = size[:, None] * vector * np.sqrt(np.maximum(value, 0.0))
    of_errors = rows.by_state @ law.cross + rows.considered
    columns, of_states = np.hstack([of_errors, rows.by_state @ root]), np.hstack([law.cross, root])
    model = model_of(m, n, columns=columns, noise=rows.noise, output_fixed=law.mean, output_columns=of_states)
    found = condition(prepare(model, np.ones(m, dtype=bool)), rows.innovation[None], np.ones(1))
    return Law(found.mean[0], found.covariance[0], law.cross - found.gain[0] @ of_errors), found


class SeenErrors(NamedTuple):
    """Errors of pressure: ``strain`` (n_d, r) and ``load`` (m, r) of the directions that gauges see.

    Of the rest: the covariances ``rest_strain`` (n_d, n_d), ``rest_cross`` (n_d, m) and ``rest_load`` (m, m).
    """

    strain: FloatArray
    load: FloatArray
    rest_strain: FloatArray
    rest_cross: FloatArray
    rest_load: FloatArray


def seen_errors(
    strain: FloatArray, cross: FloatArray, variance: FloatArray, size: float, std: FloatArray
) -> SeenErrors:
    """Split the errors ``strain`` (n_d, k), ``size`` times of which are usual.

    ``cross`` (n_d, m) and ``variance`` (m, m) are covariances of their loads with strain and among themselves,
    ``std`` (n_d,) standard deviations of the other errors of each gauge.
    """
    left, singular, turn = np.linalg.svd(size * strain / std[:, None])
    r = min(LARGEST_SEEN, int(np.sum(singular > SMALLEST_SEEN)))
    rest, seen = strain @ turn[r:].T, strain @ turn[:r].T
    load = cross.T @ (left[:, :r] / std[:, None]) * size / singular[:r]
    return SeenErrors(seen, load, rest @ rest.T, cross - seen @ load.T, variance - load @ load.T)


def seen_left(
    seen: SeenErrors, strain: FloatArray, cross: FloatArray, variance: FloatArray, std: FloatArray
) -> SeenErrors:
    """Split the errors ``strain`` (n_d, k), which are those of ``seen`` but for what has become known of them.

    Amplitudes a along the strain S of ``seen`` are what they were, (S' W S)^-1 S' W of strain with W = std^-2;
    their covariance is no longer 1. States of unit variance are L^-1 a with cov a = L L'. Others as in
    :func:`seen_errors`.
    """
    white = (seen.strain / std[:, None] ** 2).T
    along = np.linalg.solve(white @ seen.strain, white)
    root = np.linalg.cholesky(along @ strain @ strain.T @ along.T)
    of_states = np.linalg.solve(root, along)
    own, load = strain @ (strain.T @ of_states.T), cross.T @ of_states.T
    return SeenErrors(own, load, strain @ strain.T - own @ own.T, cross - own @ load.T, variance - load @ load.T)


def white_and_lasting(covariance: FloatArray, std: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Split ``covariance`` (n_d, n_d) of gauges whose noise has ``std`` (n_d,).

    Returns the variances (n_d,) of noise, columns (n_d, c) of errors in common, and the covariance of what else
    lasts.
    """
    value, vector = np.linalg.eigh(covariance / np.outer(std, std))
    white = min(1.0, float(value[0]))
    value = np.maximum(value - white, 0.0)
    common = value > max(COMMON_SIZE, COMMON_FRACTION * float(value.sum()))
    columns = std[:, None] * vector * np.sqrt(value)
    return white * std**2, columns[:, common], columns[:, ~common] @ columns[:, ~common].T


def gauge_errors(inverse_map: InverseMap, covariance: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Split ``covariance`` (n_d, n_d) of gauges as :func:`white_and_lasting`, but for temperature modes in it.

    These are the last columns in common, per amplitude.
    """
    thermal = inverse_map.thermal
    isothermal = thermal.isothermal_covariance if inverse_map.has_temperature else covariance
    white, common, lasting = white_and_lasting(isothermal, inverse_map.noise_std)
    return white, np.hstack([common, thermal.linear_strain]), lasting
