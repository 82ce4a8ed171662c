"""One step of the estimator: strain and dynamic pressure in; loads, coefficients and health out."""

from __future__ import annotations

from collections import OrderedDict
from copy import copy
from dataclasses import dataclass
from math import sqrt

import numpy as np
from numpy.typing import ArrayLike

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.inverse_map import InverseMap
from strainfmu.estimator.isolation import suspected_gauges
from strainfmu.estimator.map_parts import map_parts
from strainfmu.estimator.masked_map import MaskedMap, complete_map, masked_map
from strainfmu.estimator.settings import EstimatorSettings, default_settings

LEAST_DYNAMIC_PRESSURE = 1e-6
"""q_inf [Pa] below which there is no flow to speak of, and no coefficients."""

CACHED_MASKS = 32
"""Sets of missing gauges whose matrices are kept, the least recently used dropped first."""


@dataclass(frozen=True)
class LoadEstimate:
    """What one set of strains says. Of a gauge that is not valid, no number here depends on its strain.

    Attributes
    ----------
    loads : (5,) forces and moments [N, N, N, N m, N m], order of ``LOAD_NAMES``; NaN where they cannot be known.
    loads_std : (5,) their standard deviations.
    coefficients : (5,) C_A, C_N, C_Y, M_P, M_Y [1]; NaN where they cannot be computed.
    coefficients_std : (5,) their standard deviations [1].
    chi_square : |W (d - mean_strain)|^2 of the residual of the valid gauges [1].
    health : state of this estimate.
    load_covariance : (5, 5) covariance of the loads [(N, N m)^2].
    chi_square_limit : alarm level for the valid gauges, times ``alarm_scale``; infinite where nothing checks the
        estimate.
    degrees_of_freedom : of chi_square; 0 where nothing checks the estimate.
    valid : (n_d,) gauges that were used.
    standardised_residual : (n_d,) z, standard normal where a gauge fits the others; 0 where no other checks it.
    suspects : gauges, by index, that the largest |z| points to, none below its alarm level; more than one where
        they cannot be told apart.
    """

    loads: FloatArray
    loads_std: FloatArray
    coefficients: FloatArray
    coefficients_std: FloatArray
    chi_square: float
    health: HealthState
    load_covariance: FloatArray
    chi_square_limit: float
    degrees_of_freedom: int
    valid: BoolArray
    standardised_residual: FloatArray
    suspects: tuple[int, ...]


