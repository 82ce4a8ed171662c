"""The inverse map of Case 1: fewer pressure states than gauges, weighted least squares.

With the pressure p = p_mean + V_r q + V_t c_t (kept and truncated modes) and Z_p the strain per pressure,
a gauge reads d = Z_p (p_mean - p_internal) + Z q + Z_t c_t + noise, Z = Z_p V_r. The truncated part is treated as
further noise with the covariance it has over the snapshots; left out of the weights it aliases into q and the
stated sigma is far too small.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from builder.reduction import PressureModes
from strainfmu.errors import InputError

FloatArray = NDArray[np.float64]

LARGEST_CONDITION_NUMBER = 1e10


@dataclass(frozen=True)
class LeastSquaresMap:
    """q = T d + k for r states and n_d gauges.

    Attributes
    ----------
    strain_gain : (r, n_d) T [Pa/(m/m)].
    state_offset : (r,) k = -T Z_p (p_mean - p_internal) [Pa].
    mean_strain : (n_d,) Z_p (p_mean - p_internal) [m/m].
    residual_whitening : (n_d, n_d) W: |W (d - mean_strain)|^2 is chi-square with n_d - r degrees of freedom.
    strain_per_state : (n_d, r) Z [1/Pa].
    strain_of_truncated : (n_d, t) strain of the truncated modes at their standard deviation [m/m].
    condition_number : kappa of the whitened Z.
    """

    strain_gain: FloatArray
    state_offset: FloatArray
    mean_strain: FloatArray
    residual_whitening: FloatArray
    strain_per_state: FloatArray
    strain_of_truncated: FloatArray
    condition_number: float


def least_squares_map(
    strain_operator: FloatArray,
    modes: PressureModes,
    n_modes: int,
    noise_std: FloatArray,
    internal_pressure: float,
) -> LeastSquaresMap:
    """Build the map by QR of the whitened Z (paper, eq. ls-solution with gamma = 0; DESIGN of T and k above).

    Parameters
    ----------
    strain_operator : (n_d, n_p) Z_p [1/Pa].
    modes : POD of the snapshots of absolute pressure.
    n_modes : r, modes kept.
    noise_std : (n_d,) sigma of each gauge [m/m].
    internal_pressure : p_internal [Pa].

    Raises
    ------
    InputError
        More modes than gauges or than the snapshots hold, or gauges that cannot tell the states apart.
    """
    n_gauges = len(strain_operator)
    if n_modes > min(n_gauges, modes.modes.shape[1]):
        raise InputError(
            f"map.modes: {n_modes} found, at most {min(n_gauges, modes.modes.shape[1])} with {n_gauges} gauges "
            f"and {modes.n_snapshots} snapshots"
        )
    strain_of_modes = strain_operator @ modes.modes
    z = strain_of_modes[:, :n_modes]
    truncated = strain_of_modes[:, n_modes:] * modes.coefficient_std()[n_modes:]
    cholesky = np.linalg.cholesky(np.diag(noise_std**2) + truncated @ truncated.T)
    # Columns scaled by the states' spread, so that the condition number speaks of gauges and not of units.
    spread = modes.coefficient_std()[:n_modes]
    whitened = solve_triangular(cholesky, z * spread, lower=True)
    condition_number = float(np.linalg.cond(whitened))
    if not condition_number < LARGEST_CONDITION_NUMBER:
        raise InputError(
            f"map.modes: the {n_gauges} gauges cannot tell {n_modes} modes apart "
            f"(condition number {condition_number:.1e}); keep fewer modes or move gauges to other roll angles"
        )
    q, r = np.linalg.qr(whitened)
    inverse_cholesky = solve_triangular(cholesky, np.eye(n_gauges), lower=True)
    gain = spread[:, None] * solve_triangular(r, q.T @ inverse_cholesky)
    mean_strain = strain_operator @ (modes.mean - internal_pressure)
    return LeastSquaresMap(
        strain_gain=gain,
        state_offset=-gain @ mean_strain,
        mean_strain=mean_strain,
        residual_whitening=inverse_cholesky - q @ (q.T @ inverse_cholesky),
        strain_per_state=z,
        strain_of_truncated=truncated,
        condition_number=condition_number,
    )
