"""What a step of the nonlinear estimator's filter leaves: to the next step, and to smoothing."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.estimator.filter.consistency import Consistency
from strainfmu.estimator.filter.kalman import Law, Transition
from strainfmu.estimator.filter.named_navigation import NamedNavigation
from strainfmu.estimator.filter.warm import WarmSample
from strainfmu.estimator.manifold.estimator import ManifoldEstimator
from strainfmu.estimator.manifold.flight_estimate import FlightEstimates
from strainfmu.estimator.manifold.gauss_newton import Samples
from strainfmu.estimator.manifold.inputs import EstimatorInputs
from strainfmu.estimator.policies import LONGEST_STEP as LONGEST_STEP
from strainfmu.estimator.policies import OF_AGE as OF_AGE
from strainfmu.estimator.tables.flight_tables import N_STATES

NOTICED = 3.0
"""Deviations of a rate at which half of the motion that it predicts moves the flight state of slopes.

Without it slopes lag behind a turn by the time constant, 2 deg at 10 deg/s, and what they miss passes for errors
that last. All of it would bring the noise of the rates into them.
"""


def noticed(law: Law) -> FloatArray:
    """Return (4,) how far the rates of ``law`` stand out of their deviations, from 0 to 1."""
    rates = slice(N_STATES, 2 * N_STATES)
    square = law.mean[rates] ** 2
    both = square + NOTICED**2 * np.diagonal(law.covariance)[rates]
    return np.divide(square, both, out=np.zeros(N_STATES), where=both > 0.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class FilterTrack:
    """What a step leaves to the next one.

    Attributes
    ----------
    law : of the states, None before the first step.
    state : (4,) flight state from which the next step starts, None before the first.
    slope_state : (4,) flight state at which the last step took slopes, None for ``state``.
    slope_age : time over which that has followed the estimated one [s].
    since_search, to_return, widening : as of :class:`~strainfmu.estimator.manifold.tracker.Track`; the filter
        leaves no widening.
    consistency : of the window.
    named : what is held against navigation.
    warm : what was known of temperature modes; None for nothing.
    directions : (k, r) of the errors of pressure in ``law``; None for those without known parameters of the flow.
    """

    law: Law | None = None
    state: FloatArray | None = None
    slope_state: FloatArray | None = None
    slope_age: float = 0.0
    since_search: int = 0
    to_return: int = 0
    widening: FloatArray | None = None
    warm: WarmSample | None = None
    directions: FloatArray | None = None
    named: NamedNavigation = field(default_factory=NamedNavigation)
    consistency: Consistency = field(default_factory=Consistency)

    def slopes_after(self, time_step: float, longest: float, predicted: Law | None) -> FloatArray | None:
        """Return (4,) the flight state of slopes after ``time_step`` [s]; None where each iteration takes its own.

        It moves as the filter has ``predicted``, as far as the rates stand out of their deviations, and follows
        the estimated one with a time constant of ``longest`` [s], at most :data:`OF_AGE` of the time that the
        filter has gone on: the first estimates are the worst.
        """
        time_constant = min(longest, OF_AGE * self.slope_age)
        if self.state is None or self.law is None or predicted is None:
            return None
        if time_step >= LONGEST_STEP * time_constant:
            return None
        last = self.state if self.slope_state is None else self.slope_state
        moved = noticed(self.law) * (predicted.mean[:N_STATES] - self.law.mean[:N_STATES])
        return np.asarray(self.state + moved + np.exp(-time_step / time_constant) * (last - self.state))


@dataclass(frozen=True, kw_only=True, eq=False)
class FilteredStep:
    """A step of the filter, as much of it as smoothing needs.

    Attributes
    ----------
    estimate : of the step.
    estimator : for the temperature sensors that read, whatever else is known of the flow.
    inputs : of the step, strain as at the reference temperature.
    sample : as it was used.
    before, after : laws of the states before and after the sample.
    transition : from the last step to this one.
    continues : whether ``before`` follows from the last step; false where the filter began again.
    measured : whether the sample is part of ``after``.
    """

    estimate: FlightEstimates
    estimator: ManifoldEstimator
    inputs: EstimatorInputs
    sample: Samples
    before: Law
    after: Law
    transition: Transition
    continues: bool
    measured: bool
