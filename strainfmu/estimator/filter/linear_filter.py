"""A linear map over time: pressure states and errors that last, from step to step.

The filter changes the static estimate by the difference that memory makes: the loads of the filtered law less
those of the law of the sample alone, and their covariances likewise. What the static estimate holds beside, as
errors at the current strain and that of q_inf, stays in it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.arguments import real_numbers
from strainfmu.estimator.estimates.load_estimate import LoadEstimate
from strainfmu.estimator.filter.kalman import Law, Transition, measured, predicted, stationary_law
from strainfmu.estimator.filter.linear_model import (
    LinearModel,
    linear_loads,
    linear_measurement,
    linear_model,
    linear_transition,
)
from strainfmu.estimator.filter.settings import FilterSettings, checked_time_step
from strainfmu.estimator.filter.warm import WarmSample, carried, warm_sample
from strainfmu.estimator.health import HealthState, chi_square_limit
from strainfmu.estimator.linear.estimator import Estimator
from strainfmu.estimator.linear.moment_point import moment_transfer
from strainfmu.estimator.map.temperature import strain_at_reference
from strainfmu.estimator.settings import default_settings

_NOT_FILTERED = (HealthState.INVALID, HealthState.UNIDENTIFIED, HealthState.NO_COEFFICIENTS)
"""States in which nothing was measured."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LinearStep:
    """A step of the filter, as much of it as smoothing needs.

    Attributes
    ----------
    estimate, static : of the step, and of its sample alone.
    strain : (n_d,) readings less zeros [m/m], 0 of lost gauges.
    dynamic_pressure : q_inf [Pa].
    alone : law of the states after the sample alone, None where nothing was measured.
    before, after, transition, continues : as of :class:`~strainfmu.estimator.filter.flight_track.FilteredStep`.
    """

    estimate: LoadEstimate
    static: LoadEstimate
    strain: FloatArray
    dynamic_pressure: float
    alone: Law | None
    before: Law
    after: Law
    transition: Transition
    continues: bool


