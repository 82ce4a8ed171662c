"""The estimator: strain and dynamic pressure in; loads, coefficients and health out."""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from strainfmu.arrays import BoolArray, FloatArray, IntArray
from strainfmu.estimator.arguments import checked_mask, real_numbers, silent, strain_of_one, strain_of_samples
from strainfmu.estimator.estimates.load_estimate import (
    LoadEstimate,
    LoadEstimates,
    empty_estimates,
    set_nan,
    set_unknown,
)
from strainfmu.estimator.estimates.pressure_field import FieldInputs
from strainfmu.estimator.further_loads import is_moment
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.linear.envelope import envelope_score, flight_ranges, half_spaces
from strainfmu.estimator.linear.flow import MIN_DYNAMIC_PRESSURE, Flow, flow_of, known_pressure
from strainfmu.estimator.linear.flow import outside as outside_by_flow
from strainfmu.estimator.linear.flow_parameters import flow_parameters, write_parameters
from strainfmu.estimator.linear.isolation import suspects_by_gauge
from strainfmu.estimator.linear.loads_from_strain import LoadsFromStrain, ScaledLoads, absolute_loads
from strainfmu.estimator.linear.map_parts import map_parts
from strainfmu.estimator.linear.masked_map import MaskedMap, MaskedMaps
from strainfmu.estimator.linear.moment_point import about_point, moment_transfer
from strainfmu.estimator.map.at_temperature import SensorSets, scattered
from strainfmu.estimator.map.inverse_map import InverseMap, map_references
from strainfmu.estimator.settings import EstimatorSettings, default_settings
from strainfmu.estimator.zeros.gauge_zeros import GaugeZeros, no_zeros, with_zero_errors, zero_of_rows

BLOCK = 1024
"""Samples of a series that are computed together: few enough to stay in the processor's cache."""


