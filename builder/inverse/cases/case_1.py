"""Case 1: at most as many pressure states as gauges, weighted least squares (paper, section Case 1).

With the pressure p = p_mean + V_r q + V_t c_t (kept and truncated modes) and Z_p the strain per pressure,
a gauge reads d = Z_p (p_mean - p_internal) + Z q + Z_t c_t + noise, Z = Z_p V_r. The truncated part counts as
noise with the covariance it has over the snapshots. Left out of the weights, it aliases into q, and the stated
sigma is far too small.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from builder.inverse.cases.state_map import StateMap
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.map.inverse_map_checks import check_covariance
from strainfmu.estimator.numerics.whitening import inverse_root
from strainfmu.estimator.reference.gain import nominal, state_model

MAX_CONDITION_NUMBER = 1e10
"""Of the whitened, scaled Z: above it the gauges do not identify the states."""


@dataclass(frozen=True, eq=False, kw_only=True)
class LeastSquaresMap(StateMap):
    """The state map of Case 1; states are POD coefficients [Pa], gamma = 0.

    Attributes
    ----------
    state_covariance : (r, r) (Z^T Gamma^-1 Z)^-1 (paper, eq. sls-cov) [Pa^2].
    condition_number : kappa of the whitened Z with its columns scaled by the states' spread.
    """

    state_covariance: FloatArray
    condition_number: float


def least_squares_map(
    state_operator: FloatArray, mean_strain: FloatArray, noise_covariance: FloatArray, state_std: FloatArray
) -> LeastSquaresMap:
    """Build the map (paper, eq. ls-solution with gamma = 0, the mean's strain subtracted).

    Parameters
    ----------
    state_operator : (n_d, r) Z [1/Pa].
    mean_strain : (n_d,) Z_p (p_mean - p_internal) [m/m].
    noise_covariance : (n_d, n_d) Gamma [(m/m)^2].
    state_std : (r,) standard deviation of the states [Pa], which the condition number depends on alone.

    Raises
    ------
    InputError
        More states than gauges, gauges that do not identify the states, or a covariance that is none.
    """
    n_gauges, n_states = state_operator.shape
    if n_states > n_gauges:
        raise InputError(f"map.modes: {n_states} found, at most {n_gauges} with {n_gauges} gauges")
    check_covariance(noise_covariance)
    # Columns are scaled by the states' spread: the condition number then depends on gauges, not on units.
    condition_number = float(np.linalg.cond(inverse_root(noise_covariance) @ (state_operator * state_std)))
    if not condition_number < MAX_CONDITION_NUMBER:
        raise InputError(
            f"map.modes: the {n_gauges} gauges do not identify {n_states} modes "
            f"(condition number {condition_number:.1e}); keep fewer modes or move gauges to other roll angles"
        )
    found = nominal(state_model(state_operator, noise_covariance, 0.0))
    gain = found.gain[0]
    return LeastSquaresMap(
        state_operator=state_operator,
        mean_strain=mean_strain,
        noise_covariance=noise_covariance,
        regularisation=0.0,
        strain_gain=gain,
        state_offset=-gain @ mean_strain,
        unresolved=np.zeros((n_states, 0)),
        state_covariance=found.covariance[0],
        condition_number=condition_number,
    )


@dataclass(frozen=True, kw_only=True)
class RelativeCondition:
    """K = kappa(Z) / (nu cos theta) (paper, eq. of the relative condition number) and its inputs.

    K equals |d| / (sigma_min(Z) |q|). It changes with the units of d and q, so they are stated with it.

    Attributes
    ----------
    value : K [1].
    strain_norm : |d| [m/m].
    state_norm : |q| [1], in multiples of ``state_scale``.
    state_scale : unit of the states [Pa].
    smallest_singular_value : sigma_min of Z times ``state_scale`` [m/m].
    kappa : sigma_max / sigma_min.
    """

    value: float
    strain_norm: float
    state_norm: float
    state_scale: float
    smallest_singular_value: float
    kappa: float

    @property
    def scaling(self) -> str:
        """The scaling in words, printed with K."""
        return (
            f"|d| = {1e6 * self.strain_norm:.6g} um/m, |q| = {self.state_norm:g} in units of "
            f"{self.state_scale:.6g} Pa, sigma_min(Z) = {1e6 * self.smallest_singular_value:.6g} um/m"
        )


def relative_condition(
    state_operator: FloatArray, strain_norm: float, state_norm: float, state_scale: float
) -> RelativeCondition:
    """Return K of ``state_operator`` Z (n_d, r) [1/Pa].

    The published numbers follow with |d| = 100e-6 sqrt(n_d), |q| = 1 and states in units of the root mean square
    of |q| over the snapshots.

    Raises
    ------
    InputError
        A norm or the scale is not positive, or Z lacks full rank.
    """
    for name, value in (("strain norm", strain_norm), ("state norm", state_norm), ("state scale", state_scale)):
        if not 0.0 < value < np.inf:
            raise InputError(f"relative condition: {name} {value} found, must be positive")
    singular_values = state_scale * np.linalg.svd(state_operator, compute_uv=False)
    largest, smallest = float(singular_values[0]), float(singular_values[-1])
    if not smallest > 1e-14 * largest or len(state_operator) < state_operator.shape[1]:
        raise InputError("relative condition: the gauges do not observe every state, K is infinite")
    return RelativeCondition(
        value=strain_norm / (smallest * state_norm),
        strain_norm=strain_norm,
        state_norm=state_norm,
        state_scale=state_scale,
        smallest_singular_value=smallest,
        kappa=largest / smallest,
    )
