"""The gain from strain to loads, and the covariance of what any gain gives, in sums of positive terms.

Loads f = f_mean + M q + g, strains d = m + A q + e: g is load that no state holds, as that of truncated modes, and
may be correlated with their strain in e, X = cov(e, g). What the states leave of the strain, d - m - A q, so
tells of g: its best linear estimate is X' Gamma^-1 (d - m - A q), so that with q = T (d - m)

    f = f_mean + G (d - m),   G = (M - X' Gamma^-1 A) T + X' Gamma^-1.

With any gain G the error of the estimate is G e - g - (M - G A) q. Splitting g into its regression on e and a
remainder of covariance S,

    cov = (G L - X' L'^-1) (G L - X' L'^-1)' + S + (M - G A) (M - G A)',   Gamma = L L',

the Joseph form (Bucy & Joseph 1968; Bar-Shalom, Li & Kirubarajan, section 5.2.3): right for gains that are not
optimal, without cancellation. In Case 1 the estimate is unbiased, G A = M, and the last term is none.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.innovation import inverse_cholesky

_ROUND_OFF = 1e-6
"""Share of a stated covariance by which it may lie below what its own terms add up to."""


def load_gain(
    load_per_state: FloatArray,
    strain_gain: FloatArray,
    state_operator: FloatArray,
    noise_covariance: FloatArray,
    strain_load_covariance: FloatArray | None,
) -> FloatArray:
    """Return (5, n_d) G, loads per strain [N, N m]; M T where no load is outside the states.

    Source: Gauss-Markov estimate of a correlated quantity (Kailath, Sayed & Hassibi, Linear Estimation, 3.2).

    Parameters
    ----------
    load_per_state : (5, n_q) M [N/state, N m/state].
    strain_gain : (n_q, n_d) T [state/(m/m)].
    state_operator : (n_d, n_q) A [(m/m)/state].
    noise_covariance : (n_d, n_d) Gamma [(m/m)^2].
    strain_load_covariance : (n_d, 5) X, or None.
    """
    if strain_load_covariance is None:
        return load_per_state @ strain_gain
    of_residual = residual_load_gain(noise_covariance, strain_load_covariance)
    return (load_per_state - of_residual @ state_operator) @ strain_gain + of_residual


def residual_load_gain(noise_covariance: FloatArray, strain_load_covariance: FloatArray) -> FloatArray:
    """Return (5, n_d) X' Gamma^-1 [N, N m]: load outside the states per strain outside the states.

    Gamma is (n_d, n_d) [(m/m)^2], X (n_d, 5).
    """
    whitening = inverse_cholesky(noise_covariance)
    gain: FloatArray = (whitening @ strain_load_covariance).T @ whitening
    return gain


@dataclass(frozen=True)
class LoadErrorModel:
    """What the covariance of the loads is made of, whatever the gain.

    Attributes
    ----------
    noise_root : (n_d, n_d) L, L L' = Gamma [m/m].
    regression : (5, n_d) X' L'^-1 [N, N m]: the load of g known from whitened e.
    remainder : (5, 5) S [(N, N m)^2], positive semi-definite.
    state_operator : (n_d, n_q) A [(m/m)/state].
    load_per_state : (5, n_q) M [N/state, N m/state].
    known_prior : whether q is standard normal (Case 2) or free (Case 1).
    """

    noise_root: FloatArray
    regression: FloatArray
    remainder: FloatArray
    state_operator: FloatArray
    load_per_state: FloatArray
    known_prior: bool


def load_error_covariance(model: LoadErrorModel, load_gain: FloatArray) -> FloatArray:
    """Return (5, 5) covariance [(N, N m)^2] of the error of loads estimated with ``load_gain`` G (5, n_d)."""
    return model.remainder + _of_gain(model, load_gain)


def load_error_model(
    load_covariance: FloatArray,
    state_operator: FloatArray,
    noise_covariance: FloatArray,
    load_per_state: FloatArray,
    load_gain: FloatArray,
    strain_load_covariance: FloatArray | None,
    known_prior: bool,
) -> LoadErrorModel:
    """Return the model whose covariance is ``load_covariance`` (5, 5) for ``load_gain`` G (5, n_d).

    ``strain_load_covariance`` is X (n_d, 5), None where there is none; the other arguments are as in
    :class:`LoadErrorModel`.

    Raises
    ------
    InputError
        ``load_covariance`` is less than gauge noise and prior alone make it.
    """
    noise_root = np.asarray(np.linalg.cholesky(noise_covariance), dtype=np.float64)
    x = np.zeros((len(noise_root), 5)) if strain_load_covariance is None else strain_load_covariance
    regression = np.asarray(np.linalg.solve(noise_root, x).T, dtype=np.float64)
    nothing = np.zeros((5, 5))
    model = LoadErrorModel(noise_root, regression, nothing, state_operator, load_per_state, known_prior)
    remainder = load_covariance - _of_gain(model, load_gain)
    size = np.sqrt(np.diag(load_covariance))
    values, vectors = np.linalg.eigh(remainder / np.outer(size, size))
    if not values[0] >= -_ROUND_OFF:
        raise InputError("load_covariance is less than noise_covariance and the prior alone make it")
    root = size[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    return LoadErrorModel(noise_root, regression, root @ root.T, state_operator, load_per_state, known_prior)


def _of_gain(model: LoadErrorModel, load_gain: FloatArray) -> FloatArray:
    """Return the two terms that depend on the gain."""
    of_noise = load_gain @ model.noise_root - model.regression
    covariance = of_noise @ of_noise.T
    if model.known_prior:
        of_prior = model.load_per_state - load_gain @ model.state_operator
        covariance += of_prior @ of_prior.T
    return np.asarray(covariance)
