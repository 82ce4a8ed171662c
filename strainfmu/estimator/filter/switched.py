"""The nonlinear estimator sample after sample, whose filter over time can be turned on and off between samples.

FMUs step so: the time of a sample is that at the start of the communication step that takes it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from strainfmu.estimator.filter.consistency import Consistency
from strainfmu.estimator.filter.flight_filter import FlightFilter
from strainfmu.estimator.filter.flight_track import FilterTrack
from strainfmu.estimator.filter.kalman import Law
from strainfmu.estimator.filter.named_navigation import NamedNavigation
from strainfmu.estimator.filter.settings import LARGEST, FilterSettings
from strainfmu.estimator.filter.warm import WarmSample
from strainfmu.estimator.manifold.ambiguity import N_WIDENING
from strainfmu.estimator.manifold.estimator import ManifoldEstimator
from strainfmu.estimator.manifold.flight_estimate import FlightEstimate
from strainfmu.estimator.manifold.inputs import EstimatorInputs
from strainfmu.estimator.manifold.navigation import NAVIGATION
from strainfmu.estimator.manifold.tracker import Track, tracked


@dataclass(frozen=True, kw_only=True, eq=False)
class TimedTrack:
    """What a sample leaves to the next one.

    Attributes
    ----------
    track : of the filter; without a law where it was off.
    time : of the sample [s].
    """

    track: FilterTrack = field(default_factory=FilterTrack)
    time: float = 0.0


class SwitchedFilter:
    """An estimator and its filter, which is made when it is first used."""

    def __init__(self, estimator: ManifoldEstimator, time_constant: float) -> None:
        """Filter with ``time_constant`` [s]; 0 estimates each sample on its own."""
        self.estimator, self.time_constant = estimator, time_constant
        self._filter: FlightFilter | None = None

    def filters(self, inputs: EstimatorInputs) -> bool:
        """Return whether the sample in ``inputs`` is filtered.

        Not with deviations of zeros, which the filter does not take, or of further parameters of the flow, which
        that of native FMUs does not.
        """
        zeros = self.estimator.zeros
        follows = self.estimator.manifold.parameters is not None and inputs.knows_parameters
        return self.time_constant > 0.0 and not zeros.std.any() and zeros.common_std == 0.0 and not follows

    def step(
        self, inputs: EstimatorInputs, last: TimedTrack, time: float, temperature: ArrayLike | None = None
    ) -> tuple[FlightEstimate, TimedTrack]:
        """Return the estimate of the one sample in ``inputs`` at ``time`` [s], and what it leaves.

        ``temperature`` (n_t,) is what the temperature sensors read [K]. Time that does not go on predicts nothing.
        """
        if not self.filters(inputs):
            estimator = self.estimator
            if temperature is not None:
                ((_, estimator, inputs),) = estimator.groups(inputs, temperature)
            before = last.track
            track = Track(**{entry.name: getattr(before, entry.name) for entry in fields(Track)})
            found, after = tracked(estimator, inputs, track)
            kept = FilterTrack(**{entry.name: getattr(after, entry.name) for entry in fields(Track)})
            return found, TimedTrack(track=kept, time=time)
        if self._filter is None:
            self._filter = FlightFilter(self.estimator, FilterSettings(time_constant=self.time_constant))
        self._filter.track = replace(last.track, widening=None)
        step = self._filter.stepped(min(max(time - last.time, 0.0), LARGEST), inputs, temperature)
        return step.estimate[0], TimedTrack(track=self._filter.track, time=time)


def as_numbers(last: TimedTrack) -> dict[str, Any]:
    """Return ``last`` as numbers, lists and None, for :func:`from_numbers`."""
    track = last.track
    return {
        "time": last.time,
        "state": None if track.state is None else track.state.tolist(),
        "slope_state": None if track.slope_state is None else track.slope_state.tolist(),
        "slope_age": track.slope_age,
        "steps": [track.since_search, track.to_return],
        "widening": None if track.widening is None else track.widening.tolist(),
        "consistency": asdict(track.consistency),
        "named": [track.named.apart.tolist(), track.named.alarms.tolist()],
        "law": law_numbers(track.law),
        "directions": None if track.directions is None else track.directions.tolist(),
        "warm": warm_numbers(track.warm),
    }


def from_numbers(numbers: Mapping[str, Any]) -> TimedTrack:
    """Return the track of :func:`as_numbers`.

    Raises
    ------
    KeyError, TypeError, ValueError
        A part is missing, or of the wrong kind or shape.
    """
    state, slope_state = (
        None if numbers[name] is None else np.array(numbers[name], dtype=float).reshape(4)
        for name in ("state", "slope_state")
    )
    since_search, to_return = map(int, numbers["steps"])
    apart, alarms = np.array(numbers["named"], dtype=float).reshape(2, len(NAVIGATION))
    directions, widening = numbers["directions"], numbers["widening"]
    track = FilterTrack(
        law=law_from_numbers(numbers["law"]),
        warm=warm_from_numbers(numbers["warm"]),
        state=state,
        slope_state=slope_state,
        slope_age=float(numbers["slope_age"]),
        since_search=since_search,
        to_return=to_return,
        widening=None if widening is None else np.array(widening, dtype=float).reshape(N_WIDENING),
        consistency=Consistency(**numbers["consistency"]),
        named=NamedNavigation(apart=apart, alarms=alarms),
        directions=None if directions is None else np.array(directions, dtype=float),
    )
    return TimedTrack(track=track, time=float(numbers["time"]))


def law_numbers(law: Law | None) -> list[Any] | None:
    """Return ``law`` as lists of numbers, for :func:`law_from_numbers`."""
    return None if law is None else [part.tolist() for part in (law.mean, law.covariance, law.cross)]


def law_from_numbers(numbers: Any) -> Law | None:
    """Return the law of :func:`law_numbers`.

    Raises
    ------
    TypeError, ValueError
        It is of the wrong kind or shape.
    """
    if numbers is None:
        return None
    mean, covariance, cross = (np.array(part, dtype=float) for part in numbers)
    n = len(mean)
    return Law(mean=mean, covariance=covariance.reshape(n, n), cross=cross.reshape(n, -1))


def warm_numbers(warm: WarmSample | None) -> list[Any] | None:
    """Return ``warm`` as lists of numbers, for :func:`warm_from_numbers`."""
    return None if warm is None else [part.tolist() for part in (warm.known, warm.amplitude, warm.covariance)]


def warm_from_numbers(numbers: Any) -> WarmSample | None:
    """Return what is known of temperature modes, of :func:`warm_numbers`.

    Raises
    ------
    TypeError, ValueError
        It is of the wrong kind or shape.
    """
    if numbers is None:
        return None
    known, amplitude, covariance = numbers
    k = len(amplitude)
    return WarmSample(
        known=np.array(known, dtype=bool),
        amplitude=np.array(amplitude, dtype=float),
        covariance=np.array(covariance, dtype=float).reshape(k, k),
    )
