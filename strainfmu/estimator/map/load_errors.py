"""The gain from strain to loads, and the covariance of what any gain gives, in sums of positive terms.

Loads f = f_mean + M q + g, strains d = m + A q + e: g is load that no state holds, as that of truncated modes, and
may be correlated with their strain in e, X = cov(e, g): with independent columns y, e = e_g + N y and g = N_f y.
What the states leave of the strain, d - m - A q, so
depends on g: its best linear estimate is X' Gamma^-1 (d - m - A q), so that with q = T (d - m)

    f = f_mean + G (d - m),   G = (M - X' Gamma^-1 A) T + X' Gamma^-1.

With any gain G the error of the estimate is G e - g - (M - G A) q. Splitting g into its regression on e and a
remainder of covariance S,

    cov = (G L - X' L'^-1) (G L - X' L'^-1)' + S + (M - G A) (M - G A)',   Gamma = L L',

the Joseph form (Bucy & Joseph 1968; Bar-Shalom, Li & Kirubarajan, section 5.2.3): right for gains that are not
optimal, without cancellation. With B = X' Gamma^-1 the remainder is S = (N_f - B N) (N_f - B N)' + B Gamma_g B'.
In Case 1 the estimate is unbiased, G A = M, and the last term is none.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from strainfmu.arrays import FloatArray


def load_gain(
    *,
    load_per_state: FloatArray,
    strain_gain: FloatArray,
    state_operator: FloatArray,
    noise_whitening: FloatArray,
    strain_load_covariance: FloatArray | None,
) -> FloatArray:
    """Return (n_f, n_d) G of n_f loads, per strain [N, N m]; M T where no load is outside the states.

    Source: Gauss-Markov estimate of a correlated quantity (Kailath, Sayed & Hassibi, Linear Estimation, 3.2).

    Parameters
    ----------
    load_per_state : (n_f, n_q) M [N/state, N m/state].
    strain_gain : (n_q, n_d) T [state/(m/m)].
    state_operator : (n_d, n_q) A [(m/m)/state].
    noise_whitening : (n_d, n_d) L^-1 of Gamma = L L' [1/(m/m)].
    strain_load_covariance : (n_d, n_f) X, or None.
    """
    if strain_load_covariance is None:
        return np.asarray(load_per_state @ strain_gain)
    of_residual = residual_load_gain(noise_whitening, strain_load_covariance)
    of_states = load_per_state - of_residual @ state_operator
    return np.asarray(of_states @ strain_gain + of_residual)


def residual_load_gain(noise_whitening: FloatArray, strain_load_covariance: FloatArray) -> FloatArray:
    """Return (n_f, n_d) X' Gamma^-1 [N, N m]: load outside the states per strain outside the states.

    ``noise_whitening`` is L^-1 (n_d, n_d) of Gamma = L L' [1/(m/m)], ``strain_load_covariance`` X (n_d, n_f).
    """
    whitened = noise_whitening @ strain_load_covariance
    return np.asarray(whitened.T @ noise_whitening)


@dataclass(frozen=True, kw_only=True, eq=False)
class LoadErrorModel:
    """The terms of the covariance of m loads, whatever the gain.

    Attributes
    ----------
    noise_root : (n_d, n_d) L, L L' = Gamma [m/m].
    regression : (m, n_d) X' L'^-1 [N, N m]: the load of g known from whitened e.
    remainder : (m, m) S [(N, N m)^2], positive semi-definite.
    state_operator : (n_d, n_q) A [(m/m)/state].
    load_per_state : (m, n_q) M [N/state, N m/state].
    known_prior : whether q is standard normal (Case 2) or free (Case 1).
    """

    noise_root: FloatArray
    regression: FloatArray
    remainder: FloatArray
    state_operator: FloatArray
    load_per_state: FloatArray
    known_prior: bool


def load_error_covariance(model: LoadErrorModel, load_gain: FloatArray) -> FloatArray:
    """Return (m, m) covariance [(N, N m)^2] of the error of m loads estimated with ``load_gain`` G (m, n_d)."""
    return model.remainder + _of_gain(model, load_gain)


def load_error_model(
    *,
    gauge_covariance: FloatArray,
    error_strain: FloatArray,
    error_load: FloatArray,
    state_operator: FloatArray,
    load_per_state: FloatArray,
    known_prior: bool,
) -> LoadErrorModel:
    """Return the terms of the covariance of m loads.

    Parameters
    ----------
    gauge_covariance, error_strain, error_load : (n_d, n_d) Gamma_g, (n_d, k) N, (m, k) N_f.
    state_operator, load_per_state, known_prior : as of :class:`LoadErrorModel`.
    """
    root = np.asarray(np.linalg.cholesky(gauge_covariance + error_strain @ error_strain.T))
    regression = np.asarray(np.linalg.solve(root, error_strain @ error_load.T).T)
    # B = X' Gamma^-1 by L' B' = (X' L'^-1)', the triangle L' turned into a lower one.
    turned = np.linalg.solve(root[::-1, ::-1].T.copy(), regression[:, ::-1].T.copy())
    by_strain = turned[::-1].T.copy()
    of_columns = error_load - by_strain @ error_strain
    return LoadErrorModel(
        noise_root=root,
        regression=regression,
        remainder=of_columns @ of_columns.T + by_strain @ gauge_covariance @ by_strain.T,
        state_operator=state_operator,
        load_per_state=load_per_state,
        known_prior=known_prior,
    )


def _of_gain(model: LoadErrorModel, load_gain: FloatArray) -> FloatArray:
    """Return the two terms that depend on the gain."""
    of_noise = load_gain @ model.noise_root - model.regression
    covariance = of_noise @ of_noise.T
    if model.known_prior:
        of_prior = model.load_per_state - load_gain @ model.state_operator
        covariance = covariance + of_prior @ of_prior.T
    return np.asarray(covariance)
