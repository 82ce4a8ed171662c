"""One step of the estimator: strain and dynamic pressure in; loads, coefficients and health out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from strainfmu.errors import InputError
from strainfmu.health import HealthState, chi_square_limit
from strainfmu.inverse_map import InverseMap

FloatArray = NDArray[np.float64]

LEAST_DYNAMIC_PRESSURE = 1e-6
"""q_inf [Pa] below which there is no flow to speak of, and no coefficients."""


@dataclass(frozen=True)
class LoadEstimate:
    """What one set of strains says.

    Attributes
    ----------
    loads : (5,) forces and moments [N, N, N, N m, N m], order of ``LOAD_NAMES``.
    loads_std : (5,) their standard deviations.
    coefficients : (5,) C_A, C_N, C_Y, M_P, M_Y [1]; NaN where they cannot be computed.
    coefficients_std : (5,) their standard deviations [1].
    chi_square : |W (d - mean_strain)|^2 of the residual [1].
    health : state of this estimate.
    """

    loads: FloatArray
    loads_std: FloatArray
    coefficients: FloatArray
    coefficients_std: FloatArray
    chi_square: float
    health: HealthState


class Estimator:
    """An inverse map made ready for the loop: two small matrices and no allocation worth naming.

    Example
    -------
    >>> estimator = Estimator(load_inverse_map(Path("map.h5")))  # doctest: +SKIP
    >>> estimator.estimate(strain, dynamic_pressure=95.8e3).coefficients  # doctest: +SKIP
    """

    def __init__(self, inverse_map: InverseMap) -> None:
        self.inverse_map = inverse_map
        self._load_gain = inverse_map.load_per_state @ inverse_map.strain_gain
        self._load_offset = inverse_map.load_of_mean + inverse_map.load_per_state @ inverse_map.state_offset
        self._loads_std = np.sqrt(np.diag(inverse_map.load_covariance))
        area, length = inverse_map.reference_area, inverse_map.reference_length
        self._loads_std.flags.writeable = False  # handed out with every estimate
        self._reference = area * np.array([1.0, 1.0, 1.0, length, length])
        self.chi_square_limit = chi_square_limit(inverse_map.residual_degrees_of_freedom)

    def estimate(self, strain: ArrayLike, dynamic_pressure: float) -> LoadEstimate:
        """Estimate the loads behind one set of strains.

        Parameters
        ----------
        strain : (n_d,) strains [m/m], order of ``inverse_map.gauge_names``.
        dynamic_pressure : q_inf [Pa].

        Raises
        ------
        InputError
            ``strain`` has the wrong length. Values that are not finite are no error: the loads are NaN
            and the health state says so.
        """
        d = np.asarray(strain, dtype=float)
        if d.shape != (self.inverse_map.n_gauges,):
            raise InputError(f"strain: {d.shape} found, {self.inverse_map.n_gauges} values wanted")
        nothing = np.full(5, np.nan)
        with np.errstate(over="ignore", invalid="ignore"):
            loads = self._load_gain @ d + self._load_offset
            residual = self.inverse_map.residual_whitening @ (d - self.inverse_map.mean_strain)
            chi_square = float(residual @ residual)
        # Not finite where a strain is not, or so large that the loads overflow.
        if not (np.isfinite(chi_square) and np.all(np.isfinite(loads))):
            return LoadEstimate(nothing, nothing, nothing, nothing, np.nan, HealthState.INVALID)
        if not LEAST_DYNAMIC_PRESSURE <= dynamic_pressure < np.inf:
            return LoadEstimate(loads, self._loads_std, nothing, nothing, chi_square, HealthState.NO_COEFFICIENTS)
        scale = 1.0 / (dynamic_pressure * self._reference)
        health = HealthState.OK if chi_square <= self.chi_square_limit else HealthState.INCONSISTENT
        return LoadEstimate(loads, self._loads_std, scale * loads, scale * self._loads_std, chi_square, health)