class LinearFilter:
    """An :class:`Estimator` fed with one sample after another, with memory.

    A sample that does not fit what the filter has predicted is estimated on its own, and the filter begins again
    from it if it fits the map so. A sample without gauges or without q_inf is estimated as by the map alone; what
    is known of the states decays with time.
    """

    def __init__(
        self,
        estimator: Estimator,
        settings: FilterSettings,
        law: Law | None = None,
        warm: WarmSample | None = None,
    ) -> None:
        """Begin with ``law`` of the states, after a sample of which ``warm`` was known of the temperature.

        None is the prior of the map, and no temperature.

        Raises
        ------
        InputError
            The map is in form "absolute", which does not say what lasts.
        """
        form = estimator.inverse_map.form
        if form != "dynamic_pressure":
            raise InputError(f"inverse map: form '{form}' found, a filter needs form 'dynamic_pressure'")
        self.estimator, self.settings, self.law = estimator, settings, law
        self.model: LinearModel = linear_model(estimator.inverse_map, settings)
        self.warm = warm or self.model.warm
        shift = estimator.settings.moment_station - default_settings(estimator.inverse_map).moment_station
        self._transfer = moment_transfer(shift)
        area, length = estimator.settings.reference_area, estimator.settings.reference_length
        self._reference = area * np.array([1.0, 1.0, 1.0, length, length])

    def step(
        self,
        time_step: float,
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
        """Estimate the loads of one sample, ``time_step`` [s] after the last one.

        Other arguments as :meth:`Estimator.estimate`.

        Raises
        ------
        InputError
            ``time_step`` is not positive, or an argument has the wrong shape.
        """
        seconds = checked_time_step(time_step)
        static = self.estimator.step(
            strain,
            dynamic_pressure=dynamic_pressure,
            valid=valid,
            dynamic_pressure_std=dynamic_pressure_std,
            mach_number=mach_number,
            altitude=altitude,
            temperature=temperature,
            parameters=parameters,
        )
        readings = real_numbers("strain", strain)
        return self.stepped(seconds, static, readings, float(dynamic_pressure), temperature).estimate

    def stepped(
        self,
        time_step: float,
        static: LoadEstimate,
        strain: FloatArray,
        dynamic_pressure: float,
        temperature: ArrayLike | None = None,
    ) -> LinearStep:
        """Return the step of a sample whose estimate on its own is ``static``, and keep what it leaves.

        ``strain`` (n_d,) is what the gauges read, ``temperature`` (n_t,) what the temperature sensors do [K].
        """
        rows, warm = self._at_reference(self.estimator.rows_of(strain), temperature)
        step = linear_transition(self.model, time_step, warm)
        first = self.law is None
        prior = stationary_law(step, self.model.n_considered)
        before = prior if self.law is None else predicted(carried(self.law, self.warm, warm), step)
        self.warm = warm
        known = LinearStep(
            estimate=static,
            static=static,
            strain=np.where(static.valid, rows, 0.0),
            dynamic_pressure=dynamic_pressure,
            alone=None,
            before=before,
            after=before,
            transition=step,
            continues=not first,
        )
        if static.health in _NOT_FILTERED or not static.chi_square <= static.chi_square_limit:
            self.law = None if first else before
            return known
        ratio = dynamic_pressure / self.estimator.inverse_map.nominal_dynamic_pressure
        of_prior, of_last = (
            linear_measurement(self.model, known.strain, static.valid, ratio=ratio, law=law)
            for law in (prior, before)
        )
        alone, update = measured(prior, of_prior), measured(before, of_last)
        known = replace(known, alone=alone.law)
        if not first and update.chi_square <= _limit(static):
            self.law = update.law
            return replace(known, estimate=self.with_law(known, update.law), after=update.law)
        self.law = alone.law
        return replace(known, before=prior, after=alone.law, continues=False)

    def _at_reference(self, rows: FloatArray, temperature: ArrayLike | None) -> tuple[FloatArray, WarmSample]:
        """Return ``rows`` (n_d,) of the map as at the reference temperature, and what is known of that."""
        if temperature is None:
            return rows, self.model.warm
        sets = self.estimator.sensor_sets
        warm, sensors = warm_sample(sets, temperature)
        readings = sets.readings(temperature, 1)
        return strain_at_reference(sets.thermal, sensors, rows[None], readings)[0], warm

    def with_law(self, step: LinearStep, law: Law) -> LoadEstimate:
        """Return the estimate of ``step`` by the filtered or smoothed ``law`` of its states."""
        static = step.static
        if step.alone is None:
            return static
        ratio = step.dynamic_pressure / self.estimator.inverse_map.nominal_dynamic_pressure
        known, alone = (
            linear_loads(self.model, step.strain, static.valid, ratio=ratio, law=one) for one in (law, step.alone)
        )
        apart = self._transfer @ (known[0] - alone[0])
        by = self._transfer @ (known[1] - alone[1]) @ self._transfer.T
        covariance = static.load_covariance + by
        scale = 1.0 / (step.dynamic_pressure * self._reference)
        of_coefficients = static.coefficient_covariance + scale[:, None] * by * scale
        variance = np.diagonal(of_coefficients)
        if not (_is_positive(covariance) and np.all(variance > 0.0)):
            # Errors at a weak current strain are smaller than those that the laws hold.
            covariance, of_coefficients = static.load_covariance, static.coefficient_covariance
        return replace(
            static,
            loads=static.loads + apart,
            load_covariance=covariance,
            loads_std=np.sqrt(np.diagonal(covariance)),
            coefficients=static.coefficients + scale * apart,
            coefficients_std=np.sqrt(np.diagonal(of_coefficients)),
            coefficient_covariance=of_coefficients,
        )


def _limit(static: LoadEstimate) -> float:
    """Return the alarm level of the normalised innovation, whose degrees of freedom are all gauges used."""
    used: BoolArray = static.valid
    if static.degrees_of_freedom <= 0:
        return chi_square_limit(int(used.sum()))
    scale = static.chi_square_limit / chi_square_limit(static.degrees_of_freedom)
    return scale * chi_square_limit(int(used.sum()))


def _is_positive(covariance: FloatArray) -> bool:
    if not np.all(np.isfinite(covariance)):  # of a deviation of q_inf beyond numbers
        return False
    size = 1.0 / np.sqrt(np.maximum(np.diagonal(covariance), 1e-300))
    return bool(np.linalg.eigvalsh(covariance * size[:, None] * size)[0] > 0.0)
