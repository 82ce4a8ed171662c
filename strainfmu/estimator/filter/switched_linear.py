"""A linear map sample after sample, whose filter over time can be turned on and off between samples.

FMUs step so: the time of a sample is that at the start of the communication step that takes it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from strainfmu.arrays import FloatArray
from strainfmu.estimator.estimates.load_estimate import LoadEstimate
from strainfmu.estimator.filter.kalman import Law
from strainfmu.estimator.filter.linear_filter import LinearFilter
from strainfmu.estimator.filter.settings import LARGEST, FilterSettings
from strainfmu.estimator.filter.switched import law_from_numbers, law_numbers, warm_from_numbers, warm_numbers
from strainfmu.estimator.filter.warm import WarmSample
from strainfmu.estimator.linear.estimator import Estimator


@dataclass(frozen=True, kw_only=True, eq=False)
class TimedLaw:
    """What a sample leaves to the next one.

    Attributes
    ----------
    law : of the states, None where the filter was off or nothing has been measured.
    time : of the sample [s].
    warm : what was known of temperature modes in it; None for nothing.
    """

    law: Law | None = None
    time: float = 0.0
    warm: WarmSample | None = None


class SwitchedLinearFilter:
    """A linear estimator and its filter, which is made when it is first used."""

    def __init__(self, estimator: Estimator, time_constant: float) -> None:
        """Filter with ``time_constant`` [s]; 0 estimates each sample on its own."""
        self.estimator, self.time_constant = estimator, time_constant
        self._filter: LinearFilter | None = None

    @property
    def filters(self) -> bool:
        """Whether samples are filtered; not with deviations of zeros, which the filter does not take."""
        zeros = self.estimator.zeros
        return self.time_constant > 0.0 and not zeros.std.any() and zeros.common_std == 0.0

    def step(
        self,
        static: LoadEstimate,
        strain: FloatArray,
        dynamic_pressure: float,
        last: TimedLaw,
        time: float,
        temperature: FloatArray | None = None,
    ) -> tuple[LoadEstimate, TimedLaw]:
        """Return the estimate of the sample at ``time`` [s] whose estimate on its own is ``static``, and what it
        leaves.

        ``strain`` (n_d,) is what the gauges read, ``temperature`` (n_t,) what the temperature sensors do [K]. Time
        that does not go on predicts nothing.
        """
        if not self.filters:
            return static, TimedLaw(time=time)
        if self._filter is None:
            self._filter = LinearFilter(self.estimator, FilterSettings(time_constant=self.time_constant))
        self._filter.law, self._filter.warm = last.law, last.warm or self._filter.model.warm
        elapsed = min(max(time - last.time, 0.0), LARGEST)
        step = self._filter.stepped(elapsed, static, strain, dynamic_pressure, temperature)
        return step.estimate, TimedLaw(law=self._filter.law, time=time, warm=self._filter.warm)


def as_numbers(last: TimedLaw) -> dict[str, Any]:
    """Return ``last`` as numbers, lists and None, for :func:`from_numbers`."""
    return {
        "time": last.time,
        "law": law_numbers(last.law),
        "warm": warm_numbers(last.warm),
    }


def from_numbers(numbers: Mapping[str, Any]) -> TimedLaw:
    """Return the law of :func:`as_numbers`.

    Raises
    ------
    KeyError, TypeError, ValueError
        A part is missing, or of the wrong kind or shape.
    """
    law, warm = law_from_numbers(numbers["law"]), warm_from_numbers(numbers["warm"])
    return TimedLaw(law=law, time=float(numbers["time"]), warm=warm)
