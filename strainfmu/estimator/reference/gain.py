"""Gains and covariances of a linear map with all rows in use, at its nominal dynamic pressure.

A finished map holds primary quantities alone. Reports, pages and the builder take from here what follows from
them.
"""

from typing import NamedTuple

import numpy as np

from strainfmu.arrays import FloatArray, common_to_pairs, inverse_root
from strainfmu.estimator.map.inverse_map import DENSE_GAUGES, InverseMap
from strainfmu.estimator.reference.linear import models
from strainfmu.estimator.reference.update import Model, joseph, model_of


class Nominal(NamedTuple):
    """Of all n rows in use, at s = 1: ``gain`` (m, n) of the outputs, ``precision`` P (n, n)."""

    gain: FloatArray
    precision: FloatArray


def nominal(model: Model) -> Nominal:
    """Return gain and precision with all rows in use, at s = 1, where no decomposition for every s is needed.

    With R = L L' the covariance of the rows is L (1 + K K') L', K = L^-1 N. The QR decomposition of [K'; 1] = Q T
    gives its root L T', and K' (1 + K K')^-1 as the first rows of Q times T'^-1, without K K'.
    """
    n, n_u = model.columns.shape
    common = common_to_pairs(model.noise) if n > DENSE_GAUGES else None
    if common is not None and common >= 0.0:
        return _of_many_rows(model)
    inverse, scale = inverse_root(model.noise), np.abs(model.free).max(axis=0, initial=1e-300)
    q, t = np.linalg.qr(np.vstack([(inverse @ model.columns).T, np.eye(n)]))
    turned = np.linalg.inv(t)
    whitening = turned.T @ inverse
    basis, triangle = np.linalg.qr(whitening @ (model.free / scale))
    rest = np.eye(n) - basis @ basis.T
    of_free = np.linalg.solve(triangle.T, (model.output_free / scale).T).T
    of_rows = model.output_columns @ q[:n_u] + model.cross.T @ inverse.T @ turned
    resolved = rest @ whitening
    return Nominal(gain=(of_free @ basis.T + of_rows @ rest) @ whitening, precision=resolved.T @ resolved)


def _of_many_rows(model: Model) -> Nominal:
    """Return :func:`nominal` of rows whose noise is independent, but for a part that all have in common.

    With D the variances of the noise of each row, and D^-1/2 C = U S V' of its common part and all columns C, the
    whitening

        W = (I - U (1 - (1 + S^2)^-1/2) U') D^-1/2

    costs n k^2 instead of n^3.
    """
    n, columns, common = len(model.noise), model.columns, model.noise[0, 1]
    variance = np.diag(model.noise) - common
    root = np.sqrt(variance)[:, None]
    shared = np.hstack([np.full((n, 1), np.sqrt(common)), columns])
    left, size, _ = np.linalg.svd(shared / root, full_matrices=False)
    less = 1.0 - 1.0 / np.hypot(1.0, size)

    def whitened(rows: FloatArray) -> FloatArray:
        over_root = rows / root
        return np.asarray(over_root - left @ (less[:, None] * (left.T @ over_root)))

    def gain_by(whitened_rows: FloatArray) -> FloatArray:
        """Return W' times rows (n, m)."""
        return np.asarray((whitened_rows - left @ (less[:, None] * (left.T @ whitened_rows))) / root)

    scale = np.abs(model.free).max(axis=0, initial=1e-300)
    basis, triangle = np.linalg.qr(whitened(model.free / scale))
    of_free = np.linalg.solve(triangle.T, (model.output_free / scale).T)
    of_rows = whitened(columns @ model.output_columns.T + model.cross)
    of_rows -= basis @ (basis.T @ of_rows)
    taken = np.hstack([left / root * (size / np.hypot(1.0, size)), gain_by(basis)])
    precision = -taken @ taken.T
    precision[np.diag_indices(n)] += 1.0 / variance
    return Nominal(gain=gain_by(basis @ of_free + of_rows).T, precision=precision)


def load_gain(inverse_map: InverseMap) -> FloatArray:
    """Return (n_f, n_d) G, loads per strain [N, N m]: f = G (d - m) + f_mean."""
    return nominal(models(inverse_map, at_nominal=True)[0]).gain


def load_covariance(inverse_map: InverseMap, gain: FloatArray | None = None) -> FloatArray:
    """Return (n_f, n_f) the covariance of the loads' error [(N, N m)^2] by ``gain``, by default the map's."""
    gain = load_gain(inverse_map) if gain is None else gain
    return joseph(models(inverse_map, at_nominal=True)[1], gain[None], np.ones(1))[0]


def residual_precision(inverse_map: InverseMap) -> FloatArray:
    """Return (n_d, n_d) P [1/(m/m)^2]; chi-square of strain d is (d - m)' P (d - m).

    P is the inverse of the covariance of d under the model, A A' + Gamma in Case 2 whatever gamma; its limit for a
    free state in Case 1.
    """
    return nominal(models(inverse_map, at_nominal=True)[1]).precision


def noise_precision(inverse_map: InverseMap) -> FloatArray:
    """Return (n_d, n_d) Gamma^-1 of all errors of the strain [1/(m/m)^2]."""
    model, columns = models(inverse_map, at_nominal=True)[1], inverse_map.error_strain
    parts = {"noise": model.noise, "columns": columns, "output_columns": np.zeros((0, columns.shape[1]))}
    return nominal(model_of(len(columns), 0, **parts)).precision


def state_model(
    state_operator: FloatArray,
    noise_covariance: FloatArray,
    regularisation: float,
    load_per_state: FloatArray | None = None,
    strain_load_covariance: FloatArray | None = None,
) -> Model:
    """Return the model of d - m = A q + e whose outputs are the states, or the loads M q + g.

    Its gain is T = (A' Gamma^-1 A + gamma I)^-1 A' Gamma^-1 (``eq:segmented-ls-solution``) or, of the loads,
    (M - X' Gamma^-1 A) T + X' Gamma^-1: X' Gamma^-1 is load outside the states that the residual reveals.

    Parameters
    ----------
    state_operator : (n_d, n_q) A [(m/m)/state].
    noise_covariance : (n_d, n_d) Gamma of e [(m/m)^2].
    regularisation : gamma [1], 0 where the states are free (Case 1).
    load_per_state : (m, n_q) M [N/state, N m/state]; None for the states as outputs.
    strain_load_covariance : (n_d, m) X of e with g; None for none.
    """
    n, n_q = state_operator.shape
    outputs = np.eye(n_q) if load_per_state is None else load_per_state
    parts = {"noise": noise_covariance}
    if strain_load_covariance is not None:
        parts["cross"] = strain_load_covariance
    if regularisation == 0.0:
        return model_of(n, len(outputs), **parts, free=state_operator, output_free=outputs)
    std = 1.0 / np.sqrt(regularisation)
    return model_of(n, len(outputs), **parts, columns=std * state_operator, output_columns=std * outputs)
