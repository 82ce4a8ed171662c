"""Covariance of the estimated loads: gauge noise and truncated modes together."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from builder.inversion import LeastSquaresMap
from builder.reduction import PressureModes

FloatArray = NDArray[np.float64]


def load_covariance(
    least_squares: LeastSquaresMap, modes: PressureModes, loads: FloatArray, noise_std: FloatArray
) -> FloatArray:
    """Return the (5, 5) covariance of the loads' estimation error [(N, N m)^2].

    The error of f = G C_map p is M_r T noise + (M_r T Z_t - M_t) c_t, with M = ``loads`` V: truncated modes act
    twice, by aliasing through the strain and by the load they carry themselves, and the two are correlated.

    Parameters
    ----------
    least_squares : the map.
    modes : POD of the snapshots.
    loads : (5, n_p) load operator [m2, m3].
    noise_std : (n_d,) sigma of each gauge [m/m].
    """
    n_modes = len(least_squares.state_offset)
    load_of_modes = loads @ modes.modes
    gain = load_of_modes[:, :n_modes] @ least_squares.strain_gain
    from_noise = gain * noise_std
    from_truncation = gain @ least_squares.strain_of_truncated - (
        load_of_modes[:, n_modes:] * modes.coefficient_std()[n_modes:]
    )
    return from_noise @ from_noise.T + from_truncation @ from_truncation.T
