"""The nonlinear estimator: strain and navigation in; loads, coefficients, air data and health out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from copy import copy
from dataclasses import fields, replace
from functools import partial
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from strainfmu.arrays import BoolArray, FloatArray, IntArray
from strainfmu.errors import InputError
from strainfmu.estimator.arguments import checked_mask, given, per_sample, silent, strain_of_one, strain_of_samples
from strainfmu.estimator.estimates.load_estimate import set_unknown
from strainfmu.estimator.estimates.pressure_field import FieldInputs
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.linear.estimator import Estimator
from strainfmu.estimator.linear.flow_parameters import write_parameters
from strainfmu.estimator.manifold.air_data import AIR_DATA_NAMES, AirData, air_data
from strainfmu.estimator.manifold.flight_estimate import FlightEstimate, FlightEstimates, joined
from strainfmu.estimator.manifold.flight_health import flight_health
from strainfmu.estimator.manifold.gauss_newton import Linearised, Samples, without_navigation
from strainfmu.estimator.manifold.inputs import EstimatorInputs
from strainfmu.estimator.manifold.linear_loads import OF_LOADS, fall_back
from strainfmu.estimator.manifold.navigation import (
    LEAST_RELATIVE_STD,
    NAVIGATION,
    Navigation,
    inconsistent_navigation,
    pressure_by_altitude,
    prior,
    state_measurement,
)
from strainfmu.estimator.manifold.reference_loads import ReferenceLoads
from strainfmu.estimator.manifold.solve import FlightSolution, solution, solve_again, solve_cold, solve_near
from strainfmu.estimator.manifold.starts import search_table
from strainfmu.estimator.map.at_temperature import SensorSets, scattered
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.policies import LARGEST_USED_SCORE as LARGEST_USED_SCORE
from strainfmu.estimator.settings import EstimatorSettings
from strainfmu.estimator.tables.parameter_tables import with_known
from strainfmu.estimator.zeros.gauge_zeros import GaugeZeros, no_zeros, with_zero_errors, zero_of_rows

Solve = Callable[[Samples, IntArray], Linearised]
"""Takes samples and which of the inputs they are; returns their solution."""

BLOCK = 64
"""Samples that are computed together: their covariances are to stay in the processor's cache."""


def blocks(samples: int) -> list[slice]:
    """Return the blocks of ``samples``, at least one."""
    return [slice(first, first + BLOCK) for first in range(0, max(samples, 1), BLOCK)]


_INCIDENCE = AIR_DATA_NAMES.index("total_incidence")


