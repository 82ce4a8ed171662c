"""Settings of a filter over time: how long errors last, and how fast a vehicle changes its flight state."""

from __future__ import annotations

from dataclasses import dataclass, fields
from math import isfinite

from strainfmu.errors import InputError
from strainfmu.estimator.policies import LARGEST_TIME as LARGEST
from strainfmu.estimator.policies import RATE_TIME as RATE_TIME
from strainfmu.estimator.policies import SLOPE_TIME as SLOPE_TIME
from strainfmu.estimator.policies import SLOW as SLOW
from strainfmu.estimator.policies import SMALLEST_TIME as SMALLEST


@dataclass(frozen=True, kw_only=True)
class FilterSettings:
    """Settings of a filter.

    Attributes
    ----------
    time_constant : T of the errors of pressure off the map [s]. Towards zero the filter gives the static estimate.
    mach_number_rate : standard deviation of dM/dt [1/s]. 0.2 is 60 m/s^2 at 20 km.
    angle_rate : the same of u and w, components of the total incidence [rad/s]. 0.1 is 6 deg/s.
    log_pressure_rate : the same of ln p_inf [1/s]. 0.1 is a climb of 640 m/s.
    white_navigation : part of the variance of navigation that is independent from sample to sample, up to 1; the
        rest lasts
        100 time constants. Navigation that is filtered itself has nearly none.
    """

    time_constant: float
    mach_number_rate: float = 0.2
    angle_rate: float = 0.1
    log_pressure_rate: float = 0.1
    white_navigation: float = 0.2

    def __post_init__(self) -> None:
        for entry in fields(self):
            value = getattr(self, entry.name)
            largest = 1.0 if entry.name == "white_navigation" else LARGEST
            if not (isfinite(value) and SMALLEST <= value <= largest):
                raise InputError(f"{entry.name}: {value} found, must be between {SMALLEST:g} and {largest:g}")

    @property
    def slope_time(self) -> float:
        """Time constant of the flight state whose slopes count [s]."""
        return min(SLOPE_TIME, self.time_constant)

    @property
    def rate_scale(self) -> float:
        """Factor on the rates, which grows as the time constant goes to zero."""
        return 1.0 + RATE_TIME / self.time_constant


def checked_time_step(value: float) -> float:
    """Return ``value`` [s].

    Raises
    ------
    InputError
        It is not a positive number.
    """
    if not (isfinite(value) and 0.0 < value <= LARGEST):
        raise InputError(f"time_step: {value} found, must be positive and at most {LARGEST:g} s")
    return float(value)
