"""What a step of the nonlinear estimator's filter leaves: to the next step, and to smoothing."""

from __future__ import annotations

from dataclasses import dataclass, field

from strainfmu.arrays import FloatArray
from strainfmu.estimator.filter.consistency import Consistency
from strainfmu.estimator.filter.kalman import Law, Transition
from strainfmu.estimator.filter.named_navigation import NamedNavigation
from strainfmu.estimator.filter.warm import WarmSample
from strainfmu.estimator.manifold.estimator import ManifoldEstimator
from strainfmu.estimator.manifold.flight_estimate import FlightEstimates
from strainfmu.estimator.manifold.gauss_newton import Samples
from strainfmu.estimator.manifold.inputs import EstimatorInputs


@dataclass(frozen=True, kw_only=True, eq=False)
class FilterTrack:
    """What a step leaves to the next one.

    Attributes
    ----------
    law : of the states, None before the first step.
    state : (4,) flight state from which the next step starts, None before the first.
    since_search, to_return : as of :class:`~strainfmu.estimator.manifold.tracker.Track`.
    consistency : of the window.
    named : what is held against navigation.
    warm : what was known of temperature modes; None for nothing.
    directions : (k, r) of the errors of pressure in ``law``; None for those without known parameters of the flow.
    """

    law: Law | None = None
    state: FloatArray | None = None
    since_search: int = 0
    to_return: int = 0
    warm: WarmSample | None = None
    directions: FloatArray | None = None
    named: NamedNavigation = field(default_factory=NamedNavigation)
    consistency: Consistency = field(default_factory=Consistency)


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