class Estimator:
    """An inverse map made ready for the loop: a step is three small matrix-vector products.

    A gauge is left out of a step if its strain is not finite or beyond the sensor range, or if the caller says so.
    The matrices without it are computed in the first step that lacks it, and kept.

    Example
    -------
    >>> estimator = Estimator(load_inverse_map(Path("map.h5")))  # doctest: +SKIP
    >>> estimator.estimate(strain, dynamic_pressure=95.8e3).coefficients  # doctest: +SKIP
    """

    def __init__(self, inverse_map: InverseMap, settings: EstimatorSettings | None = None) -> None:
        """Prepare ``inverse_map``; None takes the settings that it was built with."""
        self.inverse_map = inverse_map
        self._parts = map_parts(inverse_map)
        self._masked: OrderedDict[bytes, MaskedMap | None] = OrderedDict()
        self._complete = complete_map(self._parts)
        self._apply(settings or default_settings(inverse_map))

    def with_settings(self, settings: EstimatorSettings) -> Estimator:
        """Return an estimator of the same map with other settings; the two share the matrices of masks."""
        other = copy(self)
        other._apply(settings)
        return other

    def _apply(self, settings: EstimatorSettings) -> None:
        self.settings = settings
        area, length = settings.reference_area, settings.reference_length
        self._reference = area * np.array([1.0, 1.0, 1.0, length, length])
        shift = settings.moment_station - default_settings(self.inverse_map).moment_station
        self._transfer = moment_transfer(shift) if shift != 0.0 else None
        self._threshold_scale = sqrt(settings.alarm_scale)
        self.chi_square_limit = settings.alarm_scale * self._complete.chi_square_limit

    def estimate(
        self,
        strain: ArrayLike,
        dynamic_pressure: float,
        valid: ArrayLike | None = None,
        dynamic_pressure_std: float = 0.0,
    ) -> LoadEstimate:
        """Estimate the loads behind one set of strains.

        Parameters
        ----------
        strain : (n_d,) strains [m/m], order of ``inverse_map.gauge_names``.
        dynamic_pressure : q_inf [Pa].
        valid : (n_d,) of bool, false for gauges to leave out; None for none.
        dynamic_pressure_std : standard deviation of q_inf's error [Pa]; to first order it adds C^2 (s / q)^2 to
            the variance of each coefficient C.

        Raises
        ------
        InputError
            ``strain`` or ``valid`` has the wrong length, or ``valid`` is not of bool. Values that are not finite
            are no error: the estimate goes without the gauge or without coefficients, and health says so.
        """
        d = np.asarray(strain, dtype=float)
        if d.shape != (self.inverse_map.n_gauges,):
            raise InputError(f"strain: {d.shape} found, {self.inverse_map.n_gauges} values wanted")
        used = np.abs(d) <= self.settings.sensor_range  # false for NaN
        if valid is not None:
            used &= self._checked_mask(valid)
        masked = self._complete if used.all() else self._masked_map(used)
        if masked is None:
            return _nothing(used)
        # Multiplying by the zero columns of the gain would let NaN through.
        residual = np.where(used, d - self.inverse_map.mean_strain, 0.0)
        loads = masked.load_gain @ residual + self.inverse_map.load_of_mean
        loads_std, load_covariance = masked.loads_std, masked.load_covariance
        if self._transfer is not None:
            loads = self._transfer @ loads
            load_covariance = self._transfer @ load_covariance @ self._transfer.T
            loads_std = np.sqrt(load_covariance.diagonal())
        whitened = masked.whitening @ residual
        chi_square = float(whitened @ whitened)
        chi_square_limit = self.settings.alarm_scale * masked.chi_square_limit
        z = masked.z_whitening @ whitened
        threshold = self._threshold_scale * masked.outlier_threshold
        suspects = suspected_gauges(z, threshold, masked.ambiguous_groups)
        coefficients = coefficients_std = np.full(5, np.nan)
        health = HealthState.NO_COEFFICIENTS
        if LEAST_DYNAMIC_PRESSURE <= dynamic_pressure < np.inf and 0.0 <= dynamic_pressure_std < np.inf:
            scale = 1.0 / (dynamic_pressure * self._reference)
            coefficients, coefficients_std = scale * loads, scale * loads_std
            if dynamic_pressure_std > 0.0:
                of_pressure = coefficients * (dynamic_pressure_std / dynamic_pressure)
                coefficients_std = np.sqrt(coefficients_std * coefficients_std + of_pressure * of_pressure)
            health = _health(chi_square > chi_square_limit, suspects, masked)
        return LoadEstimate(
            loads,
            loads_std,
            coefficients,
            coefficients_std,
            chi_square,
            health,
            load_covariance,
            chi_square_limit,
            masked.degrees_of_freedom,
            masked.valid,
            z,
            suspects,
        )

    def masked_map(self, valid: ArrayLike) -> MaskedMap | None:
        """Return the map for the gauges of ``valid`` (n_d,) of bool; None if they do not identify the state.

        In Case 2 the prior identifies the state with any gauge; without gauges there is no map.

        Raises
        ------
        InputError
            ``valid`` has the wrong length or is not of bool.
        """
        used = self._checked_mask(valid)
        return self._complete if used.all() else self._masked_map(used)

    def _checked_mask(self, valid: ArrayLike) -> BoolArray:
        mask = np.asarray(valid)
        if mask.shape != (self.inverse_map.n_gauges,) or mask.dtype != np.bool_:
            raise InputError(
                f"valid: {mask.shape} of {mask.dtype} found, {self.inverse_map.n_gauges} values of bool wanted"
            )
        return mask

    def _masked_map(self, used: BoolArray) -> MaskedMap | None:
        """Return the matrices for the gauges in use, from the cache if they are there."""
        key = used.tobytes()
        if key not in self._masked:
            self._masked[key] = masked_map(self._parts, used.copy())
            if len(self._masked) > CACHED_MASKS:
                self._masked.popitem(last=False)
        self._masked.move_to_end(key)
        return self._masked[key]


def moment_transfer(shift: float) -> FloatArray:
    """Return (5, 5) B, loads to loads about a moment point ``shift`` [m] further aft.

    M_P' = M_P + shift F_N and M_Y' = M_Y + shift F_Y: a force ahead of the point turns the nose its way, with an
    arm that the shift lengthens.
    """
    transfer = np.eye(5)
    transfer[3, 1] = transfer[4, 2] = shift
    return transfer


def _health(inconsistent: bool, suspects: tuple[int, ...], masked: MaskedMap) -> HealthState:
    """Return the state of an estimate that has coefficients."""
    if inconsistent:
        return HealthState.INCONSISTENT
    if suspects:
        return HealthState.SUSPECT
    return HealthState.OK if masked.valid.all() else HealthState.DEGRADED


def _nothing(used: BoolArray) -> LoadEstimate:
    """Return the estimate of gauges that do not identify the state."""
    nan, health = np.full(5, np.nan), HealthState.UNIDENTIFIED if used.any() else HealthState.INVALID
    return LoadEstimate(
        nan,
        nan,
        nan,
        nan,
        np.nan,
        health,
        np.full((5, 5), np.nan),
        np.nan,
        0,
        used,
        np.full(len(used), np.nan),
        (),
    )
