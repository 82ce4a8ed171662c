"""The nonlinear estimator over time: flight state with rates, and errors that last, from step to step."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.filter.consistency import Consistency, noted
from strainfmu.estimator.filter.flight_model import (
    FlightModel,
    flight_model,
    sample_rows,
    transition,
    with_tables,
)
from strainfmu.estimator.filter.flight_step import FilteredSample, filtered_sample
from strainfmu.estimator.filter.flight_track import FilteredStep, FilterTrack
from strainfmu.estimator.filter.kalman import Law, Transition, predicted, stationary_law
from strainfmu.estimator.filter.named_navigation import NamedNavigation
from strainfmu.estimator.filter.settings import FilterSettings, checked_time_step
from strainfmu.estimator.filter.warm import WarmSample, carried, warm_sample, warm_strain
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.manifold.estimator import ManifoldEstimator
from strainfmu.estimator.manifold.flight_estimate import FlightEstimate, FlightEstimates
from strainfmu.estimator.manifold.gauss_newton import Samples, without_navigation
from strainfmu.estimator.manifold.inputs import EstimatorInputs
from strainfmu.estimator.manifold.navigation import NAVIGATION, inconsistent_navigation, state_measurement
from strainfmu.estimator.manifold.solve import WARM_ITERATIONS
from strainfmu.estimator.manifold.tracker import RETURN_AFTER, SEARCH_EVERY
from strainfmu.estimator.tables.parameter_tables import without_known

_FLOW = (*NAVIGATION, *(f"{name}_std" for name in NAVIGATION), "altitude")


@dataclass(frozen=True, kw_only=True, eq=False)
class _Solved:
    """A sample, as it was used, and what is held against navigation after it."""

    found: FilteredSample
    sample: Samples
    named: NamedNavigation


class _OfKnown(NamedTuple):
    """An estimator, what was stated of parameters of the flow, and estimator and model for that."""

    estimator: ManifoldEstimator
    stated: bytes
    known: ManifoldEstimator
    model: FlightModel


class FlightFilter:
    """A :class:`ManifoldEstimator` fed with one sample after another, with memory.

    A sample that does not fit what the filter has predicted is estimated on its own. If it fits the tables so, the
    filter begins again from it: a manoeuvre faster than the rates costs memory, not accuracy.
    """

    def __init__(
        self, estimator: ManifoldEstimator, settings: FilterSettings, track: FilterTrack | None = None
    ) -> None:
        """Begin with ``track``; None searches the tables in the first step."""
        self.estimator, self.settings = estimator, settings
        manifold = without_known(estimator.manifold)
        self.model: FlightModel = flight_model(estimator.inverse_map, manifold, settings)
        self.track = track or FilterTrack()
        # For what is known of the sample in work: its sensors, these and parameters of the flow, the same.
        self._now, self._known, self._model = estimator, estimator, self.model
        self._of_known: _OfKnown | None = None

    def step(
        self,
        time_step: float,
        strain: ArrayLike,
        dynamic_pressure: float = np.nan,
        valid: ArrayLike | None = None,
        dynamic_pressure_std: float = np.nan,
        *,
        mach_number: float = np.nan,
        mach_number_std: float = np.nan,
        altitude: float = np.nan,
        static_pressure: float = np.nan,
        static_pressure_std: float = np.nan,
        temperature: ArrayLike | None = None,
        parameters: Mapping[str, ArrayLike] | None = None,
        parameters_std: Mapping[str, ArrayLike] | None = None,
    ) -> FlightEstimate:
        """Estimate the loads of one sample, ``time_step`` [s] after the last one.

        Other arguments as :meth:`ManifoldEstimator.estimate`. Without a gauge the estimate is the prediction, and
        health is ``DEGRADED``, until the flight state is no longer identified.

        Raises
        ------
        InputError
            ``time_step`` is not positive, or an argument has the wrong shape.
        """
        flow = {
            "mach_number": mach_number,
            "static_pressure": static_pressure,
            "dynamic_pressure": dynamic_pressure,
            "mach_number_std": mach_number_std,
            "static_pressure_std": static_pressure_std,
            "dynamic_pressure_std": dynamic_pressure_std,
            "altitude": altitude,
        }
        found = self.recorded(
            time_step,
            strain,
            flow,
            valid=valid,
            temperature=temperature,
            parameters=parameters,
            parameters_std=parameters_std,
        )
        return found.estimate[0]

    def recorded(
        self,
        time_step: float,
        strain: ArrayLike,
        flow: Mapping[str, ArrayLike],
        *,
        valid: ArrayLike | None = None,
        temperature: ArrayLike | None = None,
        parameters: Mapping[str, ArrayLike] | None = None,
        parameters_std: Mapping[str, ArrayLike] | None = None,
    ) -> FilteredStep:
        """Return the step of one sample, as much of it as smoothing needs.

        Arguments and errors as :meth:`step`; ``flow`` holds what is known of navigation, by name.
        """
        flow = dict.fromkeys(_FLOW, np.nan) | dict(flow)
        inputs = self.estimator.checked_inputs(strain, valid, flow, parameters, parameters_std)
        if len(inputs.strain) != 1:
            raise InputError(f"strain: expected one sample, got {len(inputs.strain)}")
        return self.stepped(checked_time_step(time_step), inputs, temperature)

    def stepped(
        self, time_step: float, inputs: EstimatorInputs, temperature: ArrayLike | None = None
    ) -> FilteredStep:
        """Return the step of the one sample in ``inputs``, and keep what it leaves.

        ``temperature`` (n_t,) is what the temperature sensors read [K].
        """
        self._now, warm, strain = self.estimator, self.model.modes, inputs.strain
        if temperature is not None:
            ((_, self._now, inputs),) = self.estimator.groups(inputs, temperature)
            warm, _ = warm_sample(self.estimator.sensor_sets, temperature)
        last = self.track.warm or self.model.modes
        self._known, self._model = self._at_parameters(self._now, inputs)
        self.track = replace(self.track, warm=warm)
        if self.track.law is not None:
            self.track = replace(self.track, law=carried(self.track.law, last, warm))
        return self._at_reference(time_step, inputs, warm, strain)

    def _at_reference(
        self, time_step: float, inputs: EstimatorInputs, warm: WarmSample, strain: FloatArray
    ) -> FilteredStep:
        """Return the step of ``inputs`` whose strain is that at the reference temperature by ``warm`` alone, of
        ``strain`` (1, n_d) less zeros."""
        track, base, now = self.track, self.model.seen.direction, self._model.seen.direction
        last = base if track.directions is None else track.directions
        step = transition(self._model, time_step, track.consistency.widening, warm, None if last is now else last)
        law, thermal = (
            None if track.law is None else predicted(track.law, step),
            self.estimator.inverse_map.thermal,
        )
        slopes, age = track.slopes_after(time_step, self.settings.slope_time, law), track.slope_age + time_step
        directions = None if now is base else now
        self.track = track = replace(track, directions=directions, slope_state=slopes, slope_age=age)
        if law is not None and thermal is not None:
            inputs = replace(inputs, strain=warm_strain(thermal, warm, law, strain))
        samples = Samples(
            strain=np.where(inputs.used, inputs.strain, 0.0),
            used=inputs.used,
            measured=state_measurement(self.estimator.manifold, inputs.navigation),
        )
        if not inputs.used.any():
            return self._coasted(inputs, samples, law=law, step=step)
        if law is not None and track.state is not None:
            solved = self._solved(law, samples, start=track.state, slopes=track.slope_state)
            estimate = self._concluded(inputs, solved)
            if _fits(estimate):
                return self._kept(inputs, solved, before=law, step=step, estimate=estimate)
        return self._begun(inputs, samples, law=law, step=step)

    def _at_parameters(
        self, estimator: ManifoldEstimator, inputs: EstimatorInputs
    ) -> tuple[ManifoldEstimator, FlightModel]:
        """Return ``estimator`` and the model for what the one sample in ``inputs`` knows of parameters of the
        flow; those of the last sample where it knew the same."""
        if not inputs.knows_parameters or estimator.manifold.parameters is None:
            return estimator, self.model
        stated, kept = inputs.parameter_value.tobytes() + inputs.parameter_std.tobytes(), self._of_known
        if kept is None or kept.estimator is not estimator or kept.stated != stated:
            known = estimator.at_parameters(inputs)
            kept = _OfKnown(estimator, stated, known, with_tables(self.model, known.manifold))
            self._of_known = kept
        return kept.known, kept.model

    def _solved(
        self,
        law: Law,
        samples: Samples,
        *,
        start: FloatArray,
        iterations: int = WARM_ITERATIONS,
        slopes: FloatArray | None = None,
    ) -> _Solved:
        """Return the sample from ``law``, a second time without navigation that is inconsistent."""
        held, white = self.track.named, self.settings.white_navigation
        before = after = held.without_named(samples)
        model = self._model
        found = filtered_sample(model, law, sample_rows(before), start=start, iterations=iterations, slopes=slopes)
        residual = found.solution.navigation_residual
        dropped = inconsistent_navigation(residual)
        if dropped.any():
            after = without_navigation(before, residual, dropped)
            rows = sample_rows(before, after)
            # A state that was searched with what is dropped is none of the sample without it.
            warm = WARM_ITERATIONS
            found = filtered_sample(model, law, rows, start=start, iterations=warm, slopes=slopes)
        named, distance = held.after(found.law, samples.measured, after.measured, white)
        residual = np.where(held.apart > 0.0, distance, residual)
        found = replace(found, solution=replace(found.solution, navigation_residual=residual))
        return _Solved(found=found, sample=after, named=named)

    def _concluded(self, inputs: EstimatorInputs, solved: _Solved, predicted: bool = False) -> FlightEstimates:
        """Return the estimate of a sample; not ``OK`` while navigation that is given is named."""
        estimate = self._known.concluded(inputs, solved.sample, solved.found.solution, predicted=predicted)
        named = np.isfinite(inputs.navigation.value[0]) & (solved.named.apart > 0.0)
        if named.any() and estimate.health[0] == HealthState.OK:
            estimate.health[0] = HealthState.DEGRADED
        return estimate

    def _begun(self, inputs: EstimatorInputs, samples: Samples, law: Law | None, step: Transition) -> FilteredStep:
        """Return the sample on its own; the filter begins again from it if it fits the tables."""
        track = self.track
        start = self._known.search(track.named.without_named(samples)).state[0]
        own = stationary_law(transition(self._model, 1.0, 1.0, track.warm), self.model.n_considered)
        solved = self._solved(own, samples, start=start, iterations=0)
        estimate = self._concluded(inputs, solved)
        if _fits(estimate):
            since = self._since(searched=True)
            return self._kept(inputs, solved, before=own, step=step, estimate=estimate, since=since)
        after = own if law is None else law
        # What fits nowhere does not move the state: the law goes on from there.
        self.track = replace(
            track,
            law=law,
            state=estimate.state[0] if track.state is None else track.state,
            slope_state=None,
            slope_age=0.0,
            since_search=self._since(searched=True),
            to_return=RETURN_AFTER,
            consistency=self._consistency(estimate),
        )
        return FilteredStep(
            estimate=estimate,
            estimator=self._now,
            inputs=inputs,
            sample=solved.sample,
            before=after,
            after=after,
            transition=step,
            continues=law is not None,
            measured=False,
        )

    def _kept(
        self,
        inputs: EstimatorInputs,
        solved: _Solved,
        *,
        before: Law,
        step: Transition,
        estimate: FlightEstimates,
        since: int | None = None,
    ) -> FilteredStep:
        """Keep what a sample that fits leaves. Its loads count after :data:`RETURN_AFTER` such samples.

        ``since`` is the number of steps since a search of the tables where the filter begins again, None where it
        goes on.
        """
        to_return = max(self.track.to_return - 1, 0)
        self.track = FilterTrack(
            law=solved.found.law,
            state=estimate.state[0],
            slope_state=self.track.slope_state if since is None else None,
            slope_age=self.track.slope_age if since is None else 0.0,
            since_search=self._since(searched=False) if since is None else since,
            to_return=to_return,
            named=solved.named,
            consistency=self._consistency(estimate),
            warm=self.track.warm,
            directions=self.track.directions,
        )
        if to_return > 0:
            estimate = self._now.with_linear_loads(inputs, estimate)
        return FilteredStep(
            estimate=estimate,
            estimator=self._now,
            inputs=inputs,
            sample=solved.sample,
            before=before,
            after=solved.found.law,
            transition=step,
            continues=since is None,
            measured=True,
        )

    def _coasted(
        self, inputs: EstimatorInputs, samples: Samples, *, law: Law | None, step: Transition
    ) -> FilteredStep:
        """Return the prediction of a sample without gauges, and with the navigation that it has."""
        own = stationary_law(step, self.model.n_considered) if law is None else law
        start = own.mean[:4] if self.track.state is None else self.track.state
        solved = self._solved(own, samples, start=start)
        estimate = self._concluded(inputs, solved, predicted=law is not None)
        if law is not None:
            # A state that is no longer known is no start: the next sample searches the tables.
            lost = estimate.health[0] == HealthState.INVALID
            state = None if lost else estimate.state[0]
            after = replace(self.track, law=solved.found.law, state=state, named=solved.named)
            self.track = replace(after, slope_state=None, slope_age=0.0)
        return FilteredStep(
            estimate=estimate,
            estimator=self._now,
            inputs=inputs,
            sample=solved.sample,
            before=own,
            after=solved.found.law,
            transition=step,
            continues=law is not None,
            measured=True,
        )

    def _since(self, searched: bool) -> int:
        """Return the steps since the last search of the tables, as :class:`Track` counts them."""
        return 0 if searched else min(self.track.since_search + 1, SEARCH_EVERY)

    def _consistency(self, estimate: FlightEstimates) -> Consistency:
        scale = self.estimator.settings.alarm_scale
        expected = scale * float(estimate.degrees_of_freedom[0])
        return noted(self.track.consistency, float(estimate.chi_square[0]), expected)


def _fits(estimate: FlightEstimates) -> bool:
    if estimate.health[0] in (HealthState.INVALID, HealthState.UNIDENTIFIED):
        return False
    return bool(estimate.fits[0])