class ManifoldEstimator:
    """A map with tables over the flight state, prepared for the loop.

    Samples that do not fit the tables get the loads of the linear map, and health is not OK.
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
            The map has no tables, or ``zeros`` are of another number of gauges.
        """
        self.zeros = zeros or no_zeros(inverse_map.n_strain_gauges)
        self._without_zeros, inverse_map = inverse_map, with_zero_errors(inverse_map, self.zeros)
        if inverse_map.manifold is None:
            raise InputError("inverse map: estimator 'linear' found, expected 'manifold'")
        self.inverse_map, self.manifold = inverse_map, inverse_map.manifold
        # Of strain: the zeros are taken off before it.
        self.linear = Estimator(inverse_map, settings)
        self.settings, self.parameters = self.linear.settings, self.linear.parameters
        self.sensor_sets = SensorSets(inverse_map=self._without_zeros, make=self._of_strain)
        self._search = search_table(self.manifold)
        _, precision = prior(self.manifold)
        self._prior_std = 1.0 / np.sqrt(precision)
        self._loads = ReferenceLoads(inverse_map, self.manifold, self.settings)

    def with_zeros(self, zeros: GaugeZeros) -> ManifoldEstimator:
        """Return an estimator of the same map with ``zeros`` in place of its own, as
        :meth:`Estimator.with_zeros`."""
        if len(zeros.value) == len(self.zeros.value) and np.array_equal(zeros.covariance, self.zeros.covariance):
            other = copy(self)
            other.zeros = zeros
            return other
        return ManifoldEstimator(self._without_zeros, self.settings, zeros)

    def with_settings(self, settings: EstimatorSettings) -> ManifoldEstimator:
        """Return an estimator of the same map with other settings."""
        return ManifoldEstimator(self._without_zeros, settings, self.zeros)

    def estimate(
        self,
        strain: ArrayLike,
        dynamic_pressure: ArrayLike = np.nan,
        valid: ArrayLike | None = None,
        dynamic_pressure_std: ArrayLike = np.nan,
        *,
        mach_number: ArrayLike = np.nan,
        mach_number_std: ArrayLike = np.nan,
        altitude: ArrayLike = np.nan,
        static_pressure: ArrayLike = np.nan,
        static_pressure_std: ArrayLike = np.nan,
        temperature: ArrayLike | None = None,
        parameters: Mapping[str, ArrayLike] | None = None,
        parameters_std: Mapping[str, ArrayLike] | None = None,
    ) -> FlightEstimate | FlightEstimates:
        """Estimate the loads of one sample, or of k samples at once, each on its own.

        Parameters
        ----------
        strain : (n_d,) or (k, n_d) readings [m/m], those of further sensors in units of their own, in the order of
            ``inverse_map.gauge_names``.
        dynamic_pressure, mach_number, static_pressure : q_inf [Pa], M [1], p_inf [Pa] of navigation, one for all
            samples or (k,); not given at 0 or below, or NaN. Any of them, and all, may be.
        valid : (n_d,) or (k, n_d) of bool, false for gauges to leave out; None for none.
        dynamic_pressure_std, mach_number_std, static_pressure_std : their standard deviations; NaN takes those of
            the map.
        altitude : geopotential [m]; gives p_inf of the standard atmosphere where ``static_pressure`` is not known,
            from which the air of a day differs by the map's ``altitude_error``.
        temperature : (n_t,) or (k, n_t) readings of the map's temperature sensors [K], 0 or NaN where
            one gives none; None for none. What the wall's temperature strains is taken off, as far as they tell.
        parameters : further parameters of the flow by the names of the map, one for all samples or (k,), in the
            units of the vehicle file; out of their range health is ``OUTSIDE``.
        parameters_std : their standard deviations, with which they sharpen the estimate; of any that is left out
            the value decides on health alone. Samples of another value or deviation are estimated one by one.

        Raises
        ------
        InputError
            An argument has the wrong shape, a standard deviation is negative, or the map knows nothing of the
            temperatures given.
        """
        inputs = self.checked_inputs(
            strain,
            valid,
            {
                "mach_number": mach_number,
                "static_pressure": static_pressure,
                "dynamic_pressure": dynamic_pressure,
                "mach_number_std": mach_number_std,
                "static_pressure_std": static_pressure_std,
                "dynamic_pressure_std": dynamic_pressure_std,
                "altitude": altitude,
            },
            parameters,
            parameters_std,
        )
        found = self._at_temperature(inputs, temperature)
        return found if np.ndim(strain) == 2 else found[0]

    def step(
        self,
        strain: ArrayLike,
        dynamic_pressure: float = np.nan,
        valid: ArrayLike | None = None,
        dynamic_pressure_std: float = np.nan,
        **of_flow: Any,
    ) -> FlightEstimate:
        """Estimate the loads of one sample on its own; arguments, those by name too, and errors as
        :meth:`estimate`.

        :class:`~strainfmu.estimator.manifold.tracker.FlightTracker` steps from the state of the last sample, at a
        fraction of the cost.
        """
        d = strain_of_one(strain, self.inverse_map.n_gauges)
        found = self.estimate(d, dynamic_pressure, valid, dynamic_pressure_std, **of_flow)
        assert isinstance(found, FlightEstimate)
        return found

    def _at_temperature(self, inputs: EstimatorInputs, temperature: ArrayLike | None) -> FlightEstimates:
        """Return the estimates of ``inputs`` with what is known of the temperature, if anything."""
        if temperature is None:
            return self._searched(inputs)
        parts = [
            (rows, estimator._searched(of_rows)) for rows, estimator, of_rows in self.groups(inputs, temperature)
        ]
        found: FlightEstimates = scattered(parts, len(inputs.strain))
        return found

    def _searched(self, inputs: EstimatorInputs) -> FlightEstimates:
        found = joined([self.estimated(inputs.rows(rows), self.search) for rows in blocks(len(inputs.strain))])
        if not inputs.knows_parameters or self.manifold.parameters is None:
            return found
        parts = []
        for rows in inputs.of_like_parameters():
            known, of_rows = self.at_parameters(inputs.rows(rows[:1])), inputs.rows(rows)
            parts.append(
                (rows, known._searched(of_rows) if known is self else known._from(found.state[rows], of_rows))
            )
        known_found = cast(FlightEstimates, scattered(parts, len(inputs.strain)))
        return replace(known_found, field_inputs=self.field_inputs(inputs))

    def _from(self, state: FloatArray, inputs: EstimatorInputs) -> FlightEstimates:
        """Return the estimates of ``inputs`` from ``state`` (k, 4)."""

        def solve(first: FloatArray, samples: Samples, rows: IntArray) -> Linearised:
            return solve_near(self.manifold, self._search, first[rows], samples)

        return joined(
            [self.estimated(inputs.rows(rows), partial(solve, state[rows])) for rows in blocks(len(state))]
        )

    def at_parameters(self, inputs: EstimatorInputs) -> ManifoldEstimator:
        """Return the estimator for what the one sample in ``inputs`` knows of further parameters of the flow."""
        if not inputs.knows_parameters or self.manifold.parameters is None:
            return self
        other = copy(self)
        other.manifold = with_known(self.manifold, inputs.parameter_value[0], inputs.parameter_std[0])
        return other

    def groups(
        self, inputs: EstimatorInputs, temperature: ArrayLike
    ) -> list[tuple[IntArray, ManifoldEstimator, EstimatorInputs]]:
        """Return the samples of each set of known sensors with the estimator for it, and their inputs as at the
        reference temperature; ``temperature`` as of :meth:`estimate`."""
        known, found = self.sensor_sets.readings(temperature, len(inputs.strain)), []
        for rows, key in self.sensor_sets.groups(known):
            estimator, strain = self.sensor_sets.of_set(key, inputs.strain[rows], known[rows])
            found.append((rows, estimator, replace(inputs.rows(rows), strain=strain)))
        return found

    def _of_strain(self, inverse_map: InverseMap) -> ManifoldEstimator:
        """Return the estimator of ``inverse_map`` for readings less zeros."""
        none = replace(self.zeros, value=np.zeros_like(self.zeros.value))
        return ManifoldEstimator(inverse_map, self.settings, none)

    def checked_inputs(
        self,
        strain: ArrayLike,
        valid: ArrayLike | None,
        flow: Mapping[str, ArrayLike],
        parameters: Mapping[str, ArrayLike] | None = None,
        parameters_std: Mapping[str, ArrayLike] | None = None,
    ) -> EstimatorInputs:
        """Return the inputs of :meth:`estimate` as arrays over the samples; errors as there."""
        n = self.inverse_map.n_gauges
        d = strain_of_samples(strain, n)
        used = np.abs(d) <= self.linear.largest_reading  # false for NaN
        if valid is not None:
            used &= checked_mask(valid, n, len(d) if np.ndim(strain) == 2 else None)
        used[silent(d, used, self.inverse_map.n_strain_gauges)] = False
        of = {name: per_sample(name, value, len(d)) for name, value in flow.items()}
        mach, static, dynamic = (given(of[name]) for name in NAVIGATION)
        by_altitude = np.isnan(static)
        pressure = np.where(by_altitude, pressure_by_altitude(given(of["altitude"])), static)
        value = np.column_stack([mach, pressure, dynamic])
        for name in (f"{name}_std" for name in NAVIGATION):
            if np.any(of[name] < 0.0):
                raise InputError(f"{name}: expected numbers from 0 on, got {np.nanmin(of[name]):g}")
        std = np.column_stack([of[f"{name}_std"] for name in NAVIGATION])
        navigation = Navigation(value=value, std=self._stds(value, std, by_altitude))
        known = self.parameters.values(parameters, len(d))
        score = self.parameters.score(known)
        is_used = np.isfinite(known) & (score <= LARGEST_USED_SCORE)
        deviation = np.where(is_used, self.parameters.stds(parameters_std, len(d)), np.nan)
        return EstimatorInputs(
            strain=self.linear.rows_of(d) - zero_of_rows(self.inverse_map, self.zeros),
            used=used,
            navigation=navigation,
            parameter_score=score,
            parameter_value=np.where(np.isnan(deviation), np.nan, known),
            parameter_std=deviation,
        )

    def _stds(self, value: FloatArray, std: FloatArray, by_altitude: BoolArray) -> FloatArray:
        """Return (k, 3) ``std``, those of the map where it is NaN; ``by_altitude`` where p_inf is p(h)."""
        m = self.manifold
        own = np.column_stack(
            [
                np.full(len(value), m.mach_number_error),
                np.where(by_altitude, m.altitude_error, m.static_pressure_error) * value[:, 1],
                m.dynamic_pressure_error * value[:, 2],
            ]
        )
        return np.maximum(np.where(np.isnan(std), own, std), LEAST_RELATIVE_STD * np.abs(value))

    def search(self, samples: Samples, rows: IntArray | None = None) -> Linearised:
        """Return the solution of ``samples`` from a search of the tables, whichever ``rows`` they are."""
        return solve_cold(self.manifold, self._search, samples)

    def search_again(self, samples: Samples, state: FloatArray) -> Linearised:
        """Return the solution of one sample from ``state`` (1, 4) or, where that fits better, a search."""
        return solve_again(self.manifold, self._search, state, samples)

    def estimated(self, inputs: EstimatorInputs, solve: Solve) -> FlightEstimates:
        """Return the estimates of ``inputs`` whose flight state ``solve`` finds.

        Samples with inconsistent navigation are solved a second time without it.
        """
        used = inputs.used
        samples = Samples(
            strain=np.where(used, inputs.strain, 0.0),
            used=used,
            measured=state_measurement(self.manifold, inputs.navigation),
        )
        found = solution(self.manifold, solve(samples, np.arange(len(used))), used)
        dropped = inconsistent_navigation(found.navigation_residual)
        rows = np.flatnonzero(dropped.any(axis=1))
        if len(rows):
            residual = found.navigation_residual
            samples = without_navigation(samples, residual, dropped)
            again = solution(self.manifold, solve(samples.rows(rows), rows), used[rows])
            found = replace(found.with_rows(rows, again), navigation_residual=residual)
        return self.concluded(inputs, samples, found)

    def concluded(
        self, inputs: EstimatorInputs, samples: Samples, found: FlightSolution, predicted: bool = False
    ) -> FlightEstimates:
        """Return the estimates of ``inputs`` with health, from their solution with the ``samples`` used.

        Samples without gauges are unknown, or ``predicted``: known from earlier ones while their state is
        identified.
        """
        used, navigation = inputs.used, inputs.navigation
        known = samples.measured.precision[:, :3] > 0.0
        judged = flight_health(
            self.manifold,
            found,
            used=used,
            navigation=navigation,
            navigation_used=known,
            alarm_scale=self.settings.alarm_scale,
        )
        out = self._loads.estimates(found, used, self.field_inputs(inputs), len(self.parameters.names))
        outside = write_parameters(out, self.parameters, inputs.parameter_score)
        out.health[:] = np.where(outside, HealthState.OUTSIDE, judged.health)
        out.chi_square[:], out.standardised_residual[:] = found.chi_square, found.standardised_residual
        out.degrees_of_freedom[:], out.chi_square_limit[:] = judged.degrees_of_freedom, judged.chi_square_limit
        out.envelope_score[:] = judged.range_score
        for row, suspect in enumerate(judged.suspect.tolist()):
            out.suspects[row] = () if suspect < 0 else (suspect,)
        some = np.asarray(used.any(axis=1))
        air = self._air_data(found, used, predicted)
        set_unknown(out, np.flatnonzero(~some & ~air.is_identified[:, _INCIDENCE]))
        is_linear = fall_back(self.linear, out, inputs, np.asarray(~judged.fits & some))
        return FlightEstimates(
            **{entry.name: getattr(out, entry.name) for entry in fields(out)},
            air_data=air,
            state=found.state,
            state_covariance=found.state_covariance,
            navigation_residual=found.navigation_residual,
            navigation_used=known & some[:, None],
            shape_residual=found.shape_residual,
            fits=judged.fits,
            is_linear=is_linear,
        )

    def field_inputs(self, inputs: EstimatorInputs) -> FieldInputs | None:
        """Return what the pressure of ``inputs`` follows from beside their estimates; None without a field."""
        if self.manifold.surface_field is None:
            return None
        value, std = inputs.navigation.value, inputs.navigation.std
        return FieldInputs(
            inverse_map=self.inverse_map,
            strain=inputs.strain,
            dynamic_pressure=value[:, 2],
            dynamic_pressure_std=std[:, 2],
            static_pressure=value[:, 1],
            static_pressure_std=std[:, 1],
            parameter_value=inputs.parameter_value,
            parameter_std=inputs.parameter_std,
        )

    def _air_data(self, found: FlightSolution, used: BoolArray, predicted: bool) -> AirData:
        """Return the air data; NaN where no gauge is used, since they would be those of navigation, unless
        ``predicted``."""
        air = air_data(found.state, found.state_covariance, self._prior_std)
        some = np.asarray(used.any(axis=1) | predicted)[:, None]
        return AirData(
            value=np.where(some, air.value, np.nan),
            std=np.where(some, air.std, np.nan),
            is_identified=air.is_identified & some,
        )

    def with_linear_loads(self, inputs: EstimatorInputs, found: FlightEstimates) -> FlightEstimates:
        """Return ``found`` with the loads of the linear map, where it has some, and health not OK."""
        out = replace(found, **{name: getattr(found, name).copy() for name in (*OF_LOADS, "health")})
        is_linear = fall_back(self.linear, out, inputs, np.asarray(inputs.used.any(axis=1)))
        good = is_linear & (out.health == HealthState.OK)
        out.health[good] = HealthState.DEGRADED
        return replace(out, is_linear=found.is_linear | is_linear)
