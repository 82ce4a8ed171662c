"""The estimator: strain and dynamic pressure in; loads, coefficients and health out."""

from __future__ import annotations

from collections import OrderedDict
from copy import copy
from math import sqrt
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from strainfmu.arrays import BoolArray, FloatArray, IntArray
from strainfmu.errors import InputError
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.inverse_map import InverseMap, load_inverse_map
from strainfmu.estimator.isolation import suspected_gauges, suspects_by_gauge
from strainfmu.estimator.load_estimate import LoadEstimate, LoadEstimates, empty_estimates, set_unknown
from strainfmu.estimator.map_parts import map_parts
from strainfmu.estimator.masked_map import MaskedMap, complete_map, masked_map
from strainfmu.estimator.settings import EstimatorSettings, default_settings

MIN_DYNAMIC_PRESSURE = 1e-6
"""q_inf [Pa] below which there is no flow, and no coefficients."""

BLOCK = 1024
"""Samples of a series that are computed together: few enough to stay in the processor's cache."""

ROWS = 64
"""Samples of one matrix product. For larger ones BLAS starts threads, which cost more than they save here."""

CACHED_MASKS = 32
"""Sets of missing gauges whose matrices are kept, the one unused for longest dropped first."""


def load(path: str | PathLike[str], settings: EstimatorSettings | None = None) -> Estimator:
    """Return the estimator of the map at ``path``; None takes the settings that the map was built with.

    Raises
    ------
    InputError
        The file is missing, damaged, altered, or of another schema version.
    """
    return Estimator(load_inverse_map(Path(path)), settings)