class Estimator:
    """An inverse map prepared for the loop: a step is three small matrix-vector products.

    A gauge is left out of a step if its strain is not finite or beyond the sensor range, or if the caller excludes
    it. The matrices without it are computed in the first step that lacks it, and kept.
    """

    def __init__(
        self,
        inverse_map: InverseMap,
        settings: EstimatorSettings | None = None,
        zeros: GaugeZeros | None = None,
    ) -> None:
        """Prepare ``inverse_map``; None takes the settings that it was built with, and zeros of 0.

        Raises
        ------
        InputError
            ``zeros`` are of another number of gauges.
        """
        self.zeros = zeros or no_zeros(inverse_map.n_strain_gauges)
        self._zero = zero_of_rows(inverse_map, self.zeros)
        self._without_zeros, inverse_map = inverse_map, with_zero_errors(inverse_map, self.zeros)
        self.inverse_map, self._n_strain_gauges = inverse_map, inverse_map.n_strain_gauges
        self._parts = map_parts(inverse_map)
        self._scaled = ScaledLoads(inverse_map) if inverse_map.form == "dynamic_pressure" else None
        self.parameters = flow_parameters(inverse_map)
        self._ranges, self._envelope = flight_ranges(inverse_map), half_spaces(inverse_map)
        self._masked = MaskedMaps(self._parts)
        self._apply_settings(settings or default_settings(inverse_map))

    def with_settings(self, settings: EstimatorSettings) -> Estimator:
        """Return an estimator of the same map with other settings; the two share the matrices of masks."""
        other = copy(self)
        other._apply_settings(settings)
        return other

    def with_zeros(self, zeros: GaugeZeros) -> Estimator:
        """Return an estimator of the same map with ``zeros`` in place of its own.

        They are taken off what the gauges read. Their errors are part of the covariance, as the noise of the
        gauges is: gains and alarm levels follow them.

        Raises
        ------
        InputError
            They are of another number of gauges.
        """
        if len(zeros.value) == len(self.zeros.value) and np.array_equal(zeros.covariance, self.zeros.covariance):
            other = copy(self)
            other.zeros, other._zero = zeros, zero_of_rows(self.inverse_map, zeros)
            return other
        return Estimator(self._without_zeros, self.settings, zeros)

    def _of_strain(self, inverse_map: InverseMap) -> Estimator:
        """Return the estimator of ``inverse_map`` for readings less zeros."""
        return Estimator(inverse_map, self.settings, replace(self.zeros, value=np.zeros_like(self.zeros.value)))

    def _apply_settings(self, settings: EstimatorSettings) -> None:
        self.settings = settings
        sensors, strain = self.inverse_map.sensors, settings.sensor_range
        self.largest_reading = strain if sensors is None else np.where(sensors.is_strain, strain, sensors.largest)
        self.sensor_sets = SensorSets(inverse_map=self._without_zeros, make=self._of_strain)
        area, length = settings.reference_area, settings.reference_length
        self._reference = area * np.array([1.0, 1.0, 1.0, length, length])
        shift = settings.moment_station - default_settings(self.inverse_map).moment_station
        self._transfer = moment_transfer(shift) if shift != 0.0 else None
        scale = settings.alarm_scale * self.inverse_map.chi_square_scale
        self.chi_square_limit = scale * self._masked.complete.chi_square_limit

    def estimate(
        self,
        strain: ArrayLike,
        dynamic_pressure: ArrayLike,
        valid: ArrayLike | None = None,
        dynamic_pressure_std: ArrayLike = np.nan,
        *,
        mach_number: ArrayLike = np.nan,
        altitude: ArrayLike = np.nan,
        temperature: ArrayLike | None = None,
        parameters: Mapping[str, ArrayLike] | None = None,
    ) -> LoadEstimate | LoadEstimates:
        """Estimate the loads of one sample, or of k samples at once.

        Parameters
        ----------
        strain : (n_d,) or (k, n_d) readings [m/m], those of further sensors in units of their own, in the order of
            ``inverse_map.gauge_names``.
        dynamic_pressure : q_inf [Pa], one for all samples or (k,); not given at 0 or below, or NaN.
        valid : (n_d,) or (k, n_d) of bool, false for gauges to leave out; None for none.
        dynamic_pressure_std : standard deviation of q_inf's error [Pa], one for all samples or (k,); NaN takes the
            map's ``dynamic_pressure_error``, a fraction of q_inf. It adds to the variances to first order.
        mach_number, altitude : Mach number [1] and geopotential altitude [m] by navigation, one for all samples or
            (k,); not given at 0 or below, or NaN. They decide on health alone: whether the flight is inside the
            envelope, and whether q_inf agrees with 0.7 M^2 p(h).
        temperature : (n_t,) or (k, n_t) readings of the map's temperature sensors [K], 0 or NaN where
            one gives none; None for none. What the wall's temperature strains is taken off, as far as they tell.
        parameters : further parameters of the flow by the names of the map, such as deflections of controls, one
            value for all samples or (k,), NaN where not known. They too decide on health alone.

        Raises
        ------
        InputError
            An argument has the wrong shape or is no number, ``valid`` is not of bool, or there are temperatures or
            parameters of which the map knows nothing. Values that are not
            finite are no error: the estimate goes without the gauge or without coefficients, and health states it.
        """
        d = real_numbers("strain", strain)
        if d.ndim != 2:
            flow = (dynamic_pressure, dynamic_pressure_std, mach_number, altitude)
            return self._one(d, valid, flow, temperature, parameters)
        n = self.inverse_map.n_gauges
        d = strain_of_samples(d, n)
        mask = None if valid is None else np.broadcast_to(checked_mask(valid, n, len(d)), d.shape)
        values = (dynamic_pressure, dynamic_pressure_std, mach_number, altitude)
        flows = flow_of(values, self.parameters, parameters, len(d))
        return self._at_temperature(d, mask, flows, temperature)

    def step(
        self,
        strain: ArrayLike,
        dynamic_pressure: float,
        valid: ArrayLike | None = None,
        dynamic_pressure_std: float = np.nan,
        *,
        mach_number: float = np.nan,
        altitude: float = np.nan,
        temperature: ArrayLike | None = None,
        parameters: Mapping[str, ArrayLike] | None = None,
    ) -> LoadEstimate:
        """Estimate the loads of one sample; arguments and errors as :meth:`estimate`."""
        flow = (dynamic_pressure, dynamic_pressure_std, mach_number, altitude)
        return self._one(strain, valid, flow, temperature, parameters)

    def of_rows(self, rows: FloatArray, used: BoolArray, pressure: FloatArray, std: FloatArray) -> LoadEstimates:
        """Return the estimates of ``rows`` (k, n_d) of the map [m/m], of the gauges ``used`` (k, n_d) whatever
        they read, with q_inf and its deviation (k,) [Pa]."""
        unknown = np.full(len(rows), np.nan)
        flow = flow_of((pressure, std, unknown, unknown), self.parameters, None, len(rows))
        return self._series(self.readings_of(rows), used, flow, is_checked=True)

    def _one(
        self,
        strain: ArrayLike,
        valid: ArrayLike | None,
        flow: tuple[ArrayLike, ...],
        temperature: ArrayLike | None,
        parameters: Mapping[str, ArrayLike] | None,
    ) -> LoadEstimate:
        d = strain_of_one(strain, self.inverse_map.n_gauges)
        mask = None if valid is None else checked_mask(valid, self.inverse_map.n_gauges)[None, :]
        of_one = flow_of(flow, self.parameters, parameters, 1)
        return self._at_temperature(d[None, :], mask, of_one, temperature)[0]

    def _at_temperature(
        self, readings: FloatArray, valid: BoolArray | None, flow: Flow, temperature: ArrayLike | None
    ) -> LoadEstimates:
        """Return the estimates of k samples (k, n_d) with what is known of the temperature, if anything."""
        if temperature is None:
            return self._series(readings, valid, flow)
        known = self.sensor_sets.readings(temperature, len(readings))
        used = self._used(readings, valid, flow.dynamic_pressure)
        strains = self.rows_of(readings)
        parts = []
        for rows, key in self.sensor_sets.groups(known):
            estimator, strain = self.sensor_sets.of_set(key, strains[rows], known[rows])
            of_rows = flow.rows(rows)
            parts.append((rows, estimator._series(self.readings_of(strain), used[rows], of_rows, is_checked=True)))
        found: LoadEstimates = scattered(parts, len(readings))
        return found

    def _used(self, readings: FloatArray, valid: BoolArray | None, dynamic_pressure: FloatArray) -> BoolArray:
        """Return (k, n_d) the gauges in use of k samples: in range, ``valid``, and not all exactly 0 in a flow.

        ``dynamic_pressure`` (k,) [Pa] tells where there is one.
        """
        used: BoolArray = np.abs(readings) <= self.largest_reading  # false for NaN
        if valid is not None:
            used &= valid
        if not readings.all():
            flows = dynamic_pressure >= MIN_DYNAMIC_PRESSURE
            used[silent(readings, used, self._n_strain_gauges) & flows] = False
        return used

    def rows_of(self, readings: FloatArray) -> FloatArray:
        """Return rows of the map [m/m] for ``readings`` (n_d,) or (k, n_d): over their scale, less the zeros."""
        sensors = self.inverse_map.sensors
        return np.asarray((readings if sensors is None else readings / sensors.scale) - self._zero)

    def readings_of(self, rows: FloatArray) -> FloatArray:
        """Return readings for ``rows`` (n_d,) or (k, n_d) of the map [m/m], as of gauges without zeros."""
        sensors = self.inverse_map.sensors
        return rows if sensors is None else rows * sensors.scale

    def _series(
        self, readings: FloatArray, valid: BoolArray | None, flow: Flow, is_checked: bool = False
    ) -> LoadEstimates:
        """Return the estimates of k samples: readings and valid are (k, n_d).

        ``is_checked`` for readings that are no longer those of the gauges: whether those are in range is in
        ``valid`` then.
        """
        further = self.inverse_map.further
        d = self.rows_of(readings)
        stations = None if further is None else further.section_station
        inputs = self._field_inputs(d, flow)
        series = empty_estimates(
            len(d),
            d.shape[1],
            field_inputs=inputs,
            section_station=stations,
            n_parameters=len(self.parameters.names),
        )
        if self.parameters.names:
            write_parameters(series, self.parameters, flow.parameter_score)
        for start in range(0, len(d), BLOCK):
            rows = slice(start, start + BLOCK)
            used = series.valid[rows]
            of_rows = None if valid is None else valid[rows]
            if is_checked and of_rows is not None:
                used[:] = of_rows
            else:
                used[:] = self._used(readings[rows], of_rows, flow.dynamic_pressure[rows])
            if used.all():
                self._fill(series, slice(start, start + len(used)), self._masked.complete, d, flow)
                continue
            _, first, which = np.unique(np.packbits(used, axis=1), axis=0, return_index=True, return_inverse=True)
            for number, mask in enumerate(used[first]):
                masked = self._masked.of(mask)
                of_mask = start + np.flatnonzero(which.reshape(-1) == number)
                if masked is None:
                    set_unknown(series, of_mask)
                else:
                    self._fill(series, of_mask, masked, d, flow)
        return series

    def _field_inputs(self, d: FloatArray, flow: Flow) -> FieldInputs | None:
        if self.inverse_map.field_modes is None:
            return None
        known, std = known_pressure(flow, self.inverse_map.dynamic_pressure_error)
        unknown = np.full(len(d), np.nan)
        return FieldInputs(
            inverse_map=self.inverse_map,
            strain=d,
            dynamic_pressure=np.where(known, flow.dynamic_pressure, np.nan),
            dynamic_pressure_std=std,
            static_pressure=unknown,
            static_pressure_std=unknown,
            # The linear estimate takes their values alone.
            parameter_value=np.full((len(d), len(self.parameters.names)), np.nan),
            parameter_std=np.full((len(d), len(self.parameters.names)), np.nan),
        )

    def _fill(
        self,
        series: LoadEstimates,
        rows: IntArray | slice,
        masked: MaskedMap,
        strain: FloatArray,
        all_flow: Flow,
    ) -> None:
        """Compute the ``rows`` of ``series``, all with the gauges of ``masked``."""
        flow = all_flow.rows(rows)
        known, q_std = known_pressure(flow, self.inverse_map.dynamic_pressure_error)
        q = np.where(known, flow.dynamic_pressure, np.nan)
        # Products below need numbers; what is not known is taken out at the end.
        found = self._loads_from(
            masked, strain[rows], np.where(known, q, self.inverse_map.nominal_dynamic_pressure)
        )
        score = self._envelope_score(found, q, q_std)
        found = about_point(found, self._transfer)
        scale = 1.0 / (q[:, None] * self._reference)
        coefficients = scale * found.loads
        variance = np.diagonal(found.load_covariance, axis1=1, axis2=2)
        of_pressure = (scale * found.load_per_pressure - coefficients / q[:, None]) * q_std[:, None]
        limit_scale = self.settings.alarm_scale * found.expected_ratio
        limit = self.inverse_map.chi_square_scale * masked.chi_square_limit * limit_scale
        threshold = masked.outlier_threshold * np.sqrt(self.inverse_map.outlier_scale * limit_scale)
        z = found.standardised_residual
        worst = np.argmax(np.abs(z), axis=1)
        suspicious = np.abs(z[np.arange(len(z)), worst]) > threshold
        suspects = suspects_by_gauge(z.shape[1], masked.ambiguous_groups)
        loads_of_pressure = found.load_per_pressure * q_std[:, None]
        covariance = found.load_covariance + loads_of_pressure[:, :, None] * loads_of_pressure[:, None, :]
        series.loads[rows], series.load_covariance[rows] = found.loads, covariance
        series.loads_std[rows] = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
        series.chi_square[rows], series.standardised_residual[rows] = found.chi_square, z
        series.chi_square_limit[rows], series.degrees_of_freedom[rows] = limit, masked.degrees_of_freedom
        series.suspects[rows] = suspects[np.where(suspicious, worst, len(suspects) - 1)]
        series.coefficients[rows] = coefficients
        series.coefficients_std[rows] = np.sqrt(scale * scale * variance + of_pressure * of_pressure)
        series.envelope_score[rows] = score
        of_coefficients = scale[:, :, None] * found.load_covariance * scale[:, None, :]
        of_coefficients += of_pressure[:, :, None] * of_pressure[:, None, :]
        series.coefficient_covariance[rows] = of_coefficients
        if self.inverse_map.further is not None:
            self._fill_further(series, rows, found, q, q_std)
        outside = score > self.inverse_map.envelope_score_limit
        health = np.full(len(q), HealthState.OK if masked.valid.all() else HealthState.DEGRADED, dtype=np.int64)
        # The later takes the place of the earlier.
        health[outside] = HealthState.OUTSIDE
        health[suspicious] = HealthState.SUSPECT
        health[found.chi_square > limit] = HealthState.INCONSISTENT
        health[outside_by_flow(self._ranges, flow, q_std)] = HealthState.OUTSIDE
        health[~known] = HealthState.NO_COEFFICIENTS
        series.health[rows] = health
        if self._scaled is not None and not known.all():
            set_nan(series, np.arange(len(series))[rows][~known])

    def _fill_further(
        self,
        series: LoadEstimates,
        rows: IntArray | slice,
        found: LoadsFromStrain,
        q: FloatArray,
        q_std: FloatArray,
    ) -> None:
        """Compute the further loads of the ``rows`` of ``series``; the moment point does not move them."""
        length = np.where(is_moment(len(series.section_station)), self.settings.reference_length, 1.0)
        scale = 1.0 / (q[:, None] * (self.settings.reference_area * length))
        coefficients = scale * found.further
        of_pressure = found.further_per_pressure * q_std[:, None]
        of_both = scale * of_pressure - coefficients * (q_std / q)[:, None]
        series.further_loads[rows], series.further_coefficients[rows] = found.further, coefficients
        series.further_loads_std[rows] = np.sqrt(found.further_variance + of_pressure * of_pressure)
        series.further_coefficients_std[rows] = np.sqrt(scale**2 * found.further_variance + of_both * of_both)

    def _loads_from(self, masked: MaskedMap, d: FloatArray, q: FloatArray) -> LoadsFromStrain:
        if self._scaled is None:
            return absolute_loads(self._parts, masked, d)
        return self._scaled.loads(masked, d, q)

    def _envelope_score(self, found: LoadsFromStrain, q: FloatArray, q_std: FloatArray) -> FloatArray:
        """Return (k,) the score of the coefficients at the references of the map; NaN where q is."""
        if self._envelope is None:
            return np.where(np.isnan(q), np.nan, 0.0)
        scale = 1.0 / (q[:, None] * map_references(self.inverse_map))
        coefficients = scale * found.loads
        of_pressure = (scale * found.load_per_pressure - coefficients / q[:, None]) * q_std[:, None]
        covariance = scale[:, :, None] * found.load_covariance * scale[:, None, :]
        covariance = covariance + of_pressure[:, :, None] * of_pressure[:, None, :]
        return np.where(np.isnan(q), np.nan, envelope_score(self._envelope, coefficients, covariance))

    def masked_map(self, valid: ArrayLike) -> MaskedMap | None:
        """Return the map for the gauges of ``valid`` (n_d,) of bool; None if they do not identify the state.

        In Case 2 the prior identifies the state with any gauge; without gauges there is no map.

        Raises
        ------
        InputError
            ``valid`` has the wrong length or is not of bool.
        """
        return self._masked.of(checked_mask(valid, self.inverse_map.n_gauges))
