"""The nonlinear estimator step by step: each step starts from the state of the last one, at a fixed cost."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from strainfmu.arrays import FloatArray, IntArray
from strainfmu.estimator.arguments import strain_of_one
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.manifold.ambiguity import pressure_untold
from strainfmu.estimator.manifold.estimator import ManifoldEstimator
from strainfmu.estimator.manifold.flight_estimate import FlightEstimate, FlightEstimates
from strainfmu.estimator.manifold.flight_health import navigation_alarms
from strainfmu.estimator.manifold.gauss_newton import Linearised, Samples
from strainfmu.estimator.manifold.inputs import EstimatorInputs
from strainfmu.estimator.manifold.solve import solve_warm
from strainfmu.estimator.policies import RETURN_AFTER as RETURN_AFTER
from strainfmu.estimator.policies import SEARCH_EVERY as SEARCH_EVERY


@dataclass(frozen=True, kw_only=True, eq=False)
class Track:
    """What a step leaves to the next one.

    Attributes
    ----------
    state : (4,) flight state, None before the first step and after a loss of lock.
    since_search : steps since the last search of the tables, :data:`SEARCH_EVERY` for that many and more.
    to_return : steps that still must fit before the tables' loads are used; 0 while they are.
    widening : (14,) of :func:`~strainfmu.estimator.manifold.ambiguity.widening` at the last search; None where
        navigation told the pressure then. Steps whose navigation tells it leave it as it is.
    """

    state: FloatArray | None = None
    since_search: int = 0
    to_return: int = 0
    widening: FloatArray | None = None


class FlightTracker:
    """A :class:`ManifoldEstimator` fed with one sample after another."""

    def __init__(self, estimator: ManifoldEstimator, track: Track | None = None) -> None:
        """Begin with ``track``; None searches the tables in the first step."""
        self.estimator = estimator
        self.track = track or Track()

    def step(
        self,
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
        """Estimate the loads of one sample; arguments and errors as :meth:`ManifoldEstimator.estimate`."""
        inputs = self.estimator.checked_inputs(
            strain_of_one(strain, self.estimator.inverse_map.n_gauges),
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
        estimator = self.estimator
        if temperature is not None:
            ((_, estimator, inputs),) = estimator.groups(inputs, temperature)
        found, self.track = tracked(estimator, inputs, self.track)
        return found


def tracked(estimator: ManifoldEstimator, inputs: EstimatorInputs, track: Track) -> tuple[FlightEstimate, Track]:
    """Return the estimate of the one sample in ``inputs``, and what it leaves to the next step.

    A step without gauges keeps the state. One that does not fit the tables searches them as well; so does one that
    drops a quantity of navigation with an alarm, unless one of the last :data:`SEARCH_EVERY` steps did. The search
    counts where it fits better. What fits nowhere does not move the state: a spike passes. While the pressure is
    not known, a search comes after every :data:`SEARCH_EVERY` steps, for what else fits, and in the first such
    step after a search that knew it.
    """
    estimator, state = estimator.at_parameters(inputs), track.state
    since = min(track.since_search + 1, SEARCH_EVERY)
    steps = _Solver(estimator, track, may_search=bool(inputs.used.any()))
    if state is None:
        found, since = estimator.estimated(inputs, steps.cold), 0
    else:
        found = estimator.estimated(inputs, steps.warm)
        standing, left = _standing(inputs, found), steps.widening
        since = 0 if steps.has_searched else since
        is_due = standing == _NO_FIT or (standing < _GOOD and track.since_search >= SEARCH_EVERY)
        if is_due and inputs.used.any():
            searched, since = estimator.estimated(inputs, steps.cold), 0
            if _standing(inputs, searched) > standing:
                found = searched
            else:
                steps.widening = left
    one = found[0]
    if one.health in (HealthState.INVALID, HealthState.UNIDENTIFIED):
        return one, track
    fits = one.fits
    to_return = max(track.to_return - 1, 0) if fits else RETURN_AFTER
    if fits and to_return > 0:
        one = estimator.with_linear_loads(inputs, found)[0]
    moves = fits or since > 0 or state is None
    after = one.state if moves else state
    left = None if steps.widening is None else steps.widening[0]
    return one, replace(track, state=after, since_search=since, to_return=to_return, widening=left)


class _Solver:
    """Solves the one sample of a step, and notes what the last solution leaves.

    Attributes
    ----------
    widening : (1, 14) that the last solution leaves; None for none.
    has_searched : whether a step from the last state has searched the tables as well.
    """

    def __init__(self, estimator: ManifoldEstimator, track: Track, *, may_search: bool) -> None:
        self.estimator, self.track = estimator, track
        self.is_due = may_search and (track.widening is None or track.since_search >= SEARCH_EVERY)
        self.widening: FloatArray | None = None
        self.has_searched = False

    def cold(self, samples: Samples, rows: IntArray) -> Linearised:
        """Return the solution from a search."""
        return self._noted(self.estimator.search(samples, rows))

    def warm(self, samples: Samples, _: IntArray) -> Linearised:
        """Return the solution from the last state."""
        assert self.track.state is not None
        last, is_untold = self.track.state[None], bool(pressure_untold(samples.measured)[0])
        if is_untold and self.is_due:
            self.has_searched = True
            return self._noted(self.estimator.search_again(samples, last))
        found = solve_warm(self.estimator.manifold, last, samples)
        self.widening = None if self.track.widening is None else self.track.widening[None]
        return replace(found, widening=self.widening if is_untold else None)

    def _noted(self, found: Linearised) -> Linearised:
        self.widening = found.widening
        return found


_NO_FIT, _GOOD = 0, 2


def _standing(inputs: EstimatorInputs, found: FlightEstimates) -> int:
    """Return 0 where the one sample does not fit, 1 where it drops navigation with an alarm, else ``_GOOD``."""
    if not found.fits[0]:
        return 0
    alarms = navigation_alarms(inputs.navigation, found.navigation_used, found.navigation_residual)
    return 1 if alarms[0] else _GOOD