class Estimator:
    """An inverse map prepared for the loop: a step is three small matrix-vector products.

    A gauge is left out of a step if its strain is not finite or beyond the sensor range, or if the caller excludes
    it. The matrices without it are computed in the first step that lacks it, and kept.

    Example
    -------
    >>> import strainfmu
    >>> estimator = strainfmu.load("demo/map.h5")
    >>> strain = estimator.inverse_map.mean_strain  # in place of a measurement
    >>> result = estimator.estimate(strain, dynamic_pressure=138e3)
    >>> print(f"{result.C_N:.3f} +- {3 * result.sigma.C_N:.3f}, {result.health.name}")
    0.335 +- 0.005, OK
    """

    def __init__(self, inverse_map: InverseMap, settings: EstimatorSettings | None = None) -> None:
        """Prepare ``inverse_map``; None takes the settings that it was built with."""
        self.inverse_map = inverse_map
        self._parts = map_parts(inverse_map)
        self._masked: OrderedDict[bytes, MaskedMap | None] = OrderedDict()
        self._complete = complete_map(self._parts)
        self._apply_settings(settings or default_settings(inverse_map))

    def with_settings(self, settings: EstimatorSettings) -> Estimator:
        """Return an estimator of the same map with other settings; the two share the matrices of masks."""
        other = copy(self)
        other._apply_settings(settings)
        return other

    def _apply_settings(self, settings: EstimatorSettings) -> None:
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
        dynamic_pressure: ArrayLike,
        valid: ArrayLike | None = None,
        dynamic_pressure_std: ArrayLike = 0.0,
    ) -> LoadEstimate | LoadEstimates:
        """Estimate the loads of one sample, or of k samples at once.

        Parameters
        ----------
        strain : (n_d,) or (k, n_d) strains [m/m], order of ``inverse_map.gauge_names``.
        dynamic_pressure : q_inf [Pa], one for all samples or (k,).
        valid : (n_d,) or (k, n_d) of bool, false for gauges to leave out; None for none.
        dynamic_pressure_std : standard deviation of q_inf's error [Pa], one for all samples or (k,). To first
            order it adds C^2 (s / q)^2 to the variance of each coefficient C.

        Raises
        ------
        InputError
            An argument has the wrong shape or is no number, or ``valid`` is not of bool. Values that are not
            finite are no error: the estimate goes without the gauge or without coefficients, and health states it.
        """
        d = np.asarray(strain, dtype=float)
        if d.ndim != 2:
            numbers = {"dynamic_pressure": dynamic_pressure, "dynamic_pressure_std": dynamic_pressure_std}
            q, q_std = (float(_per_sample(name, value, 1)[0]) for name, value in numbers.items())
            return self.step(d, q, valid, q_std)
        n = self.inverse_map.n_gauges
        if d.shape[1] != n:
            raise InputError(f"strain: expected (k, {n}) values, got {d.shape}")
        mask = None if valid is None else np.broadcast_to(self._checked_mask(valid, len(d)), d.shape)
        pressure = _per_sample("dynamic_pressure", dynamic_pressure, len(d))
        return self._series(d, mask, pressure, _per_sample("dynamic_pressure_std", dynamic_pressure_std, len(d)))

    def step(
        self,
        strain: ArrayLike,
        dynamic_pressure: float,
        valid: ArrayLike | None = None,
        dynamic_pressure_std: float = 0.0,
    ) -> LoadEstimate:
        """Estimate the loads of one sample, at minimum cost; arguments and errors as :meth:`estimate`."""
        d = np.asarray(strain, dtype=float)
        if d.shape != (self.inverse_map.n_gauges,):
            raise InputError(f"strain: expected {self.inverse_map.n_gauges} values, got {d.shape}")
        used = np.abs(d) <= self.settings.sensor_range  # false for NaN
        if valid is not None:
            used &= self._checked_mask(valid)
        masked = self._complete if used.all() else self._masked_map(used)
        if masked is None:
            return _no_estimate(used)
        loads, loads_std, load_covariance, chi_square, z = self._evaluated(masked, d)
        chi_square_limit = self.settings.alarm_scale * masked.chi_square_limit
        suspects = suspected_gauges(z, self._threshold_scale * masked.outlier_threshold, masked.ambiguous_groups)
        coefficients = coefficients_std = np.full(5, np.nan)
        health = HealthState.NO_COEFFICIENTS
        if MIN_DYNAMIC_PRESSURE <= dynamic_pressure < np.inf and 0.0 <= dynamic_pressure_std < np.inf:
            scale = 1.0 / (dynamic_pressure * self._reference)
            coefficients, coefficients_std = scale * loads, scale * loads_std
            if dynamic_pressure_std > 0.0:
                relative = dynamic_pressure_std / dynamic_pressure
                coefficients_std = with_pressure_error(coefficients, coefficients_std, relative)
            health = _health(bool(chi_square > chi_square_limit), bool(suspects), masked)
        return LoadEstimate(
            loads=loads,
            loads_std=loads_std,
            coefficients=coefficients,
            coefficients_std=coefficients_std,
            chi_square=float(chi_square),
            health=health,
            load_covariance=load_covariance,
            chi_square_limit=chi_square_limit,
            degrees_of_freedom=masked.degrees_of_freedom,
            valid=masked.valid,
            standardised_residual=z,
            suspects=suspects,
        )

    def _series(self, d: FloatArray, valid: BoolArray | None, q: FloatArray, q_std: FloatArray) -> LoadEstimates:
        """Return the estimates of k samples: d and valid are (k, n_d), q and q_std (k,)."""
        series = empty_estimates(*d.shape)
        for start in range(0, len(d), BLOCK):
            rows = slice(start, start + BLOCK)
            used = series.valid[rows]
            np.less_equal(np.abs(d[rows]), self.settings.sensor_range, out=used)  # false for NaN
            if valid is not None:
                used &= valid[rows]
            if used.all():
                self._fill(series, rows, self._complete, d[rows], q[rows], q_std[rows])
                continue
            _, first, which = np.unique(np.packbits(used, axis=1), axis=0, return_index=True, return_inverse=True)
            for number, mask in enumerate(used[first]):
                masked = self._complete if mask.all() else self._masked_map(mask)
                of_mask = start + np.flatnonzero(which == number)
                if masked is None:
                    set_unknown(series, of_mask)
                else:
                    self._fill(series, of_mask, masked, d[of_mask], q[of_mask], q_std[of_mask])
        return series

    def _fill(
        self,
        series: LoadEstimates,
        rows: IntArray | slice,
        masked: MaskedMap,
        d: FloatArray,
        q: FloatArray,
        q_std: FloatArray,
    ) -> None:
        """Compute the ``rows`` of ``series``, all with the gauges of ``masked``."""
        loads, loads_std, load_covariance, chi_square, z = self._evaluated(masked, d)
        series.loads[rows], series.loads_std[rows], series.load_covariance[rows] = (
            loads,
            loads_std,
            load_covariance,
        )
        series.chi_square[rows], series.standardised_residual[rows] = chi_square, z
        limit = series.chi_square_limit[rows] = self.settings.alarm_scale * masked.chi_square_limit
        series.degrees_of_freedom[rows] = masked.degrees_of_freedom
        worst = np.argmax(np.abs(z), axis=1)
        suspicious = np.abs(z[np.arange(len(z)), worst]) > self._threshold_scale * masked.outlier_threshold
        suspects = suspects_by_gauge(z.shape[1], masked.ambiguous_groups)
        series.suspects[rows] = suspects[np.where(suspicious, worst, len(suspects) - 1)]
        known = (q >= MIN_DYNAMIC_PRESSURE) & (q < np.inf) & (q_std >= 0.0) & (q_std < np.inf)
        scale = 1.0 / (np.where(known, q, np.nan)[:, None] * self._reference)
        coefficients, std = scale * loads, scale * loads_std
        if np.any(q_std > 0.0):
            std = with_pressure_error(coefficients, std, (q_std / np.where(known, q, np.nan))[:, None])
        series.coefficients[rows], series.coefficients_std[rows] = coefficients, std
        series.health[rows] = np.select(
            [~known, chi_square > limit, suspicious],
            [HealthState.NO_COEFFICIENTS, HealthState.INCONSISTENT, HealthState.SUSPECT],
            HealthState.OK if masked.valid.all() else HealthState.DEGRADED,
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

    def _evaluated(
        self, masked: MaskedMap, d: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return loads (.., 5), their deviations (5,) and covariance (5, 5), chi-square (..) and z (.., n_d)."""
        residual = d - self.inverse_map.mean_strain
        if masked is not self._complete:
            # Multiplying by the zero columns of the gain would let NaN through.
            residual = np.where(masked.valid, residual, 0.0)
        loads = product_with(masked.load_gain, residual) + self.inverse_map.load_of_mean
        loads_std, load_covariance = masked.loads_std, masked.load_covariance
        if self._transfer is not None:
            loads = product_with(self._transfer, loads)
            load_covariance = self._transfer @ load_covariance @ self._transfer.T
            loads_std = np.sqrt(load_covariance.diagonal())
        whitened = product_with(masked.whitening, residual)
        z = product_with(masked.z_whitening, whitened)
        return loads, loads_std, load_covariance, np.vecdot(whitened, whitened), z

    def _checked_mask(self, valid: ArrayLike, samples: int | None = None) -> BoolArray:
        """Return ``valid`` as an array: (n_d,), or for a number of ``samples`` also (k, n_d)."""
        mask, n = np.asarray(valid), self.inverse_map.n_gauges
        shapes = [(n,)] if samples is None else [(n,), (samples, n)]
        if mask.shape not in shapes or mask.dtype != np.bool_:
            expected = " or ".join(str(shape) for shape in shapes)
            raise InputError(f"valid: expected {expected} values of bool, got {mask.shape} of {mask.dtype}")
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


def with_pressure_error(coefficients: FloatArray, std: FloatArray, relative: float | FloatArray) -> FloatArray:
    """Return the deviations (.., 5) of coefficients, ``std`` without and ``relative`` that of q_inf [1].

    To first order an error of q_inf scales all coefficients alike: sigma^2 + (C s / q)^2.
    """
    of_pressure = coefficients * relative
    return np.asarray(np.sqrt(std * std + of_pressure * of_pressure))


def product_with(matrix: FloatArray, values: FloatArray) -> FloatArray:
    """Return ``matrix`` (m, n) times each of ``values`` (n,) or (k, n)."""
    if values.ndim == 1:
        return np.asarray(matrix @ values)
    k, n = values.shape
    whole = k - k % ROWS
    out = np.empty((k, len(matrix)))
    np.matmul(values[:whole].reshape(-1, ROWS, n), matrix.T, out=out[:whole].reshape(-1, ROWS, len(matrix)))
    np.matmul(values[whole:], matrix.T, out=out[whole:])
    return out


def _per_sample(name: str, value: ArrayLike, samples: int) -> FloatArray:
    """Return ``value``, one number or one of each sample, as (samples,).

    Raises
    ------
    InputError
        It holds something else than numbers, or another number of them.
    """
    try:
        values = np.asarray(value, dtype=float) if value is not None else None
    except (TypeError, ValueError):
        values = None
    if values is None or values.shape not in ((), (samples,)):
        expected = "a number" if samples == 1 else f"a number or {samples} numbers"
        got = repr(value) if values is None else f"shape {values.shape}"
        raise InputError(f"{name}: expected {expected}, got {got}")
    return np.broadcast_to(values, (samples,))


def _health(inconsistent: bool, suspicious: bool, masked: MaskedMap) -> HealthState:
    """Return the state of an estimate that has coefficients."""
    if inconsistent:
        return HealthState.INCONSISTENT
    if suspicious:
        return HealthState.SUSPECT
    return HealthState.OK if masked.valid.all() else HealthState.DEGRADED


def _no_estimate(used: BoolArray) -> LoadEstimate:
    """Return the estimate of gauges that do not identify the state."""
    series = empty_estimates(1, len(used))
    series.valid[:] = used
    set_unknown(series, np.zeros(1, dtype=np.int64))
    return series[0]
