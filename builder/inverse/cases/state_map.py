"""The affine map from strain to pressure states, with what it follows from: the result of either case."""

from __future__ import annotations

from dataclasses import dataclass

from strainfmu.arrays import FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class StateMap:
    """q = T d + k minimises |L^-1 (d - m - A q)|^2 + gamma |q|^2 with L L^T = Gamma; n_d gauges, n_q states.

    Attributes
    ----------
    state_operator : (n_d, n_q) A, strain per state [1/Pa, or 1 where states are standard normal].
    mean_strain : (n_d,) m, strain of the mean pressure [m/m].
    noise_covariance : (n_d, n_d) Gamma, covariance of the strain that the states do not explain [(m/m)^2].
    regularisation : gamma [1], 0 in Case 1.
    strain_gain : (n_q, n_d) T = (A^T Gamma^-1 A + gamma I)^-1 A^T Gamma^-1.
    state_offset : (n_q,) k = -T m.
    unresolved : (n_q, j) factor E of the part of q that the gain does not resolve: E E^T = (I - T A)(I - T A)^T.
    """

    state_operator: FloatArray
    mean_strain: FloatArray
    noise_covariance: FloatArray
    regularisation: float
    strain_gain: FloatArray
    state_offset: FloatArray
    unresolved: FloatArray
